"""Heightmaps where Gazebo looks for them, grounds under a foreign rover, and the ROS package."""

import shutil
import subprocess
import xml.etree.ElementTree as ET

import numpy as np
import pytest
import trimesh
from terrain_forge.exporters.sdf import Options, export
from terrain_forge.exporters.sdf.readback import read_sdf

from terrain_forge.base import ExportError
from terrain_forge.validation import NotRun
from terrain_forge.validation.measures import Entry, measure
from terrain_forge.validation.sample import draw_sample
from tests.helpers import worlds
from tests.helpers.gazebo import rested
from tests.helpers.rovers import morpheus
from tests.helpers.rovers_sdf import HUB, WHEEL, four_wheeler


def collision(directory):
    (path,) = directory.glob("models/*_ground/model.sdf")
    return ET.parse(path).getroot().find("model/link/collision")


def triple(element):
    return np.array(element.text.split()[:3], float)


def test_gz_finds_a_heightmaps_place_in_the_collisions_pose(small_world, tmp_path):
    """gz-sim hands the collision's pose to physics, and leaves out `pos`."""
    export(small_world, tmp_path, options=Options(ground="heightmap"))
    found = collision(tmp_path)
    lowest = float(small_world.ground.elevation.min())
    assert lowest < -0.5
    assert triple(found.find("pose")) == pytest.approx([0, 0, lowest], abs=1e-6)
    assert triple(found.find("geometry/heightmap/pos")).tolist() == [0, 0, 0]


def test_classic_finds_a_heightmaps_height_in_its_pos(small_world, tmp_path):
    """Its ODE never places a heightmap by the collision's pose; it lifts it by the z of `pos`."""
    export(small_world, tmp_path, options=Options(ground="heightmap", flavour="classic"))
    found = collision(tmp_path)
    assert found.find("pose") is None
    wanted = [0, 0, float(small_world.ground.elevation.min())]
    assert triple(found.find("geometry/heightmap/pos")) == pytest.approx(wanted, abs=1e-6)


def test_a_heightmap_that_classic_would_move_is_refused(small_world, tmp_path):
    moved = small_world.replace(ground=small_world.ground.replace(origin=(-11.0, -8.0)))
    with pytest.raises(ExportError, match=r"middle at the origin.* 1, 0 m; choose `ground: mesh`"):
        export(moved, tmp_path, options=Options(ground="heightmap", flavour="classic"))


@pytest.mark.consumer
@pytest.mark.parametrize(
    ("options", "balls"),
    [
        ({}, "pass"),
        ({"release": "garden", "mesh_format": "obj"}, "not carried"),
        ({"flavour": "classic"}, "not carried"),
    ],
)
def test_heightmaps_conform(small_world, tmp_path, options, balls):
    """Read and run as gz-sim does; steps make balls sink, and what is not Fortress' is not run."""
    folder = tmp_path / "sdf"
    folder.mkdir()
    chosen = Options(ground="heightmap", **options)
    export(small_world, folder, options=chosen)
    sample = draw_sample(small_world, points=500)
    try:
        reading = read_sdf(sample, folder, chosen, tmp_path)
    except NotRun as reason:
        pytest.skip(str(reason))
    blank = Entry(export="sdf", kind="sdf", consumer="", aspect="", status="pass")
    entries = measure(sample, blank, reading)
    status = {entry.aspect: entry.status for entry in entries}
    assert {status[aspect] for aspect in ("findings", "ground", "frames", "path")} == {"pass"}
    assert status["balls"] == balls
    span = float(np.ptp(small_world.ground.elevation))
    levels = 65535 if options.get("release") == "garden" else 255
    assert reading.quantum == pytest.approx(span / levels, rel=0.01)


@pytest.mark.consumer
@pytest.mark.parametrize(
    ("ground", "wheels"),
    [("mesh", "cylinder"), ("mesh", "mesh"), ("heightmap", "cylinder"), ("heightmap", "sphere")],
)
def test_a_foreign_rover_rolls_over_a_tiles_border(small_world, tmp_path, build, ground, wheels):
    """It begins with its wheels on two tiles, rolls down the slope and crosses into two more."""
    world = worlds.bare(small_world)
    export(world, tmp_path, options=Options(ground=ground, tile_cells=48))
    borders = small_world.ground.east[48], small_world.ground.north[48]
    assert borders == (0.0, 4.0)
    trimesh.creation.cylinder(WHEEL, 0.08, sections=32).export(tmp_path / "models/wheel.stl")
    east, north = 0.35, 3.95
    height = float(world.ground.height_at(np.array([east]), np.array([north]))[0])
    rover = four_wheeler(east, north, height + 0.2, wheels=wheels)
    file = tmp_path / "rover.sdf"
    text = (tmp_path / "world.sdf").read_text(encoding="utf-8")
    file.write_text(text.replace("</world>", f"{rover}</world>"), encoding="utf-8")
    x, y, z = rested(build, tmp_path, file, 6)["foreign_rover"][:3]
    assert x < -0.3
    assert y == pytest.approx(north, abs=0.2)
    below = float(world.ground.height_at(np.array([x]), np.array([y]))[0])
    assert z - below == pytest.approx(WHEEL - HUB, abs=0.03)


AMENT = """macro(ament_package)
  install(FILES package.xml DESTINATION share/${PROJECT_NAME})
endmacro()
"""


@pytest.mark.parametrize("flavour", ["gz", "classic"])
def test_the_ros_package_installs_all_that_it_refers_to(small_world, tmp_path, flavour):
    """By CMake itself, with a stand-in for ament_cmake that installs the manifest as it does."""
    if not shutil.which("cmake"):
        pytest.skip("cmake is not installed")
    world = small_world.replace(rover=morpheus())
    source, ament = tmp_path / "place", tmp_path / "ament"
    source.mkdir()
    ament.mkdir()
    (ament / "ament_cmakeConfig.cmake").write_text(AMENT)
    export(world, source, options=Options(flavour=flavour, ros_package=True, tile_cells=48))
    build, prefix = tmp_path / "build", tmp_path / "install"
    configure = ["cmake", "-S", source, "-B", build, f"-Dament_cmake_DIR={ament}"]
    install = ["cmake", "--install", build, "--prefix", prefix]
    for command in ([*configure, "-Werror=dev"], install):
        done = subprocess.run(command, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    (share,) = (prefix / "share").iterdir()
    name = ET.parse(share / "package.xml").getroot().findtext("name")
    assert share.name == name
    kept = {p.relative_to(source) for p in source.rglob("*") if p.is_file()}
    found = {p.relative_to(share) for p in share.rglob("*") if p.is_file()}
    assert {str(path) for path in kept - found} == {"CMakeLists.txt", "README.md"}
    assert (share / "launch/scene.launch.py").is_file()
    assert (share / "config/bridge.yaml").is_file() == (flavour == "gz")
    for uri in ET.parse(share / "scene.sdf").getroot().iter("uri"):
        assert (share / "models" / uri.text.removeprefix("model://")).exists()
