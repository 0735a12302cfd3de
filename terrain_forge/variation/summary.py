"""What was drawn for each of many worlds and measured in it, and the table of all."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Collection
from contextlib import suppress
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from terrain_forge.base import DataError, OutputError, read_json, write_whole
from terrain_forge.model import World
from terrain_forge.paths import Traversability, arrivals
from terrain_forge.recipe import ArrivalSpec
from terrain_forge.truth import rate_world
from terrain_forge.variation.drawing import Drawn

SUMMARY, TABLE = "drawn.json", "worlds.csv"


def summary_of(
    drawn: Drawn, world: World, spec: ArrivalSpec, rated: Traversability | None = None
) -> dict[str, Any]:
    """What was drawn for a world, and what was measured in it, as JSON has it.

    `rated` is what `rate_world` says of it, where that is known.
    """
    area = float(np.prod(world.site.size))
    own = world.field.diameter
    measured: dict[str, Any] = {
        "rocks": len(own),
        "unplaced": sum(world.unplaced),
        "rock_cover": round(float((0.25 * np.pi * own * own).sum()) / area, 6),
        "slope_deg": round(_median_slope(world), 3),
    }
    if world.rover.wheels:
        rated = rated or rate_world(world)
        found = arrivals(rated, seed=world.site.seed, starts=spec.starts, distance=spec.distance_m)
        measured |= {
            "arrive": round(found.planned, 4),
            "arrive_straight": round(found.straight, 4),
            "passable": round(found.passable, 4),
        }
    return {
        "number": drawn.number,
        "name": world.site.name,
        "seed": world.site.seed,
        "rover": world.rover.name,
        "difficulty": drawn.difficulty,
        "drawn": {key: value for key, value in drawn.values.items() if key != "seed"},
        "measured": measured,
    }


def _median_slope(world: World) -> float:
    """Median slope of the ground's cells [degrees]."""
    z = world.ground.elevation.astype(np.float64)
    east = z[:-1, 1:] + z[1:, 1:] - z[:-1, :-1] - z[1:, :-1]
    north = z[1:, :-1] + z[1:, 1:] - z[:-1, :-1] - z[:-1, 1:]
    steepness = np.sqrt(east * east + north * north) / (2.0 * world.ground.spacing)
    return math.degrees(math.atan(float(np.median(steepness))))


def read_summary(folder: Path) -> dict[str, Any]:
    """What was drawn for a world and measured in it.

    Raises:
        OutputError: if the folder holds no world of ours.
    """
    with suppress(DataError):
        found = read_json(folder / SUMMARY, SUMMARY)
        if isinstance(found, dict) and isinstance(found.get("drawn"), dict):
            measured, own = found.get("measured"), ("number", "seed", "difficulty")
            if isinstance(measured, dict) and {*own} <= {*found}:
                figures = [*measured.values(), *(found[name] for name in own)]
                if all(one is None or type(one) in (int, float) for one in figures):
                    return found
    raise OutputError(f"{folder} holds no readable {SUMMARY}: remove the folder and make it again")


def write_table(out: Path, folders: tuple[Path, ...]) -> None:
    """One row for each world: what was drawn, and what was measured; no table without any."""
    if not folders:
        return
    found = [read_summary(folder) for folder in folders]
    rows = [
        {
            "world": folder.name,
            "seed": one["seed"],
            "difficulty": one["difficulty"],
            **{_column(key, one["measured"]): value for key, value in one["drawn"].items()},
            **one["measured"],
        }
        for folder, one in zip(folders, found, strict=True)
    ]
    head = list(dict.fromkeys(key for row in rows for key in row))
    text = StringIO()
    table = csv.DictWriter(text, head, lineterminator="\n")
    table.writeheader()
    for row in rows:
        table.writerow({key: _plain(value) for key, value in row.items()})
    write_whole(out / TABLE, text.getvalue())


def _column(key: str, measured: Collection[str]) -> str:
    """The column of what was drawn, which is not that of something measured."""
    return f"recipe.{key}" if key in measured else key


def _plain(value: Any) -> Any:
    """A value as a field of a table."""
    return json.dumps(value) if isinstance(value, dict | list | tuple) else value
