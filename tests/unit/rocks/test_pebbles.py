"""Pebbles near paths: their number, sizes and places; nothing but pictures knows of them."""

import json

import numpy as np
import pytest
from terrain_forge.exporters import glb, usd
from terrain_forge.exporters.usd import Options, export

from terrain_forge.base import ExportError, matrix_from_quaternion, xyzw
from terrain_forge.making import plan
from terrain_forge.model import merge
from terrain_forge.pipeline import check, realise
from terrain_forge.recipe import DatasetSpec, recipe_from_json
from terrain_forge.recording import open_setting
from terrain_forge.rocks import path_pebbles, with_pebbles
from terrain_forge.scene import open_scene
from tests.helpers.plain_readers import glb_parts


@pytest.fixture(scope="module")
def world():
    return realise(plan(recipe_from_json(json.dumps(ROCKY))))


ROCKY = {
    "name": "rocky", "body": "mars", "dtm": {"kind": "flat", "size_m": [24, 20]},
    "terrain": {"spacing_m": 0.25}, "horizon": {"reach_m": 0},
    "rocks": {
        "library": {"shapes": 4},
        "populations": [
            {"name": "rocks", "size_frequency": {"kind": "golombek", "k": 0.1},
             "diameter_m": [0.2, 1.0]}
        ],
    },
    "paths": [
        {"name": "p", "speed_m_s": 0.5,
         "route": {"kind": "spline", "points_m": [[-8, 0], [0, 0], [8, 0]]}}
    ],
}  # fmt: skip


def test_they_lie_near_the_path_in_the_laws_number(world):
    found = path_pebbles(world, smallest=0.02, within=1.5)
    law = world.site.recipe.rocks.populations[0].size_frequency
    density = law.cumulative_number(0.02) - law.cumulative_number(0.2)
    line = world.trajectories[0].position[:, :2]
    away = np.sqrt(((found.position[:, None, :2] - line[None]) ** 2).sum(-1)).min(1)
    assert away.max() < 1.52
    length = np.sqrt((np.diff(line, axis=0) ** 2).sum(1)).sum()
    expected = density * (3.0 * length + np.pi * 1.5**2)
    assert len(found) == pytest.approx(expected, abs=5.0 * np.sqrt(expected) + 0.03 * expected)
    assert found.diameter.min() >= 0.02
    assert found.diameter.max() <= 0.2
    larger = (found.diameter > 0.05).mean()
    share = (law.cumulative_number(0.05) - law.cumulative_number(0.2)) / density
    assert larger == pytest.approx(share, abs=5.0 * np.sqrt(share / len(found)))
    ground = world.ground.height_at(found.position[:, 0], found.position[:, 1])
    assert (found.position[:, 2] - ground < 0.2001 * found.diameter).all()
    more = path_pebbles(world, smallest=0.02, within=2.5)
    places = {tuple(place) for place in more.position.tolist()}
    assert all(tuple(place) in places for place in found.position.tolist())


def test_what_is_drawn_of_each_reaches_into_the_ground(world):
    """Flat ones on a slope too, which a given height of the centre would leave in the air."""
    east, _ = np.meshgrid(world.ground.east, world.ground.north)
    steep = world.replace(ground=world.ground.replace(elevation=0.6 * np.abs(east % 1.0 - 0.5)))
    flat = [
        shape.replace(
            meshes=(*shape.meshes[:-1], mesh.replace(vertices=mesh.vertices * [1, 1, 0.5]))
        )
        for shape in world.library.prototypes
        for mesh in shape.meshes[-1:]
    ]
    steep = steep.replace(library=world.library.replace(prototypes=tuple(flat)))
    found = path_pebbles(steep, smallest=0.02, within=0.5)
    turned = matrix_from_quaternion(found.quaternion)
    for n in range(len(found)):
        corners = flat[found.prototype[n]].meshes[-1].vertices * found.scale[n]
        x, y, z = (corners @ turned[n].T + found.position[n]).T
        assert (z - steep.ground.height_at(x, y)).min() < 0.0


def test_usd_draws_them_and_no_physics_knows_them(world, tmp_path):
    from pxr import Usd, UsdGeom, UsdPhysics

    report = export(world, tmp_path, options=Options(pebbles_min_m=0.03, pebbles_within_m=1.0))
    stage = Usd.Stage.Open(str(tmp_path / "world.usda"))
    drawn = 0
    for prim in Usd.PrimRange(stage.GetPrimAtPath("/World/Pebbles")):
        assert not prim.HasAPI(UsdPhysics.CollisionAPI)
        if prim.IsA(UsdGeom.PointInstancer):
            drawn += len(UsdGeom.PointInstancer(prim).GetIdsAttr().Get())
    assert drawn == len(path_pebbles(world, smallest=0.03, within=1.0)) > 50
    assert any(f"{drawn} pebbles" in loss for loss in report.losses)


@pytest.mark.parametrize("writer", [usd, glb])
def test_none_leave_no_file(world, tmp_path, writer):
    options = writer.Options(pebbles_min_m=0.19, pebbles_within_m=0.001)
    report = writer.export(world, tmp_path, options=options)
    assert "No pebble lies within 0.001 m of a path." in report.losses
    assert not [*tmp_path.rglob("*pebbles*")]


def test_rays_meet_them_and_the_motion_does_not(world):
    """What cameras and lidars see has them as rocks; the world has not changed."""
    seen = with_pebbles(world, smallest=0.03, within=1.0)
    pebbles = path_pebbles(world, smallest=0.03, within=1.0)
    assert len(seen.field) == len(world.field) + len(pebbles)
    assert np.array_equal(np.unique(seen.field.id), seen.field.id)
    rocks = merge(seen.field, seen.neighbours)
    above = np.add(pebbles.position, (0.0, 0.0, 5.0))
    with open_scene(seen) as scene:
        hits = scene.cast(above, np.tile((0.0, 0.0, -1.0), (len(above), 1)))
    met = np.where(hits.rock >= 0, rocks.id[hits.rock], -1)
    assert (met == pebbles.id).mean() > 0.9  # a few lie under a rock or a larger one
    spec = DatasetSpec(pebbles_min_m=0.03, pebbles_within_m=1.0)
    with open_setting(world, spec) as setting, open_setting(world) as without:
        assert setting.world.field == seen.field
        assert without.world.field == world.field
        assert np.array_equal(
            setting.motion.base.samples, without.motion.base.samples, equal_nan=True
        )
    with (
        pytest.raises(ExportError, match=r"below 0.2 m"),
        open_setting(world, DatasetSpec(pebbles_min_m=0.3)),
    ):
        pass


def test_glb_has_them_in_a_file_of_instances(world, tmp_path):
    options = glb.Options(pebbles_min_m=0.03, pebbles_within_m=1.0)
    report = glb.export(world, tmp_path, options=options)
    assert [file.name for file in report.files] == ["world.glb", "pebbles.glb"]
    text, arrays = glb_parts(tmp_path / "pebbles.glb")
    assert text["extensionsRequired"] == ["EXT_mesh_gpu_instancing"]
    wanted = path_pebbles(world, smallest=0.03, within=1.0)
    assert any(f"{len(wanted)} pebbles" in loss for loss in report.losses)
    root, *nodes = text["nodes"]
    assert root["children"] == list(range(1, 1 + len(nodes)))
    parts = [node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] for node in nodes]
    found = np.concatenate([arrays[part["TRANSLATION"]] for part in parts])
    sizes = np.concatenate([arrays[part["SCALE"]] for part in parts])
    turns = np.concatenate([arrays[part["ROTATION"]] for part in parts])
    order, own = (np.lexsort(rows.T) for rows in (found, wanted.position.astype(np.float32)))
    assert np.array_equal(found[order], wanted.position.astype(np.float32)[own])
    assert np.array_equal(sizes[order, 0], wanted.scale.astype(np.float32)[own])
    assert np.allclose(turns[order], xyzw(wanted.quaternion)[own], atol=1e-6)
    plain, _ = glb_parts(tmp_path / "world.glb")
    assert "EXT_mesh_gpu_instancing" not in plain["extensionsUsed"]


@pytest.mark.parametrize(
    ("smallest", "within", "told"),
    [(0.3, 1.0, "below 0.2 m"), (1e-5, 8.0, "pebbles_within_m")],
)
def test_what_no_law_or_memory_holds_is_refused(world, smallest, within, told):
    with pytest.raises(ExportError, match=told):
        path_pebbles(world, smallest=smallest, within=within)
    with pytest.raises(ExportError, match="no path"):
        path_pebbles(world.replace(trajectories=()), smallest=0.05, within=1.0)


def test_however_far_they_end_at_the_border(world):
    """A distance beyond the site asks for no more memory than the site."""
    all_over = path_pebbles(world, smallest=0.1, within=30.0)
    farther = path_pebbles(world, smallest=0.1, within=1e6)
    assert len(all_over) > 50
    assert np.array_equal(all_over.position, farther.position)


def test_ids_are_above_those_of_rocks_of_a_very_large_site(world):
    far = world.replace(field=world.field.replace(id=world.field.id + np.int32(2**30)))
    pebbles = path_pebbles(far, smallest=0.05, within=1.0)
    assert pebbles.id.min() > far.field.id.max()
    assert len(np.unique(with_pebbles(far, smallest=0.05, within=1.0).field.id)) == len(
        far.field
    ) + len(pebbles)


@pytest.mark.parametrize(
    ("law", "smallest", "told"),
    [
        ({"kind": "golombek", "k": 0.1}, 1e-6, "some [0-9,]+ pebbles"),
        ({"kind": "table", "diameters_m": [0.1, 1], "numbers_per_m2": [1, 0.01]}, 0.01, "from 0.1"),
    ],
)
def test_what_cannot_be_is_refused_before_a_world_is_made(law, smallest, told):
    """By `check` and by a build, which else told it after ground, rocks and paths."""
    pebbles = {"pebbles_min_m": smallest}
    exported, recorded = _rocky(usd=pebbles), _rocky(usd={}) | {"dataset": pebbles}
    for rocky, key in ((exported, ("exports", "usd")), (recorded, ("dataset",))):
        rocky["rocks"]["populations"][0]["size_frequency"] = law
        with pytest.raises(ExportError, match=told) as refused:
            list(check(recipe_from_json(json.dumps(rocky))))
        assert refused.value.key == (*key, "pebbles_min_m")


def test_a_path_that_is_still_to_be_planned_is_not_counted():
    rocky = _rocky(glb={"pebbles_min_m": 1e-6})
    rocky["paths"][0]["route"] = {"kind": "planned", "start_m": [-8, 0], "goal_m": [8, 0]}
    assert any(line.startswith("cost") for line in check(recipe_from_json(json.dumps(rocky))))


def _rocky(**exports):
    return json.loads(json.dumps(ROCKY)) | {"exports": exports}
