import json
import re
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
import trimesh
from scipy.stats import kstest

from terrain_forge.base import RecipeError, matrix_from_quaternion, remembered
from terrain_forge.building.calibration import pace
from terrain_forge.building.cost import SETTLING, WATCHING
from terrain_forge.model import Heightfield, Mesh, exporter, rotations
from terrain_forge.pipeline import check
from terrain_forge.recipe import ValidateSpec, recipe_from_json
from terrain_forge.rocks import (
    LibrarySpec,
    Scattered,
    dynamic_contact,
    embed,
    expected_dynamic,
    make_library,
    require_dynamic,
    settle,
    settling,
)
from terrain_forge.rocks.embedding.footprint import footprint
from terrain_forge.rocks.embedding.outline import convex_hull, mean_width
from terrain_forge.rocks.scattering.size_classes import DYNAMIC_SPACE
from terrain_forge.rocks.shapes.solid import mass_properties
from terrain_forge.validation import validate
from terrain_forge.validation.checks.dynamic import MOST_SHIFT, Dynamic, watch
from tests.helpers import worlds

LIBRARY = make_library(LibrarySpec(shapes=4))
COUNT = 20
GRAVITY = 3.71


def ground():
    """The hill with three centimetres of roughness at the size of the rocks."""
    land = worlds.ground()
    random = np.random.default_rng(2)
    rough = random.normal(0.0, 0.01, land.shape)
    waves = 0.02 * np.sin(9.0 * land.east[None, :]) * np.cos(8.0 * land.north[:, None])
    return land.replace(elevation=land.elevation + rough + waves)


def scattered(dynamic):
    """Rocks of 0.1 to 1 m on places of a coarse grid, so that none can meet."""
    random = np.random.default_rng(7)
    places = np.stack(np.meshgrid(np.arange(-8.0, 8.1, 2.0), np.arange(-5.0, 5.1, 2.0)), -1)
    xy = places.reshape(-1, 2)[:COUNT] + random.uniform(-0.3, 0.3, (COUNT, 2))
    return Scattered(
        populations=("pebbles", "boulders"),
        id=np.arange(COUNT),
        population=np.zeros(COUNT),
        prototype=random.integers(0, len(LIBRARY.prototypes), COUNT),
        xy=xy,
        yaw=random.uniform(0, 2 * np.pi, COUNT),
        buried=random.uniform(0.05, 0.5, COUNT),
        diameter=0.1 * 10 ** random.random(COUNT),
        dynamic=dynamic,
        collides=np.ones(COUNT, np.bool_),
        unplaced=(0, 0),
    )


def export(world, folder):
    mjcf = exporter("mjcf")
    mjcf.export(world, folder, options=mjcf.Options())


def laid(land, dynamic):
    return embed(
        scattered=scattered(dynamic), library=LIBRARY, ground=land, density=(2900.0, 2500.0)
    )


@pytest.fixture(scope="module")
def settled():
    land = ground()
    dynamic = np.arange(COUNT) % 2 > 0
    return settle(rocks=laid(land, dynamic), library=LIBRARY, ground=land, gravity=GRAVITY)


@pytest.fixture(scope="module")
def world(settled):
    return worlds.world().replace(ground=ground(), library=LIBRARY, field=settled)


def test_nearly_all_come_to_rest_and_the_others_are_fixed(settled):
    before = laid(ground(), np.arange(COUNT) % 2 > 0)
    assert settled.dynamic[before.dynamic].mean() >= 0.8
    assert not settled.dynamic[~before.dynamic].any()
    fixed = ~settled.dynamic
    assert settled.select(fixed).replace(dynamic=before.dynamic[fixed]) == before.select(fixed)


def test_a_rock_that_lay_there_before_is_not_let_go_again(settled, monkeypatch):
    """As beside a path across tiles; the least change of the ground beneath it counts."""
    land, dynamic = ground(), np.arange(COUNT) % 2 > 0

    def refuse(*given):
        raise AssertionError("it is let go")

    monkeypatch.setattr(settling, "simulation", refuse)
    for prototype in LIBRARY.prototypes:
        remembered(lambda shape: shape.volume)(prototype)  # as other stages do
    again = settle(rocks=laid(land, dynamic), library=LIBRARY, ground=land, gravity=GRAVITY)
    assert again == settled
    other = land.replace(elevation=land.elevation + np.float32(1e-4) * (land.east > 0.0))
    with pytest.raises(AssertionError, match="let go"):
        settle(rocks=laid(other, dynamic), library=LIBRARY, ground=other, gravity=GRAVITY)


def test_diameters_are_exact(settled):
    """The mean of length and width of the whole outline in the settled pose, by brute force."""
    for n in np.flatnonzero(settled.dynamic):
        plan = (LIBRARY.prototypes[settled.prototype[n]].meshes[0].vertices
                @ rotations(settled)[n][:2].T) * settled.scale[n]  # fmt: skip
        apart = plan[:, None] - plan[None]
        a, b = np.unravel_index(np.hypot(*np.moveaxis(apart, -1, 0)).argmax(), apart.shape[:2])
        along = apart[a, b] / np.hypot(*apart[a, b])
        width = np.ptp(plan @ [-along[1], along[0]])
        assert 0.5 * (np.hypot(*apart[a, b]) + width) == pytest.approx(settled.diameter[n])
    wanted = scattered(settled.dynamic).diameter
    np.testing.assert_array_equal(settled.diameter, wanted)
    assert kstest(np.log10(settled.diameter / 0.1), "uniform").pvalue > 0.001


def test_masses_are_those_of_the_settled_size(settled):
    for n in np.flatnonzero(settled.dynamic):
        mesh = LIBRARY.prototypes[settled.prototype[n]].meshes[0]
        solid = mass_properties(Mesh(vertices=mesh.vertices * settled.scale[n], faces=mesh.faces))
        assert settled.volume[n] == pytest.approx(solid.volume)
        assert settled.mass[n] == pytest.approx(2900.0 * solid.volume)


def test_they_touch_the_ground_and_are_not_in_it(settled):
    land = ground()
    for n in np.flatnonzero(settled.dynamic):
        mesh = LIBRARY.prototypes[settled.prototype[n]].meshes[0]
        points = settled.scale[n] * mesh.vertices @ rotations(settled)[n].T + settled.position[n]
        above = points[:, 2] - land.height_at(points[:, 0], points[:, 1])
        assert above.min() == pytest.approx(0.0, abs=0.02 * settled.diameter[n])
        assert settled.height[n] == pytest.approx(above.max(), abs=0.5 * settled.diameter[n])
    assert not settled.buried_fraction[settled.dynamic].any()


def test_they_stay_within_their_room(settled):
    places = scattered(settled.dynamic)
    for n in np.flatnonzero(settled.dynamic):
        prototype = LIBRARY.prototypes[settled.prototype[n]]
        plan = settled.scale[n] * prototype.meshes[0].vertices @ rotations(settled)[n][:2].T
        moved = settled.position[n, :2] - places.xy[n]
        support = footprint(prototype.meshes[0])
        angle = places.yaw[n] + 2 * np.pi * np.arange(len(support)) / len(support)
        reached = (plan + moved) @ np.stack([np.cos(angle), np.sin(angle)])
        assert np.all(reached.max(axis=0) <= DYNAMIC_SPACE * support * settled.diameter[n])
        assert np.hypot(*plan.T).max() <= prototype.reach * settled.diameter[n]


def test_a_window_has_the_same_bits(settled):
    """Settled on a cut of the ground, and with other rocks dynamic."""
    land = ground()
    part = land.cut(column=17, row=9, columns=50, rows=40)
    west, south, east, north = part.bounds
    whole = laid(land, np.ones(COUNT, np.bool_))
    x, y = whole.position[:, 0], whole.position[:, 1]
    inside = (np.abs(x - 0.5 * (west + east)) < 0.5 * (east - west) - 1.8) & (
        np.abs(y - 0.5 * (south + north)) < 0.5 * (north - south) - 1.8
    )
    again = settle(rocks=whole.select(inside), library=LIBRARY, ground=part, gravity=GRAVITY)
    both = again.dynamic & settled.dynamic[inside]
    assert both.sum() >= 3
    assert again.select(both) == settled.select(np.flatnonzero(inside)[both])


@pytest.mark.slow
def test_dynamic_rocks_stay_in_the_exported_world(world, tmp_path):
    """Reloaded in MuJoCo with the ground and all others: 2 % of the diameter, 3 deg, for 5 s."""
    result = validate(world, tmp_path, spec=ValidateSpec(points=10))
    (check,) = (check for check in result.checks if "dynamic ones that stay" in check.name)
    assert check.passed, check
    assert check.figure >= 0.95
    assert [export.folder for export in result.exports] == ["validation/mjcf"]
    assert (tmp_path / "validation" / "mjcf" / "world.xml").is_file()


def test_they_need_no_rolling_friction(world, tmp_path):
    """Which SDF cannot say, nor most engines know."""
    (tmp_path / "mjcf").mkdir()
    export(world, tmp_path / "mjcf")
    scene = tmp_path / "mjcf" / "world.xml"
    text = scene.read_text()
    assert text.count('condim="6"') == 1
    scene.write_text(text.replace('condim="6"', 'condim="3"'))
    assert watch(world, scene).stayed.mean() >= 0.95


def rough(height=0.04):
    """Waves about as long as the largest rocks."""
    land = worlds.ground()
    waves = height * np.sin(14.0 * land.east[None, :]) * np.cos(12.0 * land.north[:, None])
    return land.replace(elevation=land.elevation + waves)


def test_a_rock_that_finds_no_rest_is_tried_again(monkeypatch):
    """Turned and a little beside its place; one that settles at once is not touched by that."""
    land = rough()
    before = laid(land, np.ones(COUNT, np.bool_)).select(np.arange(2))
    again = settle(rocks=before, library=LIBRARY, ground=land, gravity=GRAVITY)
    monkeypatch.setattr(settling, "TRIES", 1)
    once = settle(rocks=before, library=LIBRARY, ground=land, gravity=GRAVITY)
    assert again.dynamic.sum() > once.dynamic.sum()
    assert again.dynamic.all()
    assert again.select(once.dynamic) == once.select(once.dynamic)


def test_only_rocks_at_corridors_keep_below_their_rise():
    land = rough(0.12)
    before = laid(land, np.ones(COUNT, np.bool_)).select(np.array([0, 1, 6, 7]))
    rise = np.array([prototype.rise for prototype in LIBRARY.prototypes])[before.prototype]
    low = np.arange(4) % 2 == 0
    kept = settle(rocks=before, library=LIBRARY, ground=land, gravity=GRAVITY, low=low)
    high = kept.height > rise * kept.diameter
    assert not high[low & kept.dynamic].any()
    assert high[~low & kept.dynamic].any()


def test_a_rock_on_its_edge_does_not_pass(settled):
    """Balanced to a hundredth of its size it stays by itself; leaning gravity tips it over."""
    box = trimesh.creation.box((1.2, 0.6, 1.2))
    mesh = Mesh(vertices=box.vertices, faces=box.faces)
    shape = LIBRARY.prototypes[0].replace(
        meshes=(mesh,),
        hulls=(mesh,),
        uvs=(np.zeros((12, 3, 2)),),
        outline_errors=(0.0,),
        volume=box.volume,
        inertia=box.moment_inertia,
    )
    rock = settling.DynamicRock.of(settled, 0, shape, footprint(mesh), GRAVITY)
    flat = Heightfield(elevation=np.zeros((17, 17)), spacing=0.25, origin=(-2.0, -2.0))
    outcomes = []
    for tilt in (0.0, np.pi / 4):
        turn = np.array([np.cos(tilt / 2), 0.0, np.sin(tilt / 2), 0.0])
        lowest = (box.vertices @ matrix_from_quaternion(turn).T)[:, 2].min()
        pose = settling.Pose(position=np.array([0, 0, -lowest]), quaternion=turn, scale=1.0)
        outcomes.append(settling.stays_put(rock, pose, settling.after_test(rock, flat, pose)))
    assert outcomes == [True, False]


@pytest.mark.slow
def test_a_rock_that_is_not_settled_is_noticed(world, tmp_path, use_threads):
    """Raised by a fifth of their diameter, they fall."""
    raised = world.field.position + world.field.diameter[:, None] * (0.0, 0.0, 0.2)
    thrown = world.replace(field=world.field.replace(position=raised))
    (tmp_path / "mjcf").mkdir()
    export(thrown, tmp_path / "mjcf")
    use_threads(2)
    stay = watch(thrown, tmp_path / "mjcf" / "world.xml")
    assert not stay.stayed.any()
    assert stay.shift.min() > 5 * MOST_SHIFT
    built = SimpleNamespace(world=thrown, mjcf=tmp_path / "mjcf")
    assert not Dynamic().checks(built)[0].passed


def test_a_world_without_dynamic_rocks_is_not_checked(tmp_path):
    result = validate(worlds.world(), tmp_path, spec=ValidateSpec(points=10))
    assert not any("dynamic ones that stay" in check.name for check in result.checks)
    assert result.exports == ()


def test_a_rock_on_too_steep_a_slope_is_fixed():
    """tan 40 deg is above the sliding friction: all slide out of their room."""
    land = worlds.ground()
    steep = land.replace(elevation=np.tile(0.84 * land.east, (land.shape[0], 1)))
    before = laid(steep, np.arange(COUNT) < 1)
    after = settle(rocks=before, library=LIBRARY, ground=steep, gravity=GRAVITY)
    assert not after.dynamic.any()
    assert after == before.replace(dynamic=np.zeros(COUNT, np.bool_))


def test_physics_is_that_of_the_rock(settled):
    """MuJoCo's mass and principal moments are those of the true shape, about its centre of mass."""
    n = int(np.flatnonzero(settled.dynamic)[0])
    prototype = LIBRARY.prototypes[settled.prototype[n]]
    rock = settling.DynamicRock.of(settled, n, prototype, footprint(prototype.meshes[0]), GRAVITY)
    flat = Heightfield(elevation=np.zeros((5, 5)), spacing=1.0, origin=(-2.0, -2.0))
    pose = settling.Pose(
        position=np.array([0, 0, 1.0]), quaternion=settled.quaternion[n], scale=settled.scale[n]
    )
    model, data = settling.simulation(rock, flat, pose)
    mesh = prototype.meshes[0]
    solid = mass_properties(Mesh(vertices=mesh.vertices * pose.scale, faces=mesh.faces))
    assert model.body_mass[1] == pytest.approx(rock.density * solid.volume)
    moments = np.linalg.eigvalsh(rock.density * solid.inertia)
    np.testing.assert_allclose(np.sort(model.body_inertia[1]), moments, rtol=1e-9)
    np.testing.assert_allclose(model.body_ipos[1], 0.0, atol=1e-12)
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.xipos[1], pose.position, atol=1e-12)
    corners = np.concatenate([hull.vertices for hull in prototype.hulls])
    lowest = pose.scale * (corners @ matrix_from_quaternion(pose.quaternion).T)[:, 2].min()
    assert mujoco.mj_geomDistance(model, data, 0, 1, 5.0, None) == pytest.approx(
        1.0 + lowest, abs=1e-5
    )


def test_contact_scales_with_the_rock():
    small, large = dynamic_contact(0.2), dynamic_contact(2.0)
    assert small.condim == 6
    assert large.friction == (0.7, pytest.approx(0.1), pytest.approx(0.1))
    assert small.rolling == pytest.approx(0.1 * large.rolling)


def recipe(**population):
    stones = {
        "name": "stones",
        "size_frequency": {"kind": "golombek", "k": 0.05},
        "diameter_m": [0.1, 3.0],
    }
    content = {
        "name": "dynamic",
        "body": "mars",
        "dtm": {"kind": "flat", "size_m": [50, 50]},
        "terrain": {"spacing_m": 0.1},
        "rocks": {"populations": [stones | population]},
    }
    return recipe_from_json(json.dumps(content))


def limit(recipe):
    require_dynamic(
        recipe.rocks.populations, size=recipe.dtm.size_m, spacing=recipe.terrain.spacing_m
    )


def test_dynamic_rocks_that_cannot_be_settled_are_refused():
    limit(recipe(dynamic_m=[0.2, 0.8]))
    with pytest.raises(RecipeError, match=r"up to 1 m, at most 8 .* 0.8 m") as caught:
        limit(recipe(dynamic_m=[0.2, 1.0]))
    assert caught.value.key == ("rocks", "populations", 0, "dynamic_m")
    with pytest.raises(RecipeError, match="at most 5000"):
        limit(recipe(diameter_m=[0.03, 3.0], dynamic_m=[0.03, 0.8]))


def test_dynamic_rocks_are_part_of_the_estimate(tmp_path, monkeypatch):
    """Their number by the law, and their time, which is most of it."""
    monkeypatch.setenv("TERRAIN_FORGE_CACHE", str(tmp_path / "cache"))
    stones = recipe(dynamic_m=[0.2, 0.8])
    law = stones.rocks.populations[0].size_frequency
    wanted = 2500.0 * float(law.cumulative_number(0.2) - law.cumulative_number(0.8))
    assert expected_dynamic(stones.rocks.populations, size=(50, 50)) == pytest.approx(wanted)
    assert expected_dynamic(recipe().rocks.populations, size=(50, 50)) == 0.0

    def line(checked):
        found = [line for line in check(checked, folder=tmp_path) if line.startswith("cost")]
        (seconds,) = re.findall(r"about (\d+) s", found[0])
        return found[0], int(seconds)

    text, seconds = line(stones)
    assert f"({wanted:.0f} dynamic)" in text
    plain, least = line(recipe())
    assert "dynamic" not in plain
    assert seconds == pytest.approx(least + pace() * (wanted * SETTLING + 200 * WATCHING), abs=1)


def test_outline_of_a_settled_rock_is_convex_hull_invariant():
    """The diameter of all vertices is that of their hull."""
    plan = LIBRARY.prototypes[0].meshes[0].vertices[:, :2].copy()
    assert mean_width(plan) == pytest.approx(mean_width(convex_hull(plan)), rel=1e-12)
