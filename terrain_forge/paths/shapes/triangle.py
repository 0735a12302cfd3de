"""A triangle."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from terrain_forge.base import Key, NotNegative
from terrain_forge.paths.curves import Curve, trace_polyline
from terrain_forge.paths.named_shape import NamedShape, shortening


@dataclass(frozen=True, kw_only=True)
class Triangle(NamedShape):
    """An equilateral triangle around its centre, anticlockwise along its southern side first."""

    kind: Literal["triangle"] = "triangle"
    corner_radius_m: NotNegative = 0.0
    """Radius of the arcs around its corners [m]; at 0 the rover turns on the spot there."""

    def outline(self, key: Key) -> Curve:
        """The triangle with its arcs."""
        radius = self.corner_radius_m
        lost = 3.0 * shortening(radius, 2.0 * np.pi / 3.0)
        side = self.size_m or ((self.length_m or 0.0) + lost) / 3.0
        least, length = 2.0 * math.sqrt(3.0) * radius, 3.0 * side - lost
        self.check_side(side, least=least, pieces=3, length=length, key=key)
        low, high = -side / math.sqrt(12.0), side / math.sqrt(3.0)
        points = np.array([(-0.5 * side, low), (0.5 * side, low), (0.0, high)])
        return trace_polyline(points, closed=True, radius=radius, key=(*key, "corner_radius_m"))
