import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull, cKDTree

from terrain_forge.base import matrix_from_quaternion
from terrain_forge.model import Heightfield, Mesh, Window, rotations
from terrain_forge.rocks import (
    FOOT,
    Golombek,
    LibrarySpec,
    PopulationSpec,
    Scattered,
    embed,
    make_library,
    rock_margin,
    scatter,
)
from terrain_forge.rocks.embedding import outline
from terrain_forge.rocks.embedding.footprint import FOOTPRINT_DIRECTIONS, bounds, footprint
from terrain_forge.rocks.embedding.outline import convex_hull, mean_width
from tests.helpers import worlds
from tests.helpers.outlines import exposed_outline

LIBRARY = worlds.library()
DENSITY = (2900.0, 2500.0)
RANGES = ((0.05, 0.5), (0.05, 0.5))
PEBBLES = PopulationSpec(name="pebbles", size_frequency=Golombek(k=0.3), diameter_m=(0.15, 0.5))
BOULDERS = PopulationSpec(
    name="boulders", size_frequency=Golombek(k=0.3), diameter_m=(0.5, None)
).with_diameters(24.1 * 16.3)


def place(spacing=0.1):
    """A site whose lattice has no exact binary fractions, so that rounding shows."""
    return worlds.site().replace(size=(24.1, 16.3), spacing=spacing)


def ground(site, window=None):
    def rough(east, north):
        return worlds.hill(east, north) + 0.02 * np.sin(7.0 * east) * np.cos(9.0 * north)

    return worlds.shaped(site, rough, window)


def slope(site, rise_east, rise_north):
    return worlds.shaped(site, lambda x, y: 0.3 + rise_east * x + rise_north * y)


@pytest.fixture(scope="module")
def laid():
    site = place()
    scattered = scatter(
        site=site, populations=(PEBBLES, BOULDERS), library=LIBRARY, window=site.window
    )
    land = ground(site)
    return (
        land,
        scattered,
        embed(scattered=scattered, library=LIBRARY, ground=land, density=DENSITY, burial=RANGES),
    )


def placed_vertices(field, n):
    mesh = LIBRARY.prototypes[field.prototype[n]].meshes[0]
    return field.position[n] + field.scale[n] * mesh.vertices @ rotations(field)[n].T


def slow_diameter(points):
    """Mean of the diameter of a plan outline and the width across it, by brute force."""
    corners = points[ConvexHull(points).vertices]
    apart = corners[:, None] - corners[None, :]
    a, b = np.unravel_index(np.hypot(*np.moveaxis(apart, -1, 0)).argmax(), apart.shape[:2])
    length = np.hypot(*apart[a, b])
    across = corners @ np.array([-apart[a, b][1], apart[a, b][0]]) / length
    return 0.5 * (length + np.ptp(across))


def exposed_part(mesh, normal, point):
    """Corners of the part of a mesh above a plane, cut by trimesh."""
    vertices, faces, *_ = trimesh.intersections.slice_faces_plane(
        mesh.vertices, mesh.faces, normal, point
    )
    return vertices[np.unique(faces)]


def test_exposed_diameter_is_the_wanted_one(laid):
    """Cut by another library at the tangent plane, measured by brute force."""
    _, scattered, field = laid
    np.testing.assert_array_equal(field.diameter, scattered.diameter)
    off = []
    for n in range(0, len(field), 7):
        faces = LIBRARY.prototypes[field.prototype[n]].meshes[0].faces
        mesh = trimesh.Trimesh(placed_vertices(field, n), faces, process=False)
        normal = rotations(field)[n][:, 2]
        along = mesh.vertices @ normal
        level = along.min() + field.buried_fraction[n] * np.ptp(along)
        exposed = exposed_part(mesh, normal, level * normal)
        off.append(abs(slow_diameter(exposed[:, :2]) / field.diameter[n] - 1.0))
        height = ((exposed @ normal).max() - level) / normal[2]
        assert height == pytest.approx(field.height[n], rel=1e-6)
    assert max(off) < 2e-3
    assert np.quantile(off, 0.9) < 1e-6


def test_the_plane_passes_through_the_ground_under_the_centre(laid):
    land, _, field = laid
    for n in range(0, len(field), 11):
        normal = rotations(field)[n][:, 2]
        along = placed_vertices(field, n) @ normal
        level = along.min() + field.buried_fraction[n] * np.ptp(along)
        x, y, _ = field.position[n]
        on_ground = np.array([x, y, float(land.height_at(x, y))])
        assert on_ground @ normal == pytest.approx(level, abs=1e-6)


def test_rocks_lean_with_an_inclined_plane():
    """On a plane the rock's z is the plane's normal and nothing is sunk further than wanted."""
    site = place()
    scattered = scatter(site=site, populations=(BOULDERS,), library=LIBRARY, window=site.window)
    field = embed(
        scattered=scattered, library=LIBRARY, ground=slope(site, 0.3, -0.1), density=(2900.0,)
    )
    normal = np.array([-0.3, 0.1, 1.0]) / np.sqrt(1.1)
    np.testing.assert_allclose(
        rotations(field)[:, :, 2], np.tile(normal, (len(field), 1)), atol=1e-5
    )
    np.testing.assert_allclose(field.buried_fraction, scattered.buried, atol=1e-5)
    upright = rotations(
        embed(scattered=scattered, library=LIBRARY, ground=slope(site, 0, 0), density=(2900.0,))
    )
    np.testing.assert_allclose(
        np.arctan2(upright[:, 1, 0], upright[:, 0, 0]) % (2 * np.pi), scattered.yaw, atol=1e-6
    )


def test_steepest_tilt():
    site = place()
    scattered = scatter(site=site, populations=(BOULDERS,), library=LIBRARY, window=site.window)
    field = embed(
        scattered=scattered, library=LIBRARY, ground=slope(site, 1.5, 0), density=(2900.0,)
    )
    tilt = np.arccos(rotations(field)[:, 2, 2])
    np.testing.assert_allclose(tilt, outline.MAX_TILT, atol=1e-6)


def gaps(field, library, land, *, middles=True):
    """Largest height above the ground, over the diameter, of a loop around each rock's foot.

    The loop is cut by trimesh at the height of the foot; its corners count, and on demand the
    middles between them.
    """
    found = []
    for n in range(len(field)):
        mesh = library.prototypes[field.prototype[n]].meshes[0]
        solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        level = solid.bounds[0, 2] + FOOT * np.ptp(solid.bounds[:, 2])
        ends = trimesh.intersections.mesh_plane(solid, (0, 0, 1), (0, 0, level))
        points = np.concatenate([ends[:, 0], ends[:, 1], *([ends.mean(axis=1)] * middles)])
        points = field.position[n] + field.scale[n] * points @ rotations(field)[n].T
        above = points[:, 2] - land.height_at(points[:, 0], points[:, 1])
        found.append(above.max() / field.diameter[n])
    return np.array(found)


def test_no_daylight_under_any_rock(laid):
    land, scattered, field = laid
    gap = gaps(field, LIBRARY, land)
    assert np.quantile(gap, 0.99) < 0.002
    assert gap.max() < 0.01
    # Burial is as wanted in the mean.
    assert abs((field.buried_fraction - scattered.buried).mean()) < 0.005


def self_affine(random, degrees, exponent=-1.8, spacing=0.1):
    """Self-affine ground, 25.6 m wide, whose slopes over a spacing have an RMS of so much."""
    cells = 256
    waves = np.hypot(*np.meshgrid(np.fft.fftfreq(cells), np.fft.rfftfreq(cells), indexing="ij"))
    waves[0, 0] = np.inf
    phases = random.normal(size=waves.shape) + 1j * random.normal(size=waves.shape)
    heights = np.fft.irfft2(phases * waves**exponent, s=(cells, cells))
    rise = np.tan(np.radians(degrees)) * spacing
    heights *= rise / np.sqrt((np.diff(heights, axis=1) ** 2).mean())
    return Heightfield(elevation=heights, spacing=spacing, origin=(-12.5, -12.5))


def strewn(random, count, *, shapes):
    """Rocks of 0.2 to 2 m anywhere, to be buried evenly between 0.05 and 0.5."""
    return Scattered(
        populations=("rocks",),
        id=np.arange(count),
        population=np.zeros(count),
        prototype=random.integers(0, shapes, count),
        xy=random.uniform(-11.0, 11.0, (count, 2)),
        yaw=random.uniform(0, 2 * np.pi, count),
        buried=random.uniform(0.05, 0.5, count),
        diameter=0.2 * 10 ** random.random(count),
        dynamic=np.zeros(count, np.bool_),
        collides=np.ones(count, np.bool_),
        unplaced=(0,),
    )


def test_burial_stays_even_over_its_range_on_rough_ground():
    """Measured anew on the meshes; some need more than they drew, others lie less deep for it."""
    random = np.random.default_rng(1)
    land = self_affine(random, 30.0, exponent=-1.5)
    scattered = strewn(random, 800, shapes=len(LIBRARY.prototypes))
    common = {"scattered": scattered, "library": LIBRARY, "ground": land, "density": (2900.0,)}
    as_drawn, even = embed(**common), embed(**common, burial=((0.05, 0.5),))
    below = []
    for n in range(len(even)):
        normal = rotations(even)[n][:, 2]
        along = placed_vertices(even, n) @ normal
        x, y, _ = even.position[n]
        level = np.array([x, y, float(land.height_at(x, y))]) @ normal
        below.append((level - along.min()) / np.ptp(along))
    np.testing.assert_allclose(below, even.buried_fraction, atol=1e-6)
    wanted = scattered.buried.mean()
    assert as_drawn.buried_fraction.mean() > wanted + 0.012
    assert even.buried_fraction.mean() == pytest.approx(wanted, abs=0.003)
    found = np.sort(even.buried_fraction)
    assert np.abs(found - np.sort(scattered.buried))[: int(0.97 * len(found))].max() < 0.02
    shown = [
        (gaps(one.select(np.arange(100)), LIBRARY, land) > 0.01).sum() for one in (as_drawn, even)
    ]
    assert shown[1] <= shown[0] < 8
    listed = embed(**common, burial=((np.nan, np.nan),))
    assert listed == as_drawn


def test_burial_on_level_ground_is_as_drawn():
    scattered = strewn(np.random.default_rng(1), 50, shapes=len(LIBRARY.prototypes))
    flat = Heightfield(elevation=np.ones((9, 9)), spacing=4.0, origin=(-16.0, -16.0))
    field = embed(
        scattered=scattered, library=LIBRARY, ground=flat, density=(1.0,), burial=((0.05, 0.5),)
    )
    np.testing.assert_allclose(field.buried_fraction, scattered.buried, atol=1e-12)


def test_no_daylight_on_very_rough_ground():
    """Slopes over 0.1 m have an RMS of 20 degrees."""
    random = np.random.default_rng(1)
    land, library = self_affine(random, 20.0), make_library(LibrarySpec(shapes=3))
    scattered = strewn(random, 250, shapes=3)
    field = embed(scattered=scattered, library=library, ground=land, density=(2900.0,))
    assert (gaps(field, library, land) > 0.01).mean() < 0.01
    deep = field.buried_fraction > outline.MAX_BURIED
    assert deep.any()
    assert deep.mean() < 0.05
    for n in np.flatnonzero(deep):
        mesh = library.prototypes[field.prototype[n]].meshes[0]
        plan = field.scale[n] * mesh.vertices @ rotations(field)[n][:2].T
        support = footprint(mesh)
        angle = scattered.yaw[n] + 2 * np.pi * np.arange(len(support)) / len(support)
        along = (plan @ np.stack([np.cos(angle), np.sin(angle)])).max(axis=0)
        assert np.all(along <= support * field.diameter[n] * (1 + 1e-9))


def test_bottom_below_and_top_above_the_ground(laid):
    land, _, field = laid
    for n in range(len(field)):
        points = placed_vertices(field, n)
        above = points[:, 2] - land.height_at(points[:, 0], points[:, 1])
        assert above.min() < 0.0 < above.max()


def test_masses_are_density_times_volume(laid):
    _, _, field = laid
    for n in range(0, len(field), 13):
        faces = LIBRARY.prototypes[field.prototype[n]].meshes[0].faces
        mesh = trimesh.Trimesh(placed_vertices(field, n), faces, process=False)
        assert field.volume[n] == pytest.approx(mesh.volume, rel=1e-9)
        assert field.mass[n] == pytest.approx(DENSITY[field.population[n]] * mesh.volume, rel=1e-9)
        np.testing.assert_allclose(mesh.center_mass, field.position[n], atol=1e-9)


def hulls_overlap(one, other):
    """Whether two convex polygons overlap: no edge of either parts them."""
    for corners in (one, other):
        along = np.roll(corners, -1, axis=0) - corners
        normals = np.column_stack([along[:, 1], -along[:, 0]])
        reach = (one @ normals.T).max(axis=0) if corners is one else (other @ normals.T).max(axis=0)
        far = other if corners is one else one
        if np.any((far @ normals.T).min(axis=0) > reach):
            return False
    return True


def test_no_two_rocks_overlap_in_plan(laid):
    """Outlines of whole rocks, buried parts too, on rough ground: all near pairs by brute force."""
    _, _, field = laid
    outlines = []
    for n in range(len(field)):
        plan = placed_vertices(field, n)[:, :2]
        outlines.append(plan[ConvexHull(plan).vertices])
    pairs = cKDTree(field.position[:, :2]).query_pairs(2.0 * field.diameter.max())
    checked = 0
    for a, b in sorted(pairs):
        distance = np.hypot(*(field.position[a] - field.position[b])[:2])
        if distance < field.diameter[a] + field.diameter[b]:
            checked += 1
            assert not hulls_overlap(outlines[a], outlines[b])
    assert checked > 500


def test_reach_rise_and_footprint_hold_every_way_to_rest():
    random = np.random.default_rng(8)
    angles = 2 * np.pi * np.arange(FOOTPRINT_DIRECTIONS) / FOOTPRINT_DIRECTIONS
    for prototype in LIBRARY.prototypes:
        mesh = prototype.meshes[0]
        reach, rise = bounds(mesh)
        support = footprint(mesh)
        assert reach < 0.8
        for _ in range(300):
            tilt, azimuth, yaw = outline.MAX_TILT * random.random(), *random.uniform(0, 6.28, 2)
            lean = np.array([np.cos(azimuth), np.sin(azimuth)]) * np.sin(tilt)
            turn = matrix_from_quaternion(outline.embedding_rotation(*lean, np.cos(tilt), yaw))
            np.testing.assert_allclose(turn[:, 2], [*lean, np.cos(tilt)], atol=1e-12)
            buried = random.uniform(0, outline.MAX_BURIED)
            exposed = exposed_outline(mesh, rotation=turn, normal=turn[:, 2], buried=buried)
            diameter = slow_diameter(exposed)
            plan = mesh.vertices @ turn[:2].T
            assert np.hypot(*plan.T).max() <= reach * diameter
            top = (1 - buried) * np.ptp(mesh.vertices[:, 2]) / np.cos(tilt)
            assert top <= rise * diameter
            along = np.stack([np.cos(angles + yaw), np.sin(angles + yaw)])
            assert np.all((plan @ along).max(axis=0) <= support * diameter)


def test_convex_hull_of_degenerate_points():
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1), (0.5, 0.5), (0, 0), (0.5, 0)], float)
    hull = convex_hull(square)
    np.testing.assert_array_equal(hull, [(0, 0), (1, 0), (1, 1), (0, 1)])
    assert mean_width(hull) == pytest.approx(np.sqrt(2))
    line = np.linspace((0, 0), (3, 4), 9)
    assert mean_width(convex_hull(line)) == pytest.approx(2.5)
    assert mean_width(convex_hull(np.ones((4, 2)))) == 0.0


def test_half_a_sphere_has_its_own_diameter():
    ball = trimesh.creation.icosphere(subdivisions=4)
    mesh = Mesh(vertices=ball.vertices, faces=ball.faces)
    for buried, diameter in ((0.3, 2.0), (0.5, 2.0), (0.6, 2 * np.sqrt(1 - 0.2**2))):
        exposed = exposed_outline(
            mesh, rotation=np.eye(3), normal=np.array([0, 0, 1.0]), buried=buried
        )
        assert mean_width(exposed) == pytest.approx(diameter, rel=3e-3)


def test_rocks_of_a_window_rest_as_in_the_whole(laid):
    """Equal bits, although a window's grid begins elsewhere."""
    _, _, whole = laid
    site = place()
    kinds = (PEBBLES, BOULDERS)
    around = rock_margin(site=site, populations=kinds, library=LIBRARY)
    for column, row, columns, rows in ((0, 0, 60, 60), (97, 41, 53, 77), (190, 130, 51, 33)):
        window = Window(column=column, row=row, columns=columns, rows=rows)
        scattered = scatter(site=site, populations=kinds, library=LIBRARY, window=window)
        land = ground(site, site.padded(window, around))
        field = embed(
            scattered=scattered, library=LIBRARY, ground=land, density=DENSITY, burial=RANGES
        )
        assert len(field) > 10
        assert field == whole.select(np.isin(whole.id, field.id))


def test_rocks_off_the_ground_are_refused(laid):
    _, scattered, _ = laid
    site = place()
    part = ground(site, Window(column=0, row=0, columns=100, rows=100))
    with pytest.raises(ValueError, match="off the ground"):
        embed(scattered=scattered, library=LIBRARY, ground=part, density=DENSITY)


@pytest.mark.parametrize("density", [(), (2900.0,), (2900.0, -5.0), (2900.0, np.inf)])
def test_each_population_has_a_density_above_0(laid, density):
    land, scattered, _ = laid
    with pytest.raises(ValueError, match="must be 2 above 0, one for each population"):
        embed(scattered=scattered, library=LIBRARY, ground=land, density=density)


def test_only_rocks_at_their_limit_show_daylight():
    """Also those whose foot widens as they lean and sink, on ground rougher than any."""
    random = np.random.default_rng(3)
    land = self_affine(random, 40.0, exponent=-1.5)
    scattered = strewn(random, 400, shapes=len(LIBRARY.prototypes))
    field = embed(scattered=scattered, library=LIBRARY, ground=land, density=(2900.0,))
    at_limit = field.buried_fraction > outline.MAX_BURIED - 0.01
    assert at_limit.mean() < 0.1
    assert gaps(field.select(~at_limit), LIBRARY, land, middles=False).max() < 0.005
