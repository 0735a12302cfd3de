"""The verification of the rocks: sizes, numbers, cover, places, shapes and overlaps."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from scipy.integrate import quad
from scipy.optimize import linprog

from terrain_forge.base import matrix_from_quaternion
from terrain_forge.model import Route
from terrain_forge.rocks import (
    Clustered,
    Counts,
    Expectation,
    Golombek,
    PopulationSpec,
    PowerLaw,
    RockListSpec,
    RocksSpec,
    expected,
    find_overlaps,
    overlapping_pairs,
    scatter,
)
from terrain_forge.rocks.laws.sites import ABUNDANCES, FRAGMENTS
from terrain_forge.truth import shape_figures
from terrain_forge.truth.counts import ExpectedCounts
from terrain_forge.truth.size_frequency import size_frequency, write_size_frequency
from terrain_forge.truth.statistics import clark_evans, count_band
from tests.helpers import worlds
from tests.helpers.pictures import DRAW_AXIS
from tests.helpers.places import ROOT

ALPHA = 0.001


def population(name="rocks", *, k=0.07, diameter=(0.1, 1.5)):
    return PopulationSpec(name=name, size_frequency=Golombek(k=k), diameter_m=diameter)


def rocks(*populations, **others):
    return RocksSpec(populations=populations, **others)


def draw(random, spec, area):
    """Diameters by numerical inversion of the truncated law; Poisson number."""
    a, b = spec.diameter_m
    at = np.geomspace(a, b, 20001)
    above = spec.size_frequency.cumulative_number(at)
    count = random.poisson((above[0] - above[-1]) * area)
    u = random.uniform(above[-1], above[0], count)
    return np.interp(u, above[::-1], at[::-1])


def scattered(diameters, *, side=100.0, seed=11):
    """A flat square world with rocks of these diameters at random places."""
    count = sum(map(len, diameters))
    xy = np.random.default_rng(seed).uniform(-side / 2, side / 2, (count, 2))
    world = worlds.world(rocks=count)
    site = world.site.replace(size=(side, side), spacing=1.0)
    nodes = round(side) + 1
    return worlds.on_ground(
        world,
        world.ground.replace(
            elevation=np.zeros((nodes, nodes)), spacing=1.0, origin=(-side / 2, -side / 2)
        ),
        site=site,
        field=world.field.replace(
            populations=tuple(f"p{n}" for n in range(len(diameters))),
            population=np.repeat(np.arange(len(diameters)), list(map(len, diameters))),
            position=np.column_stack([xy, np.zeros(count)]),
            diameter=np.concatenate(diameters),
        ),
        unplaced=tuple(range(len(diameters))),
    )


def test_the_wanted_figures_are_the_golden_ones():
    spec = population("p0")
    found = size_frequency(scattered([np.array([0.2])]), rocks=rocks(spec))["populations"][0]
    assert found["count"]["expected"] == pytest.approx(13842.68, abs=0.01)
    assert found["cover"]["expected"] == pytest.approx(0.0469199, abs=1e-7)
    assert found["cover"]["standard_deviation"] == pytest.approx(0.00080622, abs=1e-8)


def test_right_samples_agree_and_kolmogorov_smirnov_is_scipys():
    random = np.random.default_rng(8)
    spec = population("p0", diameter=(0.2, 1.5))
    law = spec.size_frequency
    diameters = draw(random, spec, 1e4)
    found = size_frequency(scattered([diameters]), rocks=rocks(spec))["populations"][0]
    ends = law.cumulative_number(np.array(spec.diameter_m))

    def distribution(d):
        return (ends[0] - law.cumulative_number(d)) / (ends[0] - ends[1])

    exact = stats.kstest(diameters, distribution, method="exact")
    test = found["kolmogorov_smirnov"]
    assert test["distance"] == pytest.approx(exact.statistic, rel=1e-12)
    assert test["p_value"] == pytest.approx(exact.pvalue, abs=1e-3)
    assert test["critical_distance"] == pytest.approx(
        stats.kstwo.isf(0.05, len(diameters)), rel=1e-3
    )
    assert test["p_value"] > ALPHA
    cover = np.pi / 4 * np.sum(diameters**2) / 1e4
    assert found["cover"]["observed"] == pytest.approx(cover, rel=1e-12)
    for name in ("count", "cover"):
        assert abs(found[name]["z"]) < stats.norm.isf(ALPHA / 2)


@pytest.mark.parametrize("count", [5, 12, 60])
def test_kolmogorov_smirnov_holds_for_few_rocks(count):
    spec = population("p0", diameter=(0.2, 1.5))
    diameters = np.linspace(0.21, 0.55, count)
    found = size_frequency(scattered([diameters]), rocks=rocks(spec))["populations"][0]
    test = found["kolmogorov_smirnov"]
    assert test["p_value"] == pytest.approx(stats.kstwo.sf(test["distance"], count), abs=0.01)


def test_a_wrong_law_is_found_out():
    random = np.random.default_rng(9)
    diameters = draw(random, population(k=0.1, diameter=(0.2, 1.5)), 1e4)
    spec = population("p0", k=0.07, diameter=(0.2, 1.5))
    found = size_frequency(scattered([diameters]), rocks=rocks(spec))["populations"][0]
    assert found["kolmogorov_smirnov"]["p_value"] < ALPHA
    assert found["count"]["z"] > 10
    assert found["cover"]["z"] > 10


def test_populations_add_up_and_strangers_stay_out():
    random = np.random.default_rng(10)
    specs = [population("p0", diameter=(0.2, 0.5)), population("p1", diameter=(0.5, 1.5))]
    world = scattered([*(draw(random, spec, 1e4) for spec in specs), np.full(100, 5.0)])
    verification = size_frequency(world, rocks=rocks(*specs))
    one, two, both = *verification["populations"], verification["together"]
    for name in ("expected", "observed"):
        assert both["count"][name] == pytest.approx(one["count"][name] + two["count"][name])
        assert both["cover"][name] == pytest.approx(one["cover"][name] + two["cover"][name])
    assert both["diameter_m"] == [0.2, 1.5]
    assert both["kolmogorov_smirnov"]["p_value"] > ALPHA
    assert (one["unplaced"], two["unplaced"]) == (0, 1)


def test_the_band_is_the_poisson_one_and_the_curve_counts():
    spec = population("p0")
    diameters = draw(np.random.default_rng(12), spec, 1e4)
    curve = size_frequency(scattered([diameters]), rocks=rocks(spec))["populations"][0]["curve"]
    wanted = np.array(curve["number_expected"]) * 1e4
    for name, tail in (("number_low", 0.025), ("number_high", 0.975)):
        np.testing.assert_allclose(np.array(curve[name]) * 1e4, stats.poisson.ppf(tail, wanted))
    n = 20
    larger = diameters[diameters >= curve["diameter_m"][n]]
    assert curve["number_observed"][n] == pytest.approx(len(larger) / 1e4)
    assert curve["cover_observed"][n] == pytest.approx(np.pi / 4 * np.sum(larger**2) / 1e4)


def test_rocks_and_area_of_corridors_stay_out():
    random = np.random.default_rng(13)
    spec = population("p0", diameter=(0.2, 1.5))
    x = np.arange(-40, 40.05, 0.1)
    route = Route(
        name="straight",
        position=np.column_stack([x, np.full(len(x), 3.0)]),
        heading=np.zeros(len(x)),
        distance=x - x[0],
        closed=False,
        speed=0.3,
        corridor_width=8.0,
        corridor_clearance=0.15,
    )
    world = scattered([draw(random, spec, 1e4)])
    world = world.replace(site=world.site.replace(routes=(route,)))
    swept = np.hypot(np.maximum(np.abs(world.field.position[:, 0]) - 40, 0),
                     world.field.position[:, 1] - 3.0) < 4.0  # fmt: skip
    verification = size_frequency(
        world.replace(field=world.field.select(~swept)), rocks=rocks(spec)
    )
    assert verification["corridor_area_m2"] == pytest.approx(80 * 8 + np.pi * 16, rel=2e-3)
    assert verification["together"]["count"]["observed"] == np.sum(~swept)
    assert abs(verification["together"]["count"]["z"]) < stats.norm.isf(ALPHA / 2)
    with_swept = size_frequency(world, rocks=rocks(spec))["together"]
    for name in ("count", "kolmogorov_smirnov", "clark_evans", "curve"):
        assert with_swept[name] == verification["together"][name]
    listed = rocks(lists=(RockListSpec(name="p0", file="mine.csv"),))
    assert size_frequency(world, rocks=listed)["lists"][0]["in_corridors"] == np.sum(swept)


def test_clark_evans_tells_random_from_even_and_clustered():
    random = np.random.default_rng(14)
    points = random.uniform(0, 100, (2000, 2))
    assert abs(clark_evans(points, 1e4, 400.0)["z"]) < stats.norm.isf(ALPHA / 2)
    lattice = np.stack(np.meshgrid(np.arange(30.0), np.arange(30.0)), -1).reshape(-1, 2)
    even = clark_evans(lattice, 900.0, 120.0)
    # 2 without edges; Donnelly's expectation is 1 + 2 (0.0514 + 0.041/30) 4·30/900 times larger.
    assert even["ratio"] == pytest.approx(2.0 / (1 + 2 * (0.0514 + 0.041 / 30) * 120 / 900))
    assert clark_evans(points * 0.5, 1e4, 400.0)["z"] < -10
    assert clark_evans(points[:1], 1e4, 400.0) is None


def test_bands_of_counts_are_poisson_or_negative_binomial():
    mean = np.array([0.0, 0.01, 0.3, 2.0, 10.0, 100.0, 1e4])
    low, high = count_band(mean, mean)
    np.testing.assert_array_equal(low, stats.poisson.ppf(0.025, mean))
    np.testing.assert_array_equal(high, stats.poisson.ppf(0.975, mean))
    excess = 0.05
    low, high = count_band(mean[1:], mean[1:] + excess * mean[1:] ** 2)
    shape = 1 / excess, 1 / (1 + excess * mean[1:])
    np.testing.assert_array_equal(low, stats.nbinom.ppf(0.025, *shape))
    np.testing.assert_array_equal(high, stats.nbinom.ppf(0.975, *shape))


def clustered(name="p0", **others):
    return PopulationSpec(
        name=name,
        size_frequency=Golombek(k=0.05),
        diameter_m=(0.2, 1.0),
        arrangement=Clustered(clusters_per_m2=0.02, radius_m=1.5),
        **others,
    )


def test_clusters_scatter_more_than_poisson_by_just_what_is_stated():
    spec, shapes, seeds = clustered(), worlds.library(), 24
    site = worlds.site().replace(size=(60.0, 60.0), spacing=1.0)
    squares, poisson = [], []
    for seed in range(seeds):
        here = site.replace(seed=seed)
        wanted = ExpectedCounts(
            law=spec.size_frequency,
            smallest=0.2,
            expectation=expected(spec, site=here, window=here.window),
        )
        found = scatter(site=here, populations=(spec,), library=shapes, window=here.window)
        count = np.count_nonzero(np.abs(found.xy).max(axis=1) <= 30.0) + sum(found.unplaced)
        off = (count - wanted.number_above(0.2)) ** 2
        squares.append(off / wanted.number_variance_above(0.2))
        poisson.append(off / wanted.number_above(0.2))
    low, high = stats.chi2.ppf([ALPHA / 2, 1 - ALPHA / 2], seeds)
    assert low < np.sum(squares) < high
    assert np.sum(poisson) > high


def test_parts_of_a_law_add_up_and_end_at_their_largest_rock():
    law = Golombek(k=0.05)
    parts = ((100.0, 0.5), (50.0, 1.2), (10.0, 0.1))
    wanted = ExpectedCounts(
        law=law, smallest=0.2, expectation=Expectation(parts=parts, area_variance=160.0**2 * 0.01)
    )
    at = np.array([0.1, 0.3, 0.7, 1.3])
    number = [
        sum(
            area * quad(lambda d: np.exp(law.log_density(d)), max(low, 0.2), high)[0]
            for area, high in parts
            if high > max(low, 0.2)
        )
        for low in at
    ]
    np.testing.assert_allclose(wanted.number_above(at), number, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(
        wanted.number_variance_above(at), np.array(number) + 0.01 * np.array(number) ** 2
    )
    disc = [
        sum(
            area
            * quad(lambda d: (np.pi / 4 * d * d) ** 2 * np.exp(law.log_density(d)), low, high)[0]
            for area, high in parts
            if high > low
        )
        for low in at[1:]
    ]
    covered = wanted.area_above(at[1:])
    np.testing.assert_allclose(
        wanted.area_variance_above(at[1:]), np.array(disc) + 0.01 * covered**2, rtol=1e-9
    )
    assert wanted.largest == 1.2


def test_dynamic_rocks_and_those_for_the_eye_are_counted():
    diameters = np.array([0.2, 0.25, 0.3, 0.35, 0.4, 0.5])
    world = scattered([diameters])
    dynamic = np.array([False, True, True, False, False, False])
    solid = np.array([False, True, True, True, True, True])
    world = world.replace(field=world.field.replace(dynamic=dynamic, collides=solid))
    spec = replace(population("p0", diameter=(0.15, 1.0)), dynamic_m=(0.25, 0.35))
    found = size_frequency(world, rocks=rocks(spec))["populations"][0]
    assert found["dynamic"] == {"expected": 3, "dynamic": 2, "fixed": 1}
    assert found["visual_only"] == 1
    plain = size_frequency(world, rocks=rocks(population("p0", diameter=(0.15, 1.0))))
    assert plain["populations"][0]["dynamic"] is None


def test_listed_rocks_stand_apart_and_their_overlaps_are_no_fault():
    # Two listed rocks overlap each other; a scattered one overlaps one of them.
    world = scattered([np.array([1.0]), np.array([1.0, 1.0])])
    position = np.array([(10.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.3, 0.0, 0.0)])
    world = world.replace(field=world.field.replace(position=position, scale=np.ones(3)))
    wanted = rocks(
        population("p0", diameter=(0.2, 1.5)), lists=(RockListSpec(name="p1", file="mine.csv"),)
    )
    verification = size_frequency(world, rocks=wanted)
    assert [part["name"] for part in verification["populations"]] == ["p0"]
    assert verification["together"]["count"]["observed"] == 1
    (listed,) = verification["lists"]
    assert (listed["file"], listed["count"]) == ("mine.csv", {"observed": 2})
    assert listed["cover"]["observed"] == pytest.approx(2 * np.pi / 4 / 1e4)
    assert verification["overlaps"] == {"pairs": 0, "first": None, "of_listed_rocks": 1}
    position[0] = (-0.3, 0.0, 0.0)
    world = world.replace(field=world.field.replace(position=position))
    overlaps = size_frequency(world, rocks=wanted)["overlaps"]
    assert overlaps == {"pairs": 2, "first": (0, 1), "of_listed_rocks": 1}


def test_populations_without_any_rock_are_said_to_have_none(tmp_path):
    world = scattered([np.zeros(0)])
    write_size_frequency(world, tmp_path, rocks=rocks(population("p0")))
    found = json.loads((tmp_path / "size_frequency.json").read_text())["populations"][0]
    assert found["count"]["observed"] == 0
    assert found["kolmogorov_smirnov"] is None
    assert found["clark_evans"] is None
    few = PowerLaw(number_per_m2=1e-9, exponent=2.0)
    none = PopulationSpec(name="p0", size_frequency=few, diameter_m=(0.5, None))
    none = none.with_diameters(1e4)
    write_size_frequency(world, tmp_path, rocks=rocks(none))  # any warning fails the test
    (found,) = json.loads((tmp_path / "size_frequency.json").read_text())["populations"]
    assert (found["count"]["expected"], found["count"]["observed"]) == (0.0, 0)
    write_size_frequency(world, tmp_path, rocks=rocks())
    assert json.loads((tmp_path / "size_frequency.json").read_text())["together"] is None


def test_laws_tell_where_they_go_on_beyond_the_count():
    counts = Counts(area_m2=40.0, diameters_m=(0.3, 0.35, 0.5, 0.45, 0.9, 0.6))
    world = scattered([np.zeros(0)])
    for smallest, beyond in ((0.2, 0.3), (0.3, None), (None, None)):
        spec = PopulationSpec(name="p0", size_frequency=counts, diameter_m=(smallest, 2.0))
        (found,) = size_frequency(world, rocks=rocks(spec.with_diameters(1e4)))["populations"]
        assert found["law"].get("extrapolated_below_m") == beyond


def test_counts_are_drawn_over_the_curve_and_told_apart_from_it(tmp_path):
    """Rocks drawn as the law says, of a law that does not fit the count it was made from."""
    bins = ((0.5, 0.7, 53), (0.7, 1.0, 35), (1.0, 1.4, 33), (1.4, 2.0, 22), (2.0, None, 90))
    counts = Counts(area_m2=2000.0, bins=bins)
    spec = PopulationSpec(name="p0", size_frequency=counts, diameter_m=(0.1, 2.5))
    world = scattered([draw(np.random.default_rng(4), spec, 400.0)], side=20.0)
    text, picture = write_size_frequency(world, tmp_path, rocks=rocks(spec))
    (found,) = json.loads(text.read_text())["populations"]
    assert found["kolmogorov_smirnov"]["p_value"] > ALPHA
    assert not found["fit_to_counts"]["fits"]
    plain = tmp_path / "plain"
    plain.mkdir()
    other = PopulationSpec(name="p0", size_frequency=counts.fitted.law, diameter_m=(0.1, 2.5))
    _, without = write_size_frequency(world, plain, rocks=rocks(other))
    assert picture.read_bytes() != without.read_bytes()


def test_burial_is_told_of_static_rocks_alone():
    world = scattered([np.full(8, 0.3)])
    buried = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.0, 0.0])
    diameter = np.where(buried > 0.0, 0.3, 0.2)
    world = world.replace(field=world.field.replace(buried_fraction=buried, diameter=diameter))
    spec = replace(population("p0", diameter=(0.15, 1.0)), dynamic_m=(0.15, 0.25))
    (found,) = size_frequency(world, rocks=rocks(spec))["populations"]
    assert found["burial"] == {
        "expected": pytest.approx(0.275),
        "observed": pytest.approx(0.35),
        "standard_deviation": pytest.approx(0.45 / np.sqrt(72.0)),
        "deeper": 1,
    }


def test_any_name_can_be_drawn(tmp_path, monkeypatch):
    monkeypatch.setattr("matplotlib.axis.Axis.draw", DRAW_AXIS)
    spec = population("_a$ {b_$", diameter=(0.2, 1.5))
    world = scattered([draw(np.random.default_rng(16), spec, 1e4)])
    world = world.replace(field=world.field.replace(populations=(spec.name,)))
    write_size_frequency(world, tmp_path, rocks=rocks(spec))
    assert (tmp_path / "size_frequency.png").stat().st_size > 5_000


# Shapes and overlaps


def test_a_mesh_is_closed_only_as_a_whole_and_outward():
    mesh = worlds.library().prototypes[0].meshes[0]
    assert mesh.is_closed
    assert not mesh.replace(faces=mesh.faces[1:]).is_closed
    assert not mesh.replace(faces=mesh.faces[:, ::-1]).is_closed
    one_turned = mesh.faces.copy()
    one_turned[3] = one_turned[3, ::-1]
    assert not mesh.replace(faces=one_turned).is_closed
    assert not mesh.replace(faces=np.concatenate([mesh.faces, mesh.faces[:1]])).is_closed


def test_figures_of_the_shapes_are_the_worst_of_each():
    library = worlds.library()
    one, two, three = library.prototypes
    torn = three.replace(hulls=(one.hulls[0].replace(faces=one.hulls[0].faces[1:]),))
    prototypes = (one.replace(hull_excess=0.02), two.replace(hull_distance=0.07), torn)
    found = shape_figures(library.replace(prototypes=prototypes))
    assert (found["count"], found["watertight"]) == (3, 2)
    assert (found["largest_hull_excess"], found["largest_hull_distance"]) == (0.02, 0.07)
    assert found["shapes"][1]["axes"] == pytest.approx(np.ptp(two.meshes[0].vertices, axis=0))


def outlines_overlap(one, other):
    """Whether two sets of points can be parted by a line: a linear programme."""
    # a·p ≤ b - 1 for one's points, a·p ≥ b + 1 for the other's.
    rows = np.vstack([np.column_stack([one, -np.ones(len(one))]),
                      np.column_stack([-other, np.ones(len(other))])])  # fmt: skip
    found = linprog(np.zeros(3), rows, -np.ones(len(rows)), bounds=(None, None))
    return found.status == 2


def test_overlaps_are_those_of_a_linear_programme_for_every_pair():
    world = worlds.world(rocks=20)
    field = world.field.replace(position=0.4 * world.field.position)
    plans = []
    for n in range(len(field)):
        turn = matrix_from_quaternion(field.quaternion[n])[:2]
        mesh = world.library.prototypes[field.prototype[n]].meshes[0]
        plans.append(field.scale[n] * mesh.vertices @ turn.T + field.position[n, :2])
    brute = [(a, b) for b in range(20) for a in range(b) if outlines_overlap(plans[a], plans[b])]
    assert len(brute) > 10
    assert overlapping_pairs(field, world.library) == sorted(brute)


def test_rocks_of_a_neighbouring_window_count_where_they_meet_ones_own():
    world = scattered([np.full(4, 1.0)])
    position = np.array([(0.0, 0, 0), (0.3, 0, 0), (9.0, 0, 0), (9.3, 0, 0)])
    field = world.field.replace(position=position, scale=np.ones(4))
    world = world.replace(
        field=field.select(np.array([0])), neighbours=field.select(np.array([1, 2, 3]))
    )
    assert find_overlaps(world, lists=()).scattered == [(0, 1)]


# Documentation


def test_landing_sites_are_documented_as_they_are():
    text = (ROOT / "docs" / "science.md").read_text(encoding="utf-8")
    rows = [row.split("|") for row in text.splitlines() if row.startswith("| `")]
    tables = {row[1].strip(" `"): [cell.strip() for cell in row[2:-1]] for row in rows}
    for site, preset in ABUNDANCES.items():
        if site.startswith("chang_e"):  # another spelling
            continue
        law, cells = Golombek(site=site), tables[site]
        assert float(cells[0]) == law.abundance
        assert float(cells[1].split(",")[0]) == pytest.approx(law.q, abs=0.006)
        assert ("fitted" in cells[1]) == (preset.q_per_m is not None)
        assert cells[3] == ("yes" if preset.verified else "no")
    for site, fragments in FRAGMENTS.items():
        number, power = tables[site][0].split("·10⁻")
        scale = 10.0 ** -"⁰¹²³⁴⁵⁶⁷⁸⁹".index(power)
        assert float(number) * scale == pytest.approx(fragments.number_per_m2)
        assert float(tables[site][1]) == fragments.exponent
