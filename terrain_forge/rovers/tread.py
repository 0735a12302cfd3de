"""The tread of a wheel of a user's rover: its radius and width, measured on its shapes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from terrain_forge.base import (
    Array,
    DataError,
    matrix_from_quaternion,
    portable,
    quaternion_from_rpy,
)
from terrain_forge.model import Shape
from terrain_forge.rovers.assembly import Solid

_ALIGNED = math.cos(math.radians(2.0))
_TYRE = (0.16, 0.16, 0.17)


@dataclass(frozen=True, kw_only=True, eq=False)
class Tread:
    """Where and how a wheel rolls."""

    centre: Array
    """Middle of the wheel in base_link's frame [m], shape [3]."""
    axis: Array
    """Unit vector, shape [3]."""
    radius: float
    """[m]."""
    width: float
    """[m]."""
    round: bool
    """Whether what collides is a sphere or a cylinder of this very radius already."""

    def dress(self, shapes: Sequence[Shape], origin: Array) -> list[Shape]:
        """The wheel's shapes; a smooth cylinder collides in place of what is not round.

        Hulls and boxes are polygons, on which a rover jolts.

        Args:
            shapes: In the link's frame.
            origin: Of the link's frame in base_link's [m].
        """
        if self.round:
            return list(shapes)
        kept = [s.replace(collides=False) for s in shapes if s.visible]
        x, y, z = self.axis.tolist()
        turn = (math.asin(-min(max(y, -1.0), 1.0)), math.atan2(x, z), 0.0)
        cylinder = Shape(
            kind="cylinder",
            size=(self.radius, self.width),
            position=self.centre - origin,
            rpy=np.array(turn),
            collides=True,
            rgb=_TYRE,
            visible=not kept,
        )
        return [cylinder, *kept]


def measure_tread(
    name: str,
    solids: Sequence[Solid],
    *,
    centre: Array,
    axis: Array,
    radius: float | None,
) -> Tread:
    """The tread of a wheel, by what collides of it, else by what is seen.

    Args:
        name: The wheel's link, for messages.
        solids: Its solids and their poses in base_link's frame.
        centre: A point of its axis in base_link's frame [m].
        axis: Its axis, unit vector.
        radius: Its radius where the recipe tells [m].

    Raises:
        DataError: if it has no shape and no radius was told.
    """
    touched = [(pose, s) for pose, s in solids if s.collides] or solids
    if not touched:
        raise DataError(
            f"wheel {name!r} has no geometry: its radius is unknown", key=("rover", "wheels")
        )
    points = np.concatenate([outline(s, p[:3, :3], p[:3, 3]) for p, s in touched]) - centre
    along = portable.product(points, axis)
    reach = np.linalg.norm(points - along[:, None] * axis, axis=1)
    measured, width = float(reach.max()), float(np.ptp(along))
    pose, shape = touched[0]
    aligned = abs(float(portable.product(pose[:3, 2], axis))) > _ALIGNED
    exact = len(touched) == 1 and shape.collides
    exact &= shape.kind == "sphere" or (shape.kind == "cylinder" and aligned)
    if exact:
        measured = shape.size[0]
        width = shape.size[1] if shape.kind == "cylinder" else 2 * measured
    return Tread(
        centre=centre + (along.max() + along.min()) / 2 * axis,
        axis=axis,
        radius=radius or measured,
        width=width,
        round=exact and radius is None,
    )


def corners(shape: Shape) -> Array:
    """Points of a shape that no point of it exceeds, in the link's frame [m], shape [n, 3]."""
    return outline(shape, matrix_from_quaternion(quaternion_from_rpy(shape.rpy)), shape.position)


def outline(shape: Shape, rotation: Array, position: Array) -> Array:
    """Outermost points of a shape that is turned and put somewhere [m], shape [n, 3]."""
    size = shape.size
    angles = np.linspace(0.0, 2 * math.pi, 72, endpoint=False)
    ring = size[0] * np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])
    if shape.mesh is not None:
        points = shape.mesh.vertices
    elif shape.kind == "box":
        points = np.array(np.meshgrid(*[(-0.5, 0.5)] * 3)).reshape(3, -1).T * size
    elif shape.kind == "sphere":
        points = np.concatenate([ring, ring[:, [0, 2, 1]], ring[:, [2, 0, 1]]])
    else:
        points = np.concatenate([ring + np.array([0, 0, z]) for z in (-size[1] / 2, size[1] / 2)])
    return np.asarray(portable.product(points, rotation.T) + position)
