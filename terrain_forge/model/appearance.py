"""What a world looks like: its colours, the ground close by, Sun and sky."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, Record, compass_to_direction, shaped
from terrain_forge.model.body import Dust

USUAL = (0.6, 1.0, 0.0)
"""Pebbles, roughness and slabs of ground of which nothing is known."""
_OF_DRIFT = np.array([0.15, 0.6, 0.0])
"""The same of soil laid at rocks, over those of what it lies on."""


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
class GroundMaterial(Record):
    """What the ground is made of somewhere."""

    name: str
    """Its name, of which a world has one."""
    kind: str
    """What kind of ground it is, as a recipe names it."""
    rgb: tuple[float, float, float]
    """sRGB colour of it where it is level, 0 to 1."""
    friction: float
    """Coefficient of sliding friction of wheels on it."""
    pebbles: float
    """Share of places that hold a pebble too small to be a rock, in pictures alone, 0 to 1."""
    roughness: float
    """Rise of its fine relief over that of usual regolith, in pictures alone."""
    slabs: float
    """How much it is jointed into slabs, in pictures alone, 0 to 1."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Appearance(Record):
    """What the ground and the rocks look like."""

    ground_rgb: NDArray[np.uint8] = field(metadata=shaped("rows", "columns", 3, dtype=np.uint8))
    """sRGB colour of each node of the ground, rows run north, shape [rows, columns, 3]."""
    rock_rgb: NDArray[np.uint8] = field(metadata=shaped("populations", 3, dtype=np.uint8))
    """sRGB colour of each population's rocks, shape [populations, 3]."""
    detail: GroundDetail | None = None
    """What the ground looks like close by; None if there is none."""
    materials: tuple[GroundMaterial, ...] = ()
    """What the ground is made of; empty where nothing is known of it."""
    material: NDArray[np.uint8] | None = field(
        default=None, metadata=shaped("rows", "columns", dtype=np.uint8)
    )
    """Index into `materials` at each node, shape [rows, columns]; None where all is the first."""
    drift: NDArray[np.uint8] | None = field(
        default=None, metadata=shaped("rows", "columns", dtype=np.uint8)
    )
    """Share of each node that soil laid at rocks covers, 255 for all of it, shape [rows, columns];
    None for none. It has fewer pebbles and is finer than what it lies on."""

    def cut(self, nodes: tuple[slice, slice]) -> Appearance:
        """That of some rows and columns of nodes."""
        return self.replace(
            ground_rgb=self.ground_rgb[nodes],
            material=None if self.material is None else self.material[nodes],
            drift=None if self.drift is None else self.drift[nodes],
        )

    @property
    def grain(self) -> NDArray[np.uint8]:
        """Pebbles, roughness and slabs of the nodes, 100 for 1, shape [rows, columns, 3]."""
        rows, columns, _ = self.ground_rgb.shape
        table = np.array([(m.pebbles, m.roughness, m.slabs) for m in self.materials] or [USUAL])
        levels = np.clip(np.rint(100.0 * table), 0, 255).astype(np.uint8)
        whole = self.material is None
        grain = np.tile(levels[0], (rows, columns, 1)) if whole else levels[self.material]
        if self.drift is not None:
            covered = self.drift > 0
            share = self.drift[covered][:, None] / 255.0
            grain[covered] = np.rint(grain[covered] * (1.0 - share * (1.0 - _OF_DRIFT)))
        grain.setflags(write=False)  # as the arrays of records are: one kernel serves both
        return np.asarray(grain)


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
    dust: Dust | None = None
    """Dust in the air, which makes the sky; None without any."""
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
    earth_sun: tuple[float, float, float] | None = None
    """From the Earth to the Sun (east, north, up) over the Sun's distance from here, where the date
    is known."""
    celestial: Array | None = field(default=None, metadata=shaped(3, 3))
    """From the celestial frame of J2000 to east, north, up, where stars are shown, shape [3, 3]."""
    star_gain: float = 1.0
    """How much brighter than they are stars are shown."""

    @property
    def towards_sun(self) -> Array:
        """Unit vector (east, north, up) from the ground to the Sun."""
        return compass_to_direction(self.sun_azimuth, self.sun_elevation)
