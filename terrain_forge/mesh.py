"""The triangle mesh, which rocks, their collision parts and what users bring are made of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrain_forge.records import Record

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Mesh(Record):
    """A triangle mesh."""

    vertices: Array
    """Positions [m], shape [vertices, 3]."""
    faces: NDArray[np.int32]
    """Corner indices, counter-clockwise seen from outside, shape [faces, 3]."""

    def __post_init__(self) -> None:
        self.freeze("vertices", np.float64, ("vertices", 3))
        self.freeze("faces", np.int32, ("faces", 3))
