"""What a file holds: a tile of the ground and the rocks on it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrain_forge.geometry import grouped, merge_in_parts
from terrain_forge.model import Tile


@dataclass(frozen=True, kw_only=True)
class Part:
    """The part of a world that one file holds."""

    name: str
    """Name of the file, without its ending."""
    tile: Tile
    """That part."""
    tile_cells: int
    """Cells per tile whose rocks are joined at once, each way."""
    finest_min: float
    """Merged rocks of at least this exposed diameter have their shapes' finest meshes [m]."""
    detail: tuple[int, ...]
    """Level of detail of each prototype where merged rocks are smaller."""

    def merged_rocks(self) -> Iterator[tuple[int, NDArray[np.float64], NDArray[np.int32]]]:
        """The rocks' meshes, tile by tile: population, vertices [m] and faces."""
        prototypes = self.tile.whole.library.prototypes
        finest = [shape.meshes[0] for shape in prototypes]
        coarse = [shape.meshes[n] for shape, n in zip(prototypes, self.detail, strict=True)]
        for tile in self.tile.world.tiles(cells=self.tile_cells):
            large = tile.field.diameter >= self.finest_min
            for population, fine, rocks in grouped(tile.field, large):
                shapes = finest if fine else coarse
                for vertices, faces in merge_in_parts(rocks, shapes, self.tile.whole.ground):
                    yield population, vertices, faces
