"""Progress: a line that ticks on a terminal, elsewhere a line for each stage."""

from __future__ import annotations

import os
import re
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

import click

from terrain_forge.base import Progress, Stopwatch, ask_for_interrupt, hold_interrupts, silent

if TYPE_CHECKING:
    from rich.progress import Progress as Bar


_NARROW = 60
"""Columns of a terminal below which the line leaves out the bar, so that its stage can be read."""


class Display:
    """Shows the stages of some work on the error stream, from `with` to its end.

    A terminal has one line with the stage, what it is busy with, a bar, a clock that ticks and the
    time left, which goes at the end. Where there is none (a file, a pipe, a notebook, TERM=dumb),
    each stage is a line of its own as it begins, without control characters; the first waits for
    the second, so that work that is refused at once is told by its error alone.

    Args:
        stages: The stages to expect.
    """

    def __init__(self, stages: Sequence[str]) -> None:
        self._stages = list(stages)
        self._stage = self._part = ""
        self._share = self._part_share = self._most = 0.0
        self._begun = self._since = self._part_since = time.monotonic()
        self._end = 0.0
        self._expected: Mapping[str, float] = {}
        self._first: str | None = None
        self._bar: Bar | None = None

    def __enter__(self) -> Display:
        self._begun = self._since = time.monotonic()
        terminal = sys.stderr is not None and sys.stderr.isatty()
        if terminal and os.environ.get("TERM", "") not in ("dumb", "unknown"):
            self._bar = _bar(self)
            self._bar.start()
            self._bar.add_task("", total=1.0)
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar:
            self._bar.stop()

    def __call__(self, stage: str, share: float = 0.0) -> None:
        """A stage begins, or is so far; after `: ` stands what it is busy with."""
        ask_for_interrupt()
        name = stage.partition(": ")[0]
        part = re.split(r"\d", stage)[0]  # figures change as it goes on
        if part != self._part:
            self._part, self._part_since, self._part_share = part, time.monotonic(), share
        if name != self._stage:
            self._stage, self._since = name, self._part_since
            if not self._bar:
                self._tell(name)
        self._share = share
        self._end = time.monotonic() + self._rest()
        if self._bar:
            self._most = max(self._most, self.done)
            with hold_interrupts():  # a thread draws it
                self._bar.update(self._bar.task_ids[0], completed=self._most, description=stage)

    def expect(self, seconds: Mapping[str, float]) -> None:
        """Take how long each stage is expected to take [s]."""
        self._expected = seconds
        self._end = time.monotonic() + self._rest()

    def follow(self, stages: Sequence[str]) -> None:
        """Take other stages to expect: the work turned out to be of another kind."""
        self._stages = list(stages)

    @property
    def elapsed(self) -> float:
        """Time since the beginning [s]."""
        return time.monotonic() - self._begun

    @property
    def left(self) -> float | None:
        """Time that is left [s], where it can be told; it ticks down between reports."""
        last = self._share > self._part_share and self._stages[-1:] == [self._stage]
        return max(self._end - time.monotonic(), 0.0) if self._expected or last else None

    @property
    def done(self) -> float:
        """Share of the work that is done, 0 to 1."""
        if self._stage in self._expected:
            untold = sum(stage not in self._expected for stage in self._later())
            part = self.elapsed / max(self.elapsed + (self.left or 0.0), 1e-9)
            return part * (1.0 - untold / len(self._stages))
        if self._stage not in self._stages:
            return self._most
        return min(1.0 - (len(self._later()) + 1.0 - self._share) / len(self._stages), 1.0)

    def _rest(self) -> float:
        """Time that is left [s]: what was expected, and ever more the pace so far."""
        now = time.monotonic()
        rest = max(self._expected.get(self._stage, 0.0) - (now - self._since), 0.0)
        rest *= 1.0 - self._share
        made = self._share - self._part_share
        if made > 0.0:
            paced = (now - self._part_since) * (1.0 - self._share) / made
            rest += (self._share if self._stage in self._expected else 1.0) * paced
        return rest + sum(self._expected.get(stage, 0.0) for stage in self._later())

    def _later(self) -> list[str]:
        """The stages after this one."""
        known = self._stage in self._stages
        return self._stages[self._stages.index(self._stage) + 1 :] if known else []

    def _tell(self, name: str) -> None:
        line = f"terrain-forge: {clock(self.elapsed)} {name}"
        if self._first is None:
            self._first = line
            return
        with suppress(OSError):  # nobody reads it any more
            for told in filter(None, (self._first, line)):
                click.echo(told, err=True)
        self._first = ""


def clock(seconds: float) -> str:
    """A time as on a clock, such as 0:07 or 1:02:03."""
    minutes, second = divmod(int(seconds), 60)
    hours, minute = divmod(minutes, 60)
    return f"{hours}:{minute:02}:{second:02}" if hours else f"{minute}:{second:02}"


@contextmanager
def watched(progress: Progress | bool, stages: Sequence[str]) -> Iterator[Stopwatch]:
    """A stopwatch over the stages that tells `progress`: a callback, True for a `Display`."""
    if callable(progress):
        yield Stopwatch(progress)
    elif progress:
        with Display(stages) as display:
            yield Stopwatch(display)
    else:
        yield Stopwatch(silent)


def _bar(display: Display) -> Bar:
    """The line on a terminal; a thread of its own draws it, four times a second."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn
    from rich.table import Column
    from rich.text import Text

    class Clock(ProgressColumn):
        """Time since the beginning, and the time left."""

        max_refresh = None

        def render(self, task: Task) -> Text:
            del task
            left = display.left
            more = f", {clock(left)} left" if left is not None and left >= 1.0 else ""
            return Text(f"{clock(display.elapsed)}{more}")

    console = Console(stderr=True, highlight=False)
    stage = Column(ratio=1, no_wrap=True, overflow="ellipsis")
    return Progress(
        TextColumn("{task.description}", table_column=stage, markup=False),
        *([BarColumn(bar_width=20)] if console.width >= _NARROW else []),
        TextColumn("{task.percentage:>3.0f} %"),
        Clock(table_column=Column(no_wrap=True)),
        console=console,
        refresh_per_second=4,
        transient=True,
        expand=True,
    )
