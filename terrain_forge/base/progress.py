"""Progress reporting, and the wall times of a build's stages."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from terrain_forge.base.threads import ask_for_interrupt

Progress = Callable[[str, float], None]
"""Called with the name of each stage as it begins, and the share of it that is done, 0 to 1.

After the name and `: ` may stand what the stage is busy with. If it has a method `expect`, that is
told how long each stage is expected to take [s]; if `follow`, the stages where they turn out to be
others."""


def silent(stage: str, share: float) -> None:
    """Report nothing."""
    del stage, share


class Stopwatch:
    """Wall and processor times of the stages, for timings.json and the progress bar."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._name = ""
        self._begin = self._since = time.perf_counter()
        self._spent = _processor_time()
        self.seconds: dict[str, float] = {}
        self.work: dict[str, float] = {}
        self.figures: dict[str, float] = {}

    def __call__(self, stage: str, share: float = 0.0) -> None:
        """Begin a stage, and end the one before; or report the share of it that is done."""
        ask_for_interrupt()
        self._progress(stage, share)
        name = stage.partition(": ")[0]
        if name == self._name:
            return
        now, spent = time.perf_counter(), _processor_time()
        if self._name:
            self.seconds[self._name] = self.seconds.get(self._name, 0.0) + now - self._since
            self.work[self._name] = self.work.get(self._name, 0.0) + spent - self._spent
        self._name, self._since, self._spent = name, now, spent

    def expect(self, seconds: Mapping[str, float]) -> None:
        """Tell how long each stage is expected to take [s], where the progress wants to know."""
        told = getattr(self._progress, "expect", None)
        if told is not None:
            told(seconds)

    def follow(self, stages: Sequence[str]) -> None:
        """Tell which stages there are, where the progress wants to know."""
        told = getattr(self._progress, "follow", None)
        if told is not None:
            told(stages)

    def timed(self, name: str, task: Callable[[], Any]) -> Any:
        """Carry out a task that others may run beside, and note its wall time."""
        since = time.perf_counter()
        result = task()
        self.seconds[name] = time.perf_counter() - since
        return result

    def write(self, directory: Path) -> None:
        """Write timings.json; the times of tasks that ran side by side overlap."""
        now = time.perf_counter()
        self.seconds[self._name] = now - self._since
        self.work[self._name] = _processor_time() - self._spent
        timings = {
            "wall_time_s": {name: round(value, 4) for name, value in self.seconds.items()},
            "processor_time_s": {name: round(value, 2) for name, value in self.work.items()},
            "total_s": round(now - self._begin, 4),
            **self.figures,
        }
        (directory / "timings.json").write_text(json.dumps(timings, indent=1) + "\n")


def _processor_time() -> float:
    """Of this process, all its threads and the processes that it has ended [s]."""
    return sum(os.times()[:4])
