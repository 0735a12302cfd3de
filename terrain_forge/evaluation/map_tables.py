"""Scores of maps: of files beside a world or a system's run, as tables."""

from __future__ import annotations

import logging
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from terrain_forge.base import (
    MAX_STATE,
    Array,
    DataError,
    OutputError,
    Progress,
    read_json,
    read_text,
    reading,
    silent,
)
from terrain_forge.evaluation.map_files import MapPoints, read_map
from terrain_forge.evaluation.map_score import CELL, Area, MapScore, score_map, site_grid
from terrain_forge.evaluation.tables import MAPS, TABLE, write_table
from terrain_forge.model import World

_log = logging.getLogger(__name__)
_HEAD = (
    "map", "area [m]", "cell [m]", "points", "over the ground [m]", "rms [m]", "median [m]",
    "mapped [%]", "within 5 cm [%]", "cell rms [m]", "rock precision [%]", "rock recall [%]",
    "rock F1 [%]", "LAC map", "LAC rocks",
)  # fmt: skip


def score_maps(
    world: World,
    maps: Sequence[str],
    *,
    evaluated: Path | None = None,
    area: Area | None = None,
    cell: float = CELL,
    progress: Progress = silent,
) -> list[MapScore]:
    """Score maps that are given as `FILE`, in the world's frame, or `SYSTEM=FILE`, in a system's.

    Args:
        world: The world.
        maps: The maps.
        evaluated: Folder of the results of `evaluate_recording`, which tell how a system's
            trajectory, and so its map, was laid on the truth.
        area: West, south, east, north of what is scored [m]; the whole site by default.
        cell: Size of a cell [m].
        progress: Told of each map, and of the share of the site that is looked at.

    Returns:
        Scores of the maps that can be read, in their order; of the others a warning says why.

    Raises:
        DataError: if no map can be read or laid on the world, or two have one name.
    """
    found, failures = list[MapPoints](), list[DataError]()
    for number, told in enumerate(maps):
        progress(f"maps: {told}", number / len(maps))
        try:
            found.append(_placed(told, evaluated, world.site.crs))
        except DataError as error:
            failures.append(error)
    if failures and not found:
        raise failures[0]
    for failure in failures:
        _log.warning("a map is not scored: %s", failure)
    names = [one.name for one in found]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise DataError(f"--map: two maps are called {twice!r}, by their files: rename one")
    grid = site_grid(world, area=area, cell=cell, progress=progress)
    return [score_map(world, one, grid) for one in found]


def _placed(told: str, evaluated: Path | None, crs: str) -> MapPoints:
    system, equals, file = told.partition("=")
    if not equals or Path(told).exists():
        return read_map(told, crs=crs)
    return read_map(file, name=f"{system}: {Path(file).stem}").moved(_motion(system, evaluated))


def _motion(system: str, evaluated: Path | None) -> Array:
    """How the first good run of a system was laid on the truth, shape [4, 4]."""
    scored: dict[str, Array] = {}
    path = evaluated / f"{TABLE}.json" if evaluated else Path()
    if path.is_file():
        try:
            for one in read_json(path, str(path)):
                if one["score"]:
                    motion = np.array(one["score"]["alignment"], np.float64).reshape(4, 4)
                    scored.setdefault(one["system"], motion)
        except (ValueError, KeyError, TypeError) as error:
            raise DataError(f"{path}: cannot be read: {error}") from None
    if system in scored:
        return scored[system]
    there = ", ".join(scored) or "none"
    raise DataError(
        f"--map {system}=…: {system} has no score here, whose alignment would lay its map on the "
        f"world (there are: {there}); evaluate it first, or give a map in the world's frame"
    )


def map_rows(scores: Sequence[MapScore]) -> list[list[str]]:
    """The cells of the table, its heading first; empty where a figure could not be told."""
    rows = [list(_HEAD)]
    for one in scores:
        up, cells = one.vertical, one.cell_errors
        lac = one.challenge
        rows.append([
            one.name, " ".join(f"{value:g}" for value in one.area), f"{one.cell:g}",
            str(one.points), _shown(one.bias), _shown(up.rms if up else None),
            _shown(up.median if up else None), _shown(100.0 * one.mapped),
            _shown(100.0 * one.right), _shown(cells.rms if cells else None),
            *map(_percent, (one.precision, one.recall, one.f1)),
            f"{lac[0]:.1f}", "" if one.f1 is None else f"{lac[1]:.1f}",
        ])  # fmt: skip
    return rows


def _shown(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}"


def _percent(part: float | None) -> str:
    return "" if part is None else f"{100.0 * part:.3g}"


def kept_maps(folder: Path, scores: Sequence[MapScore], *, force: bool = False) -> list[MapScore]:
    """The scores of a folder's table that stay when others are added.

    Args:
        folder: Where the table lies.
        scores: The new ones; each takes the place of that of its name, area and cell.
        force: Whether a table that cannot be read goes; else it is an error.

    Raises:
        OutputError: for such a table.
    """
    path = folder / f"{MAPS}.json"
    try:
        found = _read_maps(path) if os.path.lexists(path) else []
    except DataError as error:
        if not force:
            raise OutputError(f"{error}; --force begins it anew") from None
        found = []
    new = {(one.name, one.area, one.cell) for one in scores}
    return [one for one in found if (one.name, one.area, one.cell) not in new]


def _read_maps(path: Path) -> list[MapScore]:
    from pydantic import TypeAdapter

    text = read_text(path, str(path), most=MAX_STATE)
    with reading(str(path)):
        return TypeAdapter(list[MapScore]).validate_json(text)


def write_maps(scores: Sequence[MapScore], folder: Path) -> list[Path]:
    """Write maps.json, maps.csv, maps.tex and maps.txt; returns them."""
    plain = [
        {k: vars(v) if hasattr(v, "rms") else v for k, v in vars(one).items()} for one in scores
    ]
    return write_table(map_rows(scores), plain, folder, name=MAPS)
