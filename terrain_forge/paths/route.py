"""A route: where a path goes in the plane, before there is any ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrain_forge.records import Record

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Route(Record):
    """A smooth curve in the plane, as a dense polyline (points every few centimetres)."""

    name: str
    """Name of the path."""
    position: Array
    """Points, east and north [m], shape [points, 2]; a closed route repeats its first point."""
    heading: Array
    """Direction of travel, counter-clockwise from east [rad], continuous, shape [points]."""
    distance: Array
    """Length along the route [m], from 0, shape [points]."""
    closed: bool
    """Whether it ends where it began."""
    speed: float
    """Speed along the route [m/s]."""
    corridor_width: float
    """Width of the strip along the route that is kept free of rocks [m]; 0 for none."""
    corridor_clearance: float
    """Height above the ground that no rock within the corridor exceeds [m]."""

    def __post_init__(self) -> None:
        self.freeze("position", np.float64, ("points", 2))
        self.freeze("heading", np.float64, (len(self.position),))
        self.freeze("distance", np.float64, (len(self.position),))

    @property
    def length(self) -> float:
        """Length of the route [m]."""
        return float(self.distance[-1])
