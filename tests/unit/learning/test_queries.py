"""Batched queries of many worlds, and ground for other packages."""

from __future__ import annotations

import json
import os
import pickle
import re
import shutil
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import terrain_forge as tf
from terrain_forge.dtm import RasterDtm
from terrain_forge.recipe import recipe_from_json, recipe_json, without_paths
from terrain_forge.terrain import mask_weight
from tests.helpers.driving_worlds import recipe
from tests.helpers.places import ROOT

mujoco = pytest.importorskip("mujoco")
gymnasium = pytest.importorskip("gymnasium")
from terrain_forge import learning  # noqa: E402


def points(made):
    rng = np.random.default_rng(0)
    world = rng.integers(0, 2, 500)
    return world, rng.uniform(-4.9, 4.9, 500), rng.uniform(-3.9, 3.9, 500)


def test_batched_queries_equal_those_of_each_world(made):
    grounds = learning.Grounds.of(made.folders)
    half = made.directory / ".begun-00003-4711"  # of one that is being made, or was killed
    half.mkdir()
    (half / "drawn.json").write_bytes((made.folders[1] / "drawn.json").read_bytes())
    try:
        assert np.array_equal(learning.Grounds.of(made.directory).elevation, grounds.elevation)
    finally:
        shutil.rmtree(half)
    loaded = [tf.World.load(folder) for folder in made.folders]
    n, x, y = points(made)
    height = grounds.height_at(n, x, y)
    assert grounds.height_at(1, float(x[1]), float(y[1])) == pytest.approx(
        grounds.height_at(np.array([1]), x[1:2], y[1:2])[0]
    )
    assert grounds.top_at(0, 0.0, 0) >= grounds.height_at(0, 0.0, 0) - 0.1
    for number, world in enumerate(loaded):
        own = n == number
        assert height[own] == pytest.approx(world.ground.height_at(x[own], y[own]), abs=1e-6)
    east, north = grounds.rise_at(n, x, y)
    step = 1e-4
    assert np.median(np.abs((grounds.height_at(n, x + step, y) - height) / step - east)) < 1e-3
    normal = np.stack(grounds.normal_at(n, x, y))
    assert np.linalg.norm(normal, axis=0) == pytest.approx(1.0)
    assert normal[0] / normal[2] == pytest.approx(-east)
    assert grounds.slope_at(n, x, y) == pytest.approx(np.hypot(east, north))
    on_rock = grounds.rock_at(n, x, y) >= 0
    assert on_rock.any()
    assert np.all(grounds.top_at(n, x, y)[on_rock] > height[on_rock] - 0.3)


def test_queries_take_lists_and_numbers(made):
    grounds = learning.Grounds.of(made.folders)
    x, y = [1.0, -2.0], [0.5, 1]
    for ask in (grounds.height_at, grounds.top_at, grounds.rock_at, grounds.slope_at):
        found = ask(np.array([0, 1]), np.array(x), np.array(y))
        assert np.array_equal(ask([0, 1], x, y), found)
        assert ask(1, x[1], y[1]) == found[1]
        assert ask([0, 1], x, y[0])[0] == found[0]
    assert grounds.height_at([], [], []).shape == (0,)


@pytest.mark.parametrize(
    ("world", "found"),
    [
        (-1, "world -1"),
        (np.int32(2), "world 2"),
        ([0, 5], "world 5"),
        (True, "worlds of the type bool"),
        (np.array([True, False]), "worlds of the type bool"),
        (0.0, "worlds of the type float64"),
        ("a", "worlds of the type str32"),
        (None, "worlds of the type object"),
    ],
)
def test_a_query_in_a_world_that_is_not_there_is_refused(made, world, found):
    grounds = learning.Grounds.of(made.folders)
    for ask in (grounds.height_at, grounds.top_at, grounds.rock_at, grounds.normal_at):
        with pytest.raises(tf.DataError, match=f"^{found}: whole numbers from 0 to 1 are allowed$"):
            ask(world, 0.0, 0.0)


@pytest.mark.parametrize(
    ("points", "found"),
    [
        (
            (0, [1, 2], [1, 2, 3]),
            "world of shape (), east of shape (2,), north of shape (3,): alike",
        ),
        (([0, 1], [1.0, 2.0, 3.0], 0.0), "world of shape (2,), east of shape (3,)"),
        ((0, "x", 0.0), "Grounds: east must be numbers, in rows of one length, found 'x'"),
        ((0, 0.0, 1 + 1j), "Grounds: north must be numbers"),
        ((0, np.array([1j]), 0.0), "Grounds: east must be numbers"),
        ((0, None, 0.0), "Grounds: east must be numbers"),
        ((0, [[1.0], [1.0, 2.0]], 0.0), "Grounds: east must be numbers"),
        (([[0], [0, 1]], 0.0, 0.0), "worlds in rows of several lengths"),
    ],
)
def test_a_query_of_what_is_no_place_is_refused(made, points, found):
    grounds = learning.Grounds.of(made.folders)
    for ask in (grounds.height_at, grounds.top_at, grounds.rock_at, grounds.slope_at):
        with pytest.raises(tf.DataError, match=f"^{re.escape(found)}"):
            ask(*points)


def test_arrays_of_another_library_are_taken_as_they_are(made):
    """Whose numbers may be on a device, or not known yet."""

    class Elsewhere:
        def __init__(self, values):
            self.values, self.dtype, self.shape = values, values.dtype, values.shape

        def __array__(self, *_, **__):
            raise AssertionError("looked at")

        def __sub__(self, other):
            return self.values - other

    grounds = learning.Grounds.of(made.folders)
    x = Elsewhere(np.array([0.5, 1.0]))
    found = grounds.height_at(0, x, x)
    assert np.array_equal(found, grounds.height_at(0, x.values, x.values))
    with pytest.raises(tf.DataError, match=r"east of shape \(2,\), north of shape \(3,\)"):
        grounds.height_at(0, x, [1, 2, 3])


def test_a_height_field_is_laid_at_the_corner_or_in_the_worlds_frame(made):
    world = tf.World.load(made.folders[0])
    west, south, _, _ = world.ground.bounds
    top = tf.rock_rasters(world)[0]
    for own_frame, (x, y) in ((False, (0.0, 0.0)), (True, (west, south))):
        spec = mujoco.MjSpec()
        learning.add_to_spec(spec, world, own_frame=own_frame)
        model = spec.compile()
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        place = np.array([x, y, 50.0]) + world.ground.spacing * np.array([30, 20, 0])
        hit, down = np.zeros(1, np.int32), np.array([0.0, 0.0, -1.0])
        distance = mujoco.mj_ray(model, data, place, down, None, 1, -1, hit)
        assert 50.0 - distance == pytest.approx(top[20, 30], abs=1e-4)


def test_queries_of_no_place_give_none(made):
    grounds = learning.Grounds.of(made.folders)
    for x, y in ((np.nan, 0.0), (np.array([0.5, np.nan]), np.array([np.nan, 0.5]))):
        found = (
            *(grounds.height_at(0, x, y), grounds.top_at(0, x, y), grounds.slope_at(0, x, y)),
            *grounds.normal_at(0, x, y),
        )
        assert np.isnan(found).all()
        assert np.all(grounds.rock_at(0, x, y) == -1)
    assert grounds.top_at(0, np.zeros(2), np.zeros(2)).dtype == grounds.top.dtype
    assert grounds.rock_at(0, np.inf, -np.inf) == grounds.rock[0, 0, -1]


def test_queries_go_to_another_library_without_a_copy(made):
    jax = pytest.importorskip("jax")
    here = learning.Grounds.of(made.folders)
    there = here.to(jax.dlpack.from_dlpack)
    n, x, y = points(made)
    x, y = x.astype(np.float32), y.astype(np.float32)
    found = jax.jit(there.height_at)(n, x, y)
    assert isinstance(found, jax.Array)
    assert np.asarray(found) == pytest.approx(here.height_at(n, x, y), abs=1e-4)
    assert np.array_equal(np.asarray(there.rock_at(n, x, y)), here.rock_at(n, x, y))


@pytest.mark.parametrize("query", ["height_at", "normal_at", "slope_at", "rock_at", "top_at"])
def test_torch_takes_lists_numbers_and_arrays_of_numpy(made, query):
    torch = pytest.importorskip("torch")
    own = learning.Grounds.of(made.folders)
    there = own.to(torch.from_dlpack)
    n, x, y = points(made)
    for given in ((n, x, y), (n.tolist(), x.tolist(), y), (1, 0.5, -0.25), (torch.tensor(1), 2, y)):
        found, wanted = getattr(there, query)(*given), getattr(own, query)(*map(np.asarray, given))
        assert np.allclose(np.asarray(found), wanted, rtol=0, atol=1e-5)
        assert isinstance(found[0] if query == "normal_at" else found, torch.Tensor)


@pytest.mark.parametrize("kind", ["uint8", "int8", "int16", "int32", "int64"])
def test_torch_takes_worlds_as_whole_numbers_of_any_size(made, kind):
    torch = pytest.importorskip("torch")
    own = learning.Grounds.of(made.folders)
    there, x = own.to(torch.from_dlpack), torch.tensor([0.5, 1.0])
    found = there.height_at(torch.tensor([1, 1], dtype=getattr(torch, kind)), x, x)
    assert np.allclose(found, own.height_at(np.array([1, 1]), x.numpy(), x.numpy()), atol=1e-6)


def test_generators_of_others_get_ground_and_origin():
    maker = learning.GroundMaker(recipe=recipe())
    spec = mujoco.MjSpec()
    spec.worldbody.add_body(name="terrain")
    origin, (geom,) = maker.mjlab(0.5, spec, np.random.default_rng(1), size=(6.0, 5.0))
    body = spec.body("terrain")
    body.pos = (10.0, 20.0, 0.0)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    geomid = np.zeros(1, np.int32)
    down = np.array([0.0, 0.0, -1.0])
    eye = np.array([10.0, 20.0, 0.0]) + origin + (0.0, 0.0, 5.0)
    depth = mujoco.mj_ray(model, data, eye, down, None, 1, -1, geomid)
    assert model.geom(geomid[0]).name == geom.name
    assert 5.0 <= depth < 5.5  # the origin stands above what is around it
    np.random.seed(2)  # noqa: NPY002 (as Isaac Lab does)
    meshes, place = maker.isaac_lab(0.5, SimpleNamespace(size=(6.0, 5.0)))
    low, high = meshes[0].bounds
    assert low[:2] == pytest.approx((0.0, 0.0), abs=1e-9)
    assert high[:2] == pytest.approx((6.0, 5.0))
    assert place[:2] == pytest.approx((3.0, 2.5))
    assert all(mesh.is_watertight for mesh in meshes[1:])


def test_what_isaac_lab_calls_is_named_by_its_recipe(tmp_path):
    raster = tmp_path / "ground.tif"
    order = recipe()
    named = replace(order, dtm=RasterDtm(source="ground.tif", size_m=(6.0, 5.0)))

    def name(order, **more):
        return learning.GroundMaker(recipe=order, folder=tmp_path, **more).isaac_lab.__name__

    without = name(named)
    raster.write_bytes(b"one")
    names = {name(order), name(replace(order, body="moon")), name(order, platform=0.1), name(named)}
    assert len(names | {without}) == 5
    os.utime(raster, ns=(1, 1))
    assert name(named) not in names
    assert name(recipe()) in names
    maker = learning.GroundMaker(recipe=order).isaac_lab
    assert pickle.loads(pickle.dumps(maker)).__name__ == maker.__name__


@pytest.mark.parametrize("size", [(6.0, 5.0), (4.1, 4.3)])
def test_nothing_near_the_middle_stands_above_the_origin(size):
    """Nor between the nodes; and of no size is the middle without any."""
    for platform in (0.0, 0.05, 0.5):
        maker = learning.GroundMaker(recipe=recipe(), platform=platform)
        for seed in range(4):
            spec = mujoco.MjSpec()
            origin, _ = maker.mjlab(1.0, spec, np.random.default_rng(seed), size=size)
            model = spec.compile()
            data = mujoco.MjData(model)
            mujoco.mj_forward(model, data)
            for turn in np.linspace(0.0, 2.0 * np.pi, 200):
                eye = origin + np.array([platform * np.cos(turn), platform * np.sin(turn), 5.0])
                down, geom = np.array([0.0, 0.0, -1.0]), np.zeros(1, np.int32)
                assert mujoco.mj_ray(model, data, eye, down, None, 1, -1, geom) > 5.0 - 1e-6


def test_ground_for_others_that_cannot_be_is_told_by_its_key():
    maker = learning.GroundMaker(recipe=recipe())
    for size, why in (
        ((1e5, 1e5), r"^terrain\.spacing_m: .* GB of memory, this machine has"),
        ((4.03, 4.0), r"^dtm\.size_m: 4\.03 m is not a whole number \(2 or more\) of cells"),
        ((0.6, 0.6), r"^rocks\.populations\[0\]\.diameter_m: rocks of up to 0\.9 m"),
    ):
        with pytest.raises(tf.RecipeError, match=why):
            maker.world(0.5, 0, size=size)


RECIPES = sorted(path.name for path in (ROOT / "recipes").glob("*.yaml"))


@pytest.mark.parametrize(
    "name",
    [
        name if name == "gale_short.yaml" else pytest.param(name, marks=pytest.mark.slow)
        for name in RECIPES
    ],
)
def test_every_recipe_of_ours_makes_ground_for_others(name):
    maker = learning.GroundMaker.of(
        tf.load_recipe(ROOT / "recipes" / name, changes=("rocks.library.shapes=2",))
    )
    world = maker.world(0.5, 0, size=(8.0, 8.0))
    assert world.site.size == (8.0, 8.0)
    assert not world.trajectories


def hello():
    """A recipe of ours, plain, whose terrain model is not searched for noise."""
    changes = "dtm.noise=keep", "rocks.library.shapes=2"
    file = tf.load_recipe(ROOT / "recipes" / "hello.yaml", changes=changes)
    return json.loads(recipe_json(file.recipe))


def test_what_a_recipe_says_of_its_paths_is_left_out_of_ground_for_others():
    told = hello() | {
        "dataset": {"path": "loop"},
        "exports": {"mjcf": {"pebbles_min_m": 0.05}},
        "worlds": {
            "arrival": {"distance_m": 20.0},
            "vary": {"paths.loop.speed_m_s": {"uniform": [0.1, 0.3]}},
        },
    }
    bands = [
        {"route": {"path": "loop", "beyond_m": 1.0}},
        {"route": {"path": "loop", "within_m": 1.0}},
        {"route": {"beyond_m": 1.0}, "invert": True},
        {"route": {"within_m": 1.0}, "invert": True},
    ]
    told["terrain"]["layers"] = [{"kind": "fractal", "mask": mask} for mask in bands]
    given = recipe_from_json(json.dumps(told))
    own = without_paths(given)
    assert (own.paths, own.validate, own.dataset) == ((), None, None)
    assert own.exports == {"mjcf": {}}
    maker = learning.GroundMaker(recipe=given, folder=ROOT / "recipes")
    world = maker.world(0.5, 0, size=(4.0, 4.0))
    site, level = world.site, np.zeros(world.ground.shape)
    for layer, weight in zip(site.recipe.terrain.layers, (1.0, 0.0, 0.0, 1.0), strict=True):
        if layer.mask is None:
            assert weight == 1.0
        else:
            found = mask_weight(layer.mask, site=site, window=site.window, elevation=level)
            assert (found == weight).all()


@pytest.mark.parametrize("difficulty", [-0.1, 1.1, np.nan])
def test_a_difficulty_is_a_part(difficulty):
    maker = learning.GroundMaker(recipe=recipe())
    with pytest.raises(ValueError, match=r"difficulty: \S+, allowed: 0 to 1"):
        maker.mjlab(difficulty, mujoco.MjSpec(), np.random.default_rng(1))


def test_ground_for_others_refuses_what_it_cannot_take(made):
    maker, world = learning.GroundMaker(recipe=recipe()), tf.World.load(made.folders[0])
    spec, rng, lab = mujoco.MjSpec(), np.random.default_rng(1), SimpleNamespace
    file, full = tf.load_recipe(ROOT / "recipes" / "hello.yaml"), mujoco.MjSpec()
    learning.add_to_spec(full, world)
    for call, why in (
        (lambda: maker.mjlab("x", spec, rng), "difficulty must be a number, found 'x'"),
        (lambda: maker.mjlab(0.5, None, rng), "spec must be a mujoco.MjSpec, found a NoneType"),
        (lambda: maker.mjlab(0.5, spec, None), "rng must be a Generator, found None"),
        (lambda: maker.mjlab(0.5, spec, rng, size=3.0), "size must be 2 values, each a number"),
        (lambda: maker.isaac_lab(0.5, None), "cfg.size must be 2 values, .* found None"),
        (lambda: maker.isaac_lab(0.5, lab(size=(np.nan, 4))), "cfg.size must be 2 values"),
        (lambda: maker.isaac_lab(0.5, lab(size="44")), "cfg.size must be 2 values, .* found '44'"),
        (lambda: maker.isaac_lab(0.5, lab(size=(4, 4), seed=-1)), "cfg.seed must be .* found -1"),
        (lambda: maker.isaac_lab(None, lab(size=(4, 4))), "difficulty must be"),
        (lambda: maker.world(0.5, "x"), "number must be a whole number"),
        (lambda: maker.world(0.5, -1), "number must be a whole number at least 0, found -1"),
        (lambda: learning.GroundMaker.of(file, platform=-1), "platform must be a number at least"),
        (lambda: learning.Grounds.of(made.folders[0]).to(None), "take must be a function"),
        (lambda: learning.GroundMaker.of("hello.yaml"), "file must be a RecipeFile"),
        (lambda: learning.add_to_spec(None, world), "spec must be a mujoco.MjSpec"),
        (lambda: learning.add_to_spec(spec, None), "world must be a World, found None"),
        (lambda: learning.add_to_spec(full, world), "name must be one that .* found 'ground'"),
        (lambda: learning.add_to_spec(spec, world, name=""), "name must be one that .* found ''"),
        (lambda: learning.trimeshes(None), "world must be a World, found None"),
        (lambda: learning.Grounds.of(None), "worlds must be"),
        (lambda: learning.Grounds.of([1]), "worlds must be"),
    ):
        with pytest.raises(tf.DataError, match=why) as caught:
            call()
        assert "\n" not in str(caught.value)


def test_grounds_are_of_one_world_too(made):
    folder = made.folders[0]
    for one in (str(folder), folder, tf.World.load(folder)):
        grounds = learning.Grounds.of(one)
        assert np.array_equal(grounds.top, learning.Grounds.of([folder]).top)
        assert repr(grounds) == "<Grounds: 1 world of 10 × 8 m at 0.1 m>"
        assert {grounds: 1}[grounds] == 1  # as jax.jit keeps what is static
        assert grounds != learning.Grounds.of([folder])
    with pytest.raises(tf.OutputError, match=r"^no worlds: give some, or the folders in which"):
        learning.Grounds.of([])


def test_a_box_slides_on_ground_of_ours_that_is_steeper_than_its_friction(made):
    """Whatever friction the box has: MuJoCo takes the ground's."""
    world = tf.World.load(made.folders[0])
    far = world.field.select(np.zeros(len(world.field), np.bool_))
    rise = np.tan(np.radians(40.0)) * world.ground.east
    ground = world.ground.replace(
        elevation=np.broadcast_to(rise, world.ground.shape).astype(np.float32)
    )
    spec = mujoco.MjSpec()
    learning.add_to_spec(
        spec, world.replace(ground=ground, field=far, neighbours=far), own_frame=True
    )
    turn = [np.cos(np.radians(-20.0)), 0.0, np.sin(np.radians(-20.0)), 0.0]
    box = spec.worldbody.add_body(pos=[2.0, 0.0, 2.0 * np.tan(np.radians(40.0)) + 0.2], quat=turn)
    box.add_freejoint()
    box.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.2, 0.2, 0.1], mass=1.0)
    model = spec.compile()
    data = mujoco.MjData(model)
    for _ in range(1000):
        mujoco.mj_step(model, data)
    assert data.qpos[0] < 1.0


def test_a_height_scan_keeps_so_many_worlds(monkeypatch):
    from terrain_forge.learning import sight

    monkeypatch.setattr(sight, "KEPT", 2)
    scan, seen = sight.HeightScan(), []
    for name in ("a", "b", "a", "c", "a", "b"):
        top = Watched(np.zeros((9, 9), np.float32), name, seen)
        scan.begin(SimpleNamespace(folder=name, written=0, spacing=0.1, top=top))
    assert seen == ["a", "b", "c", "b"]


class Watched:
    """Heights that note when they are read."""

    def __init__(self, top, name, seen):
        self._top, self._name, self._seen = top, name, seen

    def __array__(self, dtype=None, copy=None):
        del dtype, copy
        self._seen.append(self._name)
        return self._top


@pytest.mark.parametrize(
    ("mask", "vary"),
    [
        ({"route": {"within_m": 1}, "height": {"above_m": -5}}, {"mask.height.above_m": [-9, -8]}),
        ({"route": {"beyond_m": 1.0}}, {"mask.invert": None}),
        ({"route": {"beyond_m": 1.0}}, {"mask": None}),
    ],
)
def test_what_is_drawn_of_masks_by_paths_is_as_far_from_any(mask, vary):
    plain = hello()
    plain["terrain"]["layers"] = [{"kind": "fractal", "mask": mask}]
    (key, low_high), *_ = vary.items()
    choice = [True] if key.endswith("invert") else [{"route": {"within_m": 2.0}}]
    wish = {"uniform": low_high} if low_high else {"choice": choice}
    plain["worlds"] = {"vary": {f"terrain.layers.0.{key}": wish}}
    maker = learning.GroundMaker(
        recipe=recipe_from_json(json.dumps(plain)), folder=ROOT / "recipes"
    )
    site = maker.world(0.5, 0, size=(4.0, 4.0)).site
    (layer,) = site.recipe.terrain.layers
    level = np.zeros((site.window.rows + 1, site.window.columns + 1))
    assert not mask_weight(layer.mask, site=site, window=site.window, elevation=level).any()
