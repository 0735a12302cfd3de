"""A ray engine of our own, for machines that Embree's wheel is not made for; slower, as exact.

It answers the calls that kernels make to Embree (`packets.py`) under Embree's names, from one block
of 32-bit words per scene: a header, a tree of boxes over all primitives, and their geometry.
Primitives are blocks of a grid's cells, triangles and copies of other scenes, in this order. The
tree is a complete binary one over the primitives sorted along a Morton curve (Lauterbach et al.
2009, doi:10.1111/j.1467-8659.2009.01377.x), so it needs no links: node n has the children 2n and
2n + 1. Coordinates are stored in 32 bits, as in Embree, and computed with in 64.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import llvmlite.binding as llvm
import numpy as np
from numba import carray, cfunc, types  # type: ignore[attr-defined]
from numpy.typing import NDArray

from terrain_forge.base import Array, inner
from terrain_forge.scene.held import Held
from terrain_forge.scene.packets import (
    COPY,
    DIRECTION_X,
    FAR,
    GEOMETRY,
    INSTANCE,
    LANES,
    NEAR,
    NORMAL_X,
    ORIGIN_X,
    ROWS,
    TRIANGLE,
    U,
    V,
)

(
    _WORDS, _LEAVES, _BOXES, _ORDER, _VERTICES, _FACES, _TRIANGLES, _ROWS, _COLUMNS, _GRID, _COPIES,
    _PLACES, _HEADER,
) = range(13)  # fmt: skip
_BLOCK = 2
"""Cells along the side of a block of a grid."""
_PLACE = 13
"""Words of a copy: the transform into its own frame and where its scene begins."""
_STACK = 128
_SLACK = 1e-9
"""Part of a triangle's side by which it is larger, so that no ray slips between neighbours."""

_floats, _ints = (types.CPointer(kind) for kind in (types.float32, types.int32))  # type: ignore[no-untyped-call]
_query = types.void(_ints, _floats, _floats, types.intp)


class TracerScene(Held):
    """Geometry that rays can be cast at; made like an `EmbreeScene`."""

    def __init__(self) -> None:
        self._grid = np.empty((0, 0, 3), np.float32)
        self._vertices = np.empty((0, 3), np.float32)
        self._faces = np.empty((0, 3), np.int32)
        self._scenes: list[TracerScene] = []
        self._which = np.empty(0, np.int32)
        self._transforms = np.empty((0, 3, 4))
        self._words = np.empty(0, np.int32)

    def add_grid(self, vertices: NDArray[np.float32], *, often: bool = False) -> None:  # noqa: ARG002
        """Set the grid of vertices [m], shape [rows, columns, 3].

        The cell (row, column) is cut from (row, column + 1) to (row + 1, column), and made ready in
        one way, however `often` rays are cast.
        """
        self._grid = np.ascontiguousarray(vertices, np.float32)

    def add_triangles(self, vertices: NDArray[np.floating], faces: NDArray[np.int32]) -> None:
        """Set the mesh: vertices [m], shape [vertices, 3], and corners, shape [faces, 3]."""
        self._vertices = np.ascontiguousarray(vertices, np.float32)
        self._faces = np.ascontiguousarray(faces, np.int32)

    def add_instances(
        self,
        scenes: Sequence[TracerScene],
        *,
        which: NDArray[np.int32],
        transforms: NDArray[np.float32],
    ) -> None:
        """Set copies of committed scenes, as `EmbreeScene.add_instances` does."""
        for scene in scenes:
            _ = scene.handle  # refuses what is released
        self._scenes, self._which = list(scenes), np.asarray(which, np.int32)
        self._transforms = np.asarray(transforms, np.float64).reshape(-1, 3, 4)

    def commit(self) -> None:
        """Build the tree; the scene can be traced from now on."""
        bounds = [_block_bounds(self._grid), _triangle_bounds(self._vertices, self._faces)]
        bounds.append(self._copy_bounds())
        low, high = (np.concatenate([b[side] for b in bounds]) for side in (0, 1))
        boxes, order = _tree(low, high)
        header = np.zeros(_HEADER, np.int32)
        header[_LEAVES], header[_TRIANGLES] = len(boxes) // 2, len(self._faces)
        header[_ROWS], header[_COLUMNS], header[_COPIES] = *self._grid.shape[:2], len(self._which)
        parts: list[NDArray[np.generic]] = [header]
        for slot, part in (
            (_BOXES, boxes),
            (_ORDER, order),
            (_VERTICES, self._vertices),
            (_FACES, self._faces),
            (_GRID, self._grid),
        ):
            header[slot] = sum(p.size for p in parts)
            parts.append(part)
        header[_PLACES] = sum(p.size for p in parts)
        header[_WORDS] = header[_PLACES] + len(self._which) * _PLACE
        starts = np.cumsum([header[_WORDS], *(len(s._words) for s in self._scenes)])
        parts += [self._places(starts), *(scene._words for scene in self._scenes)]
        self._words = np.concatenate([part.reshape(-1).view(np.int32) for part in parts])
        self._words[_WORDS] = len(self._words)
        self._handle = int(self._words.ctypes.data)

    def release(self) -> None:
        """Give the memory back."""
        self._handle, self._words = 0, np.empty(0, np.int32)

    def _copy_bounds(self) -> tuple[Array, Array]:
        """Boxes of the copies, from the corners of their scenes' boxes."""
        if not len(self._which):
            return np.empty((0, 3)), np.empty((0, 3))
        roots = np.array([scene._root() for scene in self._scenes])[self._which]
        pick = np.array([[i & 1, 2 + (i >> 1 & 1), 4 + (i >> 2 & 1)] for i in range(8)])
        corners = roots[:, [0, 3, 1, 4, 2, 5]][:, pick]  # copies, 8, 3
        turned = np.einsum("nij,nkj->nki", self._transforms[:, :, :3], corners)
        turned += self._transforms[:, None, :, 3]
        reach = 1e-6 * np.abs(turned).max(axis=(1, 2), initial=1.0)[:, None]
        return turned.min(axis=1) - reach, turned.max(axis=1) + reach

    def _root(self) -> Array:
        start = int(self._words[_BOXES]) + 6
        return self._words[start : start + 6].view(np.float32).astype(np.float64)

    def _places(self, starts: NDArray[np.int64]) -> NDArray[np.int32]:
        places = np.empty((len(self._which), _PLACE), np.int32)
        if len(places):
            turn = np.linalg.inv(self._transforms[:, :, :3])
            back = -np.einsum("nij,nj->ni", turn, self._transforms[:, :, 3])
            rows = np.concatenate([turn, back[:, :, None]], axis=2).astype(np.float32)
            places[:, :12] = rows.reshape(-1, 12).view(np.int32)
            places[:, 12] = starts[self._which]
        return places


def _block_bounds(grid: NDArray[np.float32]) -> tuple[Array, Array]:
    """Boxes of the grid's blocks, row by row."""
    if not grid.size:
        return np.empty((0, 3)), np.empty((0, 3))
    starts = [np.arange(0, count - 1, _BLOCK) for count in grid.shape[:2]]
    found = []
    for best in (np.minimum, np.maximum):
        part = grid
        for axis, first in enumerate(starts):
            within = best.reduceat(part, first, axis=axis)
            last = np.minimum(first + _BLOCK, grid.shape[axis] - 1)  # shared with the next block
            part = best(within, np.take(part, last, axis=axis))
        found.append(part.reshape(-1, 3).astype(np.float64))
    return found[0], found[1]


def _triangle_bounds(
    vertices: NDArray[np.float32], faces: NDArray[np.int32]
) -> tuple[Array, Array]:
    corners = vertices[faces].astype(np.float64).reshape(-1, 3, 3)
    return corners.min(axis=1), corners.max(axis=1)


def _tree(low: Array, high: Array) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Boxes of all nodes, the root at 1, and the primitive of each leaf, -1 for none."""
    count = len(low)
    leaves = 1 << int(np.ceil(np.log2(max(count, 1))))
    middle = low + high
    extent = np.ptp(middle, axis=0).max() if count else 1.0
    shares = (middle - middle.min(axis=0, initial=np.inf)) / max(float(extent), 1e-30)
    cell = (shares * 1023.0).astype(np.int64)
    code = np.zeros(count, np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= (cell[:, axis] >> bit & 1) << (3 * bit + axis)
    order = np.full(leaves, -1, np.int32)
    order[:count] = np.argsort(code, kind="stable")
    boxes = np.empty((2 * leaves, 6), np.float32)
    for columns, bounds, best, none in (
        (slice(0, 3), low, np.minimum, np.inf),
        (slice(3, 6), high, np.maximum, -np.inf),
    ):
        sorted_ = np.full((leaves, 3), none)
        sorted_[:count] = bounds[order[:count]]
        boxes[leaves:, columns] = np.nextafter(sorted_.astype(np.float32), np.float32(-none))
        for first in (leaves >> k for k in range(1, leaves.bit_length())):
            below = boxes[2 * first : 4 * first, columns].reshape(first, 2, 3)
            boxes[first : 2 * first, columns] = best.reduce(below, axis=1)
    boxes[0] = 0.0
    return boxes, order


@cache
def compiled() -> tuple[Any, Any]:
    """The two queries as C functions."""
    queries = [
        cfunc(_query, cache=True, error_model="numpy")(query) for query in (_intersect, _occluded)
    ]
    return queries[0], queries[1]


def register() -> None:
    """Let kernels find the queries under Embree's names; a process does this for one engine."""
    for name, query in zip(("rtcIntersect8", "rtcOccluded8"), compiled(), strict=True):
        llvm.add_symbol(name, query.address)


def _intersect(valid: Any, scene: Any, rays: Any, query: Any) -> None:  # noqa: ARG001
    """What `rtcIntersect8` does: the first hit of each active lane of a packet."""
    active, ray = carray(valid, (LANES,)), carray(rays, (ROWS, LANES))
    word, stack, hit = ray.view(np.int32), np.empty(_STACK, np.int64), np.empty(10)
    for lane in range(LANES):
        if active[lane] and _trace(scene, ray, lane, stack, hit, False):
            ray[FAR, lane] = hit[0]
            for k in range(3):
                ray[NORMAL_X + k, lane] = hit[1 + k]
            ray[U, lane], ray[V, lane] = hit[4], hit[5]
            word[TRIANGLE, lane], word[GEOMETRY, lane] = np.int32(hit[6]), np.int32(hit[9])
            word[COPY, lane] = np.int32(hit[7])
            word[INSTANCE, lane] = -1 if hit[7] < 0.0 else 0


def _occluded(valid: Any, scene: Any, rays: Any, query: Any) -> None:  # noqa: ARG001
    """What `rtcOccluded8` does: whether anything lies on the rays of the active lanes."""
    active, ray = carray(valid, (LANES,)), carray(rays, (ROWS, LANES))
    stack, hit = np.empty(_STACK, np.int64), np.empty(10)
    for lane in range(LANES):
        if active[lane] and _trace(scene, ray, lane, stack, hit, True):
            ray[FAR, lane] = -np.inf


@inner
def _trace(scene, ray, lane, stack, hit, first):  # type: ignore[no-untyped-def]
    """Find the nearest hit of a lane's ray, or the first that is found.

    `hit` gets distance, normal, u, v, triangle, copy (-1 for none), the copy that is searched, and
    1 for a triangle of the scene itself, else 0.
    """
    floats = carray(scene, (2**31 - 1,))
    words = floats.view(np.int32)
    o, d = _triple(ray, ORIGIN_X, lane), _triple(ray, DIRECTION_X, lane)
    straight = _inverse(d)
    origin, towards, inverse = o, d, straight
    near, hit[0], hit[7], hit[8] = np.float64(ray[NEAR, lane]), ray[FAR, lane], -1.0, -1.0
    base, found, top, mark, stack[0] = 0, False, 1, -1, 1
    while top > 0:
        if top == mark:  # all of a copy was seen
            base, mark, hit[8] = 0, -1, -1.0
            origin, towards, inverse = o, d, straight
        top -= 1
        node = stack[top]
        if node < 0:
            place = words[_PLACES] + (-node - 1) * _PLACE
            mark, base, hit[8] = top, words[place + 12], -node - 1.0
            origin = _moved(floats, place, o, 1.0)
            towards = _moved(floats, place, d, 0.0)
            inverse = _inverse(towards)
            node = 1
        leaves = words[base + _LEAVES]
        if node < leaves:
            boxes = base + words[base + _BOXES] + 12 * node
            left = _enters(floats, boxes, origin, inverse, near, hit[0])
            right = _enters(floats, boxes + 6, origin, inverse, near, hit[0])
            if right < left:
                left, right, node = right, left, -node
            if right < np.inf:
                stack[top] = 2 * node + 1 if node > 0 else -2 * node
                top += 1
            if left < np.inf:
                stack[top] = 2 * node if node > 0 else -2 * node + 1
                top += 1
            continue
        grid = (
            (words[base + _ROWS] + _BLOCK - 2) // _BLOCK,
            (words[base + _COLUMNS] + _BLOCK - 2) // _BLOCK,
        )
        blocks = grid[0] * grid[1]
        number = words[base + words[base + _ORDER] + node - leaves]
        if number >= blocks + words[base + _TRIANGLES]:
            stack[top] = blocks + words[base + _TRIANGLES] - number - 1
            top += 1
        elif number >= blocks:
            corner = base + words[base + _FACES] + 3 * (number - blocks)
            start = base + words[base + _VERTICES]
            a, b, c = words[corner], words[corner + 1], words[corner + 2]
            if _meets(
                floats, start + 3 * a, start + 3 * b, start + 3 * c, origin, towards, near, hit
            ):
                found, hit[6], hit[7], hit[9] = True, number - blocks, hit[8], hit[8] < 0.0
        elif number >= 0:
            row, column = number // grid[1] * _BLOCK, number % grid[1] * _BLOCK
            if _meets_block(floats, words, base, row, column, origin, towards, near, hit):
                found, hit[6], hit[7], hit[9] = True, 0.0, hit[8], 0.0
        if found and first:
            break
    return found


@inner
def _triple(ray, first, lane):  # type: ignore[no-untyped-def]
    """Three words of a lane, none of them zero, so that they can be divided by."""
    x, y = np.float64(ray[first, lane]), np.float64(ray[first + 1, lane])
    return _not_zero(x), _not_zero(y), _not_zero(np.float64(ray[first + 2, lane]))


@inner
def _not_zero(x):  # type: ignore[no-untyped-def]
    return x if abs(x) > 1e-30 else 1e-30


@inner
def _moved(floats, place, p, one):  # type: ignore[no-untyped-def]
    """A point (`one` 1) or a direction (0) in a copy's own frame."""
    x = floats[place] * p[0] + floats[place + 1] * p[1] + floats[place + 2] * p[2]
    y = floats[place + 4] * p[0] + floats[place + 5] * p[1] + floats[place + 6] * p[2]
    z = floats[place + 8] * p[0] + floats[place + 9] * p[1] + floats[place + 10] * p[2]
    x, y = x + one * floats[place + 3], y + one * floats[place + 7]
    return _not_zero(x), _not_zero(y), _not_zero(z + one * floats[place + 11])


@inner
def _inverse(d):  # type: ignore[no-untyped-def]
    return 1.0 / d[0], 1.0 / d[1], 1.0 / d[2]


@inner
def _enters(floats, box, o, inverse, near, far):  # type: ignore[no-untyped-def]
    """Where a ray enters a box, infinite where it does not."""
    for axis in range(3):
        low, high = floats[box + axis], floats[box + 3 + axis]
        if inverse[axis] < 0.0:  # an empty box, low above high, stays empty
            low, high = high, low
        near = max(near, (low - o[axis]) * inverse[axis])
        far = min(far, (high - o[axis]) * inverse[axis])
    return near if near <= far * (1.0 + 1e-9) + 1e-9 else np.inf


@inner
def _meets(floats, a, b, c, o, d, near, hit):  # type: ignore[no-untyped-def]
    """Whether a ray meets a triangle before `hit[0]`; then `hit` gets it.

    Möller and Trumbore 1997, doi:10.1080/10867651.1997.10487468.
    """
    x, y, z = np.float64(floats[a]), np.float64(floats[a + 1]), np.float64(floats[a + 2])
    ux, uy, uz = floats[b] - x, floats[b + 1] - y, floats[b + 2] - z
    vx, vy, vz = floats[c] - x, floats[c + 1] - y, floats[c + 2] - z
    px, py, pz = d[1] * vz - d[2] * vy, d[2] * vx - d[0] * vz, d[0] * vy - d[1] * vx
    det = ux * px + uy * py + uz * pz
    if det == 0.0:
        return False
    sx, sy, sz = o[0] - x, o[1] - y, o[2] - z
    u = (sx * px + sy * py + sz * pz) / det
    if u < -_SLACK or u > 1.0 + _SLACK:
        return False
    qx, qy, qz = sy * uz - sz * uy, sz * ux - sx * uz, sx * uy - sy * ux
    v = (d[0] * qx + d[1] * qy + d[2] * qz) / det
    t = (vx * qx + vy * qy + vz * qz) / det
    if v < -_SLACK or u + v > 1.0 + _SLACK or not near <= t <= hit[0]:
        return False
    hit[0], hit[1], hit[2] = t, uy * vz - uz * vy, uz * vx - ux * vz
    hit[3], hit[4], hit[5] = ux * vy - uy * vx, u, v
    return True


@inner
def _meets_block(floats, words, base, row, column, o, d, near, hit):  # type: ignore[no-untyped-def]
    """Whether a ray meets a block of the grid's cells before `hit[0]`."""
    found, columns = False, words[base + _COLUMNS]
    for i in range(row, min(row + _BLOCK, words[base + _ROWS] - 1)):
        for j in range(column, min(column + _BLOCK, columns - 1)):
            corner = base + words[base + _GRID] + 3 * (i * columns + j)
            below = corner + 3 * columns
            if _meets(floats, corner, corner + 3, below, o, d, near, hit):
                found = True
            if _meets(floats, corner + 3, below + 3, below, o, d, near, hit):
                found = True
    return found
