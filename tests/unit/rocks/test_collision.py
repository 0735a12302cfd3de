"""Collision parts and their errors against closed forms and trimesh."""

import coacd
import numpy as np
import pytest
import trimesh

from terrain_forge.base import RecipeError
from terrain_forge.model import Mesh
from terrain_forge.rocks.shapes.collision import certify, collision_parts, unite
from terrain_forge.rocks.shapes.simplification import simplify
from terrain_forge.rocks.shapes.solid import cuts_itself, hausdorff_distance, mass_properties


def mesh_of(body):
    return Mesh(vertices=body.vertices, faces=body.faces)


def box(extents, centre=(0, 0, 0)):
    return mesh_of(trimesh.creation.box(extents).apply_translation(centre))


def bowl():
    """A box with a deep pit: far from convex."""
    from manifold3d import Manifold

    solid = Manifold.cube((1.0, 0.8, 0.6), True) - Manifold.sphere(0.35, 16).translate((0, 0, 0.3))
    mesh = solid.to_mesh()
    return Mesh(vertices=mesh.vert_properties[:, :3], faces=mesh.tri_verts)


def test_distance_of_boxes():
    """From a cube's corner to a smaller one's along the diagonal; from face to face if shifted."""
    assert hausdorff_distance(box((2, 2, 2)), box((1, 1, 1))) == pytest.approx(
        np.sqrt(3) / 2, abs=1e-3
    )
    shifted = box((2, 2, 2), (0.3, 0, 0))
    assert hausdorff_distance(box((2, 2, 2)), shifted) == pytest.approx(0.3, abs=1e-3)
    assert hausdorff_distance(shifted, shifted) < 1e-12


def test_distance_sees_what_no_vertex_shows():
    """A roof over a flat top: its ridge is a vertex, but the top's middle under it is none."""
    flat = box((2, 2, 2))
    high = flat.vertices.copy()
    high[high[:, 2] > 0, 2] += 0.5
    assert hausdorff_distance(flat, flat.replace(vertices=high)) == pytest.approx(0.5, abs=1e-3)
    ball = mesh_of(trimesh.creation.icosphere(subdivisions=4, radius=0.5))
    cube = box((2, 2, 2))
    assert hausdorff_distance(ball, cube) == pytest.approx(np.sqrt(3) - 0.5, abs=2e-3)


def test_distance_agrees_with_dense_samples():
    shape, hull = bowl(), mesh_of(trimesh.Trimesh(bowl().vertices, bowl().faces).convex_hull)
    found = hausdorff_distance(hull, shape)
    body = trimesh.Trimesh(shape.vertices, shape.faces)
    points = trimesh.sample.sample_surface_even(
        trimesh.Trimesh(hull.vertices, hull.faces), 800, seed=1
    )[0]
    sampled = np.abs(trimesh.proximity.closest_point_naive(body, points)[1]).max()
    assert sampled <= found + 1e-3
    assert sampled > found - 0.04


def test_one_hull_where_it_is_close_enough():
    found = collision_parts((bowl(),), vertices=64, excess=1.0, distance=1.0, name="bowl")
    assert len(found.parts) == 1
    volume = mass_properties(bowl()).volume
    assert found.excess == pytest.approx(0.48 / volume - 1, rel=0.02)
    assert found.distance == pytest.approx(0.35, abs=0.15)


@pytest.mark.slow
def test_parts_are_certified_on_their_union():
    """The parts of a bowl leave its pit open and meet the stated errors, which trimesh confirms."""
    shape = bowl()
    found = collision_parts((shape,), vertices=32, excess=0.25, distance=0.15, name="bowl")
    assert len(found.parts) > 1
    assert found.excess <= 0.25
    assert found.distance <= 0.15
    for part in found.parts:
        assert len(part.vertices) <= 32
        body = trimesh.Trimesh(part.vertices, part.faces)
        assert body.is_watertight
        assert body.is_convex
        assert not body.contains([[0.0, 0.0, 0.1]])[0]
    union = trimesh.boolean.union([trimesh.Trimesh(p.vertices, p.faces) for p in found.parts])
    assert union.volume / mass_properties(shape).volume - 1 == pytest.approx(found.excess, abs=1e-4)


def test_what_cannot_be_met_is_refused_with_the_figures(monkeypatch):
    monkeypatch.setattr("terrain_forge.rocks.shapes.collision.ATTEMPTS", ((0, 0.5),))
    thorny = trimesh.creation.icosphere(subdivisions=2)
    spikes = 1.0 + 1.5 * (np.arange(len(thorny.vertices)) % 9 == 0)
    mesh = Mesh(vertices=thorny.vertices * spikes[:, None], faces=thorny.faces)
    with pytest.raises(RecipeError, match="thorny: its convex parts come to") as caught:
        collision_parts((mesh,), vertices=16, excess=1e-4, distance=1e-4, name="thorny")
    assert caught.value.key == ("rocks", "library")


def test_overlapping_parts_count_once():
    parts = (box((1, 1, 1)), box((1, 1, 1), (0.5, 0, 0)))
    found = certify(parts, box((1.5, 1, 1), (0.25, 0, 0)))
    assert found.excess == pytest.approx(0.0, abs=1e-9)
    assert found.distance == pytest.approx(0.0, abs=1e-3)
    assert mass_properties(unite(parts)).volume == pytest.approx(1.5)


def test_a_surface_that_cuts_itself_is_found():
    assert not cuts_itself(bowl())
    ball = trimesh.creation.icosphere(subdivisions=2)
    pushed = ball.vertices.copy()
    pushed[np.argmax(pushed[:, 2])] = (0.1, 0.05, -1.5)
    assert cuts_itself(Mesh(vertices=pushed, faces=ball.faces))
    both = trimesh.util.concatenate([ball, ball.copy().apply_translation((1, 0.1, 0.2))])
    assert cuts_itself(mesh_of(both))


def test_simplifying_keeps_a_box_and_a_torus():
    fine = mesh_of(trimesh.creation.box((1.0, 2.0, 3.0)).subdivide().subdivide().subdivide())
    few = simplify(fine, 8, star_shaped=True)
    assert len(few.vertices) == 8
    assert mass_properties(few).volume == pytest.approx(6.0, rel=5e-3)
    assert hausdorff_distance(few, fine) < 0.02
    torus = trimesh.creation.torus(1.0, 0.3, 32, 16)
    ring = simplify(mesh_of(torus), 120)
    body = trimesh.Trimesh(ring.vertices, ring.faces)
    assert len(ring.vertices) == 120
    assert body.is_watertight
    assert body.euler_number == 0
    assert body.volume == pytest.approx(torus.volume, rel=0.05)


@pytest.mark.slow
def test_a_mesh_is_not_cut_up_twice_alike(monkeypatch):
    """Levels of detail of few faces may be one mesh."""
    calls, real = [], coacd.run_coacd

    def counted(*given, **how):
        calls.append(how["threshold"])
        return real(*given, **how)

    monkeypatch.setattr(coacd, "run_coacd", counted)
    monkeypatch.setattr(
        "terrain_forge.rocks.shapes.collision.ATTEMPTS", ((1, 0.5), (0, 0.5), (0, 0.4))
    )
    with pytest.raises(RecipeError, match="convex parts"):
        collision_parts((bowl(), bowl()), vertices=16, excess=1e-4, distance=1e-4, name="bowl")
    assert calls == [0.5, 0.4]
