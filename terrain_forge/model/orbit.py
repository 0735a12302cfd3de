"""Where a body is and how it turns: orbit, rotation and figure, as cited values.

Angles are in degrees, as the sources print them, and in the frame of J2000.
"""

from __future__ import annotations

from dataclasses import dataclass

from terrain_forge.base import Record


@dataclass(frozen=True, kw_only=True, eq=False)
class KeplerOrbit(Record):
    """An ellipse around the Sun whose elements change steadily: (at J2000, change in a century)."""

    semi_major: tuple[float, float]
    """Half the longer axis [au]."""
    eccentricity: tuple[float, float]
    """Eccentricity."""
    inclination: tuple[float, float]
    """To the ecliptic [degrees]."""
    mean_longitude: tuple[float, float]
    """Mean longitude [degrees]."""
    perihelion: tuple[float, float]
    """Longitude of the perihelion [degrees]."""
    node: tuple[float, float]
    """Longitude of the ascending node [degrees]."""
    source: str
    """Where the figures come from."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SatelliteOrbit(Record):
    """A path around a planet as a short series, in the ecliptic and equinox of date."""

    mean_longitude: tuple[float, ...]
    """Polynomial of centuries since J2000 [degrees]."""
    arguments: tuple[tuple[float, ...], ...]
    """Polynomials of the angles that the terms count [degrees]."""
    longitude: tuple[tuple[float, ...], ...]
    """Terms: a multiple of each argument, sine in longitude [degrees], cosine in distance [km]."""
    latitude: tuple[tuple[float, ...], ...]
    """Terms: a multiple of each argument, sine in latitude [degrees]."""
    mean_distance: float
    """What the distance's terms are added to [km]."""
    mass_share: float
    """Its part of both masses: so far is the planet from their common centre, over the distance."""
    source: str
    """Where the figures come from."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Rotation(Record):
    """The pole and the prime meridian in the international celestial frame.

    Right ascension, declination and meridian each have a polynomial, and waves that they share.
    """

    right_ascension: tuple[float, float]
    """Of the north pole: at J2000, change in a century [degrees]."""
    declination: tuple[float, float]
    """Of the north pole: at J2000, change in a century [degrees]."""
    meridian: tuple[float, float, float]
    """Of the prime meridian: at J2000 [degrees], degrees in a day, degrees in a day²."""
    waves: tuple[tuple[float, float, float, float, float], ...] = ()
    """Angle at J2000 and degrees in a day; its sine in right ascension, its cosine in declination,
    its sine in the meridian [degrees]."""
    source: str
    """Where the figures come from."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Ephemeris(Record):
    """All that tells where Sun and Earth stand above a place on a body."""

    orbit: KeplerOrbit
    """Around the Sun: its own, or that of the common centre with the planet that it circles."""
    satellite: SatelliteOrbit | None = None
    """Around that planet, the Earth; None for a planet."""
    rotation: Rotation
    """How it turns."""
    radii: tuple[float, float]
    """Equatorial and polar radius of the ellipsoid that vertical and latitude refer to [m]."""


EARTH_ORBIT = KeplerOrbit(
    semi_major=(1.00000261, 0.00000562),
    eccentricity=(0.01671123, -0.00004392),
    inclination=(-0.00001531, -0.01294668),
    mean_longitude=(100.46457166, 35999.37244981),
    perihelion=(102.93768193, 0.32327364),
    node=(0.0, 0.0),
    source="common centre of Earth and Moon, 1800 to 2050: Standish, Keplerian elements for "
    "approximate positions of the major planets (JPL), table 1",
)
"""The common centre of Earth and Moon."""

EARTH_RADIUS = 6371.0e3
"""Mean radius of the Earth [m]."""
