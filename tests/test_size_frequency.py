import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import kstest

from terrain_forge.rocks.placement import words
from terrain_forge.rocks.size_frequency import Golombek, PowerLaw, largest_diameter

LAWS = [
    Golombek(k=0.02),
    Golombek(k=0.3),
    Golombek(k=0.0125, q_per_m=1.5928),
    PowerLaw(number_per_m2=2.34e-3, exponent=2.11),
    PowerLaw(number_per_m2=1e-4, exponent=1.75),
    PowerLaw(number_per_m2=1e-3, exponent=2.0),
]


def addresses(count):
    return words(np.arange(count, dtype=np.uint64), 99)


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
        (0.01, (1.2081e-1, 7.0951e-3, 8.5652e-6, 4.7877e-10, 5.2641e-18, 2.3644e-33)),
        (0.05, (1.0342, 2.4010e-1, 1.3553e-2, 3.7284e-4, 8.5206e-7, 1.4729e-11)),
        (0.3, (4.7340, 1.5372, 2.0990e-1, 2.2469e-2, 6.9985e-4, 2.0360e-6)),
    ],
)
def test_golombek_table(k, numbers):
    found = Golombek(k=k).cumulative_number([0.1, 0.2, 0.5, 1, 2, 4])
    np.testing.assert_allclose(found, numbers, rtol=1e-4)


@pytest.mark.parametrize(
    ("k", "diameters"),
    [(0.02, (0.304, 0.653, 1.051)), (0.1, (0.774, 1.743, 2.862)), (0.3, (1.214, 2.635, 4.259))],
)
def test_largest_rock_of_an_area(k, diameters):
    found = [largest_diameter(Golombek(k=k), area) for area in (1e2, 1e4, 1e6)]
    np.testing.assert_allclose(found, diameters, atol=6e-4)


@pytest.mark.parametrize("law", LAWS)
def test_closed_forms_agree_with_each_other(law):
    def density(d):
        step = 1e-5 * d
        return float(law.cumulative_number(d - step) - law.cumulative_number(d + step)) / (2 * step)

    a, b, area = 0.3, 1.7, 50.0
    cover = quad(lambda d: np.pi / 4 * d**2 * density(d), a, b)[0]
    variance = quad(lambda d: (np.pi / 4 * d**2) ** 2 * density(d), a, b)[0] / area
    assert law.cumulative_area(a) - law.cumulative_area(b) == pytest.approx(cover, rel=1e-6)
    assert law.cover_variance(a, b, area) == pytest.approx(variance, rel=1e-6)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("a", "b"), [(0.1, 0.2), (0.1, 4.0), (1.0, 2.0), (1.0, 1.01)])
def test_samples_follow_the_law(law, a, b):
    sample = law.sample(addresses(20_000), a, b)
    assert a <= sample.min()
    assert sample.max() <= b
    numbers = law.cumulative_number(np.array([a, b]))

    def cdf(d):
        return (numbers[0] - law.cumulative_number(d)) / (numbers[0] - numbers[1])

    assert kstest(sample, cdf).pvalue > 0.001


def test_a_sample_depends_on_its_own_address_alone():
    law, hashes = Golombek(k=0.05), addresses(100)
    whole = law.sample(hashes, 0.1, 1.0)
    np.testing.assert_array_equal(law.sample(hashes[40:41], 0.1, 1.0), whole[40:41])
