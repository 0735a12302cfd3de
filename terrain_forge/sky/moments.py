"""Dates: UTC as people write it, and days of terrestrial time since J2000 as orbits count it."""

from __future__ import annotations

from bisect import bisect_right
from datetime import UTC, datetime, timedelta

from terrain_forge.base import Array, RecipeError

FIRST, LAST = datetime(1950, 1, 1, tzinfo=UTC), datetime(2050, 1, 1, tzinfo=UTC)
"""Dates that orbits are known for."""
_J2000 = datetime(2000, 1, 1, 12, tzinfo=UTC)
_DAY = timedelta(days=1)
_LEAP_YEARS = (
    *(1972.5, 1973, 1974, 1975, 1976, 1977, 1978, 1979, 1980, 1981.5, 1982.5, 1983.5, 1985.5),
    *(1988, 1990, 1991, 1992.5, 1993.5, 1994.5, 1996, 1997.5, 1999, 2006, 2009, 2012.5, 2015.5),
    2017,
)
"""When leap seconds came: at the beginning or in the middle of a year (IERS Bulletin C)."""
_LEAPS = [datetime(int(year), 7 if year % 1 else 1, 1, tzinfo=UTC) for year in _LEAP_YEARS]
_FIRST_UTC = datetime(1972, 1, 1, tzinfo=UTC)
_BEFORE_UTC = (29.15, 31.07, 33.15, 35.73, 40.18)
"""Terrestrial less universal time in 1950, 1955, … 1970 [s] (Meeus 1998, chapter 10)."""
_AT_UTC = 42.184


def read_time(text: str, key: tuple[str | int, ...] = ()) -> datetime:
    """The moment of an ISO 8601 text, in UTC unless it names another zone.

    Raises:
        RecipeError: where it is no date, or one that the orbits are not known for.
    """
    try:
        moment = datetime.fromisoformat(text.strip())
    except ValueError:
        raise RecipeError(
            f"{text!r} is no date; such as 2031-02-18T20:55:00Z (ISO 8601, UTC)", key=key
        ) from None
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=UTC)
    try:
        moment = moment.astimezone(UTC)
        known = FIRST <= moment < LAST
    except OverflowError:
        known = False
    if not known:
        raise RecipeError(
            f"{text!r}: orbits are known from {FIRST.year} to the end of {LAST.year - 1}", key=key
        )
    return moment


def days_of(moment: datetime) -> float:
    """Days of terrestrial time since J2000."""
    return (moment - _J2000) / _DAY + _ahead(moment) / 86400.0


def day_of(days: float) -> datetime:
    """The moment, in UTC, of days of terrestrial time since J2000, to the nearest second."""
    about = _J2000 + days * _DAY
    moment = about - timedelta(seconds=_ahead(about - timedelta(seconds=60)))
    return (moment + timedelta(milliseconds=500)).replace(microsecond=0)


def utc_text(moment: datetime) -> str:
    """A moment as a recipe writes it."""
    return moment.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def _ahead(moment: datetime) -> float:
    """Seconds that terrestrial time is ahead of UTC; no leap second is foreseen after the last."""
    if moment >= _FIRST_UTC:
        return _AT_UTC + bisect_right(_LEAPS, moment)
    years = (moment - FIRST) / (365.25 * _DAY)
    step = min(max(int(years // 5.0), 0), len(_BEFORE_UTC) - 1)
    begin = _BEFORE_UTC[step]
    last = step == len(_BEFORE_UTC) - 1
    end, wide = (_AT_UTC, 2.0) if last else (_BEFORE_UTC[step + 1], 5.0)
    return begin + (end - begin) * (years - 5.0 * step) / wide


def centuries(days: Array) -> Array:
    """Julian centuries of so many days."""
    return days / 36525.0
