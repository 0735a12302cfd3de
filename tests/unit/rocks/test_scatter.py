import numpy as np
import pytest
from scipy.stats import chi2, kstest, norm

from terrain_forge.base import RecipeError
from terrain_forge.model import Window
from terrain_forge.rocks import (
    Exponential,
    Golombek,
    LibrarySpec,
    PopulationSpec,
    PowerLaw,
    RocksSpec,
    check_rocks,
    corridor_area,
    in_corridor,
    largest_rock,
)
from tests.helpers import worlds
from tests.helpers.scattering import CLUSTERED, run


def site(size=(40.0, 30.0), *, seed=1, routes=()):
    return worlds.site().replace(size=size, spacing=0.25, seed=seed, routes=routes)


def population(name="pebbles", *, k=0.1, diameter_m=(0.1, 0.5)):
    return PopulationSpec(name=name, size_frequency=Golombek(k=k), diameter_m=diameter_m)


def dust(number_per_m2=0.04, **more):
    """So many small rocks that the cells they are drawn by are far smaller than a boulder."""
    law = PowerLaw(number_per_m2=number_per_m2, exponent=2.0)
    return PopulationSpec(name="dust", size_frequency=law, diameter_m=(0.02, 0.04), **more)


def route(points, *, width=1.2, clearance=0.15):
    return worlds.route(points, corridor_width=width, corridor_clearance=clearance)


def circle(radius, **kwargs):
    angle = np.linspace(0, 2 * np.pi, 600)
    return route(radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1), **kwargs)


def rows(scattered, chosen):
    names = ("id", "population", "prototype", "xy", "yaw", "buried", "diameter")
    return [getattr(scattered, name)[chosen] for name in names]


def assert_same(one, other):
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("k", [0.05, 0.3])
def test_no_rock_is_lost_and_the_sizes_keep_to_the_law(k):
    """Numbers, sizes and cover after all moves; many seeds, each judged and all together."""
    spec = population(k=k, diameter_m=(0.1, 1.5))
    law, area = spec.size_frequency, 40.0 * 30.0
    numbers = law.cumulative_number(np.array([0.1, 1.5]))
    expected = (numbers[0] - numbers[1]) * area
    cover = float(law.cumulative_area(0.1) - law.cumulative_area(1.5))
    found = [run(site(seed=seed), spec) for seed in range(8)]
    lost = sum(sum(s.unplaced) for s in found)
    assert lost < 1e-3 * expected * len(found)
    z = [(len(s) + sum(s.unplaced) - expected) / expected**0.5 for s in found]
    assert np.square(z).sum() < chi2.isf(0.0005, len(z))
    assert np.square(z).sum() > chi2.ppf(0.0005, len(z))
    covers = [np.pi / 4 * np.square(s.diameter).sum() / area for s in found]
    sd = (law.cover_variance(0.1, 1.5, area) / len(found)) ** 0.5
    assert abs(np.mean(covers) - cover) < norm.isf(0.0005) * sd

    def cdf(d):
        return (numbers[0] - law.cumulative_number(d)) / (numbers[0] - numbers[1])

    assert kstest(np.concatenate([s.diameter for s in found]), cdf).pvalue > 0.001


def test_numbers_in_quadrats_are_poisson():
    """Index of dispersion of sparse rocks, which hardly ever have to move."""
    spec = population(k=0.02, diameter_m=(0.1, 0.3))
    scattered = run(site((60.0, 60.0)), spec)
    counts = np.histogram2d(*scattered.xy.T, bins=20, range=[(-30, 30)] * 2)[0].ravel()
    dispersion = ((counts - counts.mean()) ** 2).sum() / counts.mean()
    assert chi2.ppf(0.0005, 399) < dispersion < chi2.isf(0.0005, 399)
    for values, high in ((scattered.yaw, 2 * np.pi), (scattered.buried - 0.05, 0.45)):
        assert kstest(values / high, "uniform").pvalue > 0.001
    shapes = np.bincount(scattered.prototype, minlength=3)
    assert ((shapes - shapes.mean()) ** 2 / shapes.mean()).sum() < chi2.isf(0.001, 2)


def test_circles_stay_on_the_site():
    place = site()
    scattered = run(place, population(k=0.3, diameter_m=(0.1, 2.0)))
    radius = 0.8 * scattered.diameter
    assert np.all(np.abs(scattered.xy[:, 0]) + radius <= 20.0)
    assert np.all(np.abs(scattered.xy[:, 1]) + radius <= 15.0)


def test_ids_are_unique_and_ordered():
    scattered = run(site(), population(), population("boulders", diameter_m=(0.5, None)))
    assert np.all(np.diff(scattered.id) > 0)
    np.testing.assert_array_equal(scattered.id >> 25, scattered.population)


def test_rocks_under_a_much_larger_one_find_places_beside_it():
    law = PowerLaw(number_per_m2=0.5, exponent=2.0)
    boulder = PopulationSpec(name="boulder", size_frequency=law, diameter_m=(4.0, 5.0))
    place = site((24.0, 20.0))
    alone, crowded = run(place, dust()), run(place, dust(), boulder)
    assert (crowded.population == 1).any()
    assert crowded.unplaced == (0, 0)
    before, after = rows(alone, slice(None)), rows(crowded, crowded.population == 0)
    assert 0 < np.any(before[3] != after[3], axis=1).mean() < 0.3
    assert_same(before[:3] + before[4:], after[:3] + after[4:])


BOULDERS = population("boulders", k=0.1, diameter_m=(0.5, None))


@pytest.mark.parametrize(
    ("size", "kinds"),
    [
        ((60.0, 50.0), (population(k=0.2), BOULDERS)),
        ((16.0, 12.0), (dust(0.02), population("boulders", k=0.1, diameter_m=(2.0, 2.5)))),
        ((16.0, 12.0), (dust(0.005, arrangement=CLUSTERED), BOULDERS)),
    ],
    ids=["two", "in wide cells", "clusters in wide cells"],
)
def test_any_window_equals_the_cut_of_the_whole(size, kinds):
    place = site(size, routes=(circle(0.3 * size[1]),))
    whole = run(place, *kinds)
    columns_, rows_ = (int(length / place.spacing) for length in size)
    half = columns_ // 2
    radius = 0.8 * whole.diameter
    random = np.random.default_rng(3)
    lost = np.zeros(2, int)
    for _ in range(12):
        column, row = random.integers(0, columns_), random.integers(0, rows_)
        across, along = (
            random.integers(1, columns_ + 1 - column),
            random.integers(1, rows_ + 1 - row),
        )
        window = Window(column=int(column), row=int(row), columns=int(across), rows=int(along))
        east, north = place.axes(window)
        outside = np.maximum(np.abs(whole.xy - (east.mean(), north.mean())), 0.0)
        outside -= (0.5 * np.ptp(east), 0.5 * np.ptp(north))
        inside = np.hypot(*np.maximum(outside, 0.0).T) <= radius
        assert_same(rows(run(place, *kinds, window=window), slice(None)), rows(whole, inside))
    for column, across in ((0, half), (half, columns_ - half)):
        window = Window(column=column, row=0, columns=across, rows=rows_)
        lost += run(place, *kinds, window=window).unplaced
    assert tuple(lost) == whole.unplaced


def test_sizes_that_hardly_any_rock_has_take_no_memory():
    """A law that is level towards small sizes: cells were as small as its smallest rocks."""
    law = Exponential(number_per_m2=2.0, decay_per_m=5.0)
    stones = PopulationSpec(name="stones", size_frequency=law, diameter_m=(1e-6, 0.5))
    place = site((5.0, 4.0))
    numbers = [len(run(place.replace(seed=seed), stones).id) for seed in range(20)]
    expected = (law.cumulative_number(1e-6) - law.cumulative_number(0.5)) * 20.0
    assert np.mean(numbers) == pytest.approx(expected, abs=4.0 * np.sqrt(expected / 20))
    whole, window = run(place, stones), Window(column=3, row=3, columns=20, rows=12)
    part = run(place, stones, window=window)
    assert {*part.id.tolist()} <= {*whole.id.tolist()}


def test_small_windows_need_little_of_a_large_site():
    """A window of a site with 200 million rocks: only its surroundings can have been placed."""
    place = site((3000.0, 3000.0))
    window = Window(column=5000, row=6000, columns=20, rows=20)
    found = run(place, population(k=0.05, diameter_m=(0.2, 0.4)), window=window)
    expected = 25.0 * float(Golombek(k=0.05).cumulative_number(0.2))
    assert 0 < len(found) < 4 * expected


def test_changing_the_boulders_leaves_the_pebbles_alone():
    pebbles = population(k=0.1)
    sparse = run(site(), pebbles, population("boulders", k=0.02, diameter_m=(0.5, None)))
    dense = run(site(), pebbles, population("boulders", k=0.2, diameter_m=(0.5, 3.0)))
    before, after = (rows(s, s.population == 0) for s in (sparse, dense))
    moved = np.any(before[3] != after[3], axis=1)
    assert 0 < moved.mean() < 0.3
    assert_same(before[:3] + before[4:], after[:3] + after[4:])


def test_a_population_stands_alone():
    """Its drawn numbers depend on its name, not on its place in the list."""
    sparse = population(k=0.01)
    other = population("others", k=0.01)
    one, two = run(site(), sparse, other), run(site(), other, sparse)
    first = {d: tuple(xy) for d, xy in zip(one.diameter, one.xy, strict=True)}
    second = {d: tuple(xy) for d, xy in zip(two.diameter, two.xy, strict=True)}
    assert first.keys() == second.keys()
    assert np.mean([first[d] == second[d] for d in first]) > 0.95


def test_corridor_holds_no_tall_rock():
    strip = circle(10.0)
    free, cleared = site(), site(routes=(strip,))
    kinds = population(k=0.2, diameter_m=(0.1, 1.0))
    without, scattered = run(free, kinds), run(cleared, kinds)
    tall = scattered.diameter > 0.15  # the test library's rise is 1
    distance = np.abs(np.hypot(*scattered.xy.T) - 10.0)
    assert np.all(distance[tall] - 0.8 * scattered.diameter[tall] > 0.6 - 1e-3)
    assert np.count_nonzero(distance[~tall] < 0.6) > 30
    was_tall = without.diameter > 0.15
    dropped = np.count_nonzero(was_tall) - np.count_nonzero(tall)
    share = corridor_area(cleared, cleared.window) / 1200.0
    assert abs(dropped - share * was_tall.sum()) < 4 * (share * was_tall.sum()) ** 0.5
    assert np.isin(scattered.id, without.id).all()


def test_no_move_crosses_the_corridors_border():
    """Low rocks are as dense within the corridor as beside it."""
    place = site(routes=(circle(10.0, width=2.0),))
    spec = population(k=0.3, diameter_m=(0.1, 0.15))
    first, then = run(site(), spec), run(place, spec, population("big", k=0.2, diameter_m=(0.5, 2)))
    low = then.population == 0
    share = corridor_area(place, place.window) / 1200.0
    inside = in_corridor(place, then.xy[low])
    assert abs(inside.sum() - share * len(first)) < 4 * (share * len(first)) ** 0.5


def test_corridor_area_and_membership():
    ring = site(routes=(circle(10.0),))
    assert corridor_area(ring, ring.window) == pytest.approx(np.pi * 24.0, rel=2e-4)
    straight = np.linspace((-7.0, -4.0), (3.0, 5.0), 80)
    for line in (straight, straight[::-1]):
        place = site(routes=(route(line, width=1.0), route(line[:40], width=0.6)))
        capsule = np.hypot(10.0, 9.0) + np.pi * 0.25
        assert corridor_area(place, place.window) == pytest.approx(capsule, rel=1e-3)
    half = Window(column=0, row=0, columns=80, rows=120)
    assert corridor_area(ring, half) == pytest.approx(np.pi * 12.0, rel=2e-4)
    np.testing.assert_array_equal(
        in_corridor(ring, np.array([(10.59, 0), (10.61, 0), (0, -9.41), (0, -9.39), (0, 0)])),
        [True, False, True, False, False],
    )
    assert corridor_area(site(), site().window) == 0.0
    assert not in_corridor(site(), np.zeros((1, 2))).any()


def test_bare_ground_and_too_few_rocks():
    assert len(run(site())) == 0
    assert len(run(site(), population(k=0.01, diameter_m=(2.0, None)))) == 0


def test_a_rock_too_large_for_the_site_is_unplaced():
    law = PowerLaw(number_per_m2=1000.0, exponent=1.0)
    spec = PopulationSpec(name="huge", size_frequency=law, diameter_m=(6.0, 6.1))
    found = run(site((4.0, 4.0)), spec)
    assert len(found) == 0
    assert found.unplaced[0] > 0


def test_what_cannot_be_packed_is_refused():
    law = PowerLaw(number_per_m2=1e3, exponent=3.0)
    spec = PopulationSpec(name="dust", size_frequency=law, diameter_m=(0.1, 0.2))
    with pytest.raises(RecipeError, match=r"dust.*packed"):
        run(site(), spec)


@pytest.mark.parametrize(
    ("populations", "message"),
    [
        ((population(diameter_m=(0.5, 0.1)),), "smallest 0.5 m, largest 0.1 m"),
        ((population(), population()), "are called 'pebbles'"),
        (
            (population(k=0.4, diameter_m=(0.05, 3)), population("b", k=0.3)),
            "would cover .* at most 0.4",
        ),
        ((population(diameter_m=(1e-4, 0.1)),), "rocks on .*raise the smallest diameter"),
        (
            (
                PopulationSpec(
                    name="a",
                    size_frequency=Golombek(k=0.1),
                    diameter_m=(0.1, 1.0),
                    buried_fraction=(0.4, 0.1),
                ),
            ),
            "from 0.4 to 0.1",
        ),
    ],
)
def test_contradictions_are_refused(populations, message):
    with pytest.raises(RecipeError, match=message):
        check_rocks(RocksSpec(library=LibrarySpec(), populations=populations), (100.0, 100.0))


def test_largest_rock_comes_from_the_area():
    kinds = (population(k=0.1, diameter_m=(0.5, None)), population("b", diameter_m=(0.1, 0.6)))
    rocks = RocksSpec(populations=tuple(kind.with_diameters(1e4) for kind in kinds))
    check_rocks(rocks, (100.0, 100.0))
    assert largest_rock(rocks) == pytest.approx(1.743, abs=1e-3)
    assert largest_rock(RocksSpec()) == 0.0
