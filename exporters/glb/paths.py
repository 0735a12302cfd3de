"""Paths as animations: an empty node that moves as the rover's base_link does."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import xyzw
from terrain_forge.model import Trajectory
from terrain_forge.writers import Gltf


def path_node(trajectory: Trajectory) -> dict[str, Any]:
    """The node in the pose of the path's first sample."""
    return {
        "name": f"path_{trajectory.name}",
        "translation": trajectory.position[0].tolist(),
        "rotation": _turns(trajectory)[0].tolist(),
    }


def animate(trajectory: Trajectory, gltf: Gltf, *, node: int) -> None:
    """Add the animation of the node of that index: the trajectory's samples, straight between."""
    times = gltf.add_samples(trajectory.time[:, None].astype(np.float32), bounded=True)
    values = {
        "translation": trajectory.position.astype(np.float32),
        "rotation": _turns(trajectory).astype(np.float32),
    }
    samplers = [
        {"input": times, "output": gltf.add_samples(some), "interpolation": "LINEAR"}
        for some in values.values()
    ]
    channels = [
        {"sampler": number, "target": {"node": node, "path": name}}
        for number, name in enumerate(values)
    ]
    animation = {"name": trajectory.name, "samplers": samplers, "channels": channels}
    gltf.add("animations", animation)


def _turns(trajectory: Trajectory) -> NDArray[np.float64]:
    """Rotations (x, y, z, w) of the samples, each on the side of the one before.

    A quaternion and its negative are the same turn, but between the two a reader that blends
    numbers would spin.
    """
    quaternions = xyzw(trajectory.quaternion)
    turns_over = (quaternions[1:] * quaternions[:-1]).sum(axis=1) < 0
    sign = np.cumprod(np.where(np.concatenate([[False], turns_over]), -1.0, 1.0))
    return quaternions * sign[:, None]
