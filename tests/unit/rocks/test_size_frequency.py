"""The size-frequency laws: golden numbers, closed forms against quadrature, samplers, fits."""

from __future__ import annotations

import json
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import chisquare, kstest

from terrain_forge.base import RecipeError
from terrain_forge.model import MARS, MOON
from terrain_forge.rocks import Counts, Exponential, Golombek, PowerLaw, Tabulated
from terrain_forge.rocks.laws.fitting import fit_law
from terrain_forge.rocks.laws.golombek import CoverAbove
from terrain_forge.rocks.laws.sites import ABUNDANCES, FRAGMENTS
from terrain_forge.rocks.populations import largest_diameter
from terrain_forge.rocks.scattering.cells import words

ALPHA = 0.001
# A table whose pieces fall as D^-2.5, D^-2 (where the cover needs a logarithm) and D^-4.2.
TABLE = Tabulated(
    diameters_m=(0.1, 0.4, 0.8, 1.6),
    numbers_per_m2=(1.0, 4**-2.5, 4**-2.5 / 4, 4**-2.5 / 4 / 2**4.2),
)
LAWS = [
    Golombek(k=0.02),
    Golombek(k=0.3),
    Golombek(k=0.0125, q_of_k="moon"),
    Golombek(site="viking_2"),
    Golombek(cover=CoverAbove(fraction=0.04, above_m=0.2)),
    PowerLaw(number_per_m2=2.34e-3, exponent=2.11),
    PowerLaw(number_per_m2=1e-4, exponent=1.75),
    PowerLaw(number_per_m2=1e-3, exponent=2.0),
    PowerLaw(number_per_m2=1e-3, exponent=4.0),
    PowerLaw(site="surveyor_3"),
    Exponential(number_per_m2=2.0, decay_per_m=3.5),
    TABLE,
]


def addresses(count, seed=99):
    return words(np.arange(count, dtype=np.uint64), seed)


def counted(law, *, rocks, smallest, seed):
    """Diameters that a survey finds which expects so many rocks, and the area [m²] it searches."""
    area = rocks / float(law.cumulative_number(smallest))
    number = np.random.default_rng(seed).poisson(rocks)
    return tuple(law.sample(addresses(number, seed), smallest, 50.0).tolist()), area


def test_golombek_golden_numbers():
    law = Golombek(k=0.07)
    assert law.q == pytest.approx(3.961428571, rel=1e-9)
    assert law.cumulative_area(0.5) == pytest.approx(9.6579e-3, rel=1e-4)
    assert Golombek(k=0.2).cumulative_area(1.0) == pytest.approx(1.5616e-2, rel=1e-4)
    assert law.cumulative_number(0.1) == pytest.approx(1.384348464, rel=1e-9)
    assert Golombek(k=0.2).cumulative_number(0.5) == pytest.approx(0.12974, rel=1e-4)
    between = law.cumulative_number(0.2) - law.cumulative_number(0.5)
    assert between == pytest.approx(0.331653, rel=1e-5)
    cover = law.cumulative_area(0.1) - law.cumulative_area(1.5)
    assert cover == pytest.approx(0.0469199, rel=1e-5)
    assert law.cover_variance(0.1, 1.5, 1e4) ** 0.5 == pytest.approx(0.00080622, rel=1e-4)


@pytest.mark.parametrize(
    ("k", "numbers"),
    [
        (0.01, (1.2081e-1, 7.0951e-3, 8.5652e-6, 4.7877e-10, 4.4978e-14, 5.2641e-18, 2.3644e-33)),
        (0.02, (3.8878e-1, 5.2648e-2, 6.7804e-4, 1.7782e-6, 7.6226e-9, 4.0340e-11, 7.3743e-20)),
        (0.05, (1.0342, 2.4010e-1, 1.3553e-2, 3.7284e-4, 1.6150e-5, 8.5206e-7, 1.4729e-11)),
        (0.07, (1.3843, 3.5883e-1, 2.7179e-2, 1.1819e-3, 7.9982e-5, 6.5621e-6, 6.5321e-10)),
        (0.1, (1.8635, 5.2613e-1, 4.9934e-2, 3.0746e-3, 2.9150e-4, 3.3362e-5, 1.2388e-8)),
        (0.2, (3.3282, 1.0426, 1.2974e-1, 1.2073e-2, 1.7035e-3, 2.8835e-4, 5.0054e-7)),
        (0.3, (4.7340, 1.5372, 2.0990e-1, 2.2469e-2, 3.6252e-3, 6.9985e-4, 2.0360e-6)),
    ],
)
def test_golombek_table(k, numbers):
    found = Golombek(k=k).cumulative_number([0.1, 0.2, 0.5, 1, 1.5, 2, 4])
    np.testing.assert_allclose(found, numbers, rtol=1e-4)


@pytest.mark.parametrize(
    ("k", "diameters"),
    [
        (0.02, (0.304, 0.653, 1.051)),
        (0.05, (0.538, 1.204, 1.972)),
        (0.07, (0.647, 1.457, 2.392)),
        (0.1, (0.774, 1.743, 2.862)),
        (0.2, (1.045, 2.314, 3.771)),
        (0.3, (1.214, 2.635, 4.259)),
    ],
)
def test_largest_rock_of_an_area(k, diameters):
    found = [largest_diameter(Golombek(k=k), area) for area in (1e2, 1e4, 1e6)]
    np.testing.assert_allclose(found, diameters, atol=6e-4)


def test_no_largest_rock_where_less_than_one_is_expected():
    assert largest_diameter(Exponential(number_per_m2=0.01, decay_per_m=2.0), 50.0) == 0.0


@pytest.mark.parametrize("law", LAWS, ids=repr)
def test_closed_forms_agree_with_each_other(law):
    def density(d):
        step = 1e-5 * d
        return float(law.cumulative_number(d - step) - law.cumulative_number(d + step)) / (2 * step)

    a, b, area = 0.3, 1.7, 50.0
    knots = [0.4, 0.8, 1.6]
    cover = quad(lambda d: np.pi / 4 * d**2 * density(d), a, b, points=knots)[0]
    fourth = quad(lambda d: (np.pi / 4 * d**2) ** 2 * density(d), a, b, points=knots)[0]
    assert law.cumulative_area(a) - law.cumulative_area(b) == pytest.approx(cover, rel=2e-5)
    assert law.cover_variance(a, b, area) == pytest.approx(fourth / area, rel=2e-5)


@pytest.mark.parametrize("decay", [0.01, 1.25, 4.0])
def test_the_cover_s_variance_of_large_mean_diameters(decay):
    law = Exponential(number_per_m2=2.0, decay_per_m=decay)
    fourth = quad(lambda d: d**4 * np.exp(-decay * d), 0.05, 0.8, epsabs=0.0, epsrel=1e-12)[0]
    wanted = (np.pi / 4) ** 2 * 2.0 * decay * fourth / 50.0
    assert law.cover_variance(0.05, 0.8, 50.0) == pytest.approx(wanted, rel=1e-10)


@pytest.mark.parametrize("law", LAWS, ids=repr)
@pytest.mark.parametrize(("a", "b"), [(0.1, 0.2), (0.1, 4.0), (1.0, 2.0), (1.0, 1.01)])
def test_samples_follow_the_law(law, a, b):
    numbers = law.cumulative_number(np.array([a, b]))

    def cdf(d):
        return (numbers[0] - law.cumulative_number(d)) / (numbers[0] - numbers[1])

    for seed in (1, 2):
        sample = law.sample(addresses(10_000, seed), a, b)
        assert a <= sample.min()
        assert sample.max() <= b
        assert kstest(sample, cdf).pvalue > ALPHA
        bins = np.histogram(cdf(sample), bins=50, range=(0.0, 1.0))[0]
        assert chisquare(bins).pvalue > ALPHA


def test_a_sample_depends_on_its_own_address_alone():
    hashes = addresses(1000)
    for law in LAWS:
        whole = law.sample(hashes, 0.1, 1.0)
        for part in (slice(40, 41), slice(7, 500)):
            np.testing.assert_array_equal(law.sample(hashes[part], 0.1, 1.0), whole[part])


@pytest.mark.parametrize("above", [0.0, 0.1, 0.2, 1.5])
@pytest.mark.parametrize("given", [{}, {"q_of_k": "moon"}, {"q_per_m": 3.0}])
def test_cover_gives_the_k_that_covers(above, given):
    law = Golombek(cover=CoverAbove(fraction=0.004, above_m=above), **given)
    assert law.cumulative_area(above) == pytest.approx(0.004, rel=1e-12)
    same = Golombek(k=law.abundance, **given)
    assert same.cumulative_number(0.3) == pytest.approx(law.cumulative_number(0.3), rel=1e-12)


def test_lunar_decay():
    law = Golombek(k=0.0125).on(MOON)
    assert law.q == pytest.approx(1.5928, rel=1e-9)
    np.testing.assert_allclose(
        law.cumulative_number([0.1, 0.5, 1.0]), (0.15912, 0.01024, 0.0016333), rtol=1e-4
    )
    assert Golombek(k=0.0125).on(MARS) == Golombek(k=0.0125)
    assert Golombek(k=0.0125, q_per_m=2.0).on(MOON).q == 2.0
    assert Golombek(site="insight").on(MOON).q == Golombek(k=0.03).q
    assert Golombek(site="chang_e_3").q == pytest.approx(1.5928)


def test_sites_name_their_sources():
    assert Golombek(site="viking_1").q == 4.08
    assert Golombek(site="viking_2").cumulative_area(0.0) == pytest.approx(0.176)
    assert Golombek(site="pathfinder").abundance == 0.19
    assert PowerLaw(site="surveyor_7").cumulative_number(1.0) == pytest.approx(2.74e-2)
    reports = [Golombek(site=site).report() for site in ABUNDANCES]
    assert all("doi:" in report["source"] for report in reports if report["verified"])
    assert {report["site"] for report in reports if not report["verified"]} == {
        *("viking_1", "viking_2", "meridiani", "gale", "jezero", "change_3", "chang_e_3")
    }
    for site in FRAGMENTS:
        assert not PowerLaw(site=site).report()["verified"]


def test_table_meets_its_rows_and_goes_on_beyond():
    np.testing.assert_allclose(
        TABLE.cumulative_number(TABLE.diameters_m), TABLE.numbers_per_m2, rtol=1e-12
    )
    last = TABLE.numbers_per_m2[-1]
    assert TABLE.cumulative_number(3.2) == pytest.approx(last / 2**4.2, rel=1e-12)
    assert TABLE.smallest_known == 0.1


ALIKE = tuple(np.linspace(0.1, 0.11, 60).tolist())
NINE = ((0.1, 0.2, 9),)
FAMILIES = [
    (Golombek(k=0.07), {}, {"k": 0.07}),
    (Golombek(k=0.0125, q_of_k="moon"), {"q_of_k": "moon"}, {"k": 0.0125}),
    (Golombek(site="viking_1"), {"q_of_k": "free"}, {"k": 0.069, "q_per_m": 4.08}),
    (
        PowerLaw(site="surveyor_1"),
        {"fit": "power_law"},
        {"number_per_m2": 2.34e-3, "exponent": 2.11},
    ),
    (
        Exponential(number_per_m2=2.0, decay_per_m=3.5),
        {"fit": "exponential"},
        {"number_per_m2": 2.0, "decay_per_m": 3.5},
    ),
]


@pytest.mark.parametrize("binned", [False, True])
@pytest.mark.parametrize(("law", "how", "truth"), FAMILIES, ids=lambda v: repr(v)[:40])
def test_fits_recover_the_law(law, how, truth, binned):
    """Errors over surveys are normal with the standard errors that the fit states."""
    errors, seeds = [], range(12)
    for seed in seeds:
        diameters, area = counted(law, rocks=400, smallest=0.2, seed=seed)
        rocks = {"diameters_m": diameters, "complete_from_m": 0.2}
        if binned:
            edges = [*np.geomspace(0.2, 1.6, 13).tolist(), None]
            number = np.histogram(diameters, bins=[*edges[:-1], np.inf])[0].tolist()
            rocks = {"bins": tuple(zip(edges[:-1], edges[1:], number, strict=True))}
        survey = Counts(area_m2=area, **rocks, **how)
        survey.check(("law",))
        found = survey.fitted.parameters
        errors.append([(found[n].value - v) / found[n].standard_error for n, v in truth.items()])
        assert survey.report()["goodness"]["p_value"] > ALPHA
    errors = np.array(errors)
    bound = 3.3 / np.sqrt(len(seeds))
    # Maximum likelihood is biased by a part of a standard error at 400 rocks.
    assert np.all(np.abs(errors.mean(axis=0)) < bound + 0.15)
    assert np.all(np.abs(errors.std(axis=0) - 1.0) < 0.6)


def test_fits_agree_with_their_closed_forms():
    diameters, area = counted(LAWS[5], rocks=200, smallest=0.1, seed=3)
    power = Counts(
        diameters_m=diameters, area_m2=area, complete_from_m=0.1, fit="power_law"
    ).fitted.parameters["exponent"]
    exponent = len(diameters) / np.sum(np.log(np.array(diameters) / 0.1))
    assert power.value == pytest.approx(exponent, rel=1e-6)
    assert power.standard_error == pytest.approx(exponent / np.sqrt(len(diameters)), rel=1e-3)
    decay = Counts(
        diameters_m=diameters, area_m2=area, complete_from_m=0.1, fit="exponential"
    ).fitted.parameters["decay_per_m"]
    assert decay.value == pytest.approx(1.0 / (np.mean(diameters) - 0.1), rel=1e-6)


def test_a_limit_that_the_smallest_rock_sets_bends_no_fit():
    """The smallest of n rocks lies above the survey's true limit; counted, it tilts the fit."""
    law, errors = PowerLaw(number_per_m2=0.01, exponent=2.0), []
    for seed in range(24):
        diameters, area = counted(law, rocks=20, smallest=0.2, seed=seed)
        fit = Counts(diameters_m=diameters, area_m2=area, fit="power_law").fitted
        errors.append(1.0 / fit.parameters["exponent"].value - 0.5)  # the mean log is unbiased
    error = np.mean(errors) / (np.std(errors) / np.sqrt(len(errors)))
    assert abs(error) < 3.3


def test_a_fitted_law_serves_as_a_law():
    diameters, area = counted(Golombek(k=0.1), rocks=500, smallest=0.15, seed=7)
    law = Counts(diameters_m=diameters, area_m2=area)
    assert law.smallest_known == min(diameters)
    assert law.count.rocks == len(diameters) - 1
    fitted = law.fitted.law
    assert isinstance(fitted, Golombek)
    assert law.cumulative_number(0.3) == fitted.cumulative_number(0.3)
    np.testing.assert_array_equal(
        law.sample(addresses(9), 0.2, 1.0), fitted.sample(addresses(9), 0.2, 1.0)
    )
    assert law.on(MOON).fitted.law.q_of_k == "moon"
    for one in (law, *LAWS):
        assert json.loads(json.dumps(one.report(), allow_nan=False))["kind"] == one.kind


@pytest.mark.parametrize("wrong", ["exponential", "power_law"])
def test_goodness_tells_a_wrong_law(wrong):
    diameters, area = counted(Golombek(k=0.07), rocks=3000, smallest=0.1, seed=1)
    survey = Counts(diameters_m=diameters, area_m2=area, complete_from_m=0.1, fit=wrong)
    assert survey.report()["goodness"]["p_value"] < ALPHA


@pytest.mark.parametrize(
    ("law", "words"),
    [
        (Golombek(), ["one of k, cover and site", "none"]),
        (Golombek(k=0.1, site="gale"), ["k and site"]),
        (Golombek(site="gale", q_per_m=2.0), ["own q"]),
        (Golombek(k=0.1, q_of_k="moon", q_per_m=2.0), ["q_of_k and q_per_m"]),
        (Golombek(cover=CoverAbove(fraction=0.3, above_m=0.5)), ["0.3", "at most 0.4", "0.135"]),
        (PowerLaw(), ["number_per_m2 and exponent", "none"]),
        (PowerLaw(exponent=2.0), ["found exponent"]),
        (PowerLaw(exponent=2.0, number_per_m2=0.1, site="surveyor_1"), ["and site"]),
        (Tabulated(diameters_m=(1.0, 2.0)), ["found diameters_m"]),
        (Tabulated(diameters_m=(1.0, 2.0), numbers_per_m2=(1.0, 1.0)), ["must fall", "row 1"]),
        (Tabulated(diameters_m=(2.0, 1.0), numbers_per_m2=(2.0, 1.0)), ["must rise"]),
        (Tabulated(diameters_m=(1.0, 2.0, 3.0), numbers_per_m2=(2.0, 1.0)), ["3 diameters"]),
        (Counts(area_m2=1.0), ["one of file", "none"]),
        (Counts(area_m2=1.0, diameters_m=(0.1, 0.2)), ["1 rocks", "at least 5"]),
        (Counts(area_m2=1.0, bins=((0.1, 0.2, 9), (0.15, 0.3, 1))), ["overlaps"]),
        (Counts(area_m2=1.0, bins=((0.1, None, 9), (0.15, 0.3, 1))), ["overlaps"]),
        (Counts(area_m2=1.0, bins=((0.2, 0.1, 9),)), ["low comes first"]),
        (Counts(area_m2=1.0, bins=NINE, fit="exponential", q_of_k="moon"), ["golombek"]),
        (Counts(area_m2=0.1, bins=((0.5, 1.0, 99), (1.0, 2.0, 30))), ["its range", "k = 0.4"]),
        (Counts(area_m2=9.0, bins=NINE, complete_from_m=0.8), ["0 rocks"]),
        (Counts(area_m2=9.0, bins=((0.1, 0.3, 9),), q_of_k="free"), ["hold rocks: 1", "2 are"]),
        (Counts(area_m2=9.0, bins=((0.1, 0.3, 9), (0.3, 0.6, 0)), q_of_k="free"), ["rocks: 1"]),
        (Counts(area_m2=9.0, bins=((0.1, 0.3, 9),), fit="power_law"), ["rocks: 1", "exponent"]),
        (Counts(area_m2=9.0, bins=((0.1, None, 9),), fit="power_law"), ["rocks: 1"]),
        (Counts(area_m2=9.0, diameters_m=(0.1, *[0.2] * 9), fit="power_law"), ["diameters: 1"]),
        (Counts(area_m2=9.0, diameters_m=ALIKE, q_of_k="free"), ["k = ", "at most 0.4"]),
        (Counts(area_m2=9.0, diameters_m=ALIKE, fit="power_law"), ["its range", "exponent = 10"]),
    ],
)  # fmt: skip
def test_laws_that_contradict_themselves(law, words):
    with pytest.raises(RecipeError) as caught:
        law.check(("rocks", "populations", 0, "size_frequency"))
    assert caught.value.key[:3] == ("rocks", "populations", 0)
    for word in words:
        assert word in str(caught.value)


def test_a_fit_that_is_not_determined_has_no_standard_error():
    """One bin tells one number, so that any exponent will do."""
    count = Counts(area_m2=9.0, bins=((0.1, 0.3, 9),), fit="power_law").count
    fit = fit_law(count, fit="power_law", decay="mars")
    assert fit.at_limit
    assert all(one.standard_error is None for one in fit.parameters.values())
    one = fit_law(count, fit="golombek", decay="mars")
    assert all(p.standard_error is not None for p in one.parameters.values())
    assert not one.at_limit
    # k ∝ the count but for q(k): a relative error a little off Poisson's
    k = one.parameters["k"]
    assert 0.2 < k.standard_error / k.value < 0.45


def test_goodness_says_that_the_law_was_fitted():
    law = Counts(area_m2=40.0, diameters_m=tuple(np.geomspace(0.2, 0.6, 30).tolist()))
    found = law.report()["goodness"]
    assert found["fitted_parameters"] == 1
    assert "too large" in found["note"]


def test_a_count_that_its_law_fits_raises_no_warning():
    """Bins of a law with Poisson numbers: p is uniform, and the errors hold the law as they say."""
    law, edges = Golombek(k=0.1), np.geomspace(0.2, 1.6, 7)
    random, number = np.random.default_rng(12), law.cumulative_number(np.geomspace(0.2, 1.6, 7))
    p_values, within = [], []
    for _ in range(30):
        found = random.poisson(400.0 * (number[:-1] - number[1:])).tolist()
        bins = tuple(zip(edges[:-1].tolist(), edges[1:].tolist(), found, strict=True))
        fit = Counts(area_m2=400.0, bins=bins).fit_to_counts(0.15, 1.6)
        counted = fit["counted_above"]
        within += list(
            (np.array(counted["number_low"]) <= law.cumulative_number(edges[:-1]))
            & (law.cumulative_number(edges[:-1]) <= np.array(counted["number_high"]))
        )
        p_values.append(fit["p_value"])
        assert fit["fits"]
        assert fit["extrapolated_below"] == pytest.approx(0.2 / 0.15)
    assert kstest(p_values, "uniform").pvalue > ALPHA
    assert 0.6 < np.mean(within) < 0.85


def test_a_count_that_its_law_misses_and_that_ends_far_off_is_told():
    """A power law counted from 0.5 m; Golombek's law, which falls faster, drawn from 0.1 m."""
    edges = (0.5, 0.7, 1.0, 1.4, 2.0, None)
    number = [0.05 * d**-1.2 for d in edges[:-1]] + [0.0]
    found = [round(2000.0 * (a - b)) for a, b in pairwise(number)]
    law = Counts(area_m2=2000.0, bins=tuple(zip(edges[:-1], edges[1:], found, strict=True)))
    fit = law.fit_to_counts(0.1, 3.0)
    assert fit["p_value"] < ALPHA
    assert not fit["fits"]
    misfit, beyond = fit["warnings"]
    assert "does not fit the count: chi-square p = " in misfit
    assert "rocks of 0.1 m are 5 times beyond the count" in beyond
    assert "extrapolated from 0.5 to 0.1 m (5 times)" in fit["summary"]
    counted = fit["counted_above"]
    above = np.cumsum(found[::-1])[::-1] / 2000.0
    np.testing.assert_allclose(counted["number"], above)
    np.testing.assert_allclose(counted["number_law"], law.cumulative_number(edges[:-1]))
    assert Golombek(k=0.1).fit_to_counts(0.1, 3.0) is None


def test_what_lies_in_no_bin_is_taken_from_the_law():
    law = Counts(area_m2=9.0, bins=((0.1, 0.3, 40), (0.5, 0.8, 3)))
    first, second = law.fit_to_counts(0.1, 1.0)["counted_above"]["number"]
    number = law.cumulative_number(np.array([0.3, 0.5, 0.8]))
    assert second == pytest.approx(3 / 9 + number[2])
    assert first == pytest.approx(43 / 9 + number[2] + number[0] - number[1])


def test_rocks_counted_one_by_one_are_shown_in_half_octaves():
    diameters, area = counted(Golombek(k=0.1), rocks=200, smallest=0.15, seed=3)
    survey = Counts(diameters_m=diameters, area_m2=area, complete_from_m=0.15)
    shown = survey.fit_to_counts(0.15, 1.0)["counted_above"]
    at = np.array(shown["diameter_m"])
    np.testing.assert_allclose(at, 0.15 * 2.0 ** (0.5 * np.arange(len(at))))
    larger = [np.count_nonzero(np.array(diameters) >= d) / area for d in at]
    np.testing.assert_allclose(shown["number"], larger)
