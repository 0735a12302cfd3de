"""Whether a built site in tiles is as it was built: every file, by its hash, and no others."""

from __future__ import annotations

import json
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Any

from terrain_forge.base import (
    DataError,
    OutputError,
    Stopwatch,
    read_json,
    read_text,
    run_tasks,
    storing,
)
from terrain_forge.building import foreign_files, hash_found, holding
from terrain_forge.model import Check, at_most
from terrain_forge.tiling.driving import DRIVE, checks_of_drive
from terrain_forge.tiling.joining import (
    FORMAT,
    MANIFEST,
    REPORT,
    TABLE,
    added_files,
    faults_of_files,
    read_site,
    read_tile,
)
from terrain_forge.tiling.order import (
    FOLDER,
    MOST,
    TILE,
    TileOrder,
    load_order,
    require_plain,
)

_NAMED = 20
"""Tiles and files that a check names."""
_FEW = 16
"""Tiles that are read in this process."""
_COUNTS = "truth/size_frequency.json"
VALIDATE_STAGES = ("tiles", "manifest")
"""Stages of a validation."""


def check_tile(out: str, number: int) -> list[str]:
    """Files of a tile that are missing, changed, or not its own; links and empty folders too."""
    order = load_order(Path(out))
    folder = order.folder(number)
    place = order.grid.folder(number)
    if not (folder / TILE).is_file():
        return [f"{place}/{TILE} is missing"]
    try:
        files: dict[str, str] = read_tile(order, number)["files"]
    except OutputError:
        return [f"{place}/{TILE} is damaged"]
    found = [f"{place}/{told}" for told in faults_of_files(folder, files)]
    there = foreign_files(folder, {})
    return found + [f"{place}/{name} was added" for name in there if name not in {*files, TILE}]


def validate_site(out: Path, *, watch: Stopwatch) -> bool:
    """Compare a built site with what its lists say; writes validation/report.json.

    Raises:
        OutputError: if the folder is none, its build is not finished, or another process writes it.
        StorageError: if the disk does not take the report.
    """
    order, manifest = load_order(out), read_site(out)
    bad: list[str] = []
    with holding(out):
        require_plain(out)
        count = len(order.grid)
        watch(f"tiles: 0 of {count}")
        work = partial(check_tile, str(out))
        workers = 0 if count <= _FEW else None  # processes take longer to begin
        for done, (number, result) in enumerate(run_tasks(work, range(count), workers=workers), 1):
            where = order.grid.folder(number)
            bad += [f"{where}: {result}"] if isinstance(result, Exception) else result
            watch(f"tiles: {done} of {count}", done / count)
        watch("manifest")
        return _judge(order, {*bad, *_of_site(order, manifest)})


def judge_again(order: TileOrder, manifest: dict[str, Any]) -> bool:
    """Judge what an earlier validation found damaged anew, after a build; whether all is well."""
    try:
        before = read_json(order.out / REPORT, REPORT)["damaged"]
        places = {*_by_place(before)}
    except (DataError, KeyError, TypeError, AttributeError):
        return True  # there was none
    if not places:
        return True
    tiles = [n for n in range(len(order.grid)) if order.grid.folder(n) in places]
    bad = [name for number in tiles for name in check_tile(str(order.out), number)]
    return _judge(order, {*bad, *_of_site(order, manifest)})


def _judge(order: TileOrder, bad: set[str]) -> bool:
    """Write the report; whether all is as it was built."""
    out = order.out
    checks = [_check("tiles", bad, "files of tiles and of the whole that are not as built")]
    if not _is_amiss(_COUNTS, bad):
        pairs = json.loads((out / _COUNTS).read_text("utf-8"))["overlaps"]["pairs"]
        checks.append(at_most("overlapping rocks", pairs, 0, note="pairs, also across borders"))
    if not _is_amiss(DRIVE, bad):
        checks += checks_of_drive(order)
    report = {
        "format": FORMAT,
        "checks": [vars(check) for check in checks],
        "conformance": [],
        "damaged": sorted(bad),
    }
    with storing(out, out):
        (out / REPORT).parent.mkdir(exist_ok=True)
        (out / REPORT).write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    return all(check.passed for check in checks)


def _is_amiss(name: str, bad: set[str]) -> bool:
    return any(told.startswith(f"{name} ") for told in bad)


def _check(name: str, bad: set[str], what: str) -> Check:
    places = _by_place(bad)
    told = [
        names[0] if len(names) == 1 else f"{place}: {len(names)} files"
        for place, names in places.items()
    ]
    more = f"; {len(told) - _NAMED} more are in {REPORT}" if len(told) > _NAMED else ""
    repair = "; move damaged tiles' folders and what was added away, and build again"
    named = "; ".join(told[:_NAMED]) + more + repair
    return at_most(name, len(bad), 0, note=f"{what}: {named}" if bad else what)


def _by_place(bad: Iterable[str]) -> dict[str, list[str]]:
    """What is not as built by the tile's folder, tiles first, or by itself."""
    found: dict[str, list[str]] = {}
    for name in sorted(bad, key=lambda one: (not one.startswith("tiles/"), one)):
        parts = name.partition(":")[0].split("/")
        place = "/".join(parts[:3]) if parts[0] == "tiles" else name
        found.setdefault(place, []).append(name)
    return found


def _of_site(order: TileOrder, manifest: dict[str, Any]) -> list[str]:
    """Files of the whole that are not as they were built, and tiles whose own list is not."""
    bad = [f"{name} was added" for name in added_files(order, manifest)]
    if wrong := order.site.misstated(manifest):
        bad.append(f"{MANIFEST} is damaged ({', '.join(wrong)})")
    bad += faults_of_files(order.out, manifest["outputs"])
    table = order.out / FOLDER / TABLE
    try:
        lines = read_text(table, TABLE, most=MOST).splitlines()[1:] if table.exists() else []
    except DataError:  # it is among the damaged
        lines = []
    for number, line in enumerate(lines):
        path = order.folder(number) / TILE
        if path.is_file() and hash_found(path) != line.rpartition(",")[2]:
            bad.append(f"{order.grid.folder(number)}/{TILE} is damaged")
    return bad
