"""What lies beyond a world's edge, out to the horizon."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Record, shaped
from terrain_forge.model.mesh import Mesh


@dataclass(frozen=True, kw_only=True, eq=False)
class Horizon(Record):
    """Ground and rocks beyond a world's edge: seen by cameras and lidars, felt by nothing.

    The first vertices are the nodes of the world's border, counter-clockwise from the south-western
    corner, so that there is neither crack nor step.
    """

    mesh: Mesh
    """Rings of ground, then rocks, in the world frame [m]; the body's curvature is in them."""
    normals: NDArray[np.float32] = field(metadata=shaped("vertices", 3, dtype=np.float32))
    """Unit normals at the vertices, at the border those of the ground, shape [vertices, 3]."""
    rgb: NDArray[np.uint8] = field(metadata=shaped("vertices", 3, dtype=np.uint8))
    """sRGB colour of the vertices, shape [vertices, 3]."""
    ground_vertices: int
    """Vertices of the ground; those of rocks follow."""
    ground_faces: int
    """Triangles of the ground; those of rocks follow."""
    rocks: int
    """Number of rocks."""
    reach: float
    """How far from the border it goes, along the axes [m]."""
    followed: float
    """How far from the border heights that were read are followed, along the axes [m]."""
    told: str
    """What it is made from, for the report."""
