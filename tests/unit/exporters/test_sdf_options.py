"""What an SDF export refuses, what it writes by default, and its names."""

import re
import subprocess
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from terrain_forge.exporters.drake import Options as DrakeOptions
from terrain_forge.exporters.drake import export as export_drake
from terrain_forge.exporters.sdf import Options, export
from terrain_forge.exporters.sdf.losses import list_losses, loading

from terrain_forge.base import ExportError, RecipeError
from terrain_forge.model import Trajectory
from tests.helpers.worlds import crowded


@pytest.mark.parametrize(
    ("options", "key", "message"),
    [
        ({"flavour": "classic", "release": "garden"}, "release", "classic"),
        ({"flavour": "classic", "release": "fortress"}, "release", "classic"),
        ({"mesh_format": "glb"}, "mesh_format", "choose mesh_format: obj, or .* release: garden"),
        ({"heightmap_bits": 8}, "heightmap_bits", "ground: heightmap"),
        ({"ground": "heightmap", "heightmap_bits": 16}, "heightmap_bits", "release: garden"),
        (
            {"ground": "heightmap", "heightmap_bits": 16, "flavour": "classic"},
            "heightmap_bits",
            "choose heightmap_bits: 8",
        ),
    ],
)
def test_contradictions_are_refused_by_their_key(options, key, message):
    with pytest.raises(RecipeError, match=message) as caught:
        Options(**options)
    assert caught.value.key == (key,)


@pytest.mark.parametrize(
    ("options", "version", "bits", "binary"),
    [
        ({}, "1.9", 8, False),
        ({"release": "fortress"}, "1.9", 8, False),
        ({"release": "garden"}, "1.10", 16, True),
        ({"release": "garden", "mesh_format": "obj"}, "1.10", 16, False),
        ({"flavour": "classic"}, "1.6", 8, False),
    ],
)
def test_the_readers_choose_the_version_the_bits_and_the_meshes(options, version, bits, binary):
    chosen = Options(ground="heightmap", **options)
    assert (chosen.version, chosen.grey_bits, chosen.binary) == (version, bits, binary)


def named(world, *, site="by-hand", path="arc"):
    trajectory = world.trajectories[0].replace(name=path)
    return world.replace(site=world.site.replace(name=site), trajectories=(trajectory,))


def all_dynamic(world):
    return world.replace(field=world.field.replace(dynamic=np.ones(len(world.field), bool)))


@pytest.mark.parametrize("path", ["rock_3", "by-hand_ground", "by-hand_rocks"])
def test_a_path_named_like_a_model_is_refused(small_world, tmp_path, path):
    with pytest.raises(ExportError, match=rf"path '{path}'.*another name"):
        export(named(all_dynamic(small_world), path=path), tmp_path, options=Options())


@pytest.mark.consumer
@pytest.mark.parametrize(
    ("site", "path"),
    [
        ("world", "world"),
        ("sun", "sun"),
        ("by-hand", "default_physics"),
        ("__x__", "__root__"),
        ("%41?#&;'\" <", "a/b"),
        ("火星 🚀", "Söhne 7"),
        ("x" * 100, "y" * 100),
    ],
)
def test_libsdformat_takes_any_names(small_world, tmp_path, build, site, path):
    program = build("sdf_check", "sdformat12")
    export(named(all_dynamic(small_world), site=site, path=path), tmp_path, options=Options())
    run = subprocess.run(
        [program, tmp_path / "scene.sdf", tmp_path / "models"], capture_output=True, text=True
    )
    assert run.returncode == 0, run.stdout
    assert run.stderr == ""


def test_drakes_world_is_not_called_world(small_world, tmp_path):
    export_drake(named(small_world, site="world"), tmp_path, options=DrakeOptions())
    assert ET.parse(tmp_path / "world.sdf").getroot().find("world").get("name") != "world"


def test_two_packages_of_a_world_have_two_names(small_world, tmp_path):
    names = []
    for folder in ("sdf", "sdf-classic", "sdf classic"):
        (tmp_path / folder).mkdir()
        export(small_world, tmp_path / folder, options=Options(ros_package=True))
        manifest = ET.parse(tmp_path / folder / "package.xml").getroot()
        names.append(manifest.findtext("name"))
        launch = (tmp_path / folder / "launch/scene.launch.py").read_text(encoding="utf-8")
        assert f'"{names[-1]}"' in launch
    assert len(set(names)) == 3
    assert all(re.fullmatch("[a-z][a-z0-9_]*", name) for name in names)


# ---- times of waypoints


@pytest.mark.parametrize("rate", [7.0, 12.0, 30.0, 1000.0, 3000.0])
def test_gz_sim_cuts_no_waypoint_to_the_millisecond_before(small_world, tmp_path, rate):
    """It takes `int(time * 1000)`, and 1.001 · 1000 is a hair below 1001."""
    time = np.arange(0, 3.0, 1 / rate)
    angle = 4.0 * time
    position = np.stack([4 * np.cos(angle), 4 * np.sin(angle), 0 * angle], axis=-1)
    rpy = np.stack([0 * angle, 0 * angle, angle], axis=-1)
    spiral = Trajectory(name="spiral", time=time, position=position, rpy=rpy, closed=False)
    world = small_world.replace(trajectories=(spiral,))
    export(world, tmp_path, options=Options())
    stops = list(ET.parse(tmp_path / "scene.sdf").getroot().iter("waypoint"))
    times = np.array([float(stop.findtext("time")) for stop in stops])
    cut = np.array([int(seconds * 1000) for seconds in times.tolist()])
    assert (cut == np.rint(times * 1000)).all()
    assert (np.diff(cut) > 0).all()
    poses = np.array([stop.findtext("pose").split() for stop in stops], float)
    wanted = spiral.at(np.minimum(cut / 1000, time[-1]))
    assert np.abs(poses[:, :3] - wanted.position).max() < 1e-7
    assert np.abs(poses[:, 3:] - wanted.rpy).max() < 1e-7


# ---- rocks that are too many elements


@pytest.mark.slow
def test_too_many_rocks_of_their_own_are_refused_with_what_makes_it_less(small_world, tmp_path):
    world = crowded(small_world, 45_000)
    with pytest.raises(
        ExportError,
        match=r"45000 rocks are elements of their own.* 24 GB .*; a larger individual_min_m merges",
    ):
        export(world, tmp_path, options=Options(individual_min_m=0))
    assert not list(tmp_path.iterdir())
    report = export(world, tmp_path, options=Options(individual_min_m=1.375))
    left = int((world.field.diameter >= 1.375).sum())
    assert f"{45_000 - left} rocks below 1.375 m are merged" in " ".join(report.losses)
    assert not any("Gazebo's parser" in loss for loss in report.losses)


def test_what_loading_takes_is_said_from_a_gigabyte_on(small_world, tmp_path):
    for count, said in ((1_500, False), (2_500, True)):
        (tmp_path / str(count)).mkdir()
        options = Options(individual_min_m=0)
        losses = export(crowded(small_world, count), tmp_path / str(count), options=options).losses
        assert any("Gazebo's parser takes some 1.3 GB and 4 s" in loss for loss in losses) == said


def test_too_many_dynamic_rocks_are_refused(small_world, tmp_path):
    with pytest.raises(ExportError, match=r"4000 of them dynamic.*make fewer rocks dynamic"):
        export(crowded(small_world, 4_000, dynamic=True), tmp_path, options=Options())


def test_dynamic_rocks_that_are_slower_than_real_time_are_told(small_world):
    for count, told in ((20, []), (21, ["21 dynamic rocks take DART about 2 ms"])):
        world = crowded(small_world, count, dynamic=True)
        losses = list_losses(world, coarse=[], heightmap=None, options=Options())
        assert [loss[:37] for loss in losses if "DART" in loss] == told


@pytest.mark.consumer
@pytest.mark.parametrize("dynamic", [False, True])
def test_libsdformat_takes_the_memory_that_is_foretold(small_world, tmp_path, build, dynamic):
    program = build("sdf_check", "sdformat12")
    options, taken = Options(individual_min_m=0), []
    worlds = [crowded(small_world, count, dynamic=dynamic) for count in (40, 240)]
    for number, world in enumerate(worlds):
        folder = tmp_path / str(number)
        folder.mkdir()
        export(world, folder, options=options)
        command = [program, folder / "world.sdf", folder / "models"]
        run = subprocess.run(command, capture_output=True, text=True, check=True)
        taken.append(int(re.search(r"kilobytes (\d+)", run.stdout)[1]) / 1024)
    few, lots = (loading(world, options)[0] for world in worlds)
    assert taken[1] - taken[0] == pytest.approx(lots - few, rel=0.25)
