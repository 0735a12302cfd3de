"""A period of light over a site: from its recipe or built world to maps, a table and a film."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

from terrain_forge.base import Array, OutputError, Progress, silent
from terrain_forge.illumination.files import write_film, write_hours, write_maps, write_table
from terrain_forge.illumination.land import Source, find_land
from terrain_forge.illumination.period import light_over, moments_of, solar_day
from terrain_forge.making import place_of
from terrain_forge.model import Site
from terrain_forge.sky import days_of, look_up, moment_of, read_time, true_solar_time, utc_text

_STEPS = 48
_KEPT = 400
"""Moments of which the shadow maps are kept."""
_UNITS = {"s": 1.0, "m": 60.0, "min": 60.0, "h": 3600.0, "d": 86_400.0}
_FRAMES = 48


@dataclass(frozen=True, kw_only=True)
class Wish:
    """What is to be found."""

    begin: str | None = None
    """Date that the period begins with; the recipe's by default."""
    end: str | None = None
    """Date that it ends with; a solar day later by default."""
    step: str | None = None
    """Length of a step, such as 30m, 1h or 2d; a 48th of the period by default."""
    size: tuple[float, float] | None = None
    """East and north extent of the map [m]; the site's by default."""
    spacing: float | None = None
    """Of the map's nodes [m]; the DTM's posting by default."""
    height: float = 0.0
    """Of the observers above the ground [m]."""
    reach: float = 100e3
    """How far from the centre is looked [m]."""
    azimuths: int = 360
    """Directions of the horizon map."""


def illuminate(
    site: Site, source: Source | None, out: Path, wish: Wish, *, progress: Progress = silent
) -> list[str]:
    """Find where the Sun shines over a period and write it; returns lines that tell of it.

    Args:
        site: Where.
        source: The recipe's DTM, to be read as far as it goes; None for what the site holds.
        out: The folder to write.
        wish: What is to be found.
        progress: Called with the part that is done.

    Raises:
        RecipeError: where no date tells the Sun's place, or nothing tells the heights.
        OutputError: for a period that is none.
    """
    place = place_of(site, key=("sun", "time"))
    begin = _begin(site, wish, place)
    end = read_time(wish.end) if wish.end else begin + solar_day(place[0])
    step = _length(wish.step) if wish.step else (end - begin) / _STEPS
    moments = moments_of(begin, end, step)
    read_time(moments[-1].isoformat())
    progress("land", 0.0)
    land = find_land(
        site, source=source, size=wish.size, spacing=wish.spacing, reach=wish.reach,
        height=wish.height,
    )  # fmt: skip
    light = light_over(
        land, site, place, moments, step, azimuths=wish.azimuths, kept=_KEPT,
        progress=lambda part: progress("rays", part),
    )  # fmt: skip
    above = look_up(*place, np.array([days_of(moment) for moment in moments]))
    progress("files", 0.0)
    out.mkdir(parents=True, exist_ok=True)
    captions = [
        f"{utc_text(moment)}  {true_solar_time(float(above.solar_time[n]))} solar  Sun "
        f"{np.degrees(np.arcsin(above.sun[n, 2])):.1f} deg high"
        for n, moment in enumerate(moments)
    ]
    lines = write_maps(out, light, land, site, [utc_text(moment) for moment in moments])
    facts = {
        "site": site.name,
        "body": site.body.name,
        "lonlat_deg": np.degrees(place[1]).round(6).tolist(),
        "from": utc_text(begin),
        "to": utc_text(end),
        "step_h": step / timedelta(hours=1),
        "looked": land.told,
        "observers_m": wish.height,
    }
    write_table(out / "illumination.json", moments, above, light, facts)
    hours = len(moments) * step / timedelta(hours=1)
    write_hours(out / "sunlight_hours.png", light, hours)
    lines += ["sunlight_hours.png", "illumination.json, where Sun and Earth stand"]
    if len(light.moments):
        write_film(out / "shadows.webp", land, light, above, captions, _FRAMES)
        lines.append("shadows.webp")
    heading = (
        f"{utc_text(begin)} to {utc_text(end)}, {len(moments):,} moments; looked {land.told}",
        f"sunlight {light.sunlight.mean():.4g} h of {hours:.4g} h on average, "
        f"{light.sunlight.min():.4g} to {light.sunlight.max():.4g} h; "
        f"{100 * light.never.mean():.3g} % of the ground is never lit",
    )
    return [*heading, *lines]


def _begin(site: Site, wish: Wish, place: tuple[object, Array | tuple[float, float]]) -> datetime:
    sun = site.recipe.sun
    if wish.begin:
        return read_time(wish.begin)
    if not sun.by_date:
        raise OutputError("the recipe's Sun has no date: give the period as --from and --to")
    return moment_of(sun, place[0], place[1])  # type: ignore[arg-type]


def _length(text: str) -> timedelta:
    """The length of a step.

    Raises:
        OutputError: where it is none.
    """
    number = text.rstrip("abcdefghijklmnopqrstuvwxyz ")
    unit = text[len(number) :].strip() or "s"
    try:
        seconds = float(number) * _UNITS[unit]
        if 0.0 < seconds < 1e9:
            return timedelta(seconds=seconds)
    except (ValueError, KeyError):
        pass
    raise OutputError(f"--step {text!r}: a length such as 90s, 30m, 1h or 2d")
