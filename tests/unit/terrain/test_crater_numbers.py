"""Numbers and sizes of craters: production, chronology, equilibrium, chance, histories, counts."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2, kstest, poisson

from terrain_forge.base import RecipeError
from terrain_forge.model import MARS, MOON, Window
from terrain_forge.recipe import recipe_from_json
from terrain_forge.terrain import (
    LIMITS,
    BodyProduction,
    CraterBin,
    CraterCounts,
    CraterLayer,
    CraterTable,
    Resurfacing,
    population_of,
    shape_ground,
)
from terrain_forge.terrain.cratering.placement import age_of, expected_craters
from terrain_forge.terrain.cratering.productions.power_law import CraterPowerLaw
from tests.helpers.craters import ALPHA, AS_JSON, KM2, MOON_AGES, everywhere, layer, moon


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


def test_mars_has_as_many_craters_as_ivanov_says():
    """N(1 km) after 1, 3 and 3.8 Ga, 2.68e-14 (exp(6.93 T) - 1) + 4.13e-4 T (Ivanov 2001)."""
    for age, per_km2 in ((1.0, 4.130e-4), (3.0, 1.2676e-3), (3.8, 8.895e-3)):
        law = BodyProduction(kind="ivanov", age_ga=age).law(MARS)
        assert law.number(np.array([1000.0]))[0] == pytest.approx(KM2 * per_km2, rel=2e-3)


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
