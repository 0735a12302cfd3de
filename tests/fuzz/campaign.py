"""Many inputs one after the other, and the figures of what came of them."""

from __future__ import annotations

import math
import os
import pickle
import random
import re
import shutil
import signal
import tempfile
import time
import traceback
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path

from tests.fuzz import samples, trial
from tests.fuzz.arguments import Arguments
from tests.fuzz.files import (
    Files,
    Folder,
    Worlds,
    folder_of_recording,
    folder_of_series,
    folder_of_site,
    folder_of_world,
)
from tests.fuzz.kills import Kills
from tests.fuzz.recipes import Recipes, put_traps
from tests.fuzz.traps import Traps

CORPUS = Path(__file__).parent / "corpus"
KINDS = {"recipes": 19, "files": 17, "worlds": 8, "arguments": 3, "traps": 2, "kills": 1}
"""Kinds of inputs, and how many of each there are among fifty: a kill takes as long as a hundred
recipes."""
_COST = re.compile(r"^cost +([\d.e+-]+) M nodes, ([\d.e+-]+) k rocks.*?: about (\d+) s", re.M)


@dataclass
class Figures:
    """What came of a campaign."""

    inputs: Counter[str] = field(default_factory=Counter)
    """Number of inputs by kind."""
    findings: dict[str, list[str]] = field(default_factory=dict)
    """Signature of each fault, and where its inputs were saved."""
    statuses: Counter[str] = field(default_factory=Counter)
    """Number of ends by kind and exit status."""
    seconds: float = 0.0
    slowest: float = 0.0
    largest: float = 0.0

    def add(self, other: Figures) -> None:
        """Take in what came of another campaign at the same time."""
        self.inputs += other.inputs
        self.statuses += other.statuses
        for name, where in other.findings.items():
            self.findings.setdefault(name, []).extend(where)
        self.seconds = max(self.seconds, other.seconds)
        self.slowest = max(self.slowest, other.slowest)
        self.largest = max(self.largest, other.largest)

    def lines(self) -> list[str]:
        """The figures as text."""
        kinds = ", ".join(f"{number} {kind}" for kind, number in sorted(self.inputs.items()))
        ends = ", ".join(f"{kind}: {number}" for kind, number in sorted(self.statuses.items()))
        return [
            f"{self.inputs.total()} inputs in {self.seconds:.0f} s: {kinds}",
            f"ends: {ends}",
            f"slowest {self.slowest:.1f} s, largest {self.largest / 1e9:.2f} GB",
            f"{len(self.findings)} findings",
            *(f"  {len(where)} × {name}: {where[0]}" for name, where in self.findings.items()),
        ]


class Campaign:
    """Draws inputs, runs them and keeps what failed.

    Args:
        seed: Root of all chance.
        kinds: Of `KINDS`.
        keep: Where inputs that fail are saved.
        builds: Part of the good recipes that is built too.
        timed: Whether commands are killed at random times, and time counts: one that is slow is a
            finding. Without it, all machines find the same.
    """

    def __init__(
        self,
        *,
        seed: int,
        kinds: tuple[str, ...] = tuple(KINDS),
        keep: Path,
        builds: float = 0.1,
        timed: bool = False,
    ) -> None:
        self.figures = Figures()
        self._said = ""
        self._seed, self._rng = seed, random.Random()
        self._kinds, self._keep, self._builds = kinds, keep, builds
        self._timed = timed
        self._place = Path(tempfile.mkdtemp(prefix="fuzz-"))
        (self._place / "good").mkdir()
        good = {**samples.of_rocks(samples.STONES), "paths": [samples.WAY]}
        trial.warm_up(samples.write_recipe(good, self._place))
        self._writers: dict[str, Recipes | Files | Worlds | Arguments | Traps] = {
            "recipes": Recipes(self._rng),
            "files": Files(self._rng, self._place / "good"),
        }
        if {"worlds", "kills", "arguments", "traps"} & {*kinds}:
            folders = self._good_folders()
            self._writers["worlds"] = Worlds(self._rng, folders)
            self._writers["arguments"] = Arguments(self._rng, self._place / "recorded")
            self._writers["traps"] = self._traps = Traps(self._rng, folders)
            self._kills = Kills(self._rng, self._place / "built", timed=timed)
        trial.load_kernels()

    def regressions(self) -> None:
        """Check the inputs that something was once wrong with."""
        for path in sorted(CORPUS.iterdir()):
            folder = self._place / "case"
            if path.is_dir():
                shutil.copytree(path, folder)
            else:
                folder.mkdir()
                shutil.copyfile(path, folder / "recipe.yaml")
            command = ("check", "recipe.yaml")
            for fault in self._judged("corpus", command, folder):
                self._save(f"{path.name}: {fault}", " ".join(command), folder)
            self.figures.inputs["corpus"] += 1
            shutil.rmtree(folder)

    def run(self, *, seconds: float = 1e9, inputs: int = 10**9, jobs: int = 1) -> Figures:
        """Run for a time, or a number of inputs, or until an interrupt.

        Args:
            seconds: For how long.
            inputs: How many.
            jobs: How many processes draw and run them; which they are does not depend on it.
        """
        pipes = [self._fork(job, jobs, seconds, inputs) for job in range(jobs)]
        usual = signal.signal(signal.SIGINT, signal.SIG_IGN)  # the others end, and tell
        try:
            for pipe in pipes:
                with os.fdopen(pipe, "rb") as file:
                    self.figures.add(pickle.load(file))
        finally:
            shutil.rmtree(self._place, ignore_errors=True)
            signal.signal(signal.SIGINT, usual)
        return self.figures

    def _fork(self, job: int, jobs: int, seconds: float, inputs: int) -> int:
        """Have another process run its part; where its figures are read."""
        reading, writing = os.pipe()
        if os.fork():
            os.close(writing)
            return reading
        try:
            self._place, self.figures = self._place / str(job), Figures()
            self._place.mkdir()
            self._run_part(job, jobs, seconds, inputs)
            with os.fdopen(writing, "wb") as file:
                pickle.dump(self.figures, file)
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(0)

    def _run_part(self, job: int, jobs: int, seconds: float, inputs: int) -> None:
        begin, drawn = time.monotonic(), Counter[str]()
        try:
            for number in range(inputs):
                if time.monotonic() - begin >= seconds:
                    break
                kind = min(self._kinds, key=lambda kind: (drawn[kind] + 1) / KINDS[kind])
                drawn[kind] += 1
                if number % jobs == job:
                    self._step(kind, drawn[kind])
                self.figures.seconds = time.monotonic() - begin
        except KeyboardInterrupt:
            self.figures.seconds = time.monotonic() - begin

    def _good_folders(self) -> list[Folder]:
        for name, recipe in (
            ("sensors", samples.of_sensors()),
            ("site", samples.of_tiles()),
            ("series", samples.of_worlds()),
        ):
            samples.write_recipe(recipe, self._place, f"{name}.yaml")
        self._must("build", "recipe.yaml", "-o", "built")
        self._must("build", "sensors.yaml", "-o", "recorded")
        self._must("record", "recorded")
        self._must("evaluate", "recorded", "--systems", "imu,wheel-odometry")
        self._must("build", "site.yaml", "-o", "site", "--workers", "0")
        self._must("worlds", "series.yaml", "-o", "series", "--workers", "0")
        return [
            *[folder_of_world(self._place / "built")] * 2,
            folder_of_recording(self._place / "recorded"),
            folder_of_site(self._place / "site"),
            folder_of_series(self._place / "series"),
        ]

    def _must(self, *command: str) -> None:
        ended = trial.run(command, self._place, seconds=90, memory=6e9)
        assert ended.status == 0, ended.stderr

    def _step(self, kind: str, number: int) -> None:
        folder = self._place / "case"
        folder.mkdir()
        # Each input has its own chance, whatever came of those before.
        self._rng.seed(f"{self._seed} {kind} {number}")
        self.figures.inputs[kind] += 1
        if kind == "kills":
            found, command, ended = self._kills.attempt(folder)
            self._note(kind, ended)
        else:
            if kind == "recipes":
                put_traps(folder)
            arguments = self._writers[kind].write(folder)
            command = " ".join(arguments)
            found = self._judged(kind, arguments, folder)
            if kind == "traps":
                found += self._traps.sprung(folder)
        for fault in found:
            self._save(f"{kind}: {fault}", command, folder)
        shutil.rmtree(folder)

    def _judged(self, kind: str, arguments: tuple[str, ...], folder: Path) -> list[str]:
        built = kind in ("worlds", "arguments", "traps")
        allowed = {"worlds": (0, 1, 2), "arguments": (0, 1, 2), "traps": (0, 1, 2, 3)}.get(
            kind, (0, 2)
        )
        before = {path.name for path in folder.iterdir()}
        ended = trial.run(arguments, folder)
        self._note(kind, ended)
        found = trial.faults(ended, allowed=allowed, seconds=self._due(trial.SECONDS))
        if built:
            return found
        left = {path.name for path in folder.iterdir()} - before
        found += [f"left behind: {sorted(left)}"] if left else []
        cost = _COST.search(ended.stdout)
        if ended.status == 0 and cost and not found and self._rng.random() < self._builds:
            nodes, estimate = float(cost[1]) * 1e6, float(cost[3])
            if nodes < 20_000 and estimate <= 10:
                found += self._built(arguments, folder, estimate)
        return found

    def _built(self, arguments: tuple[str, ...], folder: Path, estimate: float) -> list[str]:
        """What is wrong with the build of a recipe that `check` finds good."""
        self.figures.inputs["builds"] += 1
        seconds = 30.0 + 5.0 * estimate
        command = ("build", *arguments[1:], "-o", "built")
        ended = trial.run(command, folder, seconds=seconds, memory=trial.BUILD_MEMORY)
        self._note("builds", ended)
        found = trial.faults(
            ended, allowed=(0, 1), seconds=self._due(seconds), memory=trial.BUILD_MEMORY
        )
        return [f"build: {fault}" for fault in found]

    def _due(self, seconds: float) -> float:
        """From what processor time on a command is a finding [s]."""
        return seconds if self._timed else math.inf

    def _note(self, kind: str, ended: trial.Ended) -> None:
        self.figures.statuses[f"{kind} {ended.status}"] += 1
        self.figures.slowest = max(self.figures.slowest, ended.seconds)
        self.figures.largest = max(self.figures.largest, ended.memory)
        self._said = ended.stderr

    def _save(self, fault: str, command: str, folder: Path) -> None:
        """Keep the input of a fault, of each kind of fault the first few."""
        where = self.figures.findings.setdefault(fault, [])
        if len(where) >= 3:
            where.append("")
            return
        for number in count(1):
            target = self._keep / f"{number:04}"
            with suppress(FileExistsError):
                target.mkdir(parents=True)
                break
        where.append(str(target))
        pipes = [str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_fifo()]
        told = f"{fault}\n{command}\npipes: {pipes}\n"
        (target / "fault.txt").write_text(told, encoding="utf-8", errors="surrogateescape")
        said = target / "stderr.txt"  # of one that hangs, where its threads were
        said.write_text(self._said, encoding="utf-8", errors="surrogateescape")
        for path in folder.iterdir():
            if path.is_dir() and not path.is_symlink():
                shutil.copytree(path, target / path.name, symlinks=True, ignore=_pipes)
            elif path.is_symlink() or path.is_fifo():
                (target / f"{path.name}.is").write_text(f"{path.is_fifo()} {path.is_symlink()}")
            elif path.stat().st_size < 2**24:
                shutil.copyfile(path, target / path.name)


def _pipes(folder: str, names: list[str]) -> list[str]:
    """What no copy can be made of."""
    return [name for name in names if (Path(folder) / name).is_fifo()]
