"""Every body that a recipe can name: a whole world of it can be made."""

from __future__ import annotations

import numpy as np
import pytest

import terrain_forge as tf
from terrain_forge.model import BODIES, surface_friction


@pytest.fixture(scope="module", params=sorted(BODIES))
def world(request):
    """Craters, rocks, a path, on level ground."""
    recipe = tf.Recipe(
        name="small",
        body=request.param,
        dtm=tf.FlatDtm(size_m=(12, 8)),
        terrain=tf.TerrainSpec(
            spacing_m=0.25,
            layers=(
                tf.Fractal(),
                tf.CraterLayer(
                    production=tf.CraterPowerLaw(number_per_m2=0.05, exponent=2.0, age_ga=1.0),
                    diameter_m=(1.0, 6.0),
                ),
            ),
        ),
        rocks=tf.RocksSpec(
            library=tf.LibrarySpec(shapes=2),
            populations=(
                tf.PopulationSpec(
                    name="rocks",
                    size_frequency=tf.Golombek(k=0.1),
                    diameter_m=(0.2, 0.8),
                ),
            ),
        ),
        paths=(
            tf.PathSpec(name="way", route=tf.Polyline(points_m=((-4, -2), (3, 2))), speed_m_s=0.1),
        ),
        exports=(),
    )
    return tf.realise(tf.plan(recipe))


def test_its_constants_are_of_a_body():
    for name, body in BODIES.items():
        assert name == body.name == name.lower()
        assert 0.1 < body.gravity < 30
        assert body.mean_radius > 1e5
        assert body.solar_irradiance > 0
        assert 1000 < body.rock_density < 5000
        for colour in (body.sky_rgb, body.ground_rgb, body.rock_rgb):
            assert len(colour) == 3
            assert all(0 <= part <= 1 for part in colour)


def test_a_world_of_it_has_all_that_a_recipe_asks_for(world):
    assert np.ptp(world.ground.elevation) > 0.05
    assert len(world.field) > 10
    np.testing.assert_allclose(world.field.mass, world.field.volume * world.site.body.rock_density)
    assert [path.name for path in world.trajectories] == ["way"]


@pytest.mark.parametrize("name", sorted(BODIES))
@pytest.mark.parametrize("surface", ["regolith", "bedrock", "rock"])
def test_its_surfaces_have_friction(name, surface):
    friction = surface_friction(name, surface)
    assert 0.2 < friction.lowest <= friction.coefficient <= friction.highest < 1.5
