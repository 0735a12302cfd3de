"""A route: where a path goes in the plane, before there is any ground."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, Record, shaped


@dataclass(frozen=True, kw_only=True, eq=False)
class Route(Record):
    """A curve in the plane, as a dense polyline (points every few centimetres).

    A turn on the spot is a run of points at one place.
    """

    name: str
    """Name of the path."""
    position: Array = field(metadata=shaped("points", 2))
    """Points, east and north [m], shape [points, 2]; a closed route repeats its first point."""
    heading: Array = field(metadata=shaped("points"))
    """Direction of travel, counter-clockwise from east [rad], continuous, shape [points]."""
    distance: Array = field(metadata=shaped("points"))
    """Length along the route [m], from 0, shape [points]."""
    closed: bool
    """Whether it ends where it began."""
    speed: float
    """Speed along the route [m/s]."""
    corridor_width: float
    """Width of the strip along the route that is kept free of rocks [m]; 0 for none."""
    corridor_clearance: float
    """Height above the ground that no rock within the corridor exceeds [m]."""
    turns: NDArray[np.int64] = field(
        default_factory=lambda: np.zeros((0, 2), np.int64),
        metadata=shaped("turns", 2, dtype=np.int64),
    )
    """First and last point of each turn on the spot, in order, shape [turns, 2]."""
    acceleration: float = 0.0
    """Largest gain and loss of speed [m/s²]; 0 for constant speed from the first point on."""
    turn_rate: float = 1.0
    """Largest rate of turns on the spot [rad/s]."""
    time: Array | None = field(default=None, metadata=shaped("points"))
    """Recorded time at each point [s], from 0, shape [points]; None where speed, acceleration and
    turn rate tell it."""
    attitude: Array | None = field(default=None, metadata=shaped("points", 3))
    """Recorded height [m], roll and pitch [rad] at each point, shape [points, 3]; None where the
    ground tells them."""

    @property
    def length(self) -> float:
        """Length of the route [m]."""
        return float(self.distance[-1])
