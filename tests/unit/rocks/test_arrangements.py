"""Where rocks lie: around craters, by images and slopes, off exclusion_zones and listed rocks."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull, cKDTree
from scipy.stats import chi2, norm

from terrain_forge.base import DataError, RecipeError
from terrain_forge.model import ExclusionZone, Window, rotations
from terrain_forge.rocks import (
    Clustered,
    Golombek,
    PopulationSpec,
    RockListSpec,
    RocksSpec,
    check_packing,
    check_rocks,
    embed,
    expected,
    make_intensity,
    weights,
)
from terrain_forge.rocks.arrangement import AroundCraters, Crater, crowding
from terrain_forge.rocks.embedding.footprint import bounds
from terrain_forge.rocks.scattering.intensity import crater_bounds
from terrain_forge.rocks.scattering.size_classes import DYNAMIC_SPACE
from tests.helpers import worlds
from tests.helpers.scattering import CLUSTERED, LIBRARY, image, listed, rough, run, sand, site

COLUMNS = (
    "id",
    "population",
    "prototype",
    "xy",
    "yaw",
    "buried",
    "diameter",
    "dynamic",
    "collides",
)

# Craters

CRATERS = (
    Crater(centre_m=(-8.0, 3.0), diameter_m=16.0),
    Crater(centre_m=(12.0, -4.0), diameter_m=12.0, age_ga=1.0),
)


def test_density_falls_from_the_rim():
    rings = np.array([0.0, 0.5, 1.0, 1.1, 1.25, 1.5, 1.75, 2.0, 2.2])
    crater = Crater(centre_m=(1.0, -2.0), diameter_m=22.0, age_ga=0.5)
    spec = sand(20.0, arrangement=AroundCraters(craters=(crater,)))
    x = np.linspace(0.0, 2.2, 200001)
    profile = np.where(x < 1, 0.05, np.exp(-(x - 1) / 0.7) * (x <= 2)) * 2 * np.pi * x * 121.0
    rising = np.concatenate([[0.0], np.cumsum(0.5 * (profile[1:] + profile[:-1]) * x[1])])
    wanted = 20.0 * (1 - 0.5 / 4) ** 3 * np.diff(np.interp(rings, x, rising))
    found = np.zeros(8)
    for seed in range(3):
        xy = run(site(seed=seed), spec).xy
        found += np.histogram(np.hypot(*(xy - (1.0, -2.0)).T) / 11.0, rings)[0]
    wanted *= 3
    assert found[-1] == 0
    assert (np.square(found - wanted)[:-1] / wanted[:-1]).sum() < chi2.isf(0.001, 7)


def test_no_rock_is_larger_than_its_crater_throws():
    spec = PopulationSpec(
        name="blocks",
        size_frequency=Golombek(k=0.1),
        diameter_m=(0.1, 3.0),
        arrangement=AroundCraters(craters=CRATERS),
    )
    found = run(site(), spec)
    limits = 0.25 * np.array([16.0, 12.0]) ** 0.7
    near = [np.hypot(*(found.xy - c.centre_m).T) < c.diameter_m for c in CRATERS]
    assert np.all(near[0] | near[1])
    assert found.diameter[~near[0]].max() <= limits[1] < limits[0]
    assert found.diameter.max() <= limits[0]
    expectation = expected(spec, site=site(), window=site().window)
    assert [limit for _, limit in expectation.parts] == pytest.approx(limits)


def test_overlapping_craters_add_and_cells_bound_them():
    craters = (*CRATERS, Crater(centre_m=(-2.0, 6.0), diameter_m=9.0, age_ga=0.2))
    spec = sand(5.0, arrangement=AroundCraters(craters=craters))
    place = site()
    intensity = make_intensity((spec,), place)
    xy = np.random.default_rng(1).uniform((-30, -25), (30, 25), (20000, 2))
    found = weights(intensity, 0, xy, np.full(len(xy), 0.02))
    alone = [
        weights(
            make_intensity((sand(arrangement=AroundCraters(craters=(crater,))),), place),
            0,
            xy,
            np.full(len(xy), 0.02),
        )
        for crater in craters
    ]
    np.testing.assert_allclose(found, np.sum(alone, axis=0), rtol=1e-12)
    direct = [sum(c.weight(x, y) for c in craters) for x, y in xy[:500]]
    np.testing.assert_allclose(found[:500], direct, rtol=1e-12)
    bounds = crater_bounds(intensity, 0, 0.02, 37, 23)
    cell = np.floor((xy / (60.0, 50.0) + 0.5) * (37, 23)).astype(int)
    assert np.all(found <= bounds[cell[:, 1], cell[:, 0]])
    counts = [len(run(site(seed=seed), spec)) for seed in range(5)]
    mean = 5.0 * expected(spec, site=place, window=place.window).area
    assert abs(sum(counts) - 5 * mean) < norm.isf(0.0005) * (5 * mean) ** 0.5


def test_a_place_asks_the_craters_that_reach_it():
    """Hundreds, some as large as the site: as much as the sum over all, wherever the cells end."""
    rng = np.random.default_rng(3)
    size = 0.5 * rng.power(0.4, 400) ** -1.2
    size[:3] = 90.0
    where = rng.uniform((-40, -35), (40, 35), (400, 2))
    craters = tuple(
        Crater(centre_m=(x, y), diameter_m=min(d, 90.0))
        for (x, y), d in zip(where.tolist(), size.tolist(), strict=True)
    )
    around = AroundCraters(craters=craters)
    intensity = make_intensity((sand(), sand(arrangement=around)), site())
    xy = np.concatenate([rng.uniform((-30, -25), (30, 25), (300, 2)), [(30, 25), (-30, -25)]])
    found = weights(intensity, 1, xy, np.zeros(len(xy)))
    assert np.ptp(found) > 1.0
    np.testing.assert_allclose(found, sum(c.weight(*xy.T) for c in craters), rtol=1e-12)
    turn = 2.0 * np.pi * np.arange(72) / 72
    rims = [
        np.add(
            c.centre_m, 0.5 * c.diameter_m * (1 + 1e-9) * np.stack([np.cos(turn), np.sin(turn)], 1)
        )
        for c in craters
    ]
    x, y = np.concatenate(rims).T
    most = max(sum(c.weight(x, y) for c in craters))
    assert crowding(around) == pytest.approx(most, rel=1e-12)


@pytest.mark.parametrize("number", [3, 977, 3000])
def test_expected_area_around_many_craters_is_as_sure_as_around_few(number):
    """The fewer points around each of many are not all wrong in the same way."""
    where = np.random.default_rng(4).uniform((-28, -23), (28, 23), (number, 2)).tolist()
    craters = tuple(Crater(centre_m=(x, y), diameter_m=1.0) for x, y in where)
    spec = sand(arrangement=AroundCraters(craters=craters))
    wanted = number * craters[0].effective_area
    found = expected(spec, site=site(), window=site().window).area
    assert found == pytest.approx(wanted, rel=1e-4)


def test_expected_area_of_a_small_part_of_large_craters():
    """Some of their rims cross the window, whose share of them is a thousandth."""
    centres = [(40.0, 30.0), (-90.0, 10.0), (5.0, -120.0)]
    craters = tuple(Crater(centre_m=centre, diameter_m=100.0) for centre in centres)
    spec = sand(arrangement=AroundCraters(craters=craters))
    window = Window(column=100, row=90, columns=40, rows=20)
    west, south = (axis[0] for axis in site().axes(window))
    side = site().spacing
    east, north = (np.arange(20 * n) + 0.5 for n in (window.columns, window.rows))
    x, y = np.meshgrid(west + side / 20 * east, south + side / 20 * north)
    wanted = sum(float(crater.weight(x, y).sum()) for crater in craters) * (side / 20) ** 2
    found = expected(spec, site=site(), window=window).area
    assert found == pytest.approx(wanted, rel=1e-3)


def test_expected_area_around_a_crater():
    """π R² (0.05 + 2 ∫ x exp((1 - x) / 0.7) dx from 1 to 2), half of it in half of the site."""
    crater = Crater(centre_m=(0.0, 1.0), diameter_m=20.0)
    spec = sand(arrangement=AroundCraters(craters=(crater,)))
    wanted = np.pi * 100.0 * (0.05 + 1.4 * (1.7 - 2.7 * np.exp(-1 / 0.7)))
    place = site()
    half = Window(column=0, row=0, columns=120, rows=200)
    assert expected(spec, site=place, window=place.window).area == pytest.approx(wanted, rel=3e-3)
    assert expected(spec, site=place, window=half).area == pytest.approx(wanted / 2, rel=3e-3)


# Images and slopes


def test_image_thins_the_rocks_out():
    """Black and white halves, and grey in between, as bilinear between the pixels' centres."""
    values = np.repeat([[0.0, 0.0, 0.25, 1.0, 1.0, 1.0]], 2, axis=0)
    place = site(images=(image(values),))
    spec = sand(2.0, density_image="map.png")
    found = [run(place.replace(seed=seed), spec).xy for seed in range(2)]
    edges = np.linspace(-30.0, 30.0, 13)
    counts = np.histogram(np.concatenate(found)[:, 0], edges)[0]
    weight = np.interp(np.linspace(-29.99, 29.99, 3000), np.linspace(-25, 25, 6), values[0])
    wanted = 2 * 2.0 * 50.0 * weight.reshape(12, -1).mean(axis=1) * 5.0
    assert np.all(counts[:3] == 0)
    assert (np.square(counts - wanted)[3:] / wanted[3:]).sum() < chi2.isf(0.001, 9)
    area = expected(spec, site=place, window=place.window).area
    assert 4.0 * area == pytest.approx(wanted.sum(), rel=1e-3)


def test_image_lies_north_up():
    place = site(images=(image([[0.0, 0.0], [0.0, 1.0]]),))  # rows run north
    xy = run(place, sand(5.0, density_image="map.png")).xy
    assert np.all(xy[:, 0] > -15.0)
    assert np.all(xy[:, 1] > -12.5)
    assert np.mean(np.all(xy > 0.0, axis=1)) > 0.6


def test_image_takes_nobody_else_along():
    place = site(images=(image([[0.0, 1.0]]),))
    plain, thinned = run(place, sand(2.0)), run(place, sand(2.0, density_image="map.png"))
    kept = np.isin(plain.id, thinned.id)
    assert np.isin(thinned.id, plain.id).all()
    np.testing.assert_array_equal(plain.diameter[kept], thinned.diameter)
    assert np.mean(np.any(plain.xy[kept] != thinned.xy, axis=1)) < 0.02


@pytest.mark.parametrize("values", [[[0.0, 0.0]], [[0.5, 1.5]], [[-0.1, 1.0]]])
def test_images_that_hold_no_density_are_refused(values):
    with pytest.raises(DataError, match=r"map\.png (holds values from|is black)"):
        run(site(images=(image(values),)), sand(density_image="map.png"))


def test_no_rock_on_steep_ground():
    place = site()
    ground = rough(place)
    spec = PopulationSpec(
        name="a", size_frequency=Golombek(k=0.02), diameter_m=(0.05, 0.2), max_slope_deg=20.0
    )
    free = spec.__class__(**{**vars(spec), "max_slope_deg": None})
    found, everywhere = run(place, spec, ground=ground), run(place, free)

    def slope(xy):
        east = np.cos(xy[:, 0] / 3) / 3
        north = -np.sin(xy[:, 1] / 2.5) / 2.5
        return np.degrees(np.arctan(np.hypot(east, north)))

    assert slope(found.xy).max() < 20.1
    flat = slope(everywhere.xy) <= 20.0
    assert 0.1 < flat.mean() < 0.9
    surely = slope(everywhere.xy) <= 16.0  # all but a few that had to move there
    assert np.isin(everywhere.id[surely], found.id).mean() > 0.97
    u, v = np.modf((found.xy - (-30.0, -25.0)) / place.spacing)
    (i, j), z, southern = v.astype(int).T, ground.elevation, u[:, 0] >= u[:, 1]
    east = np.where(southern, z[j, i + 1] - z[j, i], z[j + 1, i + 1] - z[j + 1, i])
    north = np.where(southern, z[j + 1, i + 1] - z[j, i + 1], z[j + 1, i] - z[j, i])
    rise = np.hypot(east, north) / place.spacing
    assert rise.max() <= np.tan(np.radians(20.0))  # of the surface itself, too
    area = expected(spec, site=place, window=place.window, ground=ground).area
    grid = np.stack(np.meshgrid(np.linspace(-30, 30, 900), np.linspace(-25, 25, 900)), -1)
    wanted = 3000.0 * np.mean(slope(grid.reshape(-1, 2)) <= 20.0)
    assert 0.9 * wanted < area < wanted  # a cell counts as its steepest node
    mean = area * float(-np.diff(spec.size_frequency.cumulative_number(np.array([0.05, 0.2])))[0])
    assert abs(len(found) - mean) < norm.isf(0.0005) * mean**0.5


def test_no_rock_on_a_steep_triangle_between_flat_nodes():
    """Ripples of two nodes' length have level central differences and steep triangles."""
    place = site((20.0, 20.0))
    ground = worlds.shaped(place, lambda x, _: np.where(x > 0, 0.5 * (np.arange(x.size) % 2), 0.0))
    spec = sand(5.0, max_slope_deg=20.0)
    assert run(place, spec, ground=ground).xy[:, 0].max() < 0.0
    area = expected(spec, site=place, window=place.window, ground=ground).area
    assert area == pytest.approx(20.0 * 9.75)  # the last level cell has a steep node


def test_ground_that_is_too_steep_everywhere_is_refused():
    place = site((20.0, 20.0))
    ground = worlds.shaped(place, lambda x, _: x)
    with pytest.raises(RecipeError, match=r"no place is left for 'sand' .* slope limit"):
        run(place, sand(max_slope_deg=40.0), ground=ground)
    part = Window(column=4, row=4, columns=20, rows=20)
    assert len(run(place, sand(max_slope_deg=40.0), ground=ground, window=part)) == 0


# Clearings and lists


def test_clearings_hold_no_tall_rock():
    circles = (
        ExclusionZone(centre=(5.0, 4.0), radius=6.0, clearance=0.0),
        ExclusionZone(centre=(-20.0, 0.0), radius=4.0, clearance=0.3),
    )
    place = site(exclusion_zones=circles)
    spec = PopulationSpec(name="a", size_frequency=Golombek(k=0.2), diameter_m=(0.1, 1.5))
    free, found = run(site(), spec), run(place, spec)
    for centre, radius, clearance in ((c.centre, c.radius, c.clearance) for c in circles):
        away = np.hypot(*(found.xy - centre).T) - 0.8 * found.diameter
        assert np.all(away[found.diameter > clearance] >= radius)  # the test library's rise is 1
    low = np.hypot(*(found.xy - (-20.0, 0.0)).T) < 4.0
    assert np.count_nonzero(low) > 20
    assert np.isin(found.id, free.id).all()
    held = expected(spec, site=place, window=place.window).area
    assert held == pytest.approx(3000.0 - np.pi * 52.0, rel=1e-4)


def test_listed_rocks_lie_as_they_are_and_others_keep_off():
    rows = [(0.0, 0.0, 2.0), (1.1, 0.0, 0.5), (-12.0, 7.0, 4.0), (29.0, -24.0, 0.15)]
    place = site(tables=(listed(rows),))
    spec = PopulationSpec(name="a", size_frequency=Golombek(k=0.3), diameter_m=(0.1, 2.0))
    own = RockListSpec(name="mine", file="rocks.csv")
    found, free = run(place, spec, lists=(own,)), run(place, spec)
    assert found.populations == ("a", "mine")
    mine = found.population == 1
    np.testing.assert_array_equal(found.id[mine], 2**25 + np.arange(4))
    np.testing.assert_array_equal(found.xy[mine], np.array(rows)[:, :2])
    np.testing.assert_array_equal(found.diameter[mine], np.array(rows)[:, 2])
    np.testing.assert_array_equal(found.id[~mine], free.id)
    np.testing.assert_array_equal(found.diameter[~mine], free.diameter)
    assert np.any(found.xy[~mine] != free.xy)
    assert found.unplaced == (free.unplaced[0], 0)
    for x, y, diameter in rows:
        away = np.hypot(*(found.xy[~mine] - (x, y)).T)
        assert np.all(away > 0.35 * (diameter + found.diameter[~mine]))
    assert np.all((found.buried[mine] >= 0.05) & (found.buried[mine] <= 0.5))


def test_listed_rocks_keep_what_is_listed():
    columns = ("x_m", "y_m", "diameter_m", "yaw_deg", "buried_fraction", "prototype")
    place = site(tables=(listed([(1, 2, 0.5, 90.0, 0.25, 2), (3, 4, 0.6, 0.0, 0.1, 0)], columns),))
    found = run(place, lists=(RockListSpec(name="mine", file="rocks.csv"),))
    np.testing.assert_allclose(found.yaw, [np.pi / 2, 0.0])
    np.testing.assert_array_equal(found.buried, [0.25, 0.1])
    np.testing.assert_array_equal(found.prototype, [2, 0])


# All of them


def everything():
    """A site with all that can be, and its populations and lists."""
    random = np.random.default_rng(8)
    rows = np.column_stack(
        [random.uniform((-28, -23), (28, 23), (60, 2)), random.uniform(0.1, 1.5, 60)]
    )
    place = site(
        images=(image(random.uniform(0.0, 1.0, (7, 9))),),
        tables=(listed(rows),),
        exclusion_zones=(ExclusionZone(centre=(3.0, -3.0), radius=5.0, clearance=0.0),),
    )
    law = Golombek(k=0.06)
    sizes = (0.1, 1.0)
    kinds = (
        PopulationSpec(name="plain", size_frequency=law, diameter_m=(0.15, None)),
        PopulationSpec(
            name="clusters",
            size_frequency=Golombek(k=0.03),
            diameter_m=sizes,
            arrangement=CLUSTERED,
            dynamic_m=(0.1, 0.25),
        ),
        PopulationSpec(
            name="craters",
            size_frequency=law,
            diameter_m=sizes,
            arrangement=AroundCraters(craters=CRATERS),
            max_slope_deg=25.0,
        ),
        PopulationSpec(
            name="image",
            size_frequency=law,
            diameter_m=sizes,
            density_image="map.png",
            collision_min_m=0.2,
        ),
        PopulationSpec(
            name="both",
            size_frequency=Golombek(k=0.02),
            diameter_m=sizes,
            arrangement=CLUSTERED,
            density_image="map.png",
            max_slope_deg=30.0,
        ),
    )
    return place, kinds, (RockListSpec(name="mine", file="rocks.csv"),)


def test_any_window_equals_the_cut_of_the_whole():
    place, kinds, lists = everything()
    ground = rough(place)
    whole = run(place, *kinds, lists=lists, ground=ground)
    assert np.all(np.bincount(whole.population, minlength=6) > 30)
    radius = 0.8 * whole.diameter * np.where(whole.dynamic, DYNAMIC_SPACE, 1.0)
    random = np.random.default_rng(3)
    for n in range(6):
        column, row = (int(random.integers(0, high)) for high in (238, 198))
        most = (3, 3) if n % 2 else (240 - column, 200 - row)
        columns, rows = (int(random.integers(1, high)) for high in most)
        window = Window(column=column, row=row, columns=columns, rows=rows)
        east, north = place.axes(window)
        outside = np.abs(whole.xy - (east.mean(), north.mean()))
        outside -= (0.5 * np.ptp(east), 0.5 * np.ptp(north))
        inside = np.hypot(*np.maximum(outside, 0.0).T) <= radius
        part = run(place, *kinds, lists=lists, window=window, ground=ground)
        for name in COLUMNS:
            np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[inside])


def plan_hulls(field, library):
    """Convex hull in plan of each whole rock, buried parts too, counter-clockwise [m]."""
    turns = rotations(field)
    hulls = []
    for n in range(len(field)):
        points = field.scale[n] * library.prototypes[field.prototype[n]].meshes[0].vertices
        plan = (points @ turns[n].T)[:, :2] + field.position[n, :2]
        hulls.append(plan[ConvexHull(plan).vertices])
    return hulls


def apart(one, other):
    """Whether an edge of one of two convex polygons has all of the other one beyond it."""
    for polygon, points in ((one, other), (other, one)):
        ahead = np.roll(polygon, -1, axis=0) - polygon
        away = points[:, None] - polygon
        if np.any(np.all(ahead[:, 0] * away[..., 1] - ahead[:, 1] * away[..., 0] < 0.0, axis=0)):
            return True
    return False


@pytest.mark.slow
def test_no_two_plan_outlines_overlap():
    """All pairs, however the rocks lie on rough ground; two listed rocks may overlap."""
    place, kinds, lists = everything()
    shapes = [p.replace(reach=bounds(p.meshes[0])[0]) for p in LIBRARY.prototypes]
    library, ground = LIBRARY.replace(prototypes=tuple(shapes)), rough(place)
    dense = PopulationSpec(name="dense", size_frequency=Golombek(k=0.2), diameter_m=(0.3, 2.0))
    found = run(place, *kinds, dense, lists=lists, library=library, ground=ground)
    field = embed(scattered=found, library=library, ground=ground, density=np.ones(7))
    mine = field.population == 6
    hulls = plan_hulls(field, library)
    middle = np.array([hull.mean(axis=0) for hull in hulls])
    widest = np.array([np.hypot(*(h - m).T).max() for h, m in zip(hulls, middle, strict=True)])
    near = cKDTree(middle).query_pairs(2.0 * widest.max(), output_type="ndarray")
    close = np.hypot(*(middle[near[:, 0]] - middle[near[:, 1]]).T) < widest[near].sum(axis=1)
    touching = [pair for pair in near[close] if not apart(*(hulls[n] for n in pair))]
    assert len(near[close]) > 500
    assert [pair for pair in touching if not mine[pair].all()] == []


def test_dynamic_and_visual_rocks():
    place, kinds, lists = everything()
    found = run(place, *kinds, lists=lists, ground=rough(place))
    clusters, pictures = found.population == 1, found.population == 3
    dynamic = clusters & (found.diameter >= 0.1) & (found.diameter <= 0.25)
    np.testing.assert_array_equal(found.dynamic, dynamic)
    assert np.all(found.buried[dynamic] == 0.0)
    assert np.all(found.buried[~dynamic] > 0.0)
    np.testing.assert_array_equal(found.collides, ~(pictures & (found.diameter < 0.2)))


def test_families_choose_the_shapes():
    names = ("block", "slab", "block")
    library = LIBRARY.replace(
        prototypes=tuple(
            shape.replace(family=name)
            for shape, name in zip(LIBRARY.prototypes, names, strict=True)
        )
    )
    kinds = (sand(name="slabs", families=("slab",)), sand(name="blocks", families=("block",)))
    found = run(site(), *kinds, library=library)
    assert np.all(found.prototype[found.population == 0] == 1)
    blocks = found.prototype[found.population == 1]
    assert set(blocks) == {0, 2}
    assert abs(np.mean(blocks == 0) - 0.5) < norm.isf(0.0005) * 0.5 / len(blocks) ** 0.5
    with pytest.raises(RecipeError, match="no shape of the family 'dust'"):
        run(site(), sand(families=("dust",)), library=library)


def test_crowding():
    own = 1.0 / (4.0 * np.pi * 0.03 * 2.25)
    assert crowding(CLUSTERED) == pytest.approx(1.0 + 2.0 * own + own**0.5)
    assert crowding(AroundCraters(craters=CRATERS[:1])) == pytest.approx(1.0)
    same = AroundCraters(craters=(CRATERS[0], CRATERS[0]))
    assert crowding(same) == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("k", "more"),
    [
        (0.3, {}),
        (0.3, {"dynamic_m": (0.1, 1.5)}),
        (0.16, {"arrangement": Clustered(clusters_per_m2=0.02, radius_m=2.5)}),
        (0.038, {"arrangement": Clustered(clusters_per_m2=0.0015, radius_m=3.0)}),
        (0.3, {"arrangement": AroundCraters(craters=CRATERS)}),
        (0.3, {"density_image": "map.png"}),
    ],
)
def test_nearly_all_rocks_find_a_place(k, more):
    """About as dense as check_rocks lets pass."""
    law = Golombek(k=k)
    spec = PopulationSpec(name="a", size_frequency=law, diameter_m=(0.1, 1.5), **more)
    check_rocks(RocksSpec(populations=(spec,)), (60.0, 50.0))
    check_packing((spec,), (60.0, 50.0), lambda: LIBRARY)
    chess = np.indices((9, 9)).sum(axis=0) % 2
    found = [run(site(seed=seed, images=(image(chess),)), spec) for seed in range(1)]
    assert sum(sum(one.unplaced) for one in found) < 1e-3 * sum(map(len, found))
