"""Craters that cannot be, and lists of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from terrain_forge.base import DataError, RecipeError
from terrain_forge.dtm import ArrayDtm, FlatDtm
from terrain_forge.making import plan
from terrain_forge.recipe import TilesSpec, recipe_from_json
from terrain_forge.terrain import (
    BodyProduction,
    CraterLayer,
    population_of,
)
from terrain_forge.terrain.cratering.productions.power_law import CraterPowerLaw
from tests.helpers.craters import AS_JSON, everywhere, layer, recipe


def refused(text_or_spec, match, *, error=RecipeError, **changes):
    with pytest.raises(error, match=match) as caught:
        plan(recipe(text_or_spec, **changes))
    return caught.value.key


def test_ages_out_of_range():
    for age in ("4.6", "0", "-1"):
        with pytest.raises(RecipeError, match=r"age_ga: must be .*, found"):
            recipe_from_json(AS_JSON % f'"kind":"neukum","age_ga":{age}')
    recipe_from_json(AS_JSON % '"kind":"neukum","age_ga":4.3')


def test_craters_that_a_site_cannot_have():
    key = refused(layer(diameter_m=(50.0, 3.0)), "from 50 to 3 m: the first must be the smaller")
    assert key == ("terrain", "layers", 0, "diameter_m")
    refused(layer(diameter_m=(1.0, 3.0)), "need a spacing of 0.25 m or less, found 0.5 m")
    refused(layer(diameter_m=(5.0, 11_000.0)), "complex.*up to 10583 m on Moon")
    refused(
        layer(production=BodyProduction(kind="ivanov", age_ga=1.0)),
        "ivanov is no production function of Moon, which has neukum",
    )
    refused(
        layer(
            production=CraterPowerLaw(number_per_m2=1e4, exponent=3.0, age_ga=1),
            equilibrium="none",
        ),
        r"craters of 2 m and more would reach the site, at most 2e\+06",
    )
    key = refused(layer(diameter_m=(500.0, None)), "no craters between: smallest 500 m, largest")
    assert key == ("terrain", "layers", 0, "diameter_m")
    with pytest.raises(ValueError, match="a production function, a file, or both"):
        CraterLayer()
    with pytest.raises(RecipeError, match="a layer before is called 'Craters' too"):
        plan(recipe(layer(), layer(name="Craters")))


def test_craters_of_a_site_in_tiles_are_limited_by_those_of_a_tile():
    dense = CraterPowerLaw(number_per_m2=3e3, exponent=3.0, age_ga=1)
    wanted = recipe(layer(production=dense, equilibrium="none", diameter_m=(2.0, 5.0)))
    large = replace(wanted, dtm=FlatDtm(size_m=(400.0, 300.0)))
    with pytest.raises(RecipeError, match=r"would reach the site, .*, or tiles"):
        plan(large)
    plan(replace(large, tiles=TilesSpec(size_m=20.0)))


def test_a_dtm_shows_large_craters_itself():
    array = ArrayDtm(posting_m=2.0, size_m=(100.0, 80.0))
    heights = np.random.default_rng(0).normal(size=(60, 60))
    spec = layer(diameter_m=(None, None))
    site = plan(recipe(spec, dtm=array), heights=heights)
    assert population_of(spec, site=site).diameters == (2.0, 10.0)
    with pytest.raises(RecipeError, match="5 postings of the DTM, which shows larger ones itself"):
        plan(recipe(layer(diameter_m=(12.0, None)), dtm=array), heights=heights)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("x_m,y_m\n1,2\n", "no column 'diameter_m'"),
        ("x_m,y_m,diameter_m\n1,2,1.5\n", "diameter_m of crater 1 is 1.5, allowed: 2 to 10583"),
        ("x_m,y_m,diameter_m\n1,2,11000\n", "complex craters, which begin at 10583 m on Moon"),
        ("x_m,y_m,diameter_m,age_ga\n1,2,9,1\n1,2,9,5\n", "age_ga of crater 2 is 5, allowed"),
        ("x_m,diameter_m\n900,9\n", "x_m and y_m, or lon_deg and lat_deg; found x_m"),
        ("x_m,y_m,diameter_m\n900,2,9\n", "no crater reaches the site, which ends at ±50, ±40 m"),
        ("x_m,y_m,diameter_m,age\n1,2,9,1\n", "unknown column 'age'"),
    ],
)
def test_lists_that_cannot_be(text, match, tmp_path):
    (tmp_path / "mine.csv").write_text(text)
    with pytest.raises(DataError, match=match) as caught:
        plan(recipe(CraterLayer(file="mine.csv")), folder=tmp_path)
    assert caught.value.key == ("terrain", "layers", 0, "file")


def test_fields_of_a_list_may_be_left_empty(tmp_path):
    """They are then as if there were no such column."""
    texts = {
        "full": "x_m,y_m,diameter_m,age_ga,depth_to_diameter\n1,2,9,,\n-20,5,12,0.5,0.08\n",
        "less": "x_m,y_m,diameter_m\n1,2,9\n-20,5,12\n",
    }
    found = {}
    for name, text in texts.items():
        (tmp_path / f"{name}.csv").write_text(text)
        spec = CraterLayer(file=f"{name}.csv")
        craters = everywhere(spec, plan(recipe(spec), folder=tmp_path))
        found[name] = craters.select(np.argsort(craters.diameter))
    for measure in ("diameter", "age", "fresh_depth", "fresh_rim", "fresh_ejecta", "wear"):
        one, other = (getattr(found[name], measure) for name in texts)
        assert one[0] == other[0]
    assert found["full"].age.tolist() == [0.0, 0.5]
    assert found["full"].fresh_depth[1] == pytest.approx(0.96)
    (tmp_path / "bad.csv").write_text("x_m,y_m,diameter_m,age_ga\n1,,9,\n")
    with pytest.raises(DataError, match="line 2: y_m must be a number, found ''"):
        plan(recipe(CraterLayer(file="bad.csv")), folder=tmp_path)


def test_lists_by_longitude_and_latitude(tmp_path):
    metre = 180.0 / (np.pi * 1737.4e3)
    east, north = metre / np.cos(np.radians(3.0)), metre
    (tmp_path / "mine.csv").write_text(
        f"lon_deg,lat_deg,diameter_m\n{-23.4 + 12 * east:.12f},{-3.0 - 20 * north:.12f},9\n"
    )
    spec = CraterLayer(file="mine.csv")
    site = plan(recipe(spec), folder=tmp_path)
    assert everywhere(spec, site).xy[0] == pytest.approx([12.0, -20.0], abs=1e-3)
    with pytest.raises(DataError, match="but the site has none: give x_m and y_m"):
        plan(recipe(spec, dtm=FlatDtm(size_m=(100.0, 80.0))), folder=tmp_path)


def test_a_missing_list_is_told(tmp_path):
    with pytest.raises(DataError, match=r"mine\.csv"):
        plan(recipe(CraterLayer(file="mine.csv")), folder=tmp_path)
