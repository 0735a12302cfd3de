"""Every size-frequency law that is installed: it falls, samples agree with it, JSON holds it."""

from __future__ import annotations

import json
import pkgutil
from dataclasses import replace
from importlib import import_module
from importlib.metadata import entry_points

import numpy as np
import pytest
from scipy.stats import kstest

from terrain_forge.base import mix, stage_key
from terrain_forge.dtm import FlatDtm
from terrain_forge.model import BODIES
from terrain_forge.recipe import Recipe, TerrainSpec, recipe_from_json, recipe_json
from terrain_forge.rocks import PopulationSpec, RocksSpec

EXAMPLES = {
    "golombek": {"k": 0.05},
    "power_law": {"number_per_m2": 0.01, "exponent": 2.0},
    "exponential": {"number_per_m2": 3.0, "decay_per_m": 4.0},
    "counts": {"diameters_m": (0.21, 0.25, 0.3, 0.42, 0.6, 0.9, 1.4), "area_m2": 100.0},
    "table": {"diameters_m": (0.2, 0.5, 1.0), "numbers_per_m2": (1.0, 0.1, 0.01)},
}
"""What a kind needs beyond its defaults."""


def laws():
    """All classes of laws by their kind, ours and those of other packages."""
    folder = import_module("terrain_forge.rocks.laws")
    names = [f"{folder.__name__}.{module.name}" for module in pkgutil.iter_modules(folder.__path__)]
    names += [point.module for point in entry_points(group="terrain_forge.laws")]
    found = {}
    for module in map(import_module, names):
        for member in vars(module).values():
            if isinstance(member, type) and hasattr(member, "sample") and hasattr(member, "kind"):
                if isinstance(vars(member).get("kind"), str):
                    found[member.kind] = member
    return found


LAWS = laws()
SMALLEST, LARGEST = 0.25, 2.0


@pytest.fixture(params=sorted(LAWS))
def law(request):
    return LAWS[request.param](**EXAMPLES.get(request.param, {})).on(BODIES["mars"])


def test_the_known_ones_are_found():
    assert set(EXAMPLES) <= set(LAWS)


def test_numbers_and_areas_fall_with_diameter(law):
    diameters = np.geomspace(law.smallest_known or 0.05, 5.0, 60)
    for falling in (law.cumulative_number(diameters), law.cumulative_area(diameters)):
        assert np.isfinite(falling).all()
        assert (np.diff(falling) < 0).all()
    assert law.cumulative_number(diameters).min() >= 0


def test_area_is_the_integral_of_the_number(law):
    """F(a) - F(b) = ∫ π/4 D² n(D) dD, by parts in closed sums of a fine table."""
    d = np.geomspace(SMALLEST, LARGEST, 20_001)
    number = law.cumulative_number(d)
    middle = 0.5 * (d[1:] + d[:-1])
    integral = (np.pi / 4 * middle**2 * -np.diff(number)).sum()
    ends = law.cumulative_area(np.array([SMALLEST, LARGEST]))
    assert ends[0] - ends[1] == pytest.approx(integral, rel=1e-4)


def test_samples_agree_with_the_number(law):
    key = stage_key(3, "law")
    hashes = np.array([mix(key, n) for n in range(4000)], np.uint64)
    found = law.sample(hashes, SMALLEST, LARGEST)
    assert SMALLEST <= found.min()
    assert found.max() <= LARGEST
    most, least = law.cumulative_number(np.array([SMALLEST, LARGEST]))
    result = kstest(found, lambda d: (most - law.cumulative_number(d)) / (most - least))
    assert result.pvalue > 0.001


def test_a_recipe_with_it_is_the_same_from_its_json(law):
    terrain = TerrainSpec(spacing_m=0.25)
    recipe = Recipe(name="law", body="mars", dtm=FlatDtm(size_m=(4, 4)), terrain=terrain)
    spec = PopulationSpec(name="rocks", size_frequency=law, diameter_m=(SMALLEST, LARGEST))
    recipe = replace(recipe, rocks=RocksSpec(populations=(spec,)))
    again = recipe_from_json(recipe_json(recipe))
    assert again.rocks.populations[0].size_frequency == law


def test_its_report_is_plain(law):
    report = law.report()
    assert json.loads(json.dumps(report, allow_nan=False)) == json.loads(json.dumps(report))
    assert report["kind"] == law.kind
