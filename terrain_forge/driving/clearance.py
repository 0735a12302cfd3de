"""How much free height there was under a rover that drove."""

from __future__ import annotations

import numpy as np

from terrain_forge.base import Array, matrix_from_quaternion
from terrain_forge.driving.result import DriveResult
from terrain_forge.model import Rover, World
from terrain_forge.scene import open_scene

_POINTS = (7, 5)
_ABOVE = 1.0


def measure_clearance(world: World, result: DriveResult) -> DriveResult:
    """The result with the free height under the rover's belly over ground and rocks at each pose.

    The belly is the level rectangle between the wheels at the rover's own clearance. A height is
    negative where a rock or the ground reaches above it.
    """
    belly = belly_points(world.rover)
    rotation = matrix_from_quaternion(result.quaternion)
    points = result.position[:, None, :] + belly @ rotation.transpose(0, 2, 1)
    starts = points.reshape(-1, 3) + np.array([0.0, 0.0, _ABOVE])
    down = np.broadcast_to((0.0, 0.0, -1.0), starts.shape)
    with open_scene(world) as scene:
        distance = scene.cast(starts, down).distance.astype(np.float64)
    free = np.where(np.isfinite(distance), distance - _ABOVE, np.inf).reshape(points.shape[:2])
    lowest = free.min(axis=1)
    return result.replace(clearance=np.where(np.isfinite(lowest), lowest, world.rover.clearance))


def belly_points(rover: Rover) -> Array:
    """Points of the belly in base_link's frame [m], shape [points, 3]."""
    centres = rover.wheel_centres
    inner = np.abs(centres[:, 1]).max() - max(wheel.width for wheel in rover.wheels) / 2
    x = np.linspace(centres[:, 0].min(), centres[:, 0].max(), _POINTS[0])
    y = np.linspace(-inner, inner, _POINTS[1])
    east, north = np.meshgrid(x, y)
    return np.column_stack([east.ravel(), north.ravel(), np.full(east.size, rover.clearance)])
