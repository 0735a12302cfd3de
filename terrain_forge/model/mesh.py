"""The triangle mesh, which rocks, their collision parts and what users bring are made of."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, Record, require_indices, shaped


@dataclass(frozen=True, kw_only=True, eq=False)
class Mesh(Record):
    """A triangle mesh."""

    vertices: Array = field(metadata=shaped("vertices", 3))
    """Positions [m], shape [vertices, 3]."""
    faces: NDArray[np.int32] = field(metadata=shaped("faces", 3, dtype=np.int32))
    """Corner indices, counter-clockwise seen from outside, shape [faces, 3]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_indices(self.faces, len(self.vertices), "a face's vertex")

    @cached_property
    def is_closed(self) -> bool:
        """Whether it is closed and faces outward.

        Closed: each edge is walked once each way, by two faces, so that none is open or turned
        over. Outward: the volume that the faces enclose is positive.
        """
        faces = self.faces.astype(np.int64)
        begin, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
        count = len(self.vertices)
        there, back = np.sort(begin * count + end), np.sort(end * count + begin)
        a, b, c = (self.vertices[faces[:, corner]] for corner in range(3))
        volume = float(np.einsum("ij,ij->", a, np.cross(b, c)))
        once = bool(np.all(there[1:] > there[:-1]))
        return volume > 0.0 and once and bool(np.array_equal(there, back))


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


def box_projection(mesh: Mesh) -> Array:
    """Texture coordinates of a mesh's face corners, one tile per metre, shape [faces, 3, 2].

    Each face is projected along the axis that its normal is nearest to, so that no length is
    stretched more than √3 times; faces that look along different axes meet in a seam. Seen from
    outside, the texture is never mirrored.
    """
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    axis = np.abs(normals).argmax(axis=1)
    across, along = (axis + 1) % 3, (axis + 2) % 3
    u = np.take_along_axis(corners, across[:, None, None], axis=2)[:, :, 0]
    v = np.take_along_axis(corners, along[:, None, None], axis=2)[:, :, 0]
    facing = np.take_along_axis(normals, axis[:, None], axis=1)
    return np.stack([np.where(facing < 0.0, -u, u), v], axis=-1) + 0.5
