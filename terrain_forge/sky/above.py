"""What stands above a place: directions to Sun and Earth, their size, season and time of day."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from terrain_forge.base import Array, Record, portable, remembered, shaped
from terrain_forge.model import EARTH_RADIUS, Ephemeris
from terrain_forge.sky.orbits import AU, about_sun, axes, cross, earth_about_sun, orbit_pole, unit

_LIGHT = 299_792.458 * 86_400.0
"""How far light goes in a day [km]."""
SUN_RADIUS = 695_700.0
"""Nominal radius of the Sun [km], IAU 2015 resolution B3."""
_STEP = 0.01
"""Days over which velocities are taken."""
_CENTURY = np.arange(-18_262.0, 18_262.0, 3.0)
"""Days between 1950 and 2050."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Above(Record):
    """Sun and Earth above a place at some moments."""

    sun: Array = field(metadata=shaped("times", 3))
    """Unit vectors to the Sun's middle (east, north, up), as it is seen, shape [times, 3]."""
    sun_distance: Array = field(metadata=shaped("times"))
    """Distance of the Sun [au], shape [times]."""
    sun_diameter: Array = field(metadata=shaped("times"))
    """Angle that the Sun fills [rad], shape [times]."""
    earth: Array = field(metadata=shaped("times", 3))
    """Unit vectors to the Earth's middle, as it is seen, shape [times, 3]."""
    earth_diameter: Array = field(metadata=shaped("times"))
    """Angle that the Earth fills [rad], shape [times]."""
    earth_sun: Array = field(metadata=shaped("times", 3))
    """From the Earth to the Sun (east, north, up) over the Sun's distance from here, shape
    [times, 3]."""
    celestial: Array = field(metadata=shaped("times", 3, 3))
    """From the celestial frame of J2000 to east, north, up, shape [times, 3, 3]."""
    season: Array = field(metadata=shaped("times"))
    """Areocentric longitude of the Sun, Ls, or its like on another body [rad], 0 to 2π, shape
    [times]."""
    solar_time: Array = field(metadata=shaped("times"))
    """Local true solar time as a part of the day, 0 to 1, 0.5 where the Sun is in the meridian,
    shape [times]."""


def look_up(ephemeris: Ephemeris, lonlat: tuple[float, float], days: Array) -> Above:
    """Sun and Earth above a place.

    Args:
        ephemeris: The body's.
        lonlat: Longitude east and planetographic latitude [rad].
        days: Terrestrial time since J2000 [days], shape [times].
    """
    days = np.atleast_1d(np.asarray(days, np.float64))
    here, turn = about_sun(ephemeris, days), axes(ephemeris.rotation, days)
    place, local = _on_ellipsoid(ephemeris, lonlat)
    motion = (about_sun(ephemeris, days + _STEP) - about_sun(ephemeris, days - _STEP)) / (
        2.0 * _STEP * _LIGHT
    )
    away = portable.norm(earth_about_sun(ephemeris, days) - here)
    earth = earth_about_sun(ephemeris, days - away / _LIGHT) - here
    sun, earth = (_turned(turn, v) - place for v in (-here, earth))
    aside = _turned(turn, motion)
    seen = [unit(unit(v) + aside) for v in (sun, earth)]
    distances = [portable.norm(v) for v in (sun, earth)]
    longitude = portable.arctan2(seen[0][:, 1], seen[0][:, 0])
    return Above(
        sun=portable.product(seen[0], local.T),
        sun_distance=distances[0] / AU,
        sun_diameter=2.0 * portable.arcsin(SUN_RADIUS / distances[0]),
        earth=portable.product(seen[1], local.T),
        earth_diameter=2.0 * portable.arcsin(1e-3 * EARTH_RADIUS / distances[1]),
        earth_sun=portable.product((sun - earth) / distances[0][:, None], local.T),
        celestial=(local[None, :, :, None] * turn[:, None, :, :]).sum(axis=2),
        season=_season(turn[:, 2], orbit_pole(ephemeris.orbit, days), unit(-here)),
        solar_time=np.remainder(0.5 + (lonlat[0] - longitude) / (2.0 * np.pi), 1.0),
    )


def planetographic(ephemeris: Ephemeris, latitude: float) -> float:
    """Latitude of the vertical at a latitude from the body's centre [rad]."""
    equatorial, polar = ephemeris.radii
    sine, cosine = float(np.sin(latitude)), float(np.cos(latitude))
    return float(portable.arctan2(sine * equatorial**2, cosine * polar**2))


def true_solar_time(part: float) -> str:
    """A part of the day as hours, minutes and seconds of 24 hours."""
    seconds = round(part * 86_400.0) % 86_400
    return f"{seconds // 3600:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d}"


@remembered
def highest_declination(ephemeris: Ephemeris) -> float:
    """How far north or south of the equator the Sun's middle gets between 1950 and 2050 [rad]."""
    pole = axes(ephemeris.rotation, _CENTURY)[:, 2]
    towards = unit(-about_sun(ephemeris, _CENTURY))
    return float(portable.arcsin(np.abs((pole * towards).sum(axis=1)).max()))


@remembered
def widest_sun(ephemeris: Ephemeris) -> float:
    """The largest angle that the Sun fills between 1950 and 2050 [rad]."""
    nearest = portable.norm(about_sun(ephemeris, _CENTURY)).min()
    return 2.0 * float(portable.arcsin(SUN_RADIUS / nearest))


def _on_ellipsoid(ephemeris: Ephemeris, lonlat: tuple[float, float]) -> tuple[Array, Array]:
    """Place on the ellipsoid [km], and east, north and up there, body-fixed, shape [3, 3]."""
    equatorial, polar = (1e-3 * radius for radius in ephemeris.radii)
    (sin_lon, sin_lat), (cos_lon, cos_lat) = np.sin(lonlat), np.cos(lonlat)
    normal = equatorial**2 / np.sqrt((equatorial * cos_lat) ** 2 + (polar * sin_lat) ** 2)
    up = np.array([cos_lat * cos_lon, cos_lat * sin_lon, sin_lat])
    place = normal * up * (1.0, 1.0, (polar / equatorial) ** 2)
    east = np.array([-sin_lon, cos_lon, 0.0])
    north = np.array([-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat])
    return place, np.stack([east, north, up])


def _turned(turn: Array, vectors: Array) -> Array:
    return np.asarray((turn * vectors[:, None, :]).sum(axis=2))


def _season(pole: Array, above: Array, towards: Array) -> Array:
    """Angle of the Sun from where it crosses the equator northwards, along its path."""
    equinox = unit(cross(pole, above))
    solstice = cross(above, equinox)
    along, across = ((part * towards).sum(axis=1) for part in (equinox, solstice))
    return np.asarray(np.remainder(portable.arctan2(across, along), 2.0 * np.pi))
