"""Rows back and forth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Interval

from terrain_forge.base import Key, NotNegative, Positive, RecipeError
from terrain_forge.paths.curves import Curve, trace_polyline
from terrain_forge.paths.named_shape import NamedShape, shortening


@dataclass(frozen=True, kw_only=True)
class Lawnmower(NamedShape):
    """Parallel rows, driven back and forth from the south-western end."""

    kind: Literal["lawnmower"] = "lawnmower"
    rows: Annotated[int, Interval(ge=2, le=1000)] = 5
    """Number of rows."""
    row_spacing_m: Positive = 2.0
    """Distance of neighbouring rows [m]."""
    corner_radius_m: NotNegative | None = None
    """Radius of the arcs from row to row [m]; half the rows' distance by default, at 0 the rover
    turns on the spot."""

    closed: ClassVar[bool] = False

    def outline(self, key: Key) -> Curve:
        """The rows with the arcs between them."""
        across = self.row_spacing_m
        radius = 0.5 * across if self.corner_radius_m is None else self.corner_radius_m
        if radius > 0.5 * across:
            raise RecipeError(
                f"{radius:g} m, at most half of row_spacing_m, {0.5 * across:g} m",
                key=(*key, "corner_radius_m"),
            )
        extra = (self.rows - 1) * (across - 2.0 * shortening(radius, 0.5 * np.pi))
        row = self.size_m or ((self.length_m or 0.0) - extra) / self.rows
        length = self.rows * row + extra
        self.check_side(row, least=2.0 * radius, pieces=self.rows, length=length, key=key)
        key = (*key, "corner_radius_m")
        rows = np.arange(self.rows)
        north = (rows - 0.5 * (self.rows - 1)) * across
        east = 0.5 * row * np.where(rows % 2, 1.0, -1.0)  # where each row begins
        ends = np.stack([np.stack([east, -east], -1).ravel(), np.repeat(north, 2)], -1)
        return trace_polyline(ends, closed=False, radius=radius, key=key)
