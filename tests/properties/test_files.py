"""What is written is what is read back: paths, recipes, worlds."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import terrain_forge as tf
from terrain_forge.model import Trajectory
from terrain_forge.paths import read_recorded, write_trajectories
from terrain_forge.recipe import recipe_from_json, recipe_json
from tests.helpers import worlds

FEW = settings(max_examples=10, deadline=None, derandomize=True, database=None)
place = st.floats(-500, 500)


@st.composite
def trajectories(draw):
    """Poses anywhere, of any attitude short of upside down."""
    count = draw(st.integers(2, 12))
    steps = draw(st.lists(st.floats(0.01, 5.0), min_size=count, max_size=count))
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    rpy = random.uniform(-1.4, 1.4, (count, 3))
    rpy[:, 2] = np.cumsum(random.uniform(-1.0, 1.0, count))
    return Trajectory(
        name=draw(st.text("abc_9", min_size=1, max_size=8)),
        time=np.cumsum(steps),
        position=random.uniform(-500, 500, (count, 3)),
        rpy=rpy,
        closed=False,
    )


@FEW
@given(path=trajectories(), suffix=st.sampled_from([".csv", ".tum"]))
def test_a_path_survives_its_file(path, suffix):
    with tempfile.TemporaryDirectory() as folder:
        write_trajectories((path,), Path(folder))
        spec = tf.Recorded(file=f"{path.name}{suffix}", timing="recorded", attitude="recorded")
        found = read_recorded(spec, Path(folder), key=("paths",))
    np.testing.assert_allclose(found.position, path.position[:, :2], atol=1e-8)
    np.testing.assert_allclose(found.time, path.time - path.time[0], atol=1e-8)
    np.testing.assert_allclose(np.diff(found.yaw), np.diff(path.rpy[:, 2]), atol=1e-6)
    np.testing.assert_allclose(found.attitude[:, 0], path.position[:, 2], atol=1e-8)
    np.testing.assert_allclose(found.attitude[:, 1:], path.rpy[:, :2], atol=1e-6)


@FEW
@given(path=trajectories(), east=place, north=place, turn=st.floats(-180, 180))
def test_a_path_is_moved_and_turned_as_a_whole(path, east, north, turn):
    with tempfile.TemporaryDirectory() as folder:
        write_trajectories((path,), Path(folder))
        plain = tf.Recorded(file=f"{path.name}.csv")
        moved = replace(plain, origin_m=(east, north), turn_deg=turn)
        one, other = (read_recorded(s, Path(folder), key=("paths",)) for s in (plain, moved))
    steps = [np.linalg.norm(np.diff(poses.position, axis=0), axis=1) for poses in (one, other)]
    np.testing.assert_allclose(*steps, atol=1e-9)
    angle = np.radians(turn)
    turned = one.position @ [[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]
    np.testing.assert_allclose(other.position, turned + np.array([east, north]), atol=1e-8)
    np.testing.assert_allclose(other.yaw, one.yaw + angle, atol=1e-9)


@st.composite
def recipes(draw):
    """Small recipes of all that hypothesis can vary without a file."""
    points = draw(st.lists(st.tuples(place, place), min_size=2, max_size=5, unique=True))
    largest = draw(st.floats(0.3, 2.0))
    return tf.Recipe(
        name=draw(st.text("abz-_ ü9", min_size=1, max_size=12).filter(lambda n: n.strip() == n)),
        seed=draw(st.integers(0, 2**53)),
        body=draw(st.sampled_from(sorted(tf.BODIES))),
        dtm=tf.FlatDtm(size_m=(draw(st.floats(2, 500)), draw(st.floats(2, 500)))),
        terrain=tf.TerrainSpec(
            spacing_m=draw(st.floats(0.05, 1.0)),
            layers=(tf.Fractal(gain=draw(st.floats(0, 3))), tf.Ripples(wavelength_m=3.0)),
        ),
        rocks=tf.RocksSpec(
            library=tf.LibrarySpec(shapes=draw(st.integers(1, 50))),
            populations=(
                tf.PopulationSpec(
                    name="rocks",
                    size_frequency=tf.PowerLaw(
                        number_per_m2=draw(st.floats(1e-4, 1.0)), exponent=draw(st.floats(0.5, 4))
                    ),
                    diameter_m=(draw(st.floats(0.05, 0.2)), largest),
                ),
            ),
        ),
        paths=(tf.PathSpec(name="p", route=tf.Polyline(points_m=tuple(points)), speed_m_s=0.3),),
        exports={"sdf": {}, "other": {"kind": "mesh", "format": "stl"}},
    )


@FEW
@given(recipe=recipes())
def test_a_recipe_survives_json_and_yaml(recipe):
    assert recipe_from_json(recipe_json(recipe)) == recipe
    with tempfile.TemporaryDirectory() as folder:
        file = tf.save_recipe(recipe, Path(folder) / "recipe.yaml")
        assert tf.load_recipe(file).recipe == recipe


@FEW
@given(rocks=st.integers(0, 60), seed=st.integers(0, 2**32 - 1))
def test_a_world_survives_its_folder(rocks, seed):
    world = worlds.world(rocks=rocks)
    noise = np.random.default_rng(seed).normal(0, 1, world.ground.shape)
    world = world.replace(
        ground=world.ground.replace(elevation=world.ground.elevation + noise),
        site=world.site.replace(seed=seed),
    )
    with tempfile.TemporaryDirectory() as folder:
        world.save(Path(folder))
        assert tf.World.load(folder) == world
