"""The rocks of an export, told from its ground, and how far off they are along nine directions."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, matrix_from_quaternion
from terrain_forge.model import Heightfield, Mesh
from terrain_forge.validation.reading import BACKDROP, MERGED, SolidsOfRocks, is_ground, rock_of
from terrain_forge.validation.sample import Sample

_TURNS = np.arange(8) * np.pi / 4
DIRECTIONS = np.vstack(
    [np.column_stack([np.cos(_TURNS), np.sin(_TURNS), np.zeros(8)]), [(0.0, 0.0, 1.0)]]
)
"""Eight around the horizon, and up, shape [9, 3]."""
_FACES = 2**15
_UNMOVED = np.eye(3, 4)
_HIDDEN = 0.05
"""Part of its diameter by which a rock's furthest point must stand out of the ground to count:
exports leave out faces that lie wholly under it."""


def rock_errors(sample: Sample, solids: SolidsOfRocks) -> Array:
    """How far each of the sample's rocks is off along each direction [m], shape [rocks, 9].

    A rock that the export names is compared with its shape and with its convex parts, whichever is
    nearer; one that is merged with others is the nearest solid there. NaN along directions in
    which the ground hides the rock, infinite where there is no such rock.
    """
    found = np.full((len(solids.rock), len(DIRECTIONS)), -np.inf)
    np.maximum.at(found, solids.solid, solids.vertices @ DIRECTIONS.T)
    named = {rock: number for number, rock in enumerate(solids.rock) if rock != MERGED}
    merged = np.flatnonzero(np.array(solids.rock) == MERGED)
    centre = 0.5 * (found[:, [0, 2]] - found[:, [4, 6]])[merged]
    errors = np.full((len(sample.rows), len(DIRECTIONS)), np.inf)
    for place, row in enumerate(sample.rows.tolist()):
        rock = int(sample.world.field.id[row])
        if rock in named:
            candidates = np.array([named[rock]])
        else:
            apart = np.abs(centre - sample.world.field.position[row, :2]).max(axis=1)
            candidates = merged[apart <= sample.reach[place]]
        errors[place] = _nearest(sample, row, found[candidates])
    return errors


def _nearest(sample: Sample, row: int, candidates: Array) -> Array:
    """Errors of the candidate that is least off, against a rock's shape or its convex parts."""
    field = sample.world.field
    prototype = sample.world.library.prototypes[field.prototype[row]]
    turn = matrix_from_quaternion(field.quaternion[row]) * field.scale[row]
    hulls = np.concatenate([hull.vertices for hull in prototype.hulls])
    best = np.full(len(DIRECTIONS), np.inf)
    for vertices in (prototype.meshes[0].vertices, hulls) if len(candidates) else ():
        points = vertices @ turn.T + field.position[row]
        along = points @ DIRECTIONS.T
        above = heights_above(sample.world.ground, points[along.argmax(axis=0)])
        counts = above > _HIDDEN * field.diameter[row]
        counts[-1] = True
        off = np.abs(candidates - along.max(axis=0))
        off[:, ~counts] = np.nan
        worst = np.where(counts, off, 0.0).max(axis=1)
        least = int(worst.argmin())
        if worst[least] < np.nanmax(best):
            best = off[least]
    return best


def heights_above(ground: Heightfield, points: Array) -> Array:
    """Heights of points above the ground [m], NaN beside it; points have the shape [..., 3]."""
    inside = ground.covers(points[..., 0], points[..., 1])
    above = np.full(inside.shape, np.nan)
    seen = points[inside]
    above[inside] = seen[:, 2] - ground.height_at(seen[:, 0], seen[:, 1])
    return above


def scene_parts(scene: Any) -> Iterator[tuple[str, Array, Any]]:
    """Name, matrix and mesh of every node of a trimesh scene that has one."""
    for node in scene.graph.nodes_geometry:
        matrix, geometry = scene.graph[node]
        yield str(node), matrix, scene.geometry[geometry]


def ground_and_rocks(
    sample: Sample, parts: Iterable[tuple[str, Array, Any]]
) -> tuple[list[Mesh], SolidsOfRocks]:
    """Ground and rocks of placed meshes: name, upper rows of a homogeneous matrix, and mesh."""
    ground: list[Mesh] = []
    solids = SolidsOfRocks(sample.rocks)
    for name, matrix, mesh in parts:
        rock = rock_of(name)
        if name in BACKDROP or (rock is not None and not solids.wants(rock)):
            continue
        if rock is not None:
            solids.add(rock, placed(mesh.vertices, matrix))
        elif is_ground(name):
            ground.append(Mesh(vertices=placed(mesh.vertices, matrix), faces=mesh.faces))
        else:
            solids.add_merged(*split_merged(sample, mesh, matrix))
    return ground, solids


def placed(vertices: Array, matrix: Array) -> Array:
    """Vertices, shape [n, 3], moved by the upper rows of a homogeneous matrix, shape [3, 4]."""
    return np.asarray(vertices @ matrix[:, :3].T + matrix[:, 3])


def split_merged(
    sample: Sample, mesh: Any, matrix: Array = _UNMOVED
) -> tuple[Array, NDArray[np.int64]]:
    """The connected solids of a merged, placed mesh that may be rocks that are looked at.

    Looks at some faces at a time: a mesh of all rocks can be larger than what else is in memory.

    Returns:
        Vertices [n, 3] and the number of the solid that each belongs to, from 0, [n].
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    parts = [np.zeros((0, 3), np.int64)]
    for first in range(0, len(mesh.faces), _FACES):
        some = mesh.faces[first : first + _FACES]
        parts.append(some[sample.near(placed(mesh.vertices[some[:, 0]], matrix))])
    used, corner = np.unique(np.concatenate(parts).reshape(-1), return_inverse=True)
    vertices = np.ascontiguousarray(placed(mesh.vertices[used], matrix))
    # Readers may cut meshes open along seams and edges: equal places are one vertex again.
    place = vertices.astype(np.float32)
    _, same = np.unique(place.view([("", place.dtype)] * 3).reshape(-1), return_inverse=True)
    a, b, c = same.reshape(-1)[corner.reshape(-1, 3)].T
    count = int(same.max(initial=-1)) + 1
    links = np.ones(2 * len(a), np.int8)
    graph = coo_array(
        (links, (np.concatenate([a, b]), np.concatenate([b, c]))), shape=(count, count)
    )
    _, label = connected_components(graph, directed=False)
    return vertices, label[same.reshape(-1)].astype(np.int64)
