"""Mass properties of links made of simple homogeneous solids."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from terrain_forge.base import Array, matrix_from_quaternion, portable, quaternion_from_rpy
from terrain_forge.model import Shape


def solid_inertia(shape: Shape, mass: float) -> Array:
    """Inertia of one homogeneous solid about its centre [kg m²], link axes, shape [3, 3].

    Box: m(b²+c²)/12; cylinder: m r²/2 along its axis, m(3r²+l²)/12 across; sphere: 2 m r²/5.

    Raises:
        ValueError: for an unknown kind of shape.
    """
    if shape.kind == "box":
        squares = np.square(shape.size)
        diagonal = mass / 12 * (squares.sum() - squares)
    elif shape.kind == "cylinder":
        radius, length = shape.size
        across = mass / 12 * (3 * radius**2 + length**2)
        diagonal = np.array([across, across, mass / 2 * radius**2])
    elif shape.kind == "sphere":
        diagonal = np.full(3, 0.4 * mass * shape.size[0] ** 2)
    else:
        raise ValueError(f"shape of kind {shape.kind!r}: box, cylinder or sphere")
    rotation = matrix_from_quaternion(quaternion_from_rpy(shape.rpy))
    # Right angles leave 1e-17 where a product of inertia is zero.
    return np.round(portable.product(rotation * diagonal, rotation.T), 14)


def combine(parts: Sequence[tuple[Shape, float]]) -> tuple[float, Array, Array]:
    """Mass [kg], centre of mass [m] and inertia about it [kg m²] of shapes with their masses [kg].

    All in the link's frame; the parallel axis theorem (Steiner) carries each part to the centre.
    """
    mass = sum(part_mass for _, part_mass in parts)
    centre = sum((part_mass * shape.position for shape, part_mass in parts), np.zeros(3)) / mass
    inertia = np.zeros((3, 3))
    for shape, part_mass in parts:
        arm = shape.position - centre
        steiner = part_mass * (portable.product(arm, arm) * np.eye(3) - np.outer(arm, arm))
        inertia += solid_inertia(shape, part_mass) + steiner
    return mass, centre, inertia
