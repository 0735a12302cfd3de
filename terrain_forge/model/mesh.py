"""The triangle mesh, which rocks, their collision parts and what users bring are made of."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, Record, shaped


@dataclass(frozen=True, kw_only=True, eq=False)
class Mesh(Record):
    """A triangle mesh."""

    vertices: Array = field(metadata=shaped("vertices", 3))
    """Positions [m], shape [vertices, 3]."""
    faces: NDArray[np.int32] = field(metadata=shaped("faces", 3, dtype=np.int32))
    """Corner indices, counter-clockwise seen from outside, shape [faces, 3]."""


class TexturedMesh(NamedTuple):
    """A mesh whose vertices each have one normal and one texture coordinate."""

    vertices: Array
    """Positions in the mesh's own frame and unit, shape [vertices, 3]."""
    normals: Array
    """Unit normals, shape [vertices, 3]."""
    texture_coordinates: Array
    """u to the right, v upwards, the texture being 1 wide and high, shape [vertices, 2]."""
    faces: NDArray[np.int32]
    """Corner indices, counter-clockwise from outside, shape [faces, 3]."""
