"""What a file holds: a part of the ground, in bands of rows, and the rocks on it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrain_forge.geometry import merge_in_parts
from terrain_forge.model import Heightfield, World

BAND_NODES = 1 << 16
"""Nodes that are turned into vertices at once: they then stay in the processor's cache."""


@dataclass(frozen=True, kw_only=True)
class Part:
    """The part of a world that one file holds."""

    name: str
    """Name of the file, without its ending."""
    world: World
    """That part: the whole world, or a tile of it."""
    whole: World
    """The whole world."""
    tile_cells: int
    """Cells per tile whose rocks are joined at once, each way."""
    finest_min: float
    """Merged rocks of at least this exposed diameter have their shapes' finest meshes [m]."""
    detail: tuple[int, ...]
    """Level of detail of each prototype where merged rocks are smaller."""

    @property
    def ground(self) -> Heightfield:
        """The part's ground."""
        return self.world.ground

    def merged_rocks(self) -> Iterator[tuple[int, NDArray[np.float64], NDArray[np.int32]]]:
        """The rocks' meshes, tile by tile: population, vertices [m] and faces."""
        prototypes = self.whole.library.prototypes
        finest = [shape.meshes[0] for shape in prototypes]
        coarse = [shape.meshes[n] for shape, n in zip(prototypes, self.detail, strict=True)]
        for tile in self.world.tiles(cells=self.tile_cells):
            fine = tile.field.diameter >= self.finest_min
            groups = np.unique(np.stack([tile.field.population, fine], axis=-1), axis=0)
            for population, large in groups.tolist():
                rocks = tile.field.select((tile.field.population == population) & (fine == large))
                shapes = finest if large else coarse
                for vertices, faces in merge_in_parts(rocks, shapes, self.whole.ground):
                    yield population, vertices, faces


def node_bands(ground: Heightfield) -> Iterator[tuple[slice, Heightfield]]:
    """The rows of nodes in bands that share none of them, from the south."""
    rows, columns = ground.shape
    step = max(1, BAND_NODES // columns)
    for first in range(0, rows, step):
        band = slice(first, min(first + step, rows))
        origin = (ground.origin[0], ground.origin[1] + first * ground.spacing)
        yield band, ground.replace(elevation=ground.elevation[band], origin=origin)


def cell_bands(ground: Heightfield) -> Iterator[tuple[slice, Heightfield]]:
    """The rows of cells in bands that share their border nodes, from the south."""
    rows, columns = ground.shape
    step = max(1, BAND_NODES // columns)
    for first in range(0, rows - 1, step):
        last = min(first + step, rows - 1)
        cut = ground.cut(column=0, row=first, columns=columns - 1, rows=last - first)
        yield slice(first, last), cut
