"""What a difficulty does to laws and layers, beside what is drawn; borders of a grid."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import terrain_forge as tf
from terrain_forge.rocks import PowerLaw
from terrain_forge.variation import draw, make_grid
from tests.unit.variation.test_worlds import recipe

COVERS = (0.005, 0.2)


def drawn(folder: Path, level: float, **changes: Any) -> Any:
    """World 0 of a recipe at a difficulty; `law` and `layers` are put in, the rest is `worlds`."""

    def change(plain: dict[str, Any]) -> None:
        given = dict(changes)
        if "law" in given:
            plain["rocks"]["populations"][0]["size_frequency"] = given.pop("law")
        plain["terrain"]["layers"] = given.pop("layers", [])
        plain["worlds"] = {"difficulty": {}, **given}

    made = tf.load_recipe(recipe(folder, change)).recipe
    return draw(made, 0, folder=folder, difficulty=level)


def cover(world: Any) -> float:
    """Part of the ground that the law of a world's rocks covers between their diameters."""
    population = world.recipe.rocks.populations[0]
    low, high = population.size_frequency.cumulative_area(np.array(population.diameters))
    return float(low - high)


@pytest.mark.parametrize(
    "law",
    [
        {"kind": "power_law", "number_per_m2": 0.01, "exponent": 2.5},
        {"kind": "power_law", "site": "surveyor_1"},
        {"kind": "exponential", "number_per_m2": 0.5, "decay_per_m": 4.0},
        {"kind": "table", "diameters_m": [0.1, 0.3, 1.0], "numbers_per_m2": [2.0, 0.2, 0.01]},
    ],
    ids=["numbers", "site", "exponential", "table"],
)
def test_rocks_of_each_law_cover_what_the_difficulty_says(
    tmp_path: Path, law: dict[str, Any]
) -> None:
    for level in (0, 1):
        assert cover(drawn(tmp_path, level, law=law)) == pytest.approx(COVERS[level])


def test_golombeks_k_is_the_cover(tmp_path: Path) -> None:
    for level in (0, 1):
        world = drawn(tmp_path, level, law={"kind": "golombek", "site": "viking_1"})
        assert world.recipe.rocks.populations[0].size_frequency.k == pytest.approx(COVERS[level])


def test_a_law_that_cannot_be_scaled_is_refused(tmp_path: Path) -> None:
    (tmp_path / "sizes.csv").write_text("diameter_m,number_per_m2\n0.1,2\n1,0.01\n")
    law = {"kind": "table", "file": "sizes.csv"}
    with pytest.raises(tf.RecipeError, match=r"rock_cover cannot scale .*\(table\).*null") as told:
        drawn(tmp_path, 0.5, law=law)
    assert told.value.key[:3] == ("rocks", "populations", 0)
    assert drawn(tmp_path, 0.5, law=law, difficulty={"rock_cover": None}).difficulty == 0.5
    named = {"rocks.populations.0.size_frequency.file": {"choice": ["sizes.csv"]}}
    assert drawn(tmp_path, 0.5, law=law, vary=named).difficulty == 0.5


def test_the_difficulty_is_that_of_what_was_drawn(tmp_path: Path) -> None:
    world = drawn(
        tmp_path,
        1.0,
        layers=[{"kind": "ripples", "wavelength_m": 1.0, "height_m": 0.01}],
        law={"kind": "power_law", "number_per_m2": 0.01, "exponent": 2.5},
        vary={
            "terrain.layers.0.wavelength_m": {"uniform": [3.0, 4.0]},
            "rocks.populations.stones.diameter_m.0": {"uniform": [0.3, 0.4]},
            "rocks.populations.stones.size_frequency.exponent": {"uniform": [1.5, 1.8]},
        },
    )
    (layer,) = world.recipe.terrain.layers
    assert layer.wavelength_m >= 3.0
    assert layer.height_m == pytest.approx(0.09 * layer.wavelength_m)
    assert cover(world) == pytest.approx(COVERS[1])
    law = world.recipe.rocks.populations[0].size_frequency
    assert isinstance(law, PowerLaw)
    assert world.values["rocks.populations.0.size_frequency.number_per_m2"] == law.number_per_m2


def test_what_is_varied_is_left_to_that(tmp_path: Path) -> None:
    world = drawn(
        tmp_path,
        1.0,
        layers=[{"kind": "ripples", "wavelength_m": 1.0, "height_m": 0.01}],
        law={"kind": "golombek", "site": "viking_1"},
        vary={
            "terrain.layers.0.height_m": {"choice": [0.03]},
            "rocks.populations.0.size_frequency.site": {"choice": ["viking_2"]},
        },
    )
    assert world.recipe.terrain.layers[0].height_m == 0.03
    law = world.recipe.rocks.populations[0].size_frequency
    assert (law.k, law.site) == (None, "viking_2")


def test_a_grid_tells_its_steepest_border(tmp_path: Path) -> None:
    def steep(plain: dict[str, Any]) -> None:
        plain["dtm"]["size_m"] = [6.0, 5.0]
        plain["rocks"]["populations"] = []
        plain["terrain"]["layers"] = [{"kind": "ripples", "wavelength_m": 12, "height_m": 0.5}]
        plain["worlds"] = {"difficulty": {"level": 0.5, "ripple_ratio": None}}

    path = recipe(tmp_path, steep)
    with pytest.warns(tf.RecipeWarning, match=r"borders of 2 m .* fall by up to \d+°: [\d.]+ m"):
        narrow = make_grid(path, tmp_path / "narrow", shape=(1, 2), border=2.0)
    wide = make_grid(path, tmp_path / "wide", shape=(1, 2))
    told = [json.loads((out / "grid.json").read_text()) for out in (narrow, wide)]
    assert told[0]["steepest_border_deg"] > 20.0 > told[1]["steepest_border_deg"] > 15.0
    flat = tf.World.load(wide).ground.elevation[:, 0]
    assert np.all(flat == 0.0)
    for grid in told:
        steepest = max(cell["border_slope_deg"] for cell in grid["worlds"])
        assert grid["steepest_border_deg"] == steepest
