"""Worlds edited by hand: what was added or removed is there in world, truth and every export."""

from __future__ import annotations

import csv
import json
import re

import mujoco
import numpy as np
import pytest
import rasterio

import terrain_forge as tf
from terrain_forge.dtm import ArrayDtm
from terrain_forge.model import World, rotations
from terrain_forge.recipe import Recipe, TerrainSpec, recipe_json
from terrain_forge.rocks import Golombek, LibrarySpec, PopulationSpec, RocksSpec, overlapping_pairs
from terrain_forge.rocks.editing import BY_HAND
from terrain_forge.rocks.embedding.outline import mean_width
from terrain_forge.terrain import Fractal
from tests.helpers.outlines import exposed_outline
from tests.helpers.recipes import flat

SIZE = (12.0, 8.0)
PEBBLES = PopulationSpec(
    name="pebbles",
    size_frequency=Golombek(k=0.05),
    diameter_m=(0.2, 0.6),
    density_kg_m3=2500.0,
    rgb=(0.2, 0.3, 0.4),
)
ROCKS = RocksSpec(library=LibrarySpec(shapes=3), populations=(PEBBLES,))
MORE = {"seed": 3, "horizon": tf.HorizonSpec(reach_m=0), "rocks": ROCKS}
RECIPE = flat(SIZE, 0.125, terrain={"layers": (Fractal(),)}, **MORE)


@pytest.fixture(scope="module")
def world():
    return tf.realise(tf.plan(RECIPE))


@pytest.fixture(scope="module")
def cleared(world):
    """The world with room around (2, 1), and where (0, 0) was taken."""
    near = np.hypot(*(world.field.position[:, :2] - (2.0, 1.0)).T) < 1.5
    assert near.any()
    return tf.remove_rocks(world, world.field.id[near].tolist())


def exposed_diameter(world: World, row: int) -> float:
    """Measured anew on the mesh, above the plane that the buried fraction says."""
    rock = world.field.select(np.array([row]))
    mesh = world.library.prototypes[int(rock.prototype[0])].meshes[0]
    rotation = rotations(rock)[0]
    outline = exposed_outline(
        mesh, rotation=rotation, normal=rotation[:, 2], buried=float(rock.buried_fraction[0])
    )
    return float(mean_width(outline) * rock.scale[0])


def test_added_rock_rests_as_scattered_ones_do(cleared):
    before = cleared.field
    edited = tf.add_rock(
        cleared, east=2.0, north=1.0, diameter=0.9, prototype=1, yaw=0.4, buried_fraction=0.2
    )
    assert cleared.field is before
    assert BY_HAND not in before.populations
    assert edited.field.select(np.arange(len(before))) == before.replace(
        populations=edited.field.populations
    )
    rock = edited.field.select(np.array([len(before)]))
    assert rock.populations[int(rock.population[0])] == BY_HAND
    assert rock.position[0, :2].tolist() == [2.0, 1.0]
    assert exposed_diameter(edited, len(before)) == pytest.approx(0.9, rel=1e-9)
    assert 0.2 <= rock.buried_fraction[0] <= 0.6
    volume = cleared.library.prototypes[1].volume * rock.scale[0] ** 3
    assert rock.volume[0] == pytest.approx(volume)
    assert rock.mass[0] == pytest.approx(volume * cleared.site.body.rock_density)
    mesh = cleared.library.prototypes[1].meshes[0].vertices * rock.scale[0]
    points = mesh @ rotations(rock)[0].T + rock.position[0]
    ground = cleared.ground.height_at(points[:, 0], points[:, 1])
    assert (points[:, 2] < ground).any()
    assert points[:, 2].max() > ground.max()
    assert overlapping_pairs(edited.field, edited.library) == []
    assert edited.site.largest_rock == 0.9
    assert edited.unplaced == (*cleared.unplaced, 0)
    colour = np.round(255 * np.array(cleared.site.body.rock_rgb)).astype(int)
    assert edited.appearance.rock_rgb[-1].tolist() == colour.tolist()


def test_ids_are_above_all_and_stay(cleared):
    one = tf.add_rock(cleared, east=2.0, north=1.0, diameter=0.4)
    two = tf.add_rock(one, east=2.8, north=1.0, diameter=0.4, population="pebbles")
    added = two.field.id[-2:].tolist()
    assert added == [2**25, 2**25 + 1]  # after all that the recipe's one population can have
    fewer = tf.remove_rocks(two, [added[0]])
    assert fewer.field.id.tolist() == [*cleared.field.id.tolist(), added[1]]
    pebble = two.field.select(np.array([len(two.field) - 1]))
    assert pebble.population[0] == 0
    assert pebble.mass[0] == pytest.approx(2500.0 * pebble.volume[0])
    dense = tf.add_rock(cleared, east=2.0, north=1.0, diameter=0.4, density=5000.0).field
    assert dense.mass[-1] == pytest.approx(5000.0 * dense.volume[-1])


def test_rocks_are_removed_by_a_mask_too(world):
    large = world.field.diameter > 0.3
    left = tf.remove_rocks(world, large).field
    assert left == world.field.select(~large)
    assert tf.remove_rocks(world, large.tolist()).field == left
    assert tf.remove_rocks(world, []).field == world.field


@pytest.mark.parametrize("given", [[True, False], [0.5], [[0, 1]], ["0"]])
def test_what_is_neither_ids_nor_a_mask_is_refused(world, given):
    with pytest.raises(tf.DataError, match=r"^ids of the type .* whole numbers .* a mask of the"):
        tf.remove_rocks(world, np.array(given))


def test_a_window_gives_the_same_id_and_place(world, cleared):
    window = tf.Window(column=40, row=12, columns=48, rows=48)  # 5 to 11 m, 1.5 to 7.5 m
    part = tf.realise(world.site, window)
    near = np.hypot(*(part.field.position[:, :2] - (2.0, 1.0)).T) < 1.5
    part = tf.remove_rocks(part, part.field.id[near].tolist())
    ours = tf.add_rock(part, east=2.0, north=1.0, diameter=0.9).field
    whole = tf.add_rock(cleared, east=2.0, north=1.0, diameter=0.9).field
    last = [field.select(np.array([len(field) - 1])) for field in (ours, whole)]
    assert last[0] == last[1]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"diameter": 0.0}, "diameter 0 m"),
        ({"diameter": float("nan")}, "diameter nan m"),
        ({"prototype": 3}, "shapes are 0 to 2"),
        ({"prototype": -1}, "shapes are 0 to 2"),
        ({"yaw": float("inf")}, "yaw inf rad"),
        ({"density": -1.0}, "density -1 kg/m³"),
        ({"buried_fraction": 0.7}, "0 to 0.6"),
        ({"east": 5.9}, "does not lie within the ground, -6 to 6 m east"),
        ({"east": float("nan")}, "does not lie within the ground"),
        ({"population": "../x"}, "population '../x'"),
        ({"population": "x" * 101}, "up to 100 characters"),
    ],
)
def test_refusals(cleared, change, words):
    with pytest.raises(tf.DataError, match=re.escape(words)):
        tf.add_rock(cleared, **({"east": 2.0, "north": 1.0, "diameter": 0.5} | change))


def test_overlap_is_refused_unless_allowed(cleared):
    target = cleared.field.select(np.array([0]))
    east, north = target.position[0, :2].tolist()
    with pytest.raises(tf.DataError, match=f"overlaps rock {target.id[0]}$"):
        tf.add_rock(cleared, east=east, north=north, diameter=0.3)
    both = tf.add_rock(cleared, east=east, north=north, diameter=0.3, may_overlap=True)
    assert (int(target.id[0]), int(both.field.id[-1])) in overlapping_pairs(
        both.field, both.library
    )


def test_removing_what_is_not_there(cleared):
    with pytest.raises(tf.DataError, match="no rock with the id 77777"):
        tf.remove_rocks(cleared, [int(cleared.field.id[0]), 77777])
    assert tf.remove_rocks(cleared, []) == cleared
    bare = tf.remove_rocks(cleared, cleared.field.id)
    assert len(bare.field) == 0


@pytest.fixture(scope="module")
def written(cleared, tmp_path_factory):
    """An edited world in its folder: a large rock of a new population, and a small one."""
    edited = tf.add_rock(cleared, east=2.0, north=1.0, diameter=0.9, prototype=2)
    edited = tf.add_rock(edited, east=2.9, north=1.2, diameter=0.4)
    result = tf.write_world(edited, tmp_path_factory.mktemp("edited") / "out")
    assert result.world is edited
    return result


def test_written_world_passes_and_loads(written):
    report = json.loads((written.directory / "validation" / "report.json").read_text())
    assert written.passed, [c for c in report["checks"] if not c["passed"]]
    assert World.load(written.directory) == written.world
    assert {export.folder for export in written.exports} == {"sdf", "mjcf", "usd"}
    verification = json.loads((written.directory / "truth" / "size_frequency.json").read_text())
    assert [p["name"] for p in verification["populations"]] == ["pebbles"]
    assert verification["populations"][0]["count"]["observed"] == len(written.world.field) - 2


def test_truth_has_the_added_rocks(written):
    folder, added = written.directory / "truth", written.world.field.id[-2:].tolist()
    with (folder / "rocks.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["id"]) for row in rows[-2:]] == added
    assert {row["population"] for row in rows[-2:]} == {BY_HAND}
    with rasterio.open(folder / "rock_id.tif") as file:
        ids = file.read(1)[::-1]
    row, column = round((1.0 + 4.0) / 0.125), round((2.0 + 6.0) / 0.125)
    assert ids[row, column] == added[0]
    assert set(np.unique(ids)) <= {-1, *written.world.field.id.tolist()}


def test_exports_have_the_added_rocks(written):
    from pxr import Usd

    identity = int(written.world.field.id[-2])
    model = mujoco.MjModel.from_xml_path(str(written.directory / "mjcf" / "world.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    hit = np.zeros(1, np.int32)
    down = np.array([0.0, 0.0, -1.0])
    distance = mujoco.mj_ray(model, data, np.array([2.0, 1.0, 50.0]), down, None, 1, -1, hit)
    with rasterio.open(written.directory / "truth" / "surface_with_rocks.tif") as file:
        top = file.read(1)[::-1][40, 64]
    assert 50.0 - distance == pytest.approx(top, abs=0.02)  # hull and size, not the very mesh
    names = [model.geom(g).name for g in range(model.ngeom)]
    assert sum(name.startswith("rock_") for name in names) >= len(written.world.field)
    sdf = next((written.directory / "sdf" / "models").glob("*_rocks/model.sdf")).read_text()
    assert f'name="rock_{identity}_collision_0"' in sdf
    stage = Usd.Stage.Open(str(written.directory / "usd" / "world.usda"))
    prims = [prim.GetName() for prim in stage.Traverse()]
    assert f"rock_{identity}" in prims


def test_write_world_takes_other_exports(cleared, tmp_path):
    result = tf.write_world(cleared, tmp_path / "out", exports=("geotiff",))
    assert list((result.directory / "geotiff").glob("*.tif"))
    assert not (result.directory / "sdf").exists()
    with pytest.raises(tf.RecipeError, match=r"unknown exporter 'stl' \(mesh is for it\)"):
        tf.write_world(cleared, tmp_path / "other", exports=("stl",))
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "file").touch()
    with pytest.raises(tf.OutputError, match="not a terrain-forge world"):
        tf.write_world(cleared, tmp_path / "mine", exports=("mjcf",))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["mine", "out"]


def test_saved_recipe_reads_back_equal(tmp_path):
    odd = Recipe(
        name="1e3",
        seed=2**63 - 1,
        body="moon",
        dtm=ArrayDtm(size_m=SIZE, posting_m=1e-05),
        terrain=RECIPE.terrain,
        rocks=RocksSpec(populations=(PEBBLES, PopulationSpec(**{**vars(PEBBLES), "name": "null"}))),
        exports={"ünï # on": {"kind": "sdf", "flavour": "classic"}},
    )
    for recipe in (RECIPE, odd):
        back = tf.load_recipe(tf.save_recipe(recipe, tmp_path / "saved.yaml")).recipe
        assert back == recipe
        assert recipe_json(back) == recipe_json(recipe)
    with pytest.raises(tf.OutputError, match="cannot be written"):
        tf.save_recipe(RECIPE, tmp_path / "none" / "saved.yaml")


def test_recipe_made_in_python_is_checked():
    wrong = Recipe(**{**vars(RECIPE), "terrain": TerrainSpec(spacing_m=-1.0)})
    with pytest.raises(tf.RecipeError, match=re.escape("terrain.spacing_m: ")):
        tf.plan(wrong)


def test_a_dynamic_rock_is_settled(cleared):
    edited = tf.add_rock(cleared, east=2.0, north=1.0, diameter=0.3, prototype=1, dynamic=True)
    rock = edited.field.select(np.array([len(cleared.field)]))
    assert rock.dynamic[0]
    assert rock.buried_fraction[0] == 0.0
    turn = rotations(rock)[0][:2]
    plan = rock.scale[0] * edited.library.prototypes[1].meshes[0].vertices @ turn.T
    assert mean_width(plan) == pytest.approx(0.3)
