"""The moment that a recipe means by a date, a season and a local time."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime

import numpy as np

from terrain_forge.base import Array, RecipeError
from terrain_forge.model import Ephemeris
from terrain_forge.sky.above import Above, look_up
from terrain_forge.sky.moments import LAST, day_of, days_of, read_time
from terrain_forge.sky.spec import SunSpec

_FROM = "2030-01-01"
_SEASON_STEP, _SEASON_STEPS = 2.0, 800
"""Days, and steps of them, within which every season comes on a body that we know."""
_TIME_STEP, _TIME_STEPS = 0.02, 10_000
"""The same of every time of the day."""
_HALVINGS = 40


def moment_of(spec: SunSpec, ephemeris: Ephemeris, lonlat: tuple[float, float]) -> datetime:
    """When a recipe wants the Sun.

    Raises:
        RecipeError: where the date is none, the orbits are not known for it, or season and time do
            not come within them.
    """
    moment = read_time(_FROM if spec.time is None else spec.time, ("sun", "time"))
    if spec.ls_deg is None and spec.ltst is None:
        return moment
    days = days_of(moment)

    def above(times: Array) -> Above:
        return look_up(ephemeris, lonlat, times)

    if spec.ls_deg is not None:
        season = spec.ls_deg / 360.0
        days = _first(
            lambda times: above(times).season / (2.0 * np.pi) - season,
            days, _SEASON_STEP, _SEASON_STEPS, "ls_deg",
        )  # fmt: skip
    if (part := spec.part_of_day) is not None:
        days = _first(
            lambda times: above(times).solar_time - part, days, _TIME_STEP, _TIME_STEPS, "ltst"
        )
    found = day_of(days)
    if found >= LAST:
        raise RecipeError(
            f"that moment comes at {found:%Y-%m-%d}, orbits are known to the end of "
            f"{LAST.year - 1}",
            key=("sun", "time"),
        )
    return found


def _first(off: Callable[[Array], Array], begin: float, step: float, steps: int, key: str) -> float:
    """The first time at which a part of a turn is met, either way round."""
    times, block = begin, 500
    for _ in range(0, steps, block):
        marks = np.asarray(times + step * np.arange(block + 1), np.float64)
        apart = np.remainder(off(marks) + 0.5, 1.0) - 0.5
        crossed = (apart[:-1] * apart[1:] <= 0.0) & (np.abs(apart[:-1] - apart[1:]) < 0.5)
        if crossed.any():
            at = int(np.argmax(crossed))
            return _halved(off, float(marks[at]), float(marks[at + 1]))
        times = float(marks[-1])
    raise RecipeError("the Sun does not come there in this time", key=("sun", key))


def _halved(off: Callable[[Array], Array], low: float, high: float) -> float:
    def apart(time: float) -> float:
        return float(np.remainder(off(np.array([time]))[0] + 0.5, 1.0) - 0.5)

    rising = apart(high) > apart(low)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if (apart(middle) > 0.0) == rising:
            high = middle
        else:
            low = middle
    return 0.5 * (low + high)
