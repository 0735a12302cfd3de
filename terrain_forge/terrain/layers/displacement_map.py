"""Relief from a displacement image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from annotated_types import Interval, MinLen

from terrain_forge.base import Array, Fraction, InputFile, PositivePair
from terrain_forge.dtm import cubic
from terrain_forge.model import Site, Window
from terrain_forge.terrain.layer import Layer


@dataclass(frozen=True, kw_only=True)
class DisplacementMap(Layer):
    """Height from an image: value × height, value 0 to 1 (8 and 16 bit: of the type's range).

    North is up. The image covers the whole site, its outer pixels' centres on the site's edges, or
    is laid in tiles of a given size.
    """

    kind: Literal["displacement_map"] = "displacement_map"
    image: Annotated[str, MinLen(1), InputFile(kind="image")]
    """Image file (8 or 16 bit, or float), its path relative to the recipe."""
    height_m: Annotated[float, Interval(ge=-1e4, le=1e4)]
    """Height of the value 1 above the value 0 [m]; negative turns hills into hollows."""
    zero_level: Fraction = 0.0
    """The value that leaves the ground where it is."""
    tile_m: PositivePair | None = None
    """Size of one tile, east and north [m]; without it the image covers the site once."""

    def relief(self, *, site: Site, window: Window, elevation: Array) -> Array:  # noqa: ARG002
        """The image, interpolated by a cubic kernel at the window's nodes."""
        values = site.image(self.image)
        east, north = site.axes(window)
        rows, columns = values.shape
        if self.tile_m is None:
            column = (east - site.west) / site.size[0] * (columns - 1)
            row = (north - site.south) / site.size[1] * (rows - 1)
        else:
            column = np.mod((east - site.west) / self.tile_m[0] * columns - 0.5, columns)
            row = np.mod((north - site.south) / self.tile_m[1] * rows - 0.5, rows)
        grid = np.broadcast_arrays(column[None, :], row[:, None])
        value = cubic(values, column=grid[0], row=grid[1], wrap=self.tile_m is not None)
        return self.height_m * (value - self.zero_level)
