"""What a rover that learns sees of the ground: heights around it, or depths of a camera."""

from __future__ import annotations

import math
from collections import OrderedDict
from pathlib import Path

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from terrain_forge.base import Array, kernel
from terrain_forge.learning.arena import KEPT, Arena, Parts

AHEAD, ASIDE, STEP = (-0.5, 2.5), 1.0, 0.25
"""Where heights are told, along the heading and to both sides of it, and their distance [m]."""
HIGHEST = 2.0
"""Largest height above or below base_link that is told [m]."""
COLUMNS, ROWS, WIDE, TALL, FARTHEST = 24, 16, math.radians(80.0), math.radians(50.0), 8.0
"""Pixels of the depth camera, its angles [rad] and how far it sees [m]."""
_DOWN = math.radians(20.0)
_STRIDE = 0.5
"""How far a ray goes at once [spacings]."""


class HeightScan:
    """Heights of ground and rocks around base_link, less its own; the highest about each point."""

    def __init__(self) -> None:
        x = np.arange(AHEAD[0], AHEAD[1] + 0.5 * STEP, STEP)
        y = np.arange(-ASIDE, ASIDE + 0.5 * STEP, STEP)
        self._x, self._y = x.astype(np.float64), y.astype(np.float64)
        self.space = spaces.Box(-HIGHEST, HIGHEST, (len(x), len(y)), np.float32)
        self._kept: OrderedDict[tuple[Path, int], NDArray[np.float32]] = OrderedDict()
        self._highest = np.zeros((2, 2), np.float32)

    def begin(self, arena: Arena) -> None:
        """Take a world: the highest about each point counts, so that no rock hides."""
        from scipy.ndimage import maximum_filter

        world = arena.folder, arena.written
        if world not in self._kept:
            # As far as a corner of a point's square lies, however it is turned, from its node.
            reach = math.floor(STEP / (math.sqrt(2.0) * arena.spacing) + 0.5)
            self._kept[world] = maximum_filter(arena.top, 2 * reach + 1, mode="nearest")
        self._kept.move_to_end(world)
        if len(self._kept) > KEPT:
            self._kept.popitem(last=False)
        self._highest = self._kept[world]

    def look(self, arena: Arena, parts: Parts, cos: float, sin: float) -> NDArray[np.float32]:
        """The heights, rows ahead, columns from right to left, shape [13, 9]."""
        seen = np.empty((len(self._x), len(self._y)), np.float32)
        place = tuple(arena.data.qpos[parts.pose][:3].tolist())
        grid = (*arena.origin, arena.spacing)
        _scan(self._highest, grid, place, (cos, sin), self._x, self._y, seen)
        return seen


class DepthCamera:
    """Distances at which rays of a camera on the rover's front meet ground or rocks.

    The rays march over the heights of ground and rocks at the nodes, half a spacing at once, and
    end between the last step above and the first below: no OpenGL, and no overhangs.
    """

    def __init__(self) -> None:
        self.space = spaces.Box(0.0, FARTHEST, (ROWS, COLUMNS), np.float32)
        across = np.linspace(0.5 * WIDE, -0.5 * WIDE, COLUMNS)
        up = np.linspace(0.5 * TALL, -0.5 * TALL, ROWS) - _DOWN
        level = np.cos(up)[:, None]
        parts = (
            level * np.cos(across),
            level * np.sin(across),
            np.broadcast_to(np.sin(up)[:, None], (ROWS, COLUMNS)),
        )
        self._rays: Array = np.stack(parts, axis=-1).reshape(-1, 3)
        self._mount = np.zeros(3)
        self._highest = 0.0

    def begin(self, arena: Arena) -> None:
        """Mount the camera at the rover's front, twice its clearance up."""
        rover = arena.rover
        self._mount = np.array([0.5 * rover.length, 0.0, max(2.0 * rover.clearance, 0.4)])
        self._highest = float(arena.top.max())

    def look(self, arena: Arena, parts: Parts, cos: float, sin: float) -> NDArray[np.float32]:
        """The distances [m], rows from above, columns from left to right; the farthest for none."""
        del cos, sin
        turn = arena.data.xmat[parts.body].reshape(3, 3)
        eye = arena.data.xpos[parts.body] + turn @ self._mount
        grid = (*arena.origin, arena.spacing)
        seen = np.empty((ROWS, COLUMNS), np.float32)
        rays, stride = self._rays @ turn.T, _STRIDE * arena.spacing
        _march(arena.top, grid, self._highest, eye, rays, stride, FARTHEST, seen)
        return seen


@kernel
def _scan(top, grid, place, turn, x, y, seen):  # type: ignore[no-untyped-def]
    """Heights about a place, less its own, at x ahead and y to the left."""
    west, south, spacing = grid
    rows, columns = top.shape
    cos, sin = turn
    for n in range(len(x)):
        for k in range(len(y)):
            i = round((place[0] - west + cos * x[n] - sin * y[k]) / spacing)
            j = round((place[1] - south + sin * x[n] + cos * y[k]) / spacing)
            i, j = min(max(i, 0), columns - 1), min(max(j, 0), rows - 1)
            seen[n, k] = min(max(top[j, i] - place[2], -2.0), 2.0)


@kernel
def _march(top, grid, highest, eye, rays, stride, farthest, seen):  # type: ignore[no-untyped-def]
    """Distance at which each ray first lies below the heights of the nodes."""
    west, south, spacing = grid
    rows, columns = top.shape
    found = seen.reshape(-1)
    above = max(eye[2] - highest, 0.0)  # of all that there is
    for n in range(len(rays)):
        found[n] = farthest
        if above > 0.0 and rays[n, 2] >= 0.0:
            continue
        far, last = stride, np.inf
        if above > 0.0:
            far *= max(np.floor(above / -rays[n, 2] / stride), 1.0)
        while far < farthest:
            i = round((eye[0] + far * rays[n, 0] - west) / spacing)
            j = round((eye[1] + far * rays[n, 1] - south) / spacing)
            if i < 0 or j < 0 or i >= columns or j >= rows:
                break
            gap = eye[2] + far * rays[n, 2] - top[j, i]
            if gap <= 0.0:
                found[n] = far + stride * gap / (last - gap)
                break
            last = gap
            far += stride
