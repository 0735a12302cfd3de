"""The rock library against trimesh's geometry, closed forms and what physics engines need."""

import signal
import threading
from dataclasses import replace

import mujoco
import numpy as np
import pytest
import trimesh
from numpy.random import Generator, Philox
from pydantic import TypeAdapter, ValidationError

from terrain_forge.base import fibonacci_sphere
from terrain_forge.dtm import FlatDtm
from terrain_forge.making import plan
from terrain_forge.model import Mesh
from terrain_forge.pipeline import realise
from terrain_forge.recipe import Recipe, TerrainSpec
from terrain_forge.rocks import (
    FAMILIES,
    Golombek,
    LibrarySpec,
    PopulationSpec,
    RocksSpec,
    make_library,
)
from terrain_forge.rocks.embedding.footprint import bounds
from terrain_forge.rocks.library import MeshSpec, lay_down
from terrain_forge.rocks.shapes.carving import Sphere, carve, carve_close, convex_faces
from terrain_forge.rocks.shapes.collision import collision_hull
from terrain_forge.rocks.shapes.families import block
from terrain_forge.rocks.shapes.shapes import projections, radii
from terrain_forge.rocks.shapes.solid import cuts_itself, mass_properties
from terrain_forge.rocks.shapes.texture import MEAN_BRIGHTNESS

SPEC = LibrarySpec(shapes=7, seed=7, families=tuple(FAMILIES))


@pytest.fixture(scope="module")
def library():
    return make_library(SPEC)


@pytest.fixture(scope="module", params=range(SPEC.shapes))
def rock(request, library):
    return library.prototypes[request.param]


def solid(mesh):
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False, validate=False)


def heights(mesh, directions):
    """Support function: how far the mesh extends along each direction."""
    return projections(directions, mesh.vertices).max(axis=1)


def test_an_interrupt_waits_for_no_shape(monkeypatch):
    may_end, ended = threading.Event(), threading.Event()

    def parts(*_, name, **__):
        if name == "shape 0 (cobble)":
            signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)
        may_end.wait(10.0)
        ended.set()
        raise RuntimeError

    monkeypatch.setattr("terrain_forge.rocks.library.collision_parts", parts)
    with pytest.raises(KeyboardInterrupt):
        make_library(LibrarySpec(shapes=2, families=("cobble",)))
    assert not ended.is_set()
    may_end.set()


def test_levels_of_detail_are_closed_outward_surfaces(rock):
    finest = len(rock.meshes[0].vertices)
    assert finest in (642, 962)
    assert [len(mesh.vertices) for mesh in rock.meshes] == [finest, finest // 4, finest // 16]
    assert len(rock.close.vertices) == 2562
    for mesh in (*rock.meshes, rock.close):
        body = solid(mesh)
        assert body.is_watertight
        assert body.is_winding_consistent
        assert body.volume > 0
        assert body.euler_number == 2
        assert body.area_faces.min() > 0


def test_surface_never_cuts_itself(rock):
    """Some point sees every face from inside: the centre of carving, no longer the origin."""
    from scipy.optimize import linprog

    for mesh in (*rock.meshes, rock.close):
        body = solid(mesh)
        offsets = np.einsum("ij,ij->i", body.face_normals, mesh.vertices[mesh.faces[:, 0]])
        constraints = np.column_stack([body.face_normals, np.ones(len(offsets))])
        deepest = linprog([0, 0, 0, -1], A_ub=constraints, b_ub=offsets, bounds=[(None, None)] * 4)
        assert deepest.x[3] > 0
        assert not cuts_itself(mesh)


def test_mass_properties_are_those_of_trimesh(rock):
    body = solid(rock.meshes[0])
    assert rock.volume == pytest.approx(body.volume, rel=1e-9)
    np.testing.assert_allclose(rock.inertia, body.moment_inertia, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(body.center_mass, 0, atol=1e-10)


@pytest.mark.parametrize(
    ("centre", "within"), [((5.0, -3.0, 2.0), 1e-9), ((5e5, 4.6e6, -2e3), 1e-6)]
)
def test_mass_properties_of_a_box_far_from_the_origin(centre, within):
    box = trimesh.creation.box((1.0, 2.0, 3.0))
    found = mass_properties(Mesh(vertices=box.vertices + np.array(centre), faces=box.faces))
    assert found.volume == pytest.approx(6.0, rel=1e-8)
    np.testing.assert_allclose(found.centre, centre, rtol=1e-12)
    np.testing.assert_allclose(found.inertia, np.diag([13.0, 10.0, 5.0]) / 2, atol=within)


def test_mean_axis_is_one_and_the_rock_lies_flat(rock):
    extents = np.ptp(rock.meshes[0].vertices, axis=0)
    assert extents.mean() == pytest.approx(1.0, abs=1e-12)
    assert extents[0] >= extents[1] >= extents[2]


def test_rock_rests_on_a_facet_under_its_centre_of_mass(rock):
    vertices = rock.meshes[0].vertices
    feet = vertices[vertices[:, 2] < vertices[:, 2].min() + 1e-9]
    assert len(feet) >= 3
    facet = trimesh.points.PointCloud(np.vstack([feet, feet + np.array([0, 0, 1])])).convex_hull
    assert facet.contains([[0, 0, feet[0, 2] + 0.5]])[0]


def test_axis_ratios_follow_the_distributions():
    axes = np.array([block(Generator(Philox(key=n))).axes for n in range(400)])
    b, c = axes[:, 1] / axes[:, 0], axes[:, 2] / axes[:, 0]
    assert b.mean() == pytest.approx(0.75, abs=0.02)
    assert b.std() == pytest.approx(0.11, abs=0.015)
    assert c.mean() == pytest.approx(0.54, abs=0.025)
    assert c.std() == pytest.approx(0.11, abs=0.02)


def test_rock_has_the_axes_that_were_drawn():
    blank = block(Generator(Philox(key=5)))
    shape = lay_down(carve(blank, Sphere()), blank.axes)[0]
    np.testing.assert_allclose(np.ptp(shape.vertices, axis=0), blank.axes, rtol=1e-12)


@pytest.mark.parametrize("family", FAMILIES)
def test_the_close_mesh_is_nearer_to_what_was_drawn(family):
    """By a third at least, over directions that neither mesh was made from."""
    blank = FAMILIES[family](Generator(Philox(key=5)))
    towards = fibonacci_sphere(3001)
    drawn = towards * radii(blank, towards)[:, None] * blank.axes
    shape, close = carve(blank, Sphere())[0], carve_close(blank, Sphere(close=True))
    off = [np.sqrt(np.mean(distances(drawn, mesh) ** 2)) for mesh in (shape, close)]
    assert off[1] < 0.67 * off[0]


def distances(points, mesh):
    """Of points to the nearest of the faces whose middles are near."""
    from scipy.spatial import KDTree

    triangles = mesh.vertices[mesh.faces]
    _, near = KDTree(triangles.mean(axis=1)).query(points, k=24)
    repeated = np.repeat(points, near.shape[1], axis=0)
    foot = trimesh.triangles.closest_point(triangles[near.ravel()], repeated)
    away = np.linalg.norm(foot - repeated, axis=1).reshape(near.shape)
    return away.min(axis=1)


def test_collision_hull_is_convex_small_and_close(rock):
    (hull,) = rock.hulls
    body, shape = solid(hull), rock.meshes[0]
    assert len(hull.vertices) <= 64
    assert body.is_watertight
    assert body.is_convex
    assert body.volume / rock.volume - 1 == pytest.approx(rock.hull_excess, abs=1e-9)
    assert -0.03 < rock.hull_excess < SPEC.hull_excess
    assert 0.0 < rock.hull_distance < SPEC.hull_distance
    offsets = np.einsum("ij,ij->i", body.face_normals, hull.vertices[hull.faces[:, 0]])
    beyond = projections(shape.vertices, body.face_normals) - offsets
    assert beyond.max() < 0.035
    directions = fibonacci_sphere(1000)
    error = np.abs(heights(hull, directions) - heights(shape, directions))
    assert error.max() < 0.035
    upward = directions[:, 2] > np.cos(np.radians(25))
    assert error[upward].max() < 0.02
    assert error[upward].mean() < 0.01


def test_mujoco_takes_the_hull_as_it_is_and_the_rock_stays(rock):
    (hull,) = rock.hulls
    spec = mujoco.MjSpec()
    spec.add_mesh(name="rock", uservert=hull.vertices.ravel(), userface=hull.faces.ravel())
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[5, 5, 1])
    body = spec.worldbody.add_body(pos=[0, 0, -hull.vertices[:, 2].min()])
    body.add_freejoint()
    body.explicitinertial = True
    body.mass = 2900.0 * rock.volume
    body.fullinertia = 2900.0 * rock.inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="rock")
    model = spec.compile()
    assert model.mesh_graph[0] == len(hull.vertices)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=1000)
    assert data.qpos[3] > np.cos(np.radians(0.5 * 3))
    assert np.linalg.norm(data.qpos[:2]) < 0.02


def test_fewer_hull_vertices_when_asked(library):
    few = make_library(replace(SPEC, shapes=2, hull_vertices=16)).prototypes
    for rock, full in zip(few, library.prototypes, strict=False):
        assert len(rock.hulls[0].vertices) <= 16
        assert rock.meshes == full.meshes


def test_a_plan_cuts_up_no_shape_but_the_users(monkeypatch):
    """A library that is closer than usual is first made by a build, which ends there if it fails.

    A few shapes tell how rocks are packed, and their meshes do not depend on their hulls.
    """
    tight, own = LibrarySpec(shapes=1000, hull_excess=0.1), (MeshSpec(file="a.obj"),)
    assert tight.doubtful() is None
    assert replace(tight, meshes=own).doubtful() == replace(tight, meshes=own, shapes=0)
    assert LibrarySpec(shapes=1000, meshes=own).doubtful() == LibrarySpec(shapes=0, meshes=own)
    assert LibrarySpec(meshes=own).doubtful() == LibrarySpec(meshes=own)
    assert tight.sample() == LibrarySpec(shapes=64)
    assert LibrarySpec().sample() == LibrarySpec()

    def never(*_, **__):
        raise AssertionError("cut up")

    monkeypatch.setattr("coacd.run_coacd", never)
    dense = PopulationSpec(name="a", size_frequency=Golombek(k=0.3), diameter_m=(0.3, 1.0))
    few = replace(tight, shapes=1, families=("breccia",))
    rocks = RocksSpec(library=few, populations=(dense,))
    dtm, terrain = FlatDtm(size_m=(20.0, 20.0)), TerrainSpec(spacing_m=0.5)
    recipe = Recipe(name="tight", body="mars", dtm=dtm, terrain=terrain, rocks=rocks)
    site = plan(recipe)
    with pytest.raises(AssertionError, match="cut up"):
        realise(site)


def test_hull_of_a_box_is_the_box():
    box = trimesh.creation.box((1.0, 2.0, 3.0)).subdivide()
    hull = collision_hull(Mesh(vertices=box.vertices, faces=box.faces), vertices=8)
    assert mass_properties(hull).volume == pytest.approx(6.0)


def silhouette(mesh, view, grid):
    """Where rays along `view` through a grid of points (in view axes) meet a mesh."""
    axes = np.linalg.qr(np.column_stack([view, np.eye(3)[:, :2]]))[0].T
    starts = grid[:, :1] * axes[1] + grid[:, 1:] * axes[2] - 5.0 * view
    side = round(np.sqrt(len(grid)))
    towards = np.broadcast_to(view, starts.shape)
    return solid(mesh).ray.intersects_any(starts, towards).reshape(side, side)


def test_silhouettes_of_the_levels_agree_within_the_stated_errors(rock):
    """Of outlines cast by rays, no point is farther from the other outline than stated."""
    from scipy.ndimage import distance_transform_edt

    line = np.linspace(-0.9, 0.9, 121)
    grid, pixel = np.stack(np.meshgrid(line, line), -1).reshape(-1, 2), line[1] - line[0]
    assert rock.outline_errors[0] == 0.0
    assert rock.outline_errors[1] < 0.07
    assert rock.outline_errors[2] < 0.13
    for view in fibonacci_sphere(5):
        full = silhouette(rock.meshes[0], view, grid)
        for mesh, stated in zip(rock.meshes[1:], rock.outline_errors[1:], strict=True):
            seen = silhouette(mesh, view, grid)
            off = max(distance_transform_edt(~full)[seen].max(), 0.0)
            off = max(off, distance_transform_edt(~seen)[full].max())
            assert off * pixel < stated + 1.5 * pixel


def test_coarser_levels_have_the_volume_and_the_extent(rock):
    directions = fibonacci_sphere(1000)
    full = heights(rock.meshes[0], directions)
    for mesh, stated in zip(rock.meshes[1:], rock.outline_errors[1:], strict=True):
        assert np.abs(heights(mesh, directions) - full).max() < stated
        assert solid(mesh).volume == pytest.approx(rock.volume, rel=1e-9)


def test_texture_coordinates_stretch_little_and_never_mirror(rock):
    for mesh, uvs in zip(rock.meshes, rock.uvs, strict=True):
        corners = mesh.vertices[mesh.faces]
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        shown = np.linalg.norm(uvs - np.roll(uvs, 1, axis=1), axis=2)
        assert (shown <= sides * (1 + 1e-9)).all()
        one, other = uvs[:, 1] - uvs[:, 0], uvs[:, 2] - uvs[:, 0]
        areas = 0.5 * (one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0])
        assert (areas > solid(mesh).area_faces / 1.74).all()


def test_texture_tiles_and_keeps_colours(library):
    tile = library.texture.astype(float)
    assert tile.shape == (512, 512)
    assert tile.mean() == pytest.approx(MEAN_BRIGHTNESS, abs=1.0)
    assert 12 < tile.std() < 40
    for axis in (0, 1):
        steps = np.abs(np.diff(tile, axis=axis)).mean(axis=1 - axis)
        seam = np.abs(np.take(tile, 0, axis) - np.take(tile, -1, axis)).mean()
        assert seam < 1.2 * steps.max()
        assert steps.max() < 15


def test_the_tiles_normals_are_those_of_one_relief(library):
    normals = library.normals / 127.5 - 1.0
    assert np.abs(np.linalg.norm(normals, axis=2) - 1.0).max() < 0.02
    rise = -normals[..., :2] / normals[..., 2:]
    assert 0.25 < rise.std() < 0.8
    # Around every pixel the rises of a height field add up to nothing, over the seam too.
    across, along = rise[..., 0], rise[..., 1]
    curl = np.roll(along, -1, 1) - np.roll(along, 1, 1) - np.roll(across, -1, 0)
    curl += np.roll(across, 1, 0)
    shear = np.roll(along, -1, 1) - np.roll(along, 1, 1)
    assert curl.std() < 0.1 * shear.std()
    assert library.roughness.min() > 150


def test_reach_and_rise_are_the_outlines(rock):
    assert (rock.reach, rock.rise) == bounds(rock.meshes[0])


def test_a_smaller_library_is_the_start_of_a_larger_one(library):
    small = make_library(replace(SPEC, shapes=2))
    assert small.prototypes == library.prototypes[:2]
    assert np.array_equal(small.texture, library.texture)
    assert len({rock.meshes[0].vertices.tobytes() for rock in library.prototypes}) == SPEC.shapes
    other = make_library(replace(SPEC, seed=8, shapes=1))
    assert other.prototypes[0] != library.prototypes[0]


def test_families_are_taken_in_turn_and_differ(library):
    assert [rock.family for rock in library.prototypes[:7]] == [*SPEC.families, "block"]
    assert set(SPEC.families) == set(FAMILIES)
    flatness, roundness = {}, {}
    for family in FAMILIES:
        rocks = [rock for rock in library.prototypes if rock.family == family]
        flatness[family] = np.mean([np.ptp(rock.meshes[0].vertices[:, 2]) for rock in rocks])
        bodies = [solid(rock.meshes[0]) for rock in rocks]
        sphericity = [np.pi ** (1 / 3) * (6 * b.volume) ** (2 / 3) / b.area for b in bodies]
        roundness[family] = np.mean(sphericity)
    assert flatness["slab"] < 0.7 * flatness["block"]
    assert max(roundness, key=roundness.get) == "cobble"
    assert min(roundness, key=roundness.get) == "slab"


def test_convex_faces_refuse_a_point_inside():
    with pytest.raises(ArithmeticError, match="31 points"):
        convex_faces(np.vstack([fibonacci_sphere(30), [[0.1, 0.0, 0.0]]]))


@pytest.mark.parametrize(
    "bad", [{"shapes": -1}, {"shapes": 1001}, {"families": []}, {"families": ["blok"]}, {"n": 1}]
)
def test_bad_specs_are_refused(bad):
    with pytest.raises(ValidationError):
        TypeAdapter(LibrarySpec).validate_python(bad)


def test_spec_names_its_families():
    own = (
        MeshSpec(file="a/odd.obj"),
        MeshSpec(file="b.stl", family="mine"),
        MeshSpec(file="b.stl"),
    )
    spec = LibrarySpec(shapes=2, families=("block", "slab", "cobble"), meshes=own)
    assert spec.family_names() == ("block", "slab", "odd", "mine", "b")
