"""Places of planets, of the Moon, and of a body's axes, in the celestial frame of J2000.

Distances are in kilometres from the Sun, times in days of terrestrial time since J2000.
"""

from __future__ import annotations

import numpy as np

from terrain_forge.base import Array, portable
from terrain_forge.model import EARTH_ORBIT, Ephemeris, KeplerOrbit, Rotation, SatelliteOrbit
from terrain_forge.sky.moments import centuries

AU = 149_597_870.7
"""Astronomical unit [km]."""
_OBLIQUITY = np.radians(23.43928)
_PRECESSION = 1.396971, 0.0003086
"""General precession in longitude since J2000 [degrees per century, per century²] (IAU 1976)."""
_ECLIPTIC_TURN = 0.013056, 174.876
"""How the ecliptic of date tilts to that of J2000: degrees in a century, longitude of the node."""


def about_sun(ephemeris: Ephemeris, days: Array) -> Array:
    """Place of a body, shape [times, 3]."""
    place = _ellipse(ephemeris.orbit, days)
    if (satellite := ephemeris.satellite) is not None:
        place = place + (1.0 - satellite.mass_share) * about_planet(satellite, days)
    return place


def earth_about_sun(ephemeris: Ephemeris, days: Array) -> Array:
    """Place of the Earth; where the body is not the Earth's satellite, of Earth and Moon."""
    place = _ellipse(EARTH_ORBIT, days)
    if (satellite := ephemeris.satellite) is not None:
        place = place - satellite.mass_share * about_planet(satellite, days)
    return place


def _ellipse(orbit: KeplerOrbit, days: Array) -> Array:
    """Place on an orbit around the Sun [km], shape [times, 3]."""
    century = centuries(days)

    def element(pair: tuple[float, float]) -> Array:
        return pair[0] + pair[1] * century

    eccentricity = element(orbit.eccentricity)
    perihelion, node = element(orbit.perihelion), element(orbit.node)
    mean = np.radians(np.remainder(element(orbit.mean_longitude) - perihelion, 360.0))
    anomaly = mean + eccentricity * np.sin(mean)
    for _ in range(6):
        off = anomaly - eccentricity * np.sin(anomaly) - mean
        anomaly = anomaly - off / (1.0 - eccentricity * np.cos(anomaly))
    semi_major = AU * element(orbit.semi_major)
    x = semi_major * (np.cos(anomaly) - eccentricity)
    y = semi_major * np.sqrt(1.0 - eccentricity**2) * np.sin(anomaly)
    argument, up = np.radians(perihelion - node), np.radians(element(orbit.inclination))
    node = np.radians(node)
    across = np.cos(argument) * x - np.sin(argument) * y
    along = np.sin(argument) * x + np.cos(argument) * y
    return _from_ecliptic(
        np.cos(node) * across - np.sin(node) * np.cos(up) * along,
        np.sin(node) * across + np.cos(node) * np.cos(up) * along,
        np.sin(up) * along,
    )


def about_planet(orbit: SatelliteOrbit, days: Array) -> Array:
    """Place of a satellite from its planet [km], shape [times, 3]."""
    century = centuries(days)
    arguments = [_polynomial(angle, century) for angle in orbit.arguments]
    longitude, latitude = _polynomial(orbit.mean_longitude, century), np.zeros_like(century)
    distance = np.full_like(century, orbit.mean_distance)
    for terms, is_longitude in ((orbit.longitude, True), (orbit.latitude, False)):
        for term in terms:
            counts, amplitudes = term[: len(arguments)], term[len(arguments) :]
            angle = sum(n * a for n, a in zip(counts, arguments, strict=True))
            wave = np.radians(np.remainder(angle, 360.0))
            if is_longitude:
                longitude = longitude + amplitudes[0] * np.sin(wave)
                distance = distance + amplitudes[1] * np.cos(wave)
            else:
                latitude = latitude + amplitudes[0] * np.sin(wave)
    first, second = _PRECESSION
    longitude = longitude - first * century - second * century**2
    tilt, node = _ECLIPTIC_TURN
    latitude = latitude - tilt * century * np.sin(np.radians(longitude - node))
    lon, lat = np.radians(np.remainder(longitude, 360.0)), np.radians(latitude)
    return distance[:, None] * _from_ecliptic(
        np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)
    )


def axes(rotation: Rotation, days: Array) -> Array:
    """Celestial to body-fixed, shape [times, 3, 3]: x to longitude 0, z to the north pole."""
    century = centuries(days)
    ra = rotation.right_ascension[0] + rotation.right_ascension[1] * century
    dec = rotation.declination[0] + rotation.declination[1] * century
    turn = _polynomial(rotation.meridian, days)
    for begin, rate, in_ra, in_dec, in_turn in rotation.waves:
        wave = np.radians(np.remainder(begin + rate * days, 360.0))
        ra = ra + in_ra * np.sin(wave)
        dec = dec + in_dec * np.cos(wave)
        turn = turn + in_turn * np.sin(wave)
    a, d, w = np.radians(ra), np.radians(dec), np.radians(np.remainder(turn, 360.0))
    zero = np.zeros_like(a)
    node = np.stack([-np.sin(a), np.cos(a), zero], -1)
    pole = np.stack([np.cos(d) * np.cos(a), np.cos(d) * np.sin(a), np.sin(d)], -1)
    beyond = cross(pole, node)
    x = np.cos(w)[:, None] * node + np.sin(w)[:, None] * beyond
    return np.stack([x, cross(pole, x), pole], axis=-2)


def _from_ecliptic(x: Array, y: Array, z: Array) -> Array:
    """Vectors in the ecliptic of J2000 in the celestial frame, shape [times, 3]."""
    cosine, sine = np.cos(_OBLIQUITY), np.sin(_OBLIQUITY)
    return np.stack([x, cosine * y - sine * z, sine * y + cosine * z], axis=-1)


def _polynomial(coefficients: tuple[float, ...], x: Array) -> Array:
    value = np.zeros_like(x)
    for coefficient in reversed(coefficients):
        value = value * x + coefficient
    return value


def cross(a: Array, b: Array) -> Array:
    """Vector products."""
    return np.stack(
        [a[..., k - 2] * b[..., k - 1] - a[..., k - 1] * b[..., k - 2] for k in range(3)], axis=-1
    )


def orbit_pole(orbit: KeplerOrbit, days: Array) -> Array:
    """Unit vectors across an orbit around the Sun, about which it goes counter-clockwise."""
    return unit(cross(_ellipse(orbit, days), _ellipse(orbit, days + 1.0)))


def unit(vectors: Array) -> Array:
    """Vectors of length 1."""
    return np.asarray(vectors / portable.norm(vectors)[..., None])
