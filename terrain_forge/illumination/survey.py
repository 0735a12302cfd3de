"""A period of light over a site: from its recipe or built world to maps, a table and a film."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, timedelta
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from terrain_forge.base import (
    Array,
    OutputError,
    Progress,
    RecipeError,
    Stopwatch,
    resolved,
    silent,
)
from terrain_forge.building import pace, replacing, require_ours, told_files, write_manifest
from terrain_forge.illumination.files import (
    write_day,
    write_film,
    write_hours,
    write_maps,
    write_table,
)
from terrain_forge.illumination.land import Land, Source, find_land
from terrain_forge.illumination.period import Light, light_over, moments_of, solar_day
from terrain_forge.making import place_of
from terrain_forge.model import Site, World
from terrain_forge.sky import (
    Above,
    days_of,
    look_up,
    moment_of,
    read_time,
    true_solar_time,
    utc_text,
)

_STEPS = 48
_KEPT = 400
"""Moments of which the shadow maps are kept."""
_UNITS = {"s": 1.0, "m": 60.0, "min": 60.0, "h": 3600.0, "d": 86_400.0}
_FRAMES = 48
_RAY, _NODE = 2e-6, 300.0
"""Time that a ray takes [s], and memory that a node of the map takes beside its rays [bytes]."""
LARGEST = 1e6
"""Length of a map [m], at most."""
HOLDS = "illumination"
"""What the manifest of the folder says that it holds."""


@dataclass(frozen=True, kw_only=True)
class Wish:
    """What is to be found."""

    begin: str | None = None
    """Date that the period begins with; the recipe's by default."""
    end: str | None = None
    """Date that it ends with; a solar day later by default."""
    step: str | None = None
    """Length of a step with its unit, such as 30m, 1h or 2d, whose middle is a moment; a 48th of
    the period by default."""
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

    def __post_init__(self) -> None:
        """Refuse lengths that are none.

        Raises:
            OutputError: names the length.
        """
        east, north = self.size or (None, None)
        for name, value in (("size", east), ("size", north), ("spacing", self.spacing)):
            if value is not None and not 0.0 < value <= LARGEST:
                raise OutputError(f"{name} {value:g} m: above 0 m, at most {LARGEST:g} m")
        for name, value in (("height", self.height), ("reach", self.reach)):
            if not (isfinite(value) and value >= 0.0):
                raise OutputError(f"{name} {value:g} m: 0 m or more")


def illuminate(
    site: Site,
    source: Source | None,
    out: Path | str,
    wish: Wish,
    *,
    world: World | None = None,
    force: bool = False,
    progress: Progress = silent,
    tell: Callable[[str], None] | None = None,
) -> list[str]:
    """Find where the Sun shines over a period and write it; returns lines that tell of it.

    Args:
        site: Where; it may be planned `by_night`.
        source: The recipe's DTM, to be read as far as it goes; None for what the site holds.
        out: The folder to write; an older one of `illuminate` is replaced when the new is whole.
        wish: What is to be found.
        world: The site's world, of which a film of the day is made.
        force: Whether files may be removed that lie in the older folder and are not its own.
        progress: Called with the part that is done.
        tell: Called with a line on what it costs, before it begins.

    Raises:
        RecipeError: where no date tells the Sun's place, or nothing tells the heights.
        DataError: where the map reaches beyond the DTM.
        OutputError: for a period that is none, a map that does not fit into memory, or a folder
            that holds anything else.
        StorageError: if the disk does not take it.
    """
    watch, out = Stopwatch(progress), resolved(out)
    removed = told_files(out, require_ours(out, force=force, holds=HOLDS))
    place = place_of(site, key=("dtm",))
    begin = _begin(site, wish, place)
    end = _time("--to", wish.end) if wish.end else begin + solar_day(place[0])
    step = _length(wish.step) if wish.step else (end - begin) / _STEPS
    moments = moments_of(begin, end, step)
    read_time(moments[-1].isoformat())
    with replacing(out, force=force, holds=HOLDS) as folder:
        watch("land")
        kept = len(moments) if len(moments) <= _KEPT else 0
        land = find_land(
            site, source=source, size=wish.size, spacing=wish.spacing, reach=wish.reach,
            height=wish.height, bytes_each=_NODE + 8.0 * wish.azimuths + 3.0 * kept,
        )  # fmt: skip
        rays = wish.azimuths + 2.0 * len(moments) * (len(moments) <= wish.azimuths)
        seconds = pace() * _RAY * rays * len(land.points)
        if tell is not None:
            rows, columns = land.grid.shape
            tell(f"{columns:,} × {rows:,} points, {rays:,.0f} rays each: about {seconds:,.0f} s")
        watch.expect({"rays": seconds})
        light = light_over(
            land, site, place, moments, step, azimuths=wish.azimuths, kept=_KEPT,
            progress=lambda part: watch("rays", part),
        )  # fmt: skip
        watch("files")
        facts = {
            "site": site.name,
            "body": site.body.name,
            "lonlat_deg": np.degrees(site.lonlat or (0.0, 0.0)).round(6).tolist(),
            "from": utc_text(begin),
            "to": utc_text(end),
            "step_h": step / timedelta(hours=1),
            "map_m": [round(side, 6) for side in _sides(land)],
            "spacing_m": land.grid.spacing,
            "looked": land.told,
            "observers_m": wish.height,
        }
        above = look_up(*place, np.array([days_of(moment) for moment in moments]))
        hours = len(moments) * step / timedelta(hours=1)
        captions = _captions(moments, above)
        lines = _write(folder, site, land, light, moments, above, captions, facts, hours)
        if world is not None:
            watch("view")
            if write_day(folder / "day.webp", world, moments, above, captions, _FRAMES):
                lines.append("day.webp, what the preview's eye sees")
        write_manifest(site, folder, exports=(), holds=HOLDS)
    known = light.known_hours
    heading = (
        *([f"removed from {out}: {', '.join(removed)}"] if removed else []),
        f"{utc_text(begin)} to {utc_text(end)}, {len(moments):,} moments; {_map_told(land, wish)}; "
        f"looked {land.told}",
        f"sunlight {known.mean():.4g} h of {hours:.4g} h on average, "
        f"{known.min():.4g} to {known.max():.4g} h; "
        f"{100 * light.never_share:.3g} % of the ground is never lit",
    )
    return [*heading, *lines]


def _sides(land: Land) -> tuple[float, float]:
    """East and north extent of a map [m]."""
    west, south, east, north = land.grid.bounds
    return east - west, north - south


def _map_told(land: Land, wish: Wish) -> str:
    """How large a map is, and that this is not what was wished where the spacing does not fit."""
    east, north = _sides(land)
    told = f"map {east:g} × {north:g} m, a point each {land.grid.spacing:g} m"
    if wish.size is None or all(
        abs(a - b) <= 1e-6 * b for a, b in zip((east, north), wish.size, strict=True)
    ):
        return told
    return f"{told} (nearest to {wish.size[0]:g} × {wish.size[1]:g} m)"


def _captions(moments: list[datetime], above: Above) -> list[str]:
    return [
        f"{utc_text(moment)}  {true_solar_time(float(above.solar_time[n]))} solar  Sun "
        f"{np.degrees(np.arcsin(above.sun[n, 2])):.1f} deg high"
        for n, moment in enumerate(moments)
    ]


def _write(
    folder: Path,
    site: Site,
    land: Land,
    light: Light,
    moments: list[datetime],
    above: Above,
    captions: list[str],
    facts: dict[str, Any],
    hours: float,
) -> list[str]:
    """Write maps, table, pictures and film; returns lines that say what."""
    lines = write_maps(folder, light, land, site, [utc_text(moment) for moment in moments])
    write_table(folder / "illumination.json", moments, above, light, facts)
    write_hours(folder / "sunlight_hours.png", light, hours)
    lines += ["sunlight_hours.png", "illumination.json, where Sun and Earth stand"]
    film = folder / "shadows.webp"
    if len(light.moments) and write_film(film, land, light, above, captions, _FRAMES):
        lines.append(film.name)
    return lines


def _time(option: str, text: str) -> datetime:
    try:
        return read_time(text)
    except RecipeError as error:
        raise RecipeError(f"{option}: {error}") from None


def _begin(site: Site, wish: Wish, place: tuple[object, Array | tuple[float, float]]) -> datetime:
    sun = site.recipe.sun
    if wish.begin:
        return _time("--from", wish.begin)
    if not sun.by_date:
        raise OutputError("the recipe's Sun has no date: give the period as --from and --to")
    return moment_of(sun, place[0], place[1])  # type: ignore[arg-type]


def _length(text: str) -> timedelta:
    """The length of a step.

    Raises:
        OutputError: where it is none.
    """
    number = text.rstrip("abcdefghijklmnopqrstuvwxyz ")
    unit = text[len(number) :].strip()
    try:
        seconds = float(number) * _UNITS[unit]
        if 0.0 < seconds < 1e9:
            return timedelta(seconds=seconds)
    except (ValueError, KeyError):
        pass
    raise OutputError(f"--step {text!r}: a length with its unit, such as 90s, 30m, 1h or 2d")
