"""What a world looks like: its colours, the ground close by, Sun and sky."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, Record, compass_to_direction, shaped


@dataclass(frozen=True, kw_only=True, eq=False)
class GroundDetail(Record):
    """A tile of the ground close by, which repeats both ways: soil down to millimetres."""

    size: float
    """Side of the tile on the ground [m]; tiles are counted from the site's origin."""
    brightness: NDArray[np.uint8] = field(metadata=shaped("side", "side", dtype=np.uint8))
    """Linear factor on the ground's colour, `MIDDLE` for 1, rows run north, shape [side, side]."""
    normals: NDArray[np.uint8] = field(metadata=shaped("side", "side", 3, dtype=np.uint8))
    """Unit normals towards east, north and away from the ground, -1 to 1 as 0 to 255, rows run
    north, shape [side, side, 3]."""

    MIDDLE: ClassVar[int] = 128


@dataclass(frozen=True, kw_only=True, eq=False)
class Appearance(Record):
    """What the ground and the rocks look like."""

    ground_rgb: NDArray[np.uint8] = field(metadata=shaped("rows", "columns", 3, dtype=np.uint8))
    """sRGB colour of each node of the ground, rows run north, shape [rows, columns, 3]."""
    rock_rgb: NDArray[np.uint8] = field(metadata=shaped("populations", 3, dtype=np.uint8))
    """sRGB colour of each population's rocks, shape [populations, 3]."""
    detail: GroundDetail | None = None
    """What the ground looks like close by; None if there is none."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Lighting(Record):
    """The Sun and the sky."""

    sun_azimuth: float
    """Where the Sun stands, clockwise from north [rad]."""
    sun_elevation: float
    """Height of the Sun above the horizon [rad]."""
    irradiance: float
    """Irradiance of a surface that faces the Sun [W/m²]."""
    sky_rgb: tuple[float, float, float]
    """Colour of the sky, linear 0 to 1."""
    sun_diameter: float | None = None
    """Angle that the Sun fills [rad]; None for the body's mean."""
    time: str = ""
    """Date and time in UTC, ISO 8601; empty where only the Sun's place is known."""
    solar_time: str = ""
    """Local true solar time, of 24 hours, where the date is known."""
    season: float | None = None
    """Areocentric longitude of the Sun, Ls [rad], where the date is known."""
    earth: tuple[float, float, float] | None = None
    """Unit vector (east, north, up) to the Earth, where the date is known."""
    earth_diameter: float = 0.0
    """Angle that the Earth fills [rad], where the date is known."""

    @property
    def towards_sun(self) -> Array:
        """Unit vector (east, north, up) from the ground to the Sun."""
        return compass_to_direction(self.sun_azimuth, self.sun_elevation)
