import os

import numpy as np
import pytest
from terrain_forge.exporters.mjcf.rocks import SCALE_ERROR

from terrain_forge.dtm.projection import body_crs, local_crs
from terrain_forge.model import Heightfield, exporter
from terrain_forge.paths import write_trajectories
from terrain_forge.validation.conformance.consumer import NotRun, python_with
from terrain_forge.validation.conformance.drake import DRAKE
from terrain_forge.validation.conformance.gazebo import GAZEBO
from terrain_forge.validation.conformance.measures import Export, measure
from terrain_forge.validation.conformance.mesh_files import GLB, MESHES
from terrain_forge.validation.conformance.mujoco_reading import MUJOCO
from terrain_forge.validation.conformance.newton import NEWTON_MJCF, NEWTON_USD
from terrain_forge.validation.conformance.rasters import GDAL
from terrain_forge.validation.conformance.sample import draw_sample, free_of_rocks, resting_height
from terrain_forge.validation.conformance.suite import conformance, exports_in, measured
from terrain_forge.validation.conformance.table import table_text
from terrain_forge.validation.conformance.tracks import PATHS
from terrain_forge.validation.conformance.usd_reading import OPENUSD
from terrain_forge.validation.mujoco_agreement import mujoco_agreement, sample_model
from tests.helpers import worlds

STEP = 2 * np.log1p(SCALE_ERROR)
"""MuJoCo's ladder of sizes."""

CASES = [
    pytest.param(MUJOCO, {}, id="mjcf"),
    pytest.param(OPENUSD, {"tile_cells": 48}, id="usd"),
    pytest.param(GLB, {"tile_cells": 48, "instances_min_m": 0.5}, id="glb"),
    pytest.param(MESHES, {"rocks": "objects"}, id="obj"),
    pytest.param(MESHES, {"format": "stl"}, id="stl"),
    pytest.param(MESHES, {"format": "ply", "tiles": "tiled", "tile_cells": 48}, id="ply"),
    pytest.param(GDAL, {}, id="geotiff"),
    pytest.param(GAZEBO, {"tile_cells": 48}, id="gz", marks=pytest.mark.consumer),
    pytest.param(GAZEBO, {"flavour": "classic"}, id="classic", marks=pytest.mark.consumer),
    pytest.param(DRAKE, {"tile_cells": 48}, id="drake", marks=pytest.mark.consumer),
    pytest.param(NEWTON_USD, {}, id="newton-usd", marks=[pytest.mark.consumer, pytest.mark.slow]),
    pytest.param(NEWTON_MJCF, {}, id="newton-mjcf", marks=[pytest.mark.consumer, pytest.mark.slow]),
]


@pytest.fixture(scope="module")
def mixed():
    """A small world with dynamic rocks and visual-only rocks."""
    world = worlds.world()
    number = np.arange(len(world.field))
    dynamic, solid = number % 5 == 0, number % 7 != 1
    return world.replace(field=world.field.replace(dynamic=dynamic, collides=solid | dynamic))


def exported(world, consumer, directory, options):
    kind = consumer.kinds[0]
    folder = directory / kind
    folder.mkdir()
    module = exporter(kind)
    module.export(world, folder, options=module.Options(**options))
    return folder


def entries(world, consumer, directory):
    """What the consumer finds of an export that is measured against a world."""
    kind = consumer.kinds[0]
    export = Export(folder=kind, kind=kind, outline_error=0.02)
    sample = draw_sample(world, points=500)
    found, _ = measured(sample, export, consumer, directory, directory)
    if found[0].status == "not run":
        pytest.skip(found[0].note)
    return {entry.aspect: entry for entry in found}


@pytest.mark.parametrize(("consumer", "options"), CASES)
def test_exports_conform_and_wrong_worlds_do_not(mixed, tmp_path, consumer, options):
    exported(mixed, consumer, tmp_path, options)
    found = entries(mixed, consumer, tmp_path)
    # Newton cuts hulls down to 64 vertices, and these shapes have more.
    excused = {"rock outlines"} if consumer in (NEWTON_USD, NEWTON_MJCF) else set()
    failing = {a: e.note for a, e in found.items() if e.status == "fail" and a not in excused}
    assert failing == {}
    assert found["ground"].status == "pass"
    field, ground = mixed.field, mixed.ground
    lifted = mixed.replace(
        ground=ground.replace(elevation=ground.elevation + 0.002),
        field=field.replace(
            mass=1.01 * field.mass, position=field.position + 0.05 * field.diameter[:, None]
        ),
        trajectories=tuple(t.replace(position=t.position + 0.001) for t in mixed.trajectories),
        site=mixed.site.replace(body=mixed.site.body.replace(gravity=1.62)),
    )
    for aspect, entry in entries(lifted, consumer, tmp_path).items():
        if aspect not in ("findings", "balls") and found[aspect].status == "pass":
            moved = aspect != "frames" or found["masses"].status == "pass"
            assert (entry.status == "fail") == moved, aspect


def test_a_tilted_ball_rests_where_geometry_says():
    slope, radius = 0.3, 0.2
    east = np.arange(41) * 0.1 - 2.0
    plane = np.broadcast_to(slope * east, (41, 41))
    ground = Heightfield(elevation=plane, spacing=0.1, origin=(-2.0, -2.0))
    wanted = slope * 0.37 + radius * np.hypot(1.0, slope)
    assert resting_height(ground, 0.37, 0.11, radius) == pytest.approx(wanted, abs=1e-6)


def test_balls_stand_apart_from_rocks_and_each_other(mixed):
    balls = draw_sample(mixed, points=10).balls
    assert len(balls.rest) > 5
    assert free_of_rocks(mixed, balls.xy, margin=balls.radius).all()
    apart = np.linalg.norm(balls.xy[:, None] - balls.xy, axis=2) + 9 * np.eye(len(balls.xy))
    assert apart.min() > 2 * balls.radius


def test_a_turned_rock_is_seen(mixed, tmp_path):
    folder = exported(mixed, OPENUSD, tmp_path, {})
    quaternion = mixed.field.quaternion.copy()
    quaternion[3] = quaternion[3][[3, 0, 1, 2]]
    turned = mixed.replace(field=mixed.field.replace(quaternion=quaternion))
    sample = draw_sample(turned, points=10)
    export = Export(folder="usd", kind="usd", outline_error=0.02)
    found = {e.aspect: e for e in measure(sample, export, OPENUSD.read(sample, folder, tmp_path))}
    assert found["rock outlines"].status == "fail"
    assert found["ground"].status == "pass"


@pytest.mark.consumer
def test_complaints_of_a_library_that_is_too_old_do_not_count(mixed, tmp_path):
    """SDF 1.10 places a site on its body, which libsdformat 12 takes for a mistake."""
    crs = local_crs(body_crs(3396190.0), 137.4, -4.6)
    site = mixed.site.replace(crs=crs, lonlat=(np.radians(137.4), np.radians(-4.6)))
    world = mixed.replace(site=site)
    exported(world, GAZEBO, tmp_path, {"release": "garden"})
    found = entries(world, GAZEBO, tmp_path)
    assert {entry.status for entry in found.values()} == {"pass", "not carried"}
    assert found["findings"].note == "libsdformat 12 knows SDF up to 1.9, the file is 1.10"
    assert found["ground"].status == found["balls"].status == "pass"


def test_a_rounded_size_is_no_error_of_a_rock_that_is_mostly_buried(mixed, tmp_path):
    """What shows of it is a third of its size, of which MuJoCo's rounding is up to 1 %."""
    field = mixed.field
    world = mixed.replace(
        field=field.replace(
            diameter=0.3 * field.scale,
            scale=np.exp((np.round(np.log(field.scale) / STEP) + 0.49) * STEP),
        )
    )
    folder = exported(world, MUJOCO, tmp_path, {})
    found = {export.folder: export for export in exports_in(world, tmp_path)}
    assert found["mjcf"].scale_error == SCALE_ERROR
    sample = draw_sample(world, points=10)
    measured = measure(sample, found["mjcf"], MUJOCO.read(sample, folder, tmp_path))
    tops = next(entry for entry in measured if entry.aspect == "rock tops")
    assert tops.status == "pass"
    assert tops.figure > 0.01
    points = sample.points[:10]
    checks = mujoco_agreement(world, sample_model(world, folder), "mjcf", points)
    rocks = next(check for check in checks if check.name == "mjcf: rocks")
    assert rocks.passed


def test_what_is_not_installed_is_not_run(mixed, tmp_path, monkeypatch):
    monkeypatch.setenv("TERRAIN_FORGE_DRAKE_PYTHON", str(tmp_path / "nowhere"))
    python_with.cache_clear()
    with pytest.raises(NotRun, match="is no Python"):
        python_with("pydrake", "TERRAIN_FORGE_DRAKE_PYTHON")
    export = Export(folder="drake", kind="drake", outline_error=0.03)
    sample = draw_sample(mixed, points=10)
    (entry,), reading = measured(sample, export, DRAKE, tmp_path, tmp_path)
    assert (entry.status, reading, entry.check) == ("not run", None, None)
    assert "not run: " in table_text([vars(entry)])
    python_with.cache_clear()


def test_an_export_that_cannot_be_read_fails(mixed, tmp_path):
    folder = exported(mixed, MUJOCO, tmp_path, {})
    os.truncate(folder / "world.xml", 400)
    (entry,) = entries(mixed, MUJOCO, tmp_path).values()
    assert entry.status == "fail"
    assert "cannot be read" in entry.note
    assert not entry.check.passed


def test_paths_are_read_back_at_every_sample(mixed, tmp_path):
    """CSV by its quaternions and its angles, TUM, and the track of MuJoCo's mocap body."""
    write_trajectories(mixed.trajectories, tmp_path / "paths")
    count = len(mixed.trajectories[0].time)
    found = entries(mixed, PATHS, tmp_path)["path"]
    assert (found.status, found.note.rpartition(" turn, ")[2]) == ("pass", f"{3 * count} samples")
    folder = exported(mixed, MUJOCO, tmp_path, {})
    assert entries(mixed, MUJOCO, tmp_path)["path"].status == "pass"
    for consumer, file in ((PATHS, tmp_path / "paths/arc.tum"), (MUJOCO, folder / "paths/arc.csv")):
        for spoil in (dropped, shifted):
            text = file.read_text()
            file.write_text(spoil(text))
            assert entries(mixed, consumer, tmp_path)["path"].status == "fail", spoil
            file.write_text(text)
    (tmp_path / "paths" / "arc.csv").unlink()
    (tmp_path / "paths" / "arc.tum").unlink()
    assert entries(mixed, PATHS, tmp_path)["path"].note == "path arc is missing"


def dropped(text):
    """A table without one of its rows."""
    lines = text.splitlines(keepends=True)
    return "".join(lines[:100] + lines[101:])


def shifted(text):
    """A table whose poses come a sample too late."""
    lines = text.splitlines()
    for n in range(len(lines) - 2, 3, -1):
        sign = "," if "," in lines[n] else " "
        lines[n] = sign.join([lines[n].split(sign)[0], *lines[n - 1].split(sign)[1:]])
    return "\n".join(lines) + "\n"


def test_a_world_with_paths_has_a_row_for_them(mixed, tmp_path):
    assert [export.kind for export in exports_in(mixed, tmp_path)] == ["paths"]
    assert list(exports_in(mixed.replace(trajectories=()), tmp_path)) == []


@pytest.fixture(scope="module")
def winding(mixed):
    """A path that winds five times to the right, with a name that is hard on every format."""
    time = np.arange(0, 300, 1 / 12)
    angle = -0.1047 * time
    xy = np.stack([6 * np.cos(angle), 4 * np.sin(angle)], -1)
    yaw = np.unwrap(np.arctan2(np.gradient(xy[:, 1]), np.gradient(xy[:, 0])))
    assert np.ptp(yaw) > 9 * np.pi
    path = mixed.trajectories[0].replace(
        name='Höhe "rund" & <um> 路\'s',
        time=time,
        position=np.column_stack([xy, mixed.ground.height_at(xy[:, 0], xy[:, 1])]),
        rpy=np.stack([0.05 * np.sin(time), 0.04 * np.cos(time), yaw], -1),
    )
    return mixed.replace(trajectories=(path,))


@pytest.mark.parametrize(
    "consumer",
    [
        *(pytest.param(c, id=c.kinds[0]) for c in (MUJOCO, OPENUSD, GLB, PATHS)),
        pytest.param(GAZEBO, id="sdf", marks=pytest.mark.consumer),
    ],
)
def test_a_path_may_wind_and_have_any_name(winding, tmp_path, consumer):
    if consumer is PATHS:
        write_trajectories(winding.trajectories, tmp_path / "paths")
    else:
        exported(winding, consumer, tmp_path, {})
    found = entries(winding, consumer, tmp_path)["path"]
    assert (found.status, found.limit) == ("pass", 1e-4)
    assert found.figure < 1e-5


def test_the_suite_tells_how_far_it_is(mixed, tmp_path):
    exported(mixed, OPENUSD, tmp_path, {})
    exported(mixed, GLB, tmp_path, {})
    shares = []
    found = conformance(mixed.replace(trajectories=()), tmp_path, points=20, progress=shares.append)
    assert shares == [0.0, 0.5]
    assert {entry.export for entry in found} >= {"usd", "glb"}
