import os

import numpy as np
import pytest

from terrain_forge.registry import exporter
from terrain_forge.validation.conformance.consumer import NotRun, python_with
from terrain_forge.validation.conformance.drake import DRAKE
from terrain_forge.validation.conformance.gazebo import GAZEBO
from terrain_forge.validation.conformance.measures import Export, measure
from terrain_forge.validation.conformance.mesh_files import GLB, MESHES
from terrain_forge.validation.conformance.mujoco_reading import MUJOCO
from terrain_forge.validation.conformance.newton import NEWTON_USD
from terrain_forge.validation.conformance.rasters import GDAL
from terrain_forge.validation.conformance.sample import draw_sample, free_of_rocks, resting_height
from terrain_forge.validation.conformance.suite import _measured
from terrain_forge.validation.conformance.table import table_text
from terrain_forge.validation.conformance.usd_reading import OPENUSD
from terrain_forge.world import Heightfield
from tests import worlds

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
    pytest.param(NEWTON_USD, {}, id="newton", marks=[pytest.mark.consumer, pytest.mark.slow]),
]


@pytest.fixture(scope="module")
def mixed():
    """A small world with loose rocks and rocks for the eye alone."""
    world = worlds.world()
    number = np.arange(len(world.field))
    loose, solid = number % 5 == 0, number % 7 != 1
    return world.replace(field=world.field.replace(loose=loose, solid=solid | loose))


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
    found, _ = _measured(sample, export, consumer, directory, directory)
    if found[0].status == "not run":
        pytest.skip(found[0].note)
    return {entry.aspect: entry for entry in found}


@pytest.mark.parametrize(("consumer", "options"), CASES)
def test_exports_conform_and_wrong_worlds_do_not(mixed, tmp_path, consumer, options):
    exported(mixed, consumer, tmp_path, options)
    found = entries(mixed, consumer, tmp_path)
    # Newton cuts hulls down to 64 vertices, and these shapes have more.
    excused = {"rock outlines"} if consumer is NEWTON_USD else set()
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


def test_what_is_not_installed_is_not_run(mixed, tmp_path, monkeypatch):
    monkeypatch.setenv("TERRAIN_FORGE_DRAKE_PYTHON", str(tmp_path / "nowhere"))
    python_with.cache_clear()
    with pytest.raises(NotRun, match="is no Python"):
        python_with("pydrake", "TERRAIN_FORGE_DRAKE_PYTHON")
    export = Export(folder="drake", kind="drake", outline_error=0.03)
    sample = draw_sample(mixed, points=10)
    (entry,), reading = _measured(sample, export, DRAKE, tmp_path, tmp_path)
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
