"""Every installed body makes worlds with craters, rocks, soils, friction, in each format."""

from __future__ import annotations

import json

import numpy as np
import pytest
import rasterio

import terrain_forge as tf
from terrain_forge.base.given import trusting
from terrain_forge.building.checking import check_raster
from terrain_forge.model import BODIES, World
from terrain_forge.model.body import unfit
from terrain_forge.recipe import recipe_from_json
from terrain_forge.terrain import LIMITS, fresh_shapes

ALL = pytest.mark.parametrize("body", BODIES.values(), ids=list(BODIES))


def recipe(body, **changes):
    """A tiny site with craters of the body, pebbles, and a few stones that can be pushed."""
    kinds = [one.kind for one in body.craters.productions]
    law = {"kind": "power_law", "number_per_m2": 0.02, "exponent": 2.0}
    plain = {
        "name": body.name,
        "seed": 3,
        "body": body.name,
        "dtm": {"kind": "flat", "size_m": [16, 12]},
        "terrain": {
            "spacing_m": 0.25,
            "layers": [
                {"kind": "fractal", "longest_wavelength_m": 4},
                {
                    "kind": "craters",
                    "production": {"kind": kinds[0], "age_ga": 3.0} if kinds else law,
                    "diameter_m": [1.0, 10.0],
                },
            ],
            "appearance": {"regolith": body.soils[-1].name, "variation": 0.0},
        },
        "rocks": {
            "library": {"shapes": 2},
            "populations": [
                {
                    "name": "stones",
                    "size_frequency": law,
                    "diameter_m": [0.2, 0.8],
                    "dynamic_m": [0.2, 0.202],
                }
            ],
        },
        "paths": [
            {"name": "line", "route": {"points_m": [[-5, -3], [5, -3]]}, "speed_m_s": 0.2},
        ],
        "exports": ["sdf", "mjcf", "usd"],
    }
    return recipe_from_json(json.dumps(plain | changes))


@pytest.fixture(scope="module")
def worlds():
    return {name: tf.realise(tf.plan(recipe(body))) for name, body in BODIES.items()}


@ALL
def test_a_world_has_craters_rocks_and_the_body_s_soil(worlds, body):
    world = worlds[body.name]
    assert world.site.body is body
    assert np.ptp(world.ground.elevation) > 0.1  # more than the fractal makes
    assert len(world.field) > 10
    assert 0 < world.field.dynamic.sum() < len(world.field)
    assert np.allclose(world.field.mass, world.field.volume * body.rock_density)
    colours = world.appearance.ground_rgb.reshape(-1, 3) / 255.0
    assert np.abs(np.median(colours, axis=0) - body.soils[-1].rgb).max() < 0.02


@ALL
def test_a_saved_world_knows_its_body_without_asking_for_it(worlds, body, tmp_path):
    worlds[body.name].save(tmp_path)
    assert World.load(tmp_path).site.body == body


@ALL
def test_its_constants_are_possible(body):
    craters = body.craters
    assert craters.equilibrium in LIMITS
    sizes = np.geomspace(1.0, craters.largest_simple, 200)
    shape = fresh_shapes(sizes, body=body)
    assert ((shape.depth / sizes > 0.05) & (shape.depth / sizes < 0.25)).all()
    assert ((shape.rim > shape.ejecta) & (shape.rim < shape.depth)).all()
    for one in craters.productions:
        law = tf.BodyProduction(kind=one.kind, age_ga=1.0).law(body)
        assert (np.diff(law.number(sizes)) < 0.0).all()
        # N(1 km) after 10⁹ years is what the chronology says.
        wanted = 1e-6 * one.chronology.number(1.0)
        assert law.number(np.array([1000.0]))[0] == pytest.approx(wanted, rel=2e-3)
        assert one.source
    astronomical_units = np.sqrt(1361.0 / body.solar_irradiance)
    assert body.sun_diameter == pytest.approx(0.0093 / astronomical_units, rel=0.01)
    assert body.airless == (max(body.sky_rgb) == 0.0)


def test_soils_have_names_of_their_own():
    names = [soil.name for body in BODIES.values() for soil in body.soils]
    assert len(set(names)) == len(names)


@pytest.mark.slow
def test_mercury_is_written_end_to_end(worlds, tmp_path):
    result = tf.write_world(worlds["mercury"], tmp_path / "out")
    assert result.passed
    with rasterio.open(tmp_path / "out" / "truth" / "surface.tif") as file:
        assert file.tags()["TERRAIN_FORGE_BODY"] == "mercury"
    world = World.load(tmp_path / "out")
    assert world.site.body == BODIES["mercury"]
    assert world.lighting.irradiance == 9082.7
    for name in ("sdf", "mjcf", "usd"):
        assert (tmp_path / "out" / name).is_dir()


@ALL
def test_figures_that_cannot_be_are_told(body):
    """As they are told of bodies of other packages, which are skipped then."""
    assert unfit(body) == ""
    regolith = body.friction.regolith
    with trusting():
        slippery = body.friction.replace(regolith=regolith.replace(coefficient=-1.0))
    for name, value, told in (
        ("gravity", 0.0, "has gravity that must be greater than or equal to 0"),
        ("gravity", np.nan, "has gravity that must be a finite number, found NaN"),
        ("mean_radius", -1.0, "has mean_radius that must be greater than"),
        ("rock_density", "heavy", 'has rock_density that must be a valid number, found "heavy"'),
        ("ground_rgb", (0.1, 0.2, 3.0), "has ground_rgb that must be less than or equal to 1"),
        ("craters", None, "has craters that must be an instance of CraterConstants, found nothing"),
        ("friction", slippery, "has friction.regolith.coefficient that must be greater than"),
        ("name", "", "has name that must not be empty"),
    ):
        with trusting():  # else such a body cannot be made
            wrong = body.replace(**{name: value})
        assert unfit(wrong).startswith(told)


def test_rocks_of_mercury_have_no_decay_of_their_own():
    population = {"name": "a", "size_frequency": {"kind": "golombek", "k": 0.05}}
    rocks = {"populations": [population | {"diameter_m": [0.2, 0.8]}]}
    with pytest.raises(
        tf.RecipeError, match=r"of Mercury: give q_per_m, or .* q_of_k: mars or moon"
    ):
        tf.plan(recipe(BODIES["mercury"], rocks=rocks))
    population["size_frequency"]["q_of_k"] = "moon"
    site = tf.plan(recipe(BODIES["mercury"], rocks=rocks))
    assert site.recipe.rocks.populations[0].size_frequency.q == pytest.approx(0.8218)


@ALL
def test_a_dtm_is_known_by_its_radius(tmp_path, body):
    path = tmp_path / "dtm.tif"
    crs = f"+proj=eqc +R={body.mean_radius} +units=m +no_defs"
    heights = np.add.outer(np.arange(40.0), np.arange(40.0)).astype(np.float32)
    profile = {"driver": "GTiff", "width": 40, "height": 40, "count": 1, "dtype": "float32"}
    affine = rasterio.transform.from_origin(-20.0, 20.0, 1.0, 1.0)
    with rasterio.open(path, "w", crs=crs, transform=affine, **profile) as file:
        file.write(heights, 1)
    assert any(body.name in line for line in check_raster(path))
    dtm = {"kind": "raster", "source": str(path), "size_m": [16, 12]}
    assert tf.plan(recipe(body, dtm=dtm)).dtm is not None
    others = [other for other in BODIES.values() if other is not body]
    for other in others:
        with pytest.raises(tf.DataError, match=f"{other.name} has"):
            tf.plan(recipe(other, dtm=dtm))
