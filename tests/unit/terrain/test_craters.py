"""Craters: laws and shapes against closed forms and golden numbers, chance, windows, overlaps."""

from __future__ import annotations

import csv
import json
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2, kstest, norm, poisson

from terrain_forge.base import DataError, RecipeError
from terrain_forge.dtm import ArrayDtm, FlatDtm
from terrain_forge.making import plan
from terrain_forge.model import MARS, MERCURY, MOON, Table, Window
from terrain_forge.pipeline import realise
from terrain_forge.recipe import Recipe, TerrainSpec, recipe_from_json
from terrain_forge.report.page import render
from terrain_forge.report.section import Built
from terrain_forge.report.sections.ground import Craters as CratersSection
from terrain_forge.rocks import Golombek, LibrarySpec, PopulationSpec, RocksSpec
from terrain_forge.rocks.arrangement import AroundCraters
from terrain_forge.terrain import (
    LIMITS,
    BodyProduction,
    CraterBin,
    CraterCounts,
    CraterLayer,
    CraterTable,
    Resurfacing,
    fresh_shapes,
    make_craters,
    population_of,
    shape_ground,
)
from terrain_forge.terrain.cratering import degradation
from terrain_forge.terrain.cratering.degradation import ejecta_thickness, worn_shapes
from terrain_forge.terrain.cratering.placement import age_of, expected_craters
from terrain_forge.terrain.cratering.population import Wear
from terrain_forge.terrain.cratering.productions.power_law import CraterPowerLaw
from terrain_forge.terrain.masks import Mask
from terrain_forge.truth.craters import write_craters
from terrain_forge.validation.checks.truth import Craters as CratersCheck
from tests.helpers import worlds

ALPHA = 0.001
KM2 = 1e-6


def moon(size=(200.0, 160.0), *, spacing=0.5, seed=1, **changes):
    """A flat site on the Moon."""
    return worlds.site().replace(size=size, spacing=spacing, seed=seed, body=MOON, **changes)


def layer(**changes):
    """Craters of an old mare from 2 to 60 m."""
    return CraterLayer(
        **{
            "production": BodyProduction(kind="neukum", age_ga=3.5),
            "diameter_m": (2.0, 60.0),
            **changes,
        }
    )


def listed(rows, columns=("x_m", "y_m", "diameter_m", "age_ga"), **changes):
    """A site with a list of craters, and their layer."""
    table = Table(path="craters.csv", columns=columns, values=np.array(rows, float))
    return moon(tables=(table,)), CraterLayer(file="craters.csv", **changes)


MOON_AGES = MOON.craters.chronology
AS_JSON = (
    '{"name":"m","body":"moon","dtm":{"kind":"flat","size_m":[100,80]},"terrain":{"spacing_m":'
    '0.5,"layers":[{"kind":"craters","production":{%s}}]}}'
)
"""A recipe with a production function to be filled in."""


def fresh_profile(x, *, depth, rim, ejecta):
    """Height [m] of a fresh crater above the ground around at distances in radii."""
    weights = np.array([depth, rim - ejecta, ejecta])
    return np.tensordot(weights, degradation.shapes(x), axes=1)


def everywhere(spec, place):
    return make_craters(spec, site=place, area=place.bounds)


# How many


@pytest.mark.parametrize(
    ("law", "diameter", "per_km2"),
    [
        (BodyProduction(kind="neukum", age_ga=1.0), 10.0, 3796.6),
        (BodyProduction(kind="neukum", age_ga=1.0), 100.0, 2.9048),
        (BodyProduction(kind="neukum", age_ga=1.0), 1000.0, 8.3792e-4),
        (BodyProduction(kind="neukum", age_ga=3.5), 1000.0, 4.7926e-3 * 8.3792e-4 / 8.3800e-4),
        (BodyProduction(kind="ivanov", age_ga=1.0), 30.0, 70.982),
        (BodyProduction(kind="ivanov", age_ga=1.0), 100.0, 1.5258),
        (BodyProduction(kind="ivanov", age_ga=1.0), 1000.0, 4.1335e-4),
        (BodyProduction(kind="hartmann_daubar", age_ga=1.0), 1000.0, 5.8373e-4),
    ],
)
def test_production_functions(law, diameter, per_km2):
    assert law.law(MOON if law.kind == "neukum" else MARS).number(np.array([diameter]))[
        0
    ] == pytest.approx(KM2 * per_km2, rel=1e-4)


def test_hartmann_and_daubar_has_its_bins():
    """Craters per km² and 10⁹ years in bins of √2: 67 from 22.1 m, 24 from 31.25 m on."""
    law = BodyProduction(kind="hartmann_daubar", age_ga=1.0).law(MARS)
    ends = 1000.0 * 2.0 ** np.array([-5.5, -5.0, -4.5])
    assert -np.diff(law.number(ends)) / KM2 == pytest.approx([67.0, 24.0], rel=1e-9)


def test_chronologies():
    assert MOON_AGES.number(3.5) == pytest.approx(4.7926e-3, rel=1e-4)
    for ages in (MOON_AGES, MARS.craters.chronology):
        wanted = np.array([1e-6, 0.01, 1.0, 3.0, 3.9, 4.3])
        numbers = np.array([ages.number(age) for age in wanted])
        found = age_of(numbers, 4.4, ages.burst, ages.rate, ages.steady)
        assert found == pytest.approx(wanted, rel=1e-9)


def test_equilibrium_laws():
    at = np.array([1.0, 10.0])
    assert LIMITS["trask"].number(at) == pytest.approx([0.0794328, 794.33e-6], rel=1e-5)
    assert LIMITS["viper"].number(np.array([10.0, 100.0])) == pytest.approx(
        [29174e-6 * 10**-1.92, 156228e-6 * 100**-2.389]
    )
    assert LIMITS["hartmann"].number(np.array([1000.0]))[0] == pytest.approx(KM2 * 10**-1.14)
    share = LIMITS["trask"].number(at) / LIMITS["gault"].number(at)
    assert share == pytest.approx(0.0516, rel=2e-3)


@pytest.mark.parametrize(("age", "crossing"), [(1.0, 42.3), (3.0, 110), (3.5, 179), (3.8, 420)])
def test_equilibrium_begins_where_production_crosses_it(age, crossing):
    spec = CraterLayer(
        production=BodyProduction(kind="neukum", age_ga=age),
        equilibrium="trask",
        diameter_m=(4.0, 2000.0),
    )
    population = population_of(spec, site=moon((4000.0, 4000.0)))
    diameters = crossing * np.array([0.98, 1.02])
    limit, produced = LIMITS["trask"].number(diameters), population.produced.number(diameters)
    assert limit[0] < produced[0]
    assert limit[1] > produced[1]
    assert population.number(diameters) == pytest.approx([limit[0], produced[1]])
    assert population.part(diameters)[1] == 1.0
    assert 0.3 < population.part(diameters)[0] < 0.9


# What they look like


def test_fresh_depths():
    """Pike's 5 km crater; the classes of Stopar et al. in their middles; the ends on Mars."""
    diameters = np.array([5000.0, 283.0, 141.0, 63.0])
    shape = fresh_shapes(diameters, body=MOON)
    assert shape.depth[0] == pytest.approx(995.90, rel=1e-5)
    assert shape.rim[0] == pytest.approx(184.10, rel=1e-4)
    assert shape.depth[1:] / diameters[1:] == pytest.approx([0.17, 0.15, 0.13], abs=0.005)
    ends = np.array([1.0, 5000.0])
    assert fresh_shapes(ends, body=MARS).depth / ends == pytest.approx([0.15, 0.2], abs=0.001)


@pytest.mark.parametrize("body", [MOON, MARS, MERCURY], ids=lambda body: body.name)
def test_depth_and_wear_have_no_steps(body):
    """Over a diameter that is one in a thousand larger they change by less than six in 1000."""
    diameters = 1.001 ** np.arange(np.log(0.5) / np.log(1.001), np.log(5000.0) / np.log(1.001))
    ratio = fresh_shapes(diameters, body=body).depth / diameters
    assert np.all(np.diff(ratio) > 0.0)
    assert np.abs(np.diff(np.log(ratio))).max() < 0.0006
    for one in body.craters.productions:
        for equilibrium in ("trask", "hartmann"):
            wear = Wear(body=body, kind=one.kind, equilibrium=equilibrium)
            assert np.abs(np.diff(np.log(wear.diffusivity(diameters)))).max() < 0.006


LUNAR_SHARES = 0.50, 0.30, 0.17, 0.03
"""Of lunar craters below a kilometre, by depth over diameter: below 0.07, 0.10 and 0.15, and above
(SLS-SPEC-159, table 3.4.1.2-2, after Basilevsky 1976)."""


def shares(place, spec, low, high):
    """Shares of the classes among craters of some diameters, over three seeds."""
    depths = []
    for seed in range(3):
        craters = everywhere(spec, place.replace(seed=seed))
        craters = craters.select((craters.diameter >= low) & (craters.diameter < high))
        depths.append(craters.depth / craters.diameter)
    depths = np.concatenate(depths)
    assert len(depths) > 300
    return np.histogram(depths, [0.0, 0.07, 0.10, 0.15, 1.0])[0] / len(depths)


@pytest.mark.parametrize(("low", "high"), [(2, 10), (10, 40), (40, 100)])
@pytest.mark.parametrize("age", [1.5, 3.3, 3.8])
def test_shares_of_depths_at_equilibrium(low, high, age):
    """Within 0.1 of the table in each class."""
    place = moon((25.0 * high, 25.0 * high), spacing=low / 4.0)
    spec = layer(
        production=BodyProduction(kind="neukum", age_ga=age), diameter_m=(float(low), float(high))
    )
    assert np.abs(shares(place, spec, low, high) - LUNAR_SHARES).max() < 0.1


@pytest.mark.parametrize("kind", ["ivanov", "hartmann_daubar"])
@pytest.mark.parametrize(("low", "high"), [(10, 40), (40, 100), (100, 200)])
def test_old_craters_of_mars_are_shallow(kind, low, high):
    """After 3·10⁹ years few are deeper than 0.15, and the mix is the Moon's within 0.15."""
    place = moon((40.0 * high, 40.0 * high), spacing=low / 4.0).replace(body=MARS)
    spec = layer(
        production=BodyProduction(kind=kind, age_ga=3.0), diameter_m=(float(low), float(high))
    )
    found = shares(place, spec, low, high)
    assert found[3] < 0.12
    assert np.abs(found - LUNAR_SHARES).max() < 0.15


def test_craters_of_a_young_surface_are_deep():
    place = moon((2000.0, 2000.0), spacing=4.0)
    spec = layer(production=BodyProduction(kind="neukum", age_ga=0.1), diameter_m=(20.0, 400.0))
    craters = everywhere(spec, place)
    young = craters.select(craters.diameter > 30.0)
    assert len(young) > 50
    assert np.all(young.depth > 0.7 * young.fresh_depth)


def test_ejecta_never_exceed_half_the_rim():
    assert ejecta_thickness(np.array([50.0])) == pytest.approx(2.53143, rel=1e-5)
    diameters = np.geomspace(0.5, 10_000, 200)
    shape = fresh_shapes(diameters, body=MOON)
    assert np.all(shape.ejecta <= 0.5 * shape.rim * (1 + 1e-12))
    large = diameters > 500.0
    np.testing.assert_allclose(shape.ejecta[large], ejecta_thickness(0.5 * diameters[large]))
    assert not fresh_shapes(diameters, body=MOON, ejecta=False).ejecta.any()


def test_profile_of_fassett_and_thomson():
    heights = degradation.fassett_thomson(np.array([0.0, 0.5, 1.2, 1.5, 2.0]))
    assert heights == pytest.approx([-0.181, -0.099201, 0.016375, 0.0, 0.0], abs=1e-6)
    x = np.linspace(0.0, 3.0, 3001)
    own = fresh_profile(x, depth=degradation.FT_DEPTH, rim=degradation.FT_RIM, ejecta=0.0)
    assert np.abs(own - degradation.fassett_thomson(x)).max() < 2e-5
    assert np.ptp(own) == pytest.approx(0.21783, abs=1e-5)


def test_blanket_falls_with_the_cube():
    """McGetchin: R = 50 m has 2.53 m at the rim, an eighth of it at 2 R; the rest is uplift."""
    thickness = float(ejecta_thickness(np.array([50.0]))[0])
    x = np.array([1.0, 1.6, 2.0, 2.7, 4.0])
    blanket = fresh_profile(x, depth=15.0, rim=6.0, ejecta=thickness)
    assert blanket[1:3] == pytest.approx([thickness / 1.6**3, 0.316429], rel=1e-5)
    assert blanket[3:] == pytest.approx([0.0, 0.0], abs=1e-12)
    crest = fresh_profile(np.array([degradation.CREST]), depth=15.0, rim=6.0, ejecta=thickness)
    assert crest[0] == pytest.approx(6.0)


def worn(heights, step, tau):
    """Radial heat equation by explicit differences: ∂z/∂s = z'' + z'/x, s = 4τ, x in radii."""
    x = (np.arange(len(heights)) + 0.5) * step
    outer, inner = (x + 0.5 * step) / x, (x - 0.5 * step) / x
    steps = int(np.ceil(4.0 * tau / (0.2 * step**2)))
    rate = 4.0 * tau / steps / step**2
    z = heights.copy()
    for _ in range(steps):
        up = np.append(z[1:], z[-1]) - z
        down = z - np.append(z[0], z[:-1])
        z += rate * (outer * up - inner * down)
    return x, z


@pytest.mark.parametrize("tau", [0.0005, 0.01, 0.1])
def test_wear_is_diffusion(tau):
    """Against finite differences, for the whole profile with its ejecta."""
    step = 0.02
    x = (np.arange(400) + 0.5) * step
    place, spec = listed([(0.0, 0.0, 100.0, 1.0)], diffusivity_m2_per_myr=tau * 10.0)
    craters = everywhere(spec, place)
    assert craters.wear == pytest.approx(tau)
    fresh = fresh_profile(
        x,
        depth=craters.fresh_depth[0],
        rim=craters.fresh_rim[0],
        ejecta=craters.fresh_ejecta[0],
    )
    _, wanted = worn(fresh, step, tau)
    found = craters.profile(0, 50.0 * x)
    assert np.abs(found - wanted).max() < 0.005 * craters.fresh_depth[0]
    assert craters.depth[0] == pytest.approx(np.ptp(wanted), abs=0.005 * craters.fresh_depth[0])


def fassett_and_thomson(craters):
    """The same craters with the very profile of the paper: its rim is lower than Pike's."""
    diameter = craters.diameter
    return craters.replace(
        fresh_depth=degradation.FT_DEPTH * diameter,
        fresh_rim=degradation.FT_RIM * diameter,
        fresh_ejecta=0.0 * diameter,
    )


@pytest.mark.parametrize(
    ("diameter", "left"), [(1000.0, 0.525), (300.0, 0.060)], ids=["52 %", "about 7 %"]
)
def test_wear_of_the_last_three_billion_years(diameter, left):
    """Fassett & Thomson 2014: 5.5 m²/10⁶ years over 3·10⁹ years."""
    place, spec = listed(
        [(0.0, 0.0, diameter, 3.0)],
        ejecta=False,
        depth_to_diameter=0.21782,
        diffusivity_m2_per_myr=5.5,
    )
    craters = everywhere(spec, place)
    assert craters.depth[0] / craters.fresh_depth[0] == pytest.approx(left, abs=0.012)
    pure = fassett_and_thomson(craters)
    assert pure.depth[0] / pure.fresh_depth[0] == pytest.approx(left, abs=0.002)


def test_wear_table_against_known_ratios():
    known = {0.001: 0.946, 0.005: 0.799, 0.01: 0.658, 0.05: 0.227, 0.1: 0.113, 0.1833: 0.0597}
    rows = [(0.0, 0.0, 50.0, 1.0)]
    for tau, ratio in known.items():
        place, spec = listed(rows, diffusivity_m2_per_myr=2.5 * tau)
        craters = fassett_and_thomson(everywhere(spec, place))
        assert craters.depth[0] / craters.fresh_depth[0] == pytest.approx(ratio, abs=0.001)


def test_wear_is_even_in_space():
    """No step where a crater ends, and the old reach farther than the fresh."""
    values, reaches = worn_shapes()
    for row, reach in enumerate(reaches):
        beyond = int(np.ceil(reach / 0.01))
        assert np.abs(values[row, beyond:]).max(initial=0.0) < 1e-12
    assert np.all(np.diff(reaches) >= 0.0)


def test_wear_holds_equilibrium_and_is_measured_at_a_kilometre():
    """A crater has reached 0.046 of its diameter when as many of its size have come as can be."""
    wear = Wear(body=MOON, kind="neukum", equilibrium="trask")
    diameters = np.array([5.0, 20.0, 100.0])
    at = wear.lifetime(diameters) * 1000.0 * wear.diffusivity(diameters) / diameters**2
    fresh = fresh_shapes(diameters, body=MOON)
    place, spec = listed([(0.0, 0.0, diameter, 0.0) for diameter in diameters])
    craters = everywhere(spec, place)
    craters = craters.select(np.argsort(craters.diameter)).replace(wear=at)
    np.testing.assert_array_equal(craters.fresh_depth, fresh.depth)
    assert craters.depth / diameters == pytest.approx(0.046, abs=0.0015)
    assert wear.diffusivity(np.array([1e3, 5e3])) == pytest.approx([5.5, 5.5])
    assert 0.1 < wear.diffusivity(np.array([100.0]))[0] < 0.4


@pytest.mark.parametrize("age", [0.0, 0.05, 2.0])
def test_surface_of_one_crater_is_its_profile(age):
    place, spec = listed([(3.17, -8.41, 40.0, age)])
    ground = shape_ground(site=place, window=place.window, layers=(spec,))
    east, north = place.axes(place.window)
    x = np.hypot(east[None, :] - 3.17, north[:, None] + 8.41) / 20.0
    shape = fresh_shapes(np.array([40.0]), body=MOON)
    depth, rim, ejecta = float(shape.depth[0]), float(shape.rim[0]), float(shape.ejecta[0])
    tau = float(everywhere(spec, place).wear[0])
    radii, wanted = (
        worn(
            fresh_profile((np.arange(400) + 0.5) * 0.02, depth=depth, rim=rim, ejecta=ejecta),
            *(0.02, tau),
        )
        if age
        else (x, None)
    )
    if wanted is None:
        expected = fresh_profile(x, depth=depth, rim=rim, ejecta=ejecta)
    else:
        expected = np.interp(x, radii, wanted)
    assert np.abs(ground.elevation - expected).max() < 0.01 * depth


# Chance


def drawn(spec, *, seeds, size=(400.0, 400.0)):
    """Craters of several seeds whose centres lie on the site."""
    found = []
    for seed in range(seeds):
        place = moon(size, seed=seed)
        craters = everywhere(spec, place)
        inside = np.all(np.abs(craters.xy) <= 0.5 * np.array(size), axis=1)
        found.append(craters.select(inside))
    return found


LAWS = (
    layer(),
    layer(production=BodyProduction(kind="neukum", age_ga=0.05), diameter_m=(2.0, 80.0)),
    layer(production=CraterPowerLaw(number_per_m2=0.2, exponent=2.6, age_ga=1), equilibrium="none"),
    layer(
        production=CraterTable(
            diameters_m=(2.0, 8.0, 50.0), numbers_per_km2=(3e4, 900.0, 20.0), age_ga=1
        ),
        equilibrium="none",
    ),
    layer(equilibrium="viper", diameter_m=(3.0, 200.0)),
)


@pytest.mark.parametrize("spec", LAWS, ids=lambda spec: spec.production.kind)
def test_numbers_and_sizes_follow_the_law(spec):
    seeds, area = 4, 400.0 * 400.0
    population = population_of(spec, site=moon())
    found = drawn(spec, seeds=seeds)
    ends = population.number(np.array(population.diameters))
    mean = seeds * area * (ends[0] - ends[1])
    count = sum(map(len, found))
    assert mean > 500
    assert min(poisson.cdf(count, mean), poisson.sf(count - 1, mean)) > 0.5 * ALPHA
    diameters = np.concatenate([craters.diameter for craters in found])
    assert diameters.min() >= population.diameters[0]
    assert diameters.max() <= population.diameters[1]

    def below(diameter):
        return (ends[0] - population.number(diameter)) / (ends[0] - ends[1])

    assert kstest(diameters, below).pvalue > ALPHA


def test_counts_of_windows_are_poisson():
    """Numbers in 100 m squares, of small and of large craters: mean as variance, all alike."""
    found = drawn(layer(), seeds=6)
    population = population_of(layer(), site=moon())
    for low, high in ((2.0, 4.0), (4.0, 60.0)):
        counts = []
        for craters in found:
            one = craters.select((craters.diameter >= low) & (craters.diameter < high))
            counts.append(np.histogram2d(*one.xy.T, bins=4, range=[[-200, 200]] * 2)[0].ravel())
        counts = np.concatenate(counts)
        mean = 1e4 * population.density(low, high)
        statistic = np.sum((counts - mean) ** 2) / mean
        tail = chi2.cdf(statistic, counts.size)
        assert 0.5 * ALPHA < tail < 1 - 0.5 * ALPHA


def test_ages_follow_the_chronology():
    """Production: all ages by N(T); equilibrium: the youngest ones, as many as there may be."""
    free = layer(
        equilibrium="none",
        production=BodyProduction(kind="neukum", age_ga=3.7),
        diameter_m=(20.0, 200.0),
    )
    ages = np.concatenate([c.age for c in drawn(free, seeds=3)])
    whole = MOON_AGES.number(3.7)
    assert len(ages) > 500
    assert kstest(ages, lambda t: np.array([MOON_AGES.number(a) for a in t]) / whole).pvalue > ALPHA
    held = drawn(layer(), seeds=2)
    population = population_of(layer(), site=moon())
    for craters in held:
        oldest = population.part(craters.diameter) * MOON_AGES.number(3.5)
        part = np.array([MOON_AGES.number(age) for age in craters.age]) / oldest
        assert part.max() < 1.001
        assert kstest(part, "uniform").pvalue > ALPHA


def test_expected_number_of_all_that_reach_a_site():
    numbers = [expected_craters(population_of(layer(), site=moon()), moon().bounds)]
    assert numbers[0] > len(everywhere(layer(), moon())) > 0.2 * numbers[0]


def test_smaller_craters_leave_the_larger_alone():
    place = moon()
    few, many = everywhere(layer(diameter_m=(8.0, 60.0)), place), everywhere(layer(), place)
    rows = np.isin(many.id, few.id)
    assert rows.sum() == len(few) < len(many)
    np.testing.assert_array_equal(many.select(rows).xy, few.xy)
    np.testing.assert_array_equal(many.select(rows).age, few.age)


@pytest.mark.parametrize("limits", [(2.7, 60.0), (5.5, 60.0), (2.0, 21.0), (5.5, 21.0)])
def test_limits_of_size_are_a_cut(limits):
    """Also within an octave: who is left keeps address, place, size and age."""
    place = moon()
    some = everywhere(layer(diameter_m=limits), place)
    every = everywhere(layer(diameter_m=(2.0, 60.0)), place)
    inside = (every.diameter >= limits[0]) & (every.diameter <= limits[1])
    assert 10 < inside.sum() < len(every)
    for name in ("id", "xy", "diameter", "age", "wear"):
        np.testing.assert_array_equal(getattr(some, name), getattr(every.select(inside), name))


def test_layers_of_other_names_are_others():
    place = moon()
    one, other = everywhere(layer(), place), everywhere(layer(name="secondaries"), place)
    assert not np.isin(one.id, other.id).any()


# Histories and counts


def within_poisson(found, mean):
    return min(poisson.cdf(found, mean), poisson.sf(found - 1, mean)) > 0.5 * ALPHA


HISTORY = BodyProduction(
    kind="ivanov",
    age_ga=3.6,
    resurfaced=(Resurfacing(age_ga=1.2, below_m=1000.0), Resurfacing(age_ga=0.2, below_m=200.0)),
)


def test_small_craters_are_as_many_as_came_since_they_were_erased():
    """In each band as many as the production of its own age has there, and none that is older."""
    law = HISTORY.law(MARS)
    bands = ((60.0, 200.0, 0.2), (200.0, 1000.0, 1.2), (1000.0, 4000.0, 3.6))
    place = moon((60_000.0, 60_000.0), spacing=15.0).replace(body=MARS)
    spec = layer(production=HISTORY, diameter_m=(60.0, 4000.0), equilibrium="none")
    craters = everywhere(spec, place)
    craters = craters.select(np.all(np.abs(craters.xy) <= 30_000.0, axis=1))
    for low, high, age in bands:
        alone = BodyProduction(kind="ivanov", age_ga=age).law(MARS).number(np.array([low, high]))
        assert np.diff(law.number(np.array([low, high]))) == pytest.approx(np.diff(alone))
        inside = (craters.diameter >= low) & (craters.diameter < high)
        assert within_poisson(inside.sum(), 3.6e9 * -np.diff(alone)[0])
        assert 0.9 * age < craters.age[inside].max() <= age
    at = np.geomspace(30.0, 3000.0, 400)
    slope = -np.diff(np.log(law.number(at))) / np.diff(np.log(at))
    assert np.median(np.abs(slope / law.slope(np.sqrt(at[1:] * at[:-1])) - 1.0)) < 1e-3


def test_counted_bins_are_met():
    """Counts that no single age has: 5285 craters on 3037 km², 1707 of them above 100 m.

    These two sums are those of a count near Pickering; the bins that add up to them are invented.
    """
    area = 3036.6
    counted = ((60.0, 100.0, 3578), (100.0, 200.0, 1200), (200.0, 500.0, 0), (700.0, 1500.0, 507))
    bins = tuple(
        CraterBin(diameter_m=(low, high), number_per_km2=n / area, age_ga=0.5 if n > 600 else None)
        for low, high, n in counted
    )
    production = CraterCounts(bins=bins, age_ga=3.5)
    side = 1000.0 * area**0.5
    place = moon((side, side), spacing=15.0).replace(body=MARS)
    craters = everywhere(layer(production=production, diameter_m=(60.0, None)), place)
    craters = craters.select(np.all(np.abs(craters.xy) <= 0.5 * side, axis=1))
    assert within_poisson(len(craters), 5285)
    assert within_poisson(np.count_nonzero(craters.diameter >= 100.0), 1707)
    for low, high, number in counted:
        inside = (craters.diameter >= low) & (craters.diameter < high)
        assert within_poisson(inside.sum(), number) if number else not inside.any()
    assert craters.age[craters.diameter < 200.0].max() <= 0.5 < craters.age.max()


@pytest.mark.parametrize(
    "production",
    [
        BodyProduction(
            kind="neukum", age_ga=3.5, resurfaced=(Resurfacing(age_ga=0.1, below_m=12.0),)
        ),
        CraterCounts(
            bins=(
                CraterBin(diameter_m=(2, 5), number_per_km2=9e3),
                CraterBin(diameter_m=(5, 60), number_per_km2=900.0),
            ),
            age_ga=3.5,
        ),
    ],
    ids=["history", "counts"],
)
def test_windows_of_histories_and_counts_equal_the_cut(production):
    place, spec = moon(), layer(production=production)
    whole = shape_ground(site=place, window=place.window, layers=(spec,)).elevation
    window = Window(column=57, row=31, columns=90, rows=111)
    part = shape_ground(site=place, window=window, layers=(spec,)).elevation
    np.testing.assert_array_equal(part, whole[31:143, 57:148])


@pytest.mark.parametrize(
    ("production", "match"),
    [
        (
            '"kind":"neukum","age_ga":1,"resurfaced":[{"age_ga":2,"below_m":50}]',
            "resurfaced: ages must fall from age_ga on, and below_m from event to event",
        ),
        (
            '"kind":"neukum","age_ga":3,"resurfaced":[{"age_ga":2,"below_m":50},'
            '{"age_ga":1,"below_m":60}]',
            "below_m from event to event",
        ),
        ('"kind":"neukum","age_ga":3,"resurfaced":[{"age_ga":2}]', "below_m"),
        (
            '"kind":"counts","age_ga":3,"bins":[{"diameter_m":[5,3],"number_per_km2":1}]',
            "bins: diameters must rise, in a bin and from bin to bin",
        ),
        (
            '"kind":"counts","age_ga":3,"bins":[{"diameter_m":[3,5],"number_per_km2":1},'
            '{"diameter_m":[4,8],"number_per_km2":1}]',
            "from bin to bin",
        ),
        (
            '"kind":"counts","age_ga":3,"bins":[{"diameter_m":[3,5],"number_per_km2":0}]',
            "bins: no craters in any bin",
        ),
        (
            '"kind":"counts","age_ga":3,"bins":[{"diameter_m":[3,5],"number_per_km2":1,'
            '"age_ga":3.5}]',
            "bins: none may be older than age_ga",
        ),
        ('"kind":"counts","age_ga":3,"bins":[]', "bins"),
    ],
)
def test_histories_and_counts_that_cannot_be(production, match):
    with pytest.raises(RecipeError, match=match) as caught:
        recipe_from_json(AS_JSON % production)
    assert "\n" not in str(caught.value)


# Windows and overlaps


def test_any_window_equals_the_cut():
    table = Table(
        path="craters.csv",
        columns=("x_m", "y_m", "diameter_m", "age_ga"),
        values=np.array([(10.0, 5.0, 50.0, 0.1), (-130.0, 0.0, 90.0, 1.0), (14.0, 9.0, 50.0, 0.1)]),
    )
    place = moon(tables=(table,))
    spec = layer(file="craters.csv", diameter_m=(2.0, 300.0))
    whole = shape_ground(site=place, window=place.window, layers=(spec,)).elevation
    random = np.random.default_rng(3)
    for n in range(12):
        column, row = int(random.integers(0, 399)), int(random.integers(0, 319))
        columns = int(random.integers(1, 401 - column)) if n % 2 else 1
        rows = int(random.integers(1, 321 - row)) if n % 3 else 1
        window = Window(column=column, row=row, columns=columns, rows=rows)
        part = shape_ground(site=place, window=window, layers=(spec,)).elevation
        cut = whole[row : row + rows + 1, column : column + columns + 1]
        np.testing.assert_array_equal(part, cut)
    other = shape_ground(site=place.replace(seed=2), window=place.window, layers=(spec,))
    assert not np.array_equal(other.elevation, whole)


def heights(*rows, **changes):
    """Ground under listed craters."""
    place, spec = listed(rows, diffusivity_m2_per_myr=0.0, **changes)
    return shape_ground(site=place, window=place.window, layers=(spec,)).elevation.astype(float)


def near(x, y, radius):
    """Nodes of `heights` within a circle."""
    east, north = moon().axes(moon().window)
    return np.hypot(east[None, :] - x, north[:, None] - y) <= radius


@pytest.mark.parametrize(
    "craters",
    [((-50, 0, 20, 0.0), (50, 10, 30, 1.0)), ((0, 0, 80, 2.0), (5, 3, 6, 0.1))],
    ids=["apart", "a small young one on the floor of a large old one"],
)
def test_craters_that_add_up(craters):
    alone = sum(heights(crater) for crater in craters)
    np.testing.assert_allclose(heights(*craters), alone, atol=1e-6)


def test_a_large_young_crater_erases_a_small_old_one():
    young = heights((0, 0, 80, 0.1))
    both = heights((0, 0, 80, 0.1), (20, 10, 12, 2.0), (70, 50, 10, 2.0))
    np.testing.assert_allclose(both[near(0, 0, 36)], young[near(0, 0, 36)], atol=1e-6)
    assert np.abs((both - young)[near(70, 50, 5)]).max() > 0.5
    younger = heights((0, 0, 80, 0.1), (20, 10, 12, 0.0))
    assert np.abs((younger - young)[near(20, 10, 5)]).max() > 0.5


def test_of_two_alike_the_younger_keeps_its_rim():
    """Where the younger one's rim crosses the older one's bowl, it stands up."""
    both = heights((0, 0, 40, 0.1), (24, 0, 40, 2.0))
    old, young = heights((24, 0, 40, 2.0)), heights((0, 0, 40, 0.1))
    only_young = near(0, 0, 17)
    expected = young + 0.5 * old
    np.testing.assert_allclose(both[only_young], expected[only_young], atol=1e-5)


# Rocks and light


def test_rocks_lie_around_the_craters_of_a_layer():
    around = AroundCraters(layer="craters", smallest_crater_m=12.0)
    blocks = PopulationSpec(
        name="blocks",
        size_frequency=Golombek(k=0.02),
        diameter_m=(0.1, 0.8),
        arrangement=around,
    )
    site = plan(
        recipe(layer(), rocks=RocksSpec(library=LibrarySpec(shapes=2), populations=(blocks,)))
    )
    (spec,) = site.recipe.rocks.populations
    craters = everywhere(layer(), site)
    near = craters.select((craters.diameter >= 12.0) & (craters.wear < 1.0))
    assert isinstance(spec.arrangement, AroundCraters)
    assert spec.arrangement.layer is None
    assert [c.diameter_m for c in spec.arrangement.craters] == near.diameter.tolist()
    assert [c.age_ga for c in spec.arrangement.craters] == near.age.tolist()
    rocks = realise(site).field
    assert len(rocks) > 50
    away = np.hypot(*(rocks.position[:, None, :2] - near.xy).transpose(2, 0, 1)) / near.diameter
    assert np.all((away < 1.05).any(axis=1))
    limit = 0.25 * near.diameter**0.7
    assert np.all(rocks.diameter <= np.where(away < 1.05, limit, 0.0).max(axis=1))
    again = plan(site.recipe)
    assert again.recipe_json == site.recipe_json


def test_rocks_around_a_layer_that_cannot_be():
    def planned(**more):
        blocks = PopulationSpec(
            name="blocks",
            size_frequency=Golombek(k=0.02),
            diameter_m=(0.1, 2.0),
            arrangement=AroundCraters(**more),
        )
        rocks = RocksSpec(populations=(blocks,))
        return plan(recipe(layer(), rocks=rocks, dtm=FlatDtm(size_m=(200.0, 200.0))))

    with pytest.raises(RecipeError, match="no layer of craters is called 'mine', there are: crat"):
        planned(layer="mine")
    with pytest.raises(RecipeError, match=r"0 craters of 55 m and more .* allowed: 1 to 500"):
        planned(layer="craters", smallest_crater_m=55.0)
    with pytest.raises(RecipeError, match=r"craters of 2 m and more .* allowed: 1 to 500"):
        planned(layer="craters", smallest_crater_m=2.0)
    with pytest.raises(ValueError, match="one of craters and layer"):
        AroundCraters()


def test_young_ejecta_are_bright():
    place, spec = listed([(0, 0, 40.0, 0.0), (60, 50, 40.0, 1.0), (-50, -40, 8.0, 0.01)])
    factor = spec.brightness(site=place, window=place.window)
    assert factor is not None
    assert factor[near(0, 0, 15)] == pytest.approx(1.0 + 0.4 * 0.4)
    assert factor[near(60, 50, 15)] == pytest.approx(1.0)
    assert 1.0 < factor[near(-50, -40, 2)].max() < 1.0 + 0.4 * 0.08
    part = Window(column=150, row=100, columns=80, rows=90)
    np.testing.assert_array_equal(
        spec.brightness(site=place, window=part), factor[100:191, 150:231]
    )
    assert layer(ejecta_contrast=0.0).brightness(site=place, window=part) is None


def test_production_of_the_users_table(tmp_path):
    """Counts of one's own, from a file as from lists, and hashed as an input."""
    lines = "diameter_m,number_per_km2\n2,15000\n8,900\n60,4\n"
    (tmp_path / "counts.csv").write_text(lines)
    from_file = layer(production=CraterTable(file="counts.csv", age_ga=3.5))
    lists = CraterTable(diameters_m=(2, 8, 60), numbers_per_km2=(15000, 900, 4), age_ga=3.5)
    site = plan(recipe(from_file), folder=tmp_path)
    assert [name for name, _ in site.inputs] == ["counts.csv"]
    given = plan(recipe(layer(production=lists)))
    assert site.recipe.terrain == given.recipe.terrain
    (spec,) = site.recipe.terrain.layers
    found = everywhere(spec, site)
    assert np.array_equal(found.xy, everywhere(spec, given).xy)
    wanted = population_of(spec, site=site).number(np.array([2.0, 8.0, 60.0])) * 1e6
    assert wanted[:2] - wanted[2] == pytest.approx([14996.0, 896.0])
    for text, match in (
        ("2,15000\n8,30000\n", "numbers fall"),
        ("2,15000\n", "two diameters"),
        ("2,0\n8,-1\n", "must be above 0"),
    ):
        (tmp_path / "counts.csv").write_text("diameter_m,number_per_km2\n" + text)
        with pytest.raises(DataError, match=match) as error:
            plan(recipe(from_file), folder=tmp_path)
        assert error.value.key == ("terrain", "layers", 0, "production", "file")


# Truth


def recipe(*layers, **changes):
    """A flat Moon of 100 × 80 m."""
    spec = {
        "name": "m",
        "body": "moon",
        "dtm": FlatDtm(size_m=(100.0, 80.0), lonlat_deg=(-23.4, -3.0)),
        "terrain": TerrainSpec(spacing_m=0.5, layers=layers),
        "rocks": RocksSpec(library=LibrarySpec(shapes=2)),
        "exports": (),
        **changes,
    }
    return Recipe(**spec)


def test_truth_lists_the_craters(tmp_path):
    (tmp_path / "mine.csv").write_text("x_m,y_m,diameter_m\n7,-5,20\n-52,0,10\n")
    site = plan(recipe(layer(diameter_m=(2.0, 30.0), file="mine.csv")), folder=tmp_path)
    world = realise(site)
    files = write_craters(world, tmp_path)
    assert [path.name for path in files] == ["craters.csv", "crater_counts.json"]
    rows = list(csv.DictReader(files[0].read_text().splitlines()))
    mine = [row for row in rows if row["listed"] == "1"]
    assert [(float(row["x_m"]), float(row["y_m"]), row["inside"]) for row in mine] == [
        (7.0, -5.0, "1"),
        (-52.0, 0.0, "0"),
    ]
    for row in rows:
        lost = 1.0 - float(row["depth_m"]) / float(row["fresh_depth_m"])
        assert float(row["degradation"]) == pytest.approx(lost, abs=1e-5)
    assert float(mine[0]["degradation"]) == pytest.approx(0.0, abs=2e-3)
    metre = 180.0 / (np.pi * 1737.4e3)
    assert float(mine[0]["lat_deg"]) + 3.0 == pytest.approx(-5.0 * metre, abs=1e-7)
    assert len({row["id"] for row in rows}) == len(rows)
    part = realise(site, Window(column=20, row=30, columns=60, rows=50))
    write_craters(part, tmp_path)
    inside = {row["id"]: row for row in csv.DictReader(files[0].read_text().splitlines())}
    known = {row["id"]: row for row in rows}
    assert 0 < len(inside) < len(known)
    for name, row in inside.items():
        assert row["diameter_m"] == known[name]["diameter_m"]


def test_truth_tells_of_resurfacing(tmp_path):
    event = Resurfacing(age_ga=1.2, below_m=6.0)
    production = BodyProduction(kind="neukum", age_ga=3.5, resurfaced=(event,))
    spec = CraterLayer(production=production, diameter_m=(5.0, 30.0))
    world = realise(plan(recipe(spec)), Window(column=0, row=0, columns=20, rows=20))
    (counts,) = json.loads(write_craters(world, tmp_path)[1].read_text())["layers"]
    assert counts["resurfaced"] == [{"age_ga": 1.2, "below_m": 6.0}]


def test_truth_tells_which_craters_were_masked_out(tmp_path):
    """West of the middle the mask is black: the ground is level there and the table says so."""
    from PIL import Image as Picture

    black_and_white = np.repeat([0, 255], 100).astype(np.uint8)
    Picture.fromarray(np.tile(black_and_white, (160, 1))).save(tmp_path / "mask.png")
    spec = CraterLayer(
        production=BodyProduction(kind="neukum", age_ga=3.5),
        diameter_m=(2.0, 30.0),
        mask=Mask(image="mask.png"),
    )
    site = plan(recipe(spec), folder=tmp_path)
    for window in (site.window, Window(column=30, row=20, columns=120, rows=90)):
        world = realise(site, window)
        rows = list(csv.DictReader(write_craters(world, tmp_path)[0].read_text().splitlines()))
        weight = np.array([float(row["mask_weight"]) for row in rows])
        east = np.array([float(row["x_m"]) for row in rows])
        assert set(weight[east < -5.0]) == {0.0}
        assert set(weight[east > 5.0]) == {1.0}
        assert not world.ground.elevation[:, world.ground.east < -5.0].any()
        assert world.ground.elevation[:, world.ground.east > 5.0].any()


def test_nothing_is_written_where_no_craters_are_made(tmp_path):
    world = realise(plan(recipe()))
    assert write_craters(world, tmp_path) == []
    assert list(tmp_path.iterdir()) == []


def counted(spec, folder):
    """A world with a layer, the file of its counts, and what that says of the layer."""
    world = realise(plan(recipe(spec, name="counts")))
    (folder / "truth").mkdir()
    _, counts = write_craters(world, folder / "truth")
    (report,) = json.loads(counts.read_text())["layers"]
    return world, counts, report


def test_proof_of_the_numbers(tmp_path):
    world, counts, report = counted(layer(), tmp_path)
    assert abs(report["number"]["z"]) < norm.isf(0.5 * ALPHA)
    assert report["sizes"]["p_value"] > ALPHA
    built = SimpleNamespace(directory=tmp_path)
    checks = CratersCheck().checks(built)
    assert [check.passed for check in checks] == [True, True]
    bent = json.loads(counts.read_text())
    bent["layers"][0]["number"]["z"] = -4.0
    counts.write_text(json.dumps(bent))
    assert [check.passed for check in CratersCheck().checks(built)] == [False, True]
    counts.write_text(json.dumps({"layers": [report]}))
    shown = render("blocks.html", blocks=CratersSection().blocks(Built(world, tmp_path)))
    assert all(said in shown for said in (">neukum<", "3.5·10⁹ years", ">trask<", "2 to 60 m"))
    assert shown.count("<td") == 4 * 5
    assert report["cumulative"]["expected"][0] == pytest.approx(report["number"]["expected"])


def test_numbers_count_from_the_smallest(tmp_path):
    """Also where that lies within an octave."""
    spec = layer(diameter_m=(2.7, 21.0))
    world, _, report = counted(spec, tmp_path)
    wanted = 100.0 * 80.0 * population_of(spec, site=world.site).density(2.7, 21.0)
    assert report["number"]["expected"] == pytest.approx(wanted)
    assert report["cumulative"]["diameter_m"] == [2.7, 4.0, 8.0, 16.0]
    assert report["cumulative"]["expected"][0] == pytest.approx(wanted)
    assert abs(report["number"]["z"]) < norm.isf(0.5 * ALPHA)


# What cannot be


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
