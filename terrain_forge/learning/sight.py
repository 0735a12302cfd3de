"""What a rover that learns sees of the ground: heights around it, or depths of a camera."""

from __future__ import annotations

import math

import mujoco
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from terrain_forge.base import Array
from terrain_forge.learning.arena import Arena, Parts

AHEAD, ASIDE, STEP = (-0.5, 2.5), 1.0, 0.25
"""Where heights are told, along the heading and to both sides of it, and their distance [m]."""
HIGHEST = 2.0
"""Largest height above or below base_link that is told [m]."""
COLUMNS, ROWS, WIDE, TALL, FARTHEST = 24, 16, math.radians(80.0), math.radians(50.0), 8.0
"""Pixels of the depth camera, its angles [rad] and how far it sees [m]."""
_DOWN = math.radians(20.0)
_TELLS_NORMALS = "normal" in str(mujoco.mj_multiRay.__doc__)
"""Whether this version of MuJoCo takes an array for them."""


class HeightScan:
    """Heights of ground and rocks around base_link, less its own; the highest about each point."""

    def __init__(self) -> None:
        x = np.arange(AHEAD[0], AHEAD[1] + 0.5 * STEP, STEP)
        y = np.arange(-ASIDE, ASIDE + 0.5 * STEP, STEP)
        self._x, self._y = (part.astype(np.float64) for part in np.meshgrid(x, y, indexing="ij"))
        self.space = spaces.Box(-HIGHEST, HIGHEST, self._x.shape, np.float32)
        self._kept: dict[str, NDArray[np.float32]] = {}
        self._highest = np.zeros((2, 2), np.float32)

    def begin(self, arena: Arena, parts: Parts) -> None:
        """Take a world: the highest about each point counts, so that no rock hides."""
        from scipy.ndimage import maximum_filter

        del parts
        name = str(arena.folder)
        if name not in self._kept:
            span = max(round(STEP / arena.spacing), 1)
            self._kept[name] = maximum_filter(arena.top, span, mode="nearest")
        self._highest = self._kept[name]

    def look(self, arena: Arena, parts: Parts, cos: float, sin: float) -> NDArray[np.float32]:
        """The heights, rows ahead, columns from right to left, shape [13, 9]."""
        x, y, z = arena.data.qpos[parts.pose][:3].tolist()
        west, south = arena.origin
        spacing, (rows, columns) = arena.spacing, self._highest.shape
        column = np.rint((x - west + cos * self._x - sin * self._y) / spacing).astype(np.intp)
        row = np.rint((y - south + sin * self._x + cos * self._y) / spacing).astype(np.intp)
        np.clip(column, 0, columns - 1, out=column)
        np.clip(row, 0, rows - 1, out=row)
        seen = self._highest[row, column] - np.float32(z)
        return np.asarray(np.clip(seen, -HIGHEST, HIGHEST))


class DepthCamera:
    """Distances at which rays of a camera on the front meet something; it needs no OpenGL."""

    def __init__(self) -> None:
        self.space = spaces.Box(0.0, FARTHEST, (ROWS, COLUMNS), np.float32)
        across = np.linspace(0.5 * WIDE, -0.5 * WIDE, COLUMNS)
        up = np.linspace(0.5 * TALL, -0.5 * TALL, ROWS) - _DOWN
        level = np.cos(up)[:, None]
        self._rays: Array = np.stack(
            [
                level * np.cos(across),
                level * np.sin(across),
                np.broadcast_to(np.sin(up)[:, None], (ROWS, COLUMNS)),
            ],
            axis=-1,
        ).reshape(-1, 3)
        self._mount = np.zeros(3)
        self._groups = np.array([1, 1, 0, 1, 0, 0], np.uint8)  # ground, rocks and their hulls

    def begin(self, arena: Arena, parts: Parts) -> None:
        """Mount the camera at the rover's front, twice its clearance up."""
        del parts
        rover = arena.rover
        self._mount = np.array([0.5 * rover.length, 0.0, max(2.0 * rover.clearance, 0.4)])

    def look(self, arena: Arena, parts: Parts, cos: float, sin: float) -> NDArray[np.float32]:
        """The distances [m], rows from above, columns from left to right; the farthest for none."""
        del cos, sin
        turn = arena.data.xmat[parts.body].reshape(3, 3)
        eye = arena.data.xpos[parts.body] + turn @ self._mount
        rays = self._rays @ turn.T
        distance = np.empty(len(rays))
        hit = np.empty(len(rays), np.int32)
        normals = (None,) if _TELLS_NORMALS else ()
        mujoco.mj_multiRay(
            arena.model, arena.data, eye, rays.ravel(), self._groups, 1, parts.body, hit,
            distance, *normals, len(rays), FARTHEST,
        )  # fmt: skip
        distance[hit < 0] = FARTHEST
        return distance.reshape(ROWS, COLUMNS).astype(np.float32)
