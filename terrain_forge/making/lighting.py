"""The light of a site: the Sun where a recipe puts it, or where it stands at a date."""

from __future__ import annotations

from datetime import datetime, timedelta

import numpy as np

from terrain_forge.base import RecipeError, portable
from terrain_forge.dtm import ellipsoid
from terrain_forge.model import Dust, Ephemeris, Lighting, Site
from terrain_forge.sky import (
    Above,
    days_of,
    look_up,
    moment_of,
    planetographic,
    true_solar_time,
    utc_text,
)

_NIGHT_STEP, _NIGHT_STEPS = 0.02, 20_000
"""Days, and steps of them, within which the Sun rises where it rises at all: a night of Mars."""
_LEAST_TAU = 1e-4
"""Thinner dust makes a sky that no picture shows, of light that rounding makes."""


def light_of(site: Site) -> Lighting:
    """Sun and sky of a site.

    Raises:
        RecipeError: where a date cannot tell the Sun's place, or it is night then.
    """
    sun = site.recipe.sun
    if sun.by_date:
        ephemeris, lonlat = place_of(site, key=("sun", "time"))
        return light_at(site, moment_of(sun, ephemeris, lonlat))
    if site.recipe.sky.stars:
        raise RecipeError("stars need the date: give sun.time", key=("sky", "stars"))
    dust, sky_rgb = _air(site)
    return Lighting(
        sun_azimuth=float(np.radians(sun.azimuth_deg)),
        sun_elevation=float(np.radians(sun.elevation_deg)),
        irradiance=site.body.solar_irradiance,
        sky_rgb=sky_rgb,
        dust=dust,
    )


def light_at(site: Site, moment: datetime) -> Lighting:
    """Sun and sky of a site at a moment.

    Raises:
        RecipeError: where nothing of the Sun is above the horizon of a plane.
    """
    ephemeris, lonlat = place_of(site, key=("sun", "time"))
    above = look_up(ephemeris, lonlat, np.array([days_of(moment)]))
    up = float(above.sun[0, 2])
    if up < -0.5 * float(above.sun_diameter[0]):
        told = f"{np.degrees(portable.arcsin(up)):.1f}° high"
        raise RecipeError(
            f"at {utc_text(moment)} the Sun stands {told}, it is night"
            f"{_sunrise(ephemeris, lonlat, days_of(moment), moment)}",
            key=("sun", "time"),
        )
    return lighting(site, above, 0, utc_text(moment))


def lighting(site: Site, above: Above, at: int, time: str) -> Lighting:
    """Sun and sky of a site under one of several skies."""
    ephemeris, _ = place_of(site, key=("sun", "time"))
    azimuth, elevation = compass(above.sun[at])
    nearness = ephemeris.orbit.semi_major[0] / float(above.sun_distance[at])
    earth, lit, sky = above.earth[at], above.earth_sun[at], site.recipe.sky
    dust, sky_rgb = _air(site)
    return Lighting(
        sun_azimuth=azimuth,
        sun_elevation=elevation,
        irradiance=site.body.solar_irradiance * nearness**2,
        sky_rgb=sky_rgb,
        dust=dust,
        sun_diameter=float(above.sun_diameter[at]),
        time=time,
        solar_time=true_solar_time(float(above.solar_time[at])),
        season=float(above.season[at]),
        earth=(float(earth[0]), float(earth[1]), float(earth[2])),
        earth_diameter=float(above.earth_diameter[at]),
        earth_sun=(float(lit[0]), float(lit[1]), float(lit[2])),
        celestial=above.celestial[at] if sky.stars else None,
        star_gain=sky.star_gain if sky.stars else 1.0,
    )


def _air(site: Site) -> tuple[Dust | None, tuple[float, float, float]]:
    """Dust in the air, and the colour of the sky for formats that have one; black without dust."""
    dust, tau = site.body.dust, site.recipe.sky.tau
    if tau is not None and dust is None:
        raise RecipeError(f"{site.body.name} has no dusty air", key=("sky", "tau"))
    sky_rgb = site.body.sky_rgb
    if dust is not None and tau is not None:
        shows = tau >= _LEAST_TAU
        dust, sky_rgb = (dust.replace(tau=tau), sky_rgb) if shows else (None, (0.0, 0.0, 0.0))
    if site.recipe.sky.stars and max(sky_rgb) > 0.0:
        raise RecipeError(
            f"no stars are seen by day through the air of {site.body.name}", key=("sky", "stars")
        )
    return dust, sky_rgb


def place_of(site: Site, *, key: tuple[str | int, ...]) -> tuple[Ephemeris, tuple[float, float]]:
    """What tells where the Sun stands, and longitude and planetographic latitude of a site [rad].

    Raises:
        RecipeError: where the body has no orbit, or nobody knows where on it the site lies.
    """
    angles = "sun.azimuth_deg and sun.elevation_deg" if key[:1] == ("sun",) else ""
    if (ephemeris := site.body.ephemeris) is None:
        give = f": give {angles} instead" if angles else ""
        raise RecipeError(f"{site.body.name} has no ephemeris that tells the Sun{give}", key=key)
    if site.lonlat is None:
        raise RecipeError(
            f"nobody knows where on {site.body.name} the site lies, so no date tells the Sun's "
            "place: give a DTM with coordinates, or dtm.lonlat_deg of a flat site"
            + (f", or {angles} instead" if angles else ""),
            key=key,
        )
    lon, lat = site.lonlat
    # Latitudes of a map on a sphere are from the body's centre, those on an ellipsoid are not.
    major, minor = ellipsoid(site.crs)
    return ephemeris, (lon, planetographic(ephemeris, lat) if major == minor else lat)


def compass(towards: np.ndarray) -> tuple[float, float]:
    """Azimuth, 0 to 2π, and elevation of a unit vector [rad]."""
    east, north, up = (float(x) for x in towards)
    azimuth = float(portable.arctan2(east, north))
    return azimuth % (2.0 * np.pi), float(portable.arctan2(up, np.hypot(east, north)))


def _sunrise(
    ephemeris: Ephemeris, lonlat: tuple[float, float], days: float, moment: datetime
) -> str:
    """When the Sun's middle rises next, in words."""
    steps = np.arange(1, _NIGHT_STEPS) * _NIGHT_STEP
    for part in np.array_split(steps, 40):
        up = look_up(ephemeris, lonlat, days + part).sun[:, 2] > 0.0
        if up.any():
            rises = moment + timedelta(days=float(part[np.argmax(up)]))
            return f"; it rises before {utc_text(rises)}"
    return ""
