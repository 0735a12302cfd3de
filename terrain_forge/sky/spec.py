"""What a recipe says of the Sun."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Interval, Len

from terrain_forge.base import Idle, RecipeError, Spec
from terrain_forge.sky.moments import read_time

_LONGEST = 40


def _is_clock_time(text: str) -> bool:
    hours, _, rest = text.partition(":")
    parts = hours, *rest.split(":")
    if not all(part.isascii() and part.isdecimal() and len(part) <= 2 for part in parts):
        return False
    return len(parts) in (2, 3) and all(
        int(part) < most for part, most in zip(parts, (24, 60, 60), strict=False)
    )


_Text = Annotated[str, Len(1, _LONGEST)]


@dataclass(frozen=True, kw_only=True)
class SunSpec(Spec):
    """Where the Sun stands: by azimuth and elevation, or by date.

    By date it is the first moment from `time` on, at which the season is `ls_deg` if that is given,
    and from there on the first at which the local true solar time is `ltst` if that is given.
    """

    azimuth_deg: Annotated[float, Interval(ge=-360, le=360)] = 250.0
    """Compass direction, clockwise from north [degrees]."""
    elevation_deg: Annotated[float, Interval(gt=0, le=90)] = 35.0
    """Height above the horizon [degrees]."""
    time: _Text | None = None
    """Date and time, ISO 8601, UTC unless it names another zone: 2031-02-18T20:55:00Z; 1950 to
    2049. Given `ls_deg` or `ltst`, 2030-01-01 where it is left out."""
    ls_deg: Annotated[float, Interval(ge=0, lt=360)] | None = None
    """Season: areocentric longitude of the Sun [degrees], 0 where spring begins in the north."""
    ltst: _Text | None = None
    """Local true solar time, of 24 hours a day: "09:30"; the Sun is in the meridian at 12:00."""

    @property
    def by_date(self) -> bool:
        """Whether the Sun's place is found from a date."""
        return (self.time, self.ls_deg, self.ltst) != (None, None, None)

    @property
    def part_of_day(self) -> float | None:
        """The solar time as a part of the day."""
        if self.ltst is None:
            return None
        parts = [int(part) for part in self.ltst.split(":")]
        return sum(part / unit for part, unit in zip(parts, (24, 1440, 86_400), strict=False))

    def idle(self) -> Iterator[Idle]:
        """A place of the Sun beside a date."""
        if self.by_date:
            why = "time, ls_deg or ltst tell where the Sun stands"
            yield from (Idle(name, why, refused=True) for name in ("azimuth_deg", "elevation_deg"))

    def require_sound(self) -> None:
        """Refuse a place of the Sun beside a date, and dates and local times that are none.

        Raises:
            RecipeError: if one is given.
        """
        try:
            self.refuse_idle()
        except RecipeError as error:
            raise RecipeError(str(error), key=("sun", *error.key)) from None
        if self.time is not None:
            read_time(self.time, key=("sun", "time"))
        if self.ltst is not None and not _is_clock_time(self.ltst):
            raise RecipeError(
                f'{self.ltst!r} is no time of a day of 24 hours, such as "09:30"',
                key=("sun", "ltst"),
            )


@dataclass(frozen=True, kw_only=True)
class SkySpec(Spec):
    """What is in the air."""

    tau: Annotated[float, Interval(ge=0, le=10)] | None = None
    """Optical depth of the dust, 0 for none, and so is less than 0.0001; a usual day of the body
    where it is left out. On Mars 0.3 is clear, 1 dusty, above 3 a storm."""
    stars: bool = False
    """Whether stars down to magnitude 5 stand in a black sky; the Sun must be given by a date."""
    star_gain: Annotated[float, Interval(gt=0, le=1e7)] = 3e4
    """How much brighter than they are stars are shown. At 1, as they are, none is bright enough to
    show beside ground in the Sun."""

    def idle(self) -> Iterator[Idle]:
        """The brightness of stars that there are none of."""
        if not self.stars:
            yield Idle("star_gain", "no stars are shown; choose stars: true")
