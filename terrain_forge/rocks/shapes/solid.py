"""Volume, centre of mass and inertia of a closed mesh, exactly."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from terrain_forge.base import Array
from terrain_forge.model import Mesh


class MassProperties(NamedTuple):
    """Mass properties of a homogeneous solid of density 1 kg/m³."""

    volume: float
    """Volume [m³]; positive where the faces point outward."""
    centre: Array
    """Centre of mass [m], shape [3]."""
    inertia: Array
    """Inertia tensor about the centre of mass [kg m²], shape [3, 3]."""


def signed_volume(mesh: Mesh) -> float:
    """Volume of a closed mesh [m³]; negative where the faces point inward."""
    vertices = mesh.vertices - mesh.vertices.mean(axis=0)
    a, b, c = (vertices[mesh.faces[:, corner]] for corner in range(3))
    return float(np.einsum("ij,ij->", np.cross(a, b), c) / 6.0)


def mass_properties(mesh: Mesh) -> MassProperties:
    """Integrate over the signed tetrahedra between a closed mesh's middle and each of its faces.

    Taken from a far origin they would be large and cancel out, to no digits.

    With s the sum of a tetrahedron's corners a, b, c (the fourth is the middle) and V its volume,
    the integral of x xᵀ over it is V/20 (s sᵀ + a aᵀ + b bᵀ + c cᵀ); the inertia is tr(C) 1 - C of
    their sum C. Tonon 2004, doi:10.3844/jmssp.2005.8.11.
    """
    middle = mesh.vertices.mean(axis=0)
    corners = (mesh.vertices - middle)[mesh.faces]
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    volumes = np.einsum("ij,ij->i", np.cross(a, b), c) / 6.0
    volume = volumes.sum()
    sums = corners.sum(axis=1)
    centre = np.einsum("i,ij->j", volumes, sums) / (4.0 * volume)
    second = np.einsum("ij,ik->jk", volumes[:, None] * sums, sums)
    for corner in (a, b, c):
        second += np.einsum("ij,ik->jk", volumes[:, None] * corner, corner)
    central = second / 20.0 - volume * np.outer(centre, centre)
    return MassProperties(
        volume=float(volume),
        centre=middle + centre,
        inertia=np.trace(central) * np.eye(3) - central,
    )
