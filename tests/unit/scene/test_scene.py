"""The ray scene against the surface's definition and against a ray test that shares no code."""

from __future__ import annotations

import numpy as np
import pytest

from terrain_forge.base import TerrainForgeError
from terrain_forge.model import Heightfield, rotations
from terrain_forge.scene import (
    GROUND,
    RayScene,
    embree,
    open_scene,
    pinhole_camera,
    render_preview,
    subject_of,
)
from terrain_forge.scene.camera import map_camera
from terrain_forge.scene.scene import MISSED
from tests.helpers import worlds

DOWN = np.array([0.0, 0.0, -1.0])


@pytest.fixture(scope="module")
def scene(small_world):
    with open_scene(small_world) as opened:
        yield opened


def triangles(world):
    """All triangles in the world frame, and the row of their rock (-1: ground)."""
    ground = world.ground
    x, y = np.meshgrid(ground.east, ground.north)
    nodes = np.stack([x, y, ground.elevation.astype(float)], -1)
    sw, se, nw, ne = nodes[:-1, :-1], nodes[:-1, 1:], nodes[1:, :-1], nodes[1:, 1:]
    parts = [
        np.stack([sw, se, ne], 2).reshape(-1, 3, 3),
        np.stack([sw, ne, nw], 2).reshape(-1, 3, 3),
    ]
    owners = [np.full(len(part), GROUND) for part in parts]
    field = world.field
    for row, turn in enumerate(rotations(field)):
        mesh = world.library.prototypes[field.prototype[row]].meshes[0]
        vertices = field.scale[row] * mesh.vertices @ turn.T + field.position[row]
        parts.append(vertices[mesh.faces])
        owners.append(np.full(len(mesh.faces), row))
    return np.concatenate(parts), np.concatenate(owners)


def first_hit(origin, direction, corners, owners):
    """Möller & Trumbore 1997 over every triangle, in double precision."""
    a, b, c = np.moveaxis(corners, 1, 0)
    ab, ac = b - a, c - a
    across = np.cross(direction, ac)
    scale = np.einsum("ij,ij->i", ab, across)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.einsum("ij,ij->i", origin - a, across) / scale
        turned = np.cross(origin - a, ab)
        v = turned @ direction / scale
        t = np.einsum("ij,ij->i", ac, turned) / scale
    hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
    if not hit.any():
        return np.inf, np.zeros(3), MISSED
    first = np.argmin(np.where(hit, t, np.inf))
    normal = np.cross(ab[first], ac[first])
    return t[first], normal / np.linalg.norm(normal), owners[first]


def test_rays_meet_the_ground_where_height_at_says(small_world):
    bare = open_scene(worlds.bare(small_world))
    random = np.random.default_rng(2)
    points = random.uniform((-11.99, -7.99), (11.99, 7.99), (2000, 2))
    with bare:
        hits = bare.cast(np.column_stack([points, np.full(2000, 30.0)]), DOWN)
    assert np.all(hits.rock == GROUND)
    wanted = small_world.ground.height_at(points[:, 0], points[:, 1])
    np.testing.assert_allclose(30.0 - hits.distance, wanted, atol=2e-5)
    assert np.all(hits.normal[:, 2] > 0)


def test_cut_runs_from_south_west_to_north_east(small_world):
    heights = np.zeros((2, 2), np.float32)
    heights[0, 0] = heights[1, 1] = 1.0
    ground = Heightfield(elevation=heights, spacing=1.0, origin=(100.0, -50.0))
    subject = subject_of(small_world)
    bare = subject.instances.select(np.arange(0))
    rgb = np.zeros((2, 2, 3), np.uint8)
    with RayScene(subject.replace(ground=ground, ground_rgb=rgb, instances=bare)) as scene:
        middle = scene.cast([100.5, -49.5, 9.0], DOWN)
        north_west = scene.cast([100.25, -49.25, 9.0], DOWN)
    assert middle.distance[0] == pytest.approx(8.0, abs=1e-6)
    assert north_west.distance[0] == pytest.approx(8.5, abs=1e-6)


def test_nodes_edges_and_border_are_watertight(small_world):
    ground = small_world.ground
    east, north = (grid.ravel() for grid in np.meshgrid(ground.east[1:-1], ground.north[1:-1]))
    bare = open_scene(worlds.bare(small_world))
    with bare:
        hits = bare.cast(np.column_stack([east, north, np.full(len(east), 20.0)]), DOWN)
    np.testing.assert_allclose(
        20.0 - hits.distance, ground.elevation[1:-1, 1:-1].ravel(), atol=2e-5
    )


@pytest.mark.parametrize("coherent", [False, True])
def test_slanting_rays_agree_with_brute_force(small_world, scene, coherent):
    random = np.random.default_rng(3)
    origins = random.uniform((-13, -9, 2.5), (13, 9, 6.0), (150, 3))
    target = random.uniform((-12, -8, -1), (12, 8, 1), (150, 3))
    target[::2] = small_world.field.position[random.integers(0, 40, 75)]
    directions = (target - origins) * random.uniform(0.1, 4.0, (150, 1))
    hits = scene.cast(origins, directions, coherent=coherent)
    corners, owners = triangles(small_world)
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    wanted = [first_hit(o, d, corners, owners) for o, d in zip(origins, unit, strict=True)]
    distance, normal, rock = (np.array(column) for column in zip(*wanted, strict=True))
    assert set(np.unique(rock)) >= {GROUND, MISSED}
    assert np.count_nonzero(rock >= 0) > 50
    np.testing.assert_array_equal(hits.rock, rock)
    np.testing.assert_allclose(hits.distance, distance, rtol=1e-5, atol=2e-5)
    np.testing.assert_allclose(hits.normal, normal, atol=2e-4)


def test_neighbours_are_part_of_the_scene(small_world):
    inside = small_world.field.position[:, 0] < 0
    split = small_world.replace(
        field=small_world.field.select(inside), neighbours=small_world.field.select(~inside)
    )
    top = small_world.field.position + np.array([0.0, 0.0, 5.0])
    with open_scene(small_world) as whole, open_scene(split) as parts:
        one, other = whole.cast(top, DOWN), parts.cast(top, DOWN)
        assert parts.subject.instances == whole.subject.instances
    np.testing.assert_array_equal(one.rock, other.rock)
    np.testing.assert_array_equal(one.distance, other.distance)


def test_a_rock_alone_keeps_its_shape(small_world):
    """Embree forgets which scene the only copy is of."""
    row = int(np.argmax(small_world.field.prototype))
    alone = small_world.field.select(np.arange(len(small_world.field)) == row)
    mesh = small_world.library.prototypes[alone.prototype[0]].meshes[0]
    vertices = alone.scale[0] * mesh.vertices @ rotations(alone)[0].T + alone.position[0]
    highest = vertices[np.argmax(vertices[:, 2])]
    east, north = highest[:2] + 1e-4 * (alone.position[0, :2] - highest[:2])
    with open_scene(small_world.replace(field=alone)) as scene:
        hits = scene.cast(np.array([[east, north, 50.0]]), DOWN)
    assert alone.prototype[0] > 0
    assert hits.rock[0] == 0
    assert 50.0 - hits.distance[0] == pytest.approx(highest[2], abs=1e-3)


def test_a_far_away_tile_loses_no_precision(small_world):
    offset = np.array([524_288.0, -262_144.0, 0.0])
    ground = small_world.ground
    east, north = ground.origin
    moved = Heightfield(
        elevation=ground.elevation,
        spacing=ground.spacing,
        origin=(east + offset[0], north + offset[1]),
    )
    subject = subject_of(small_world)
    rocks = subject.instances.replace(position=small_world.field.position + offset)
    start = small_world.field.position + np.array([0.03, 0.0, 5.0])
    with (
        open_scene(small_world) as here,
        RayScene(subject.replace(ground=moved, instances=rocks)) as there,
    ):
        one, other = here.cast(start, DOWN), there.cast(start + offset, DOWN)
    np.testing.assert_array_equal(one.rock, other.rock)
    np.testing.assert_allclose(one.distance, other.distance, atol=1e-6)


def test_same_bytes_for_any_number_of_threads(small_world, scene, use_threads):
    """Of casting and of taking a picture, whose bands are drawn by several."""
    random = np.random.default_rng(0)
    origins = random.uniform((-12, -8, 3), (12, 8, 4), (5000, 3))
    directions = random.normal(size=(5000, 3))
    found = []
    for threads in (1, 3):
        use_threads(threads)
        hits = scene.cast(origins, directions)
        picture = render_preview(small_world, width=64, height=36)
        found.append([hits.distance, hits.normal, hits.rock, picture])
    for one, other in zip(*found, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_closed_scene_says_so(small_world):
    scene = open_scene(small_world)
    scene.close()
    scene.close()
    with pytest.raises(TerrainForgeError, match="closed"):
        scene.cast([0, 0, 9], DOWN)


def test_missing_embree_is_named(monkeypatch):
    monkeypatch.setattr(embree, "find_spec", lambda _: None)
    with pytest.raises(TerrainForgeError, match=r"embreex is not installed.*pip install"):
        embree.load_library.__wrapped__()


def test_pinhole_looks_where_it_is_told(small_world, scene):
    stand = np.array([0.0, 0.0, float(small_world.ground.height_at(0.0, 0.0)) + 2.0])
    camera = pinhole_camera(
        position=stand, yaw=np.pi / 2, pitch=0.0, field_of_view=np.pi / 2, width=101, height=51
    )
    origins, directions = camera.rays()
    pixels = directions.reshape(51, 101, 3)
    np.testing.assert_allclose(pixels[25, 50], [0, 1, 0], atol=1e-12)
    assert pixels[25, 100, 0] > 0.97  # right of the picture is east when looking north
    assert pixels[0, 50, 2] > 0.4  # its top is up
    assert scene.cast(origins, directions).rock.reshape(51, 101)[0, 50] == MISSED


def test_map_camera_has_north_up(small_world):
    camera = map_camera(middle=(10.0, 20.0), top=5.0, pixel=0.5, width=4, height=2)
    origins, directions = camera.rays()
    np.testing.assert_allclose(origins[0], [9.25, 20.25, 5.0])
    np.testing.assert_allclose(origins[-1], [10.75, 19.75, 5.0])
    np.testing.assert_array_equal(directions, np.broadcast_to(DOWN, (8, 3)))


def test_added_instances_keep_their_own_meshes(small_world):
    """A copy of a mesh that only the second of two sets knows, in front of the first's."""
    subject = subject_of(small_world)
    last = len(subject.instances.meshes) - 1
    rocks = subject.instances.replace(mesh=np.minimum(subject.instances.mesh, last))
    mesh = subject.instances.meshes[last]
    lone = rocks.select(np.arange(1)).replace(
        meshes=(mesh,), mesh=np.zeros(1), position=np.array([[0.0, 0.0, 40.0]])
    )
    both = rocks.add(lone)
    assert len(both) == len(rocks) + 1
    assert both.meshes[both.mesh[-1]] is mesh
    assert both.select(np.arange(len(rocks))).replace(meshes=rocks.meshes) == rocks
    with RayScene(subject.replace(instances=both)) as scene:
        assert scene.cast([0.0, 0.0, 60.0], DOWN).rock[0] == len(rocks)
