"""What of Sun and Earth is seen over a period from all points of a map."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from functools import partial

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, Mask, OutputError, Record, shaped
from terrain_forge.illumination.horizon import LOWEST, horizon_slopes
from terrain_forge.illumination.land import Land
from terrain_forge.model import Ephemeris, Site
from terrain_forge.sky import (
    Above,
    days_of,
    highest_declination,
    look_up,
    utc_text,
    widest_sun,
)

MOST = 100_000
"""Moments of a period."""
_FINEST = 720
"""Azimuths, at least, in which what is never lit has been looked at: each a Sun's width."""
_SURELY = np.radians(0.01)
"""How much higher than it is the Sun is taken to come at most, before anything is never lit."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Light(Record):
    """Maps of a period, shape [rows, columns] or with a first axis for moments or azimuths.

    Where nothing is known they hold 0.
    """

    missing: Mask = field(metadata=shaped("rows", "columns", dtype=np.bool_))
    """Nodes where the DTM has no height, shape [rows, columns]."""

    sunlight: NDArray[np.float32] = field(metadata=shaped("rows", "columns", dtype=np.float32))
    """Hours of the whole Sun: an hour of half its disc counts for half, shape [rows, columns]."""
    earth: NDArray[np.float32] = field(metadata=shaped("rows", "columns", dtype=np.float32))
    """Hours of the whole Earth, likewise, shape [rows, columns]."""
    never: NDArray[np.uint8] = field(metadata=shaped("rows", "columns", dtype=np.uint8))
    """1 where no part of the Sun ever shines, whatever the date, shape [rows, columns]."""
    azimuths: Array = field(metadata=shaped("azimuths"))
    """Of the horizon, clockwise from north [rad], shape [azimuths]."""
    horizon: NDArray[np.float32] = field(
        metadata=shaped("azimuths", "rows", "columns", dtype=np.float32)
    )
    """Height of the horizon above each point's own level [rad], shape
    [azimuths, rows, columns]."""
    moments: NDArray[np.uint8] = field(
        metadata=shaped("moments", "rows", "columns", dtype=np.uint8)
    )
    """Part of the Sun that is seen [percent]; of none where there are too many moments, shape
    [moments, rows, columns]."""

    @property
    def known_hours(self) -> NDArray[np.float32]:
        """The hours of the whole Sun where something is known, shape [nodes]."""
        return np.asarray(self.sunlight[~self.missing])

    @property
    def never_share(self) -> float:
        """Part of what is known that is never lit."""
        return float(self.never[~self.missing].mean())


def moments_of(begin: datetime, end: datetime, step: timedelta) -> list[datetime]:
    """The middles of the steps of a period.

    Raises:
        OutputError: where there is none, or too many.
    """
    if end <= begin:
        raise OutputError(f"--to {utc_text(end)}: it must be after --from {utc_text(begin)}")
    if step <= timedelta(0):
        raise OutputError(f"--step {step}: it must be above 0")
    count = max(1, round((end - begin) / step))
    if count > MOST:
        raise OutputError(f"{count:,} moments, at most {MOST:,}: take a longer --step")
    return [begin + (n + 0.5) * step for n in range(count)]


def solar_day(ephemeris: Ephemeris) -> timedelta:
    """The mean solar day of a body."""
    turn = ephemeris.rotation.meridian[1] - ephemeris.orbit.mean_longitude[1] / 36_525.0
    return timedelta(days=abs(360.0 / turn))


def seen_part(height: Array, radius: Array | float) -> Array:
    """Part of a disc above a level horizon, its middle at a height over it [rad]."""
    x = np.clip(height / radius, -1.0, 1.0)
    return np.asarray(0.5 + (x * np.sqrt(1.0 - x * x) + np.arcsin(x)) / np.pi)


def light_over(
    land: Land,
    site: Site,
    place: tuple[Ephemeris, tuple[float, float]],
    moments: list[datetime],
    step: timedelta,
    *,
    azimuths: int,
    kept: int,
    progress: Callable[[float], None],
) -> Light:
    """The maps of a period.

    Where there are fewer moments than azimuths, each looks exactly where Sun and Earth stand; where
    there are more, the horizon is linear between the azimuths. What seems never lit is looked at
    between them too, and at the moments.

    Args:
        land: The map and what stands around it.
        site: Where it lies.
        place: The body's ephemeris; longitude and planetographic latitude of the centre [rad].
        moments: The middles of the steps.
        step: How long each stands for.
        azimuths: Directions of the horizon map, evenly all around.
        kept: The most moments whose maps are kept.
        progress: Called with the part that is done.
    """
    ephemeris, lonlat = place
    above = look_up(ephemeris, lonlat, np.array([days_of(moment) for moment in moments]))
    shape, count = land.grid.shape, len(land.points)
    hours = step / timedelta(hours=1)
    sums = {"sun": np.zeros(count), "earth": np.zeros(count)}
    shown = np.zeros((len(moments) if len(moments) <= kept else 0, count), np.uint8)

    def add(name: str, at: int, slopes: Array) -> None:
        part = _part_of(name, above, at, slopes)
        sums[name] += hours * part
        if name == "sun" and len(shown):
            shown[at] = np.round(100.0 * part)

    exact = len(moments) <= azimuths
    turns = 2.0 * np.pi * np.arange(azimuths) / azimuths
    bodies = [(name, _azimuths(getattr(above, name))) for name in ("sun", "earth")]
    rows = np.empty((azimuths, count), np.float32)
    missing = land.missing.ravel()
    top = partial(_top_of_sun, ephemeris, lonlat[1])
    never, highest = ~missing, top(turns)
    for k, azimuth in enumerate(turns):
        own = np.arctan(horizon_slopes(land.reliefs, land.points, float(azimuth)))
        never &= own > highest[k]
        rows[k] = own + _tilt(land.points, float(azimuth), site.body.mean_radius)
        progress((k + 1) / azimuths * (0.4 if exact else 0.8))
    if exact:
        for at in range(len(moments)):
            for name, turn in bodies:
                add(name, at, horizon_slopes(land.reliefs, land.points, float(turn[at])))
            progress(0.4 + 0.5 * (at + 1) / len(moments))
    else:
        for name, turn in bodies:
            for at in range(len(moments)):
                whole = turn[at] / (2.0 * np.pi) * azimuths
                low, part = int(whole) % azimuths, whole - int(whole)
                local = (1.0 - part) * rows[low] + part * rows[(low + 1) % azimuths]
                tilt = _tilt(land.points, float(turn[at]), site.body.mean_radius)
                add(name, at, np.tan(local - tilt))
    never &= sums["sun"] == 0.0
    finer = -(-_FINEST // azimuths) * azimuths
    between = 2.0 * np.pi * np.flatnonzero(np.arange(finer) % (finer // azimuths)) / finer
    for k, (azimuth, height) in enumerate(zip(between, top(between), strict=True)):
        if not never.any():
            break
        slopes = horizon_slopes(land.reliefs, land.points[never], float(azimuth))
        never[never] = np.arctan(slopes) > height
        progress(0.9 + 0.1 * (k + 1) / len(between))
    for values in (*sums.values(), *rows, *shown):
        values[missing] = 0
    return Light(
        missing=land.missing,
        sunlight=sums["sun"].reshape(shape).astype(np.float32),
        earth=sums["earth"].reshape(shape).astype(np.float32),
        never=never.reshape(shape).astype(np.uint8),
        azimuths=turns,
        horizon=rows.reshape(azimuths, *shape),
        moments=shown.reshape(len(shown), *shape),
    )


def _part_of(name: str, above: Above, at: int, slopes: Array) -> Array:
    towards = getattr(above, name)[at]
    up = float(np.arcsin(np.clip(towards[2], -1.0, 1.0)))
    radius = 0.5 * float(getattr(above, f"{name}_diameter")[at])
    return seen_part(up - np.arctan(np.maximum(slopes, LOWEST)), radius)


def _azimuths(towards: Array) -> Array:
    return np.asarray(np.remainder(np.arctan2(towards[:, 0], towards[:, 1]), 2.0 * np.pi))


def _tilt(points: Array, azimuth: float, radius: float) -> Array:
    """How much higher the sky stands in a direction above points than above the centre [rad]."""
    along = points[:, 0] * np.sin(azimuth) + points[:, 1] * np.cos(azimuth)
    return np.asarray(along / radius)


def _top_of_sun(ephemeris: Ephemeris, latitude: float, azimuths: Array) -> Array:
    """How high the Sun's edge ever stands in each direction [rad], 0.01° too high at most.

    Far below the ground where it never comes.
    """
    most, side = highest_declination(ephemeris), np.copysign(1.0, latitude)
    up, level = side * np.sin(latitude), side * np.cos(latitude) * np.cos(azimuths)
    # At a height h the sine of the declination is hypot(up, level) · cos(h - atan2(up, level)).
    within = np.clip(np.sin(most) / np.hypot(up, level), -1.0, 1.0)
    middle = np.arctan2(up, level) - np.arccos(within) + _SURELY
    middle = np.where(up <= np.sin(most), 0.5 * np.pi, np.maximum(middle, -0.5 * np.pi))
    return np.asarray(middle + 0.5 * widest_sun(ephemeris))
