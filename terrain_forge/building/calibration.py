"""How slow the machine at hand is: measured once, and learnt from each build.

Each build tells how long its stages took here, and the next estimate goes by that.
"""

from __future__ import annotations

import json
import math
import os
import platform
import time
import zlib
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path
from tempfile import NamedTemporaryFile

import numpy as np

from terrain_forge.base import cache_folder

CALIBRATED = 0.021
"""How long the machine of the rates takes for the work of `pace` [s]."""
LIBRARY = "rock library"
"""The stage that takes no time where its result is in the cache."""
SHORTEST = 0.2
"""What a stage must take to tell anything [s]."""
FARTHEST = 5.0
"""By how much a stage may be slower or faster here than its rate says, at most."""

_KEPT = "pace.json"


def pace() -> float:
    """How much slower this machine is; measured once, in a tenth of a second, and kept."""
    return _machine()[0]


def _machine() -> tuple[float, dict[str, float]]:
    """How much slower this machine is, and its stages than that, by the builds that it has made."""
    folder, machine = cache_folder(), _name()
    kept = folder / _KEPT if folder else None
    with suppress(OSError, ValueError, LookupError, TypeError, AttributeError):
        found = json.loads(kept.read_text(encoding="utf-8")) if kept else {}
        if found["machine"] == machine and 0.0 < float(found["pace"]) < 1e3:
            stages = {str(stage): float(part) for stage, part in found["stages"].items()}
            if all(1.0 / FARTHEST <= part <= FARTHEST for part in stages.values()):
                return float(found["pace"]), stages
    measured = _measured()
    _keep(measured, {})
    return measured, {}


@cache
def _measured() -> float:
    """How much slower this machine is, by this process."""
    return min(_work() for _ in range(5)) / CALIBRATED


def learn(
    expected: Mapping[str, float],
    taken: Mapping[str, float],
    work: Mapping[str, float],
    *,
    driven: float = 0.0,
    passed: bool = True,
) -> None:
    """Take note of how long expected stages took [s]; what compiled anything is no measure.

    Of a validation `driven` [s] are expected to be the drives', and what is beyond the rest tells
    of these alone: checks and drives are not slower by the same. Where not all `passed`, a drive
    may have ended early: the validation is no measure. Where a stage took longer than the
    processors worked for it, the machine was busy with other things. Half of what was found counts,
    lest one build spoils the next estimates.
    """
    slower, stages = _machine()
    if cache_folder() is None or "compile" in taken:
        return
    known = {**expected, "drive": driven}
    times = {stage: min(taken[stage], work.get(stage, math.inf)) for stage in taken}
    if not passed:
        times.pop("validation", None)
    if driven and "validation" in times:
        times["drive"] = times.pop("validation") - (expected["validation"] - driven)
    for stage, seconds in times.items():
        if stage in known and stage != LIBRARY and seconds >= SHORTEST:
            part = stages.get(stage, 1.0) * (seconds / known[stage]) ** 0.5
            stages[stage] = min(max(part, 1.0 / FARTHEST), FARTHEST)
    _keep(slower, stages)


def _name() -> str:
    """This machine's."""
    return f"{platform.node()} {platform.machine()} {os.cpu_count()}"


def _work() -> float:
    """Processor time [s] of a bit of all that a build does."""
    since = time.process_time()
    counts: dict[int, int] = {}
    for number in range(60_000):
        counts[number % 977] = counts.get(number % 977, 0) + number
    wave = np.sort(np.sin(np.arange(200_000.0)))
    zlib.compress(wave[:40_000].tobytes(), 6)
    return time.process_time() - since


def _keep(slower: float, stages: Mapping[str, float]) -> None:
    """Keep what is known of this machine, in a file that others see all of or nothing."""
    parts = {stage: round(part, 3) for stage, part in stages.items()}
    content = {"machine": _name(), "pace": round(slower, 3), "stages": parts}
    with suppress(OSError):
        if (folder := cache_folder()) is not None:
            folder.mkdir(parents=True, exist_ok=True)
            with NamedTemporaryFile("w", dir=folder, delete=False, encoding="utf-8") as file:
                json.dump(content, file)
            Path(file.name).replace(folder / _KEPT)


def calibrated(stages: Mapping[str, float]) -> dict[str, float]:
    """Time of stages on this machine [s], by that on the machine of the rates."""
    slower, parts = _machine()
    return {stage: slower * parts.get(stage, 1.0) * seconds for stage, seconds in stages.items()}
