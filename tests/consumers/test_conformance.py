import os

import numpy as np
import pytest
from terrain_forge.exporters import drake, geotiff, glb, mesh, mjcf, sdf, usd
from terrain_forge.exporters.mjcf.rocks import SCALE_ERROR

from terrain_forge.dtm.projection import body_crs, local_crs
from terrain_forge.model import Export, Heightfield, exporter, plain_options
from terrain_forge.paths import write_trajectories
from terrain_forge.validation import NotRun, python_with
from terrain_forge.validation.measures import Entry, measure
from terrain_forge.validation.sample import draw_sample, free_of_rocks, resting_height
from terrain_forge.validation.suite import conformance, consumers, quick_checks, read
from terrain_forge.validation.table import table_text
from terrain_forge.validation.tracks import PATHS
from tests.helpers import worlds

STEP = 2 * np.log1p(SCALE_ERROR)
"""MuJoCo's ladder of sizes."""

MUJOCO, NEWTON_MJCF = mjcf.CONSUMERS
OPENUSD, NEWTON_USD = usd.CONSUMERS
(GLB,), (MESHES,), (GDAL,) = glb.CONSUMERS, mesh.CONSUMERS, geotiff.CONSUMERS
GAZEBO, DRAKE = sdf.CONSUMERS[1], drake.CONSUMERS[1]
KINDS = {
    **{MUJOCO: "mjcf", NEWTON_MJCF: "mjcf", OPENUSD: "usd", NEWTON_USD: "usd", GLB: "glb"},
    **{MESHES: "mesh", GDAL: "geotiff", GAZEBO: "sdf", DRAKE: "drake", PATHS: "paths"},
}
BLANK = Entry(export="", kind="", consumer="", aspect="", status="pass")

CASES = [
    pytest.param(MUJOCO, {}, id="mjcf"),
    pytest.param(OPENUSD, {"tile_cells": 48}, id="usd"),
    pytest.param(GLB, {"tile_cells": 48, "instances_min_m": 0.5}, id="glb"),
    pytest.param(MESHES, {"format": "obj", "rocks": "objects"}, id="obj"),
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
    kind = KINDS[consumer]
    folder = directory / kind
    folder.mkdir()
    module = exporter(kind)
    module.export(world, folder, options=module.Options(**options))
    return folder


def entries(world, consumer, directory, options=None):
    """What the consumer finds of an export that is measured against a world."""
    kind = KINDS[consumer]
    export = Export(folder=kind, kind=kind, options={})
    chosen = None if consumer is PATHS else exporter(kind).Options(**(options or {}))
    sample = draw_sample(world, points=200)
    found, _ = read(sample, directory, export, consumer, chosen, directory)
    if found[0].status == "not run":
        pytest.skip(found[0].note)
    return {entry.aspect: entry for entry in found}


@pytest.mark.parametrize(("consumer", "options"), CASES)
def test_exports_conform_and_wrong_worlds_do_not(mixed, tmp_path, consumer, options):
    exported(mixed, consumer, tmp_path, options)
    found = entries(mixed, consumer, tmp_path, options)
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
    for aspect, entry in entries(lifted, consumer, tmp_path, options).items():
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
    reading = OPENUSD.read(sample, folder, usd.Options(), tmp_path)
    found = {e.aspect: e for e in measure(sample, BLANK, reading)}
    assert found["rock outlines"].status == "fail"
    assert found["ground"].status == "pass"


@pytest.mark.consumer
def test_complaints_of_a_library_that_is_too_old_do_not_count(mixed, tmp_path):
    """SDF 1.10 places a site on its body, which libsdformat 12 takes for a mistake."""
    crs = local_crs(body_crs(3396190.0), 137.4, -4.6)
    site = mixed.site.replace(crs=crs, lonlat=(np.radians(137.4), np.radians(-4.6)))
    world = mixed.replace(site=site)
    options = {"release": "garden", "mesh_format": "obj"}
    exported(world, GAZEBO, tmp_path, options)
    found = entries(world, GAZEBO, tmp_path, options)
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
    sample = draw_sample(world, points=10)
    reading = MUJOCO.read(sample, folder, mjcf.Options(), tmp_path)
    assert reading.rock_error == SCALE_ERROR
    tops = next(e for e in measure(sample, BLANK, reading) if e.aspect == "rock tops")
    assert tops.status == "pass"
    assert tops.figure > 0.01
    exports = [Export(folder="mjcf", kind="mjcf", options={})]
    checks = quick_checks(world, tmp_path, exports, points=10)
    rocks = next(check for check in checks if check.name == "mjcf: rocks")
    assert rocks.passed


def test_what_is_not_installed_is_not_run(mixed, tmp_path, monkeypatch):
    monkeypatch.setenv("TERRAIN_FORGE_DRAKE_PYTHON", str(tmp_path / "nowhere"))
    with pytest.raises(NotRun, match="is no Python"):
        python_with("pydrake", "TERRAIN_FORGE_DRAKE_PYTHON")
    export = Export(folder="drake", kind="drake", options={})
    sample = draw_sample(mixed, points=10)
    (entry,), reading = read(sample, tmp_path, export, DRAKE, drake.Options(), tmp_path)
    assert (entry.status, reading, entry.check) == ("not run", None, None)
    assert "not run: " in table_text([vars(entry)])


def test_an_export_that_cannot_be_read_fails(mixed, tmp_path):
    folder = exported(mixed, MUJOCO, tmp_path, {})
    os.truncate(folder / "world.xml", 400)
    (entry,) = entries(mixed, MUJOCO, tmp_path).values()
    assert entry.status == "fail"
    assert "cannot be read" in entry.note
    assert not entry.check.passed


def test_a_rover_that_mujoco_cannot_load_fails(mixed, tmp_path):
    scene = exported(mixed, MUJOCO, tmp_path, {}) / "scene.xml"
    twice = '<worldbody><body name="path"/></worldbody></mujoco>'
    scene.write_text(scene.read_text().replace("</mujoco>", twice))
    (entry,) = entries(mixed, MUJOCO, tmp_path).values()
    assert entry.status == "fail"
    assert "MuJoCo cannot load scene.xml: " in entry.note


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
    write_trajectories(mixed.trajectories, tmp_path / "paths")
    found = conformance(mixed, tmp_path, [], points=10)
    assert {entry.kind for entry in found} == {"paths"}
    assert conformance(mixed.replace(trajectories=()), tmp_path, [], points=10) == []


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
        *(pytest.param(c, id=KINDS[c]) for c in (MUJOCO, OPENUSD, GLB, PATHS)),
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
    exports = [Export(folder=kind, kind=kind, options={}) for kind in ("glb", "usd")]
    shares, world = [], mixed.replace(trajectories=())
    found = conformance(world, tmp_path, exports, points=20, progress=shares.append)
    assert shares == [0.0, 0.5]
    assert {entry.export for entry in found} >= {"usd", "glb"}


def test_an_export_whose_exporter_is_gone_is_not_read_back(mixed, tmp_path, caplog):
    (tmp_path / "mine").mkdir()
    mine = Export(folder="mine", kind="gone", options={})
    refused = Export(folder="sdf", kind="sdf", options=plain_options(sdf.Options()) | {"new": 1})
    assert quick_checks(mixed, tmp_path, [mine, refused], points=10) == []
    assert consumers(refused) == []
    assert "unknown exporter 'gone'" in caplog.text
    assert "exporter 'sdf' refuses its options" in caplog.text


def test_a_quick_sample_looks_at_what_a_full_one_does(mixed):
    quick, full = (draw_sample(mixed, points=50, quick=quick) for quick in (True, False))
    assert np.array_equal(quick.points, full.points)
    assert np.array_equal(quick.rows, full.rows)
    assert set(quick.dynamic) <= set(full.dynamic)
    assert len(quick.balls.rest) == 0 < len(full.balls.rest)
