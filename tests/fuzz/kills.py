"""Commands that are killed or refused by the disk, and what is left of the older world."""

from __future__ import annotations

import errno
import hashlib
import os
import random
import resource
import shutil
import signal
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from tests.fuzz import samples, trial

EVENTS = {"open", "os.mkdir", "os.rename", "os.rmdir", "os.remove", "ctypes.dlsym", "os.scandir"}
"""What Python tells of the file system (its audit events)."""
LIMITS = {"seconds": trial.BUILD_SECONDS, "memory": trial.BUILD_MEMORY}
KINDS = "size", "step", "refusal"
"""How a command is met, the same on each machine."""
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT
_REFUSALS = (errno.ENOSPC, errno.EROFS, errno.EDQUOT, errno.EIO)


BUILD = "build", "recipe.yaml", "-o", "world"
COMMANDS = BUILD, BUILD, ("export", "world", "--only", "geotiff"), ("validate", "world", "--quick")
_SIGNALS = signal.SIGKILL, signal.SIGTERM, signal.SIGINT


class Kills:
    """Draws commands on a built world that end before their time.

    Args:
        rng: where chance comes from.
        world: a good one.
        timed: whether some are killed after a time; when that is, another machine decides anew.
    """

    def __init__(self, rng: random.Random, world: Path, *, timed: bool = False) -> None:
        self._rng, self._world, self._timed = rng, world, timed
        self._steps: dict[str, int] = {}
        """Number of steps by command."""

    def attempt(self, folder: Path) -> tuple[list[str], str, trial.Ended]:
        """Meet one command; what is wrong with what came of it, what was done, and its end."""
        rng = self._rng
        world = folder / "world"
        self._lay_out(folder, seed=rng.randrange(9))
        command = rng.choice(COMMANDS)
        older = digest(world)
        kind = rng.choice(("time", *KINDS) if self._timed else KINDS)
        number, refusal = rng.choice(_SIGNALS), rng.choice(_REFUSALS)
        if kind == "time":
            when = rng.uniform(0.0, 4.0)
            what = f"{number.name} after {when:.3f} s"
            ended = trial.run(command, folder, **LIMITS, kill=(when, number))
            allowed = [0, 1, 130]
        elif kind == "size":
            limit = int(10 ** rng.uniform(3.7, 6))
            what = f"files of at most {limit} bytes"
            ended = trial.run(command, folder, **LIMITS, before=_limited(limit))
            allowed = [0, 1, 3]
        else:
            writes = kind == "refusal"
            steps, share = self._count(command, folder, writes=writes), rng.random()
            step = int(steps**share if rng.random() < 0.5 else 1 + steps * share)
            act = _killing(number) if kind == "step" else _refusing(refusal, world)
            what = f"{number.name if kind == 'step' else os.strerror(refusal)} at step {step}"
            ended = trial.run(command, folder, **LIMITS, before=lambda: at_step(step, act, writes))
            allowed = [0, 1, 3] if writes else [0, 1, 130]
        found = []
        if ended.status not in [-one for one in _SIGNALS]:  # two of them before it listens
            found = trial.faults(ended, allowed=allowed, **LIMITS)
        if ended.status != -signal.SIGKILL and kind != "refusal":  # which tidying may meet too
            found += _left(folder)
        whole = digest(world)
        if command[0] == "build" and whole != older and not _is_whole(world):
            found.append(f"lost: {command[0]} ended {ended.status}")
        # What an export or a validation has left half done, it makes good itself, or a build.
        for after in dict.fromkeys((command, BUILD) if rng.random() < 0.5 else (BUILD,)):
            again = trial.run(after, folder, **LIMITS)
            faults = [*trial.faults(again, allowed=(0, 1), **LIMITS), *_left(folder)]
            found += [f"{after[0]} after {command[0]}: {fault}" for fault in faults]
        return found, f"{' '.join(command)}: {what}\n{ended.stderr}", ended

    def _lay_out(self, folder: Path, *, seed: int) -> None:
        shutil.copytree(self._world, folder / "world", symlinks=True)
        samples.write_recipe({**samples.of_rocks(samples.STONES), "seed": seed}, folder)

    def _count(self, command: Sequence[str], folder: Path, *, writes: bool) -> int:
        """How many steps, or writing ones, a command takes in the file system; found out once."""
        name = f"{command[0]} {writes}"
        if name not in self._steps:
            place, log = folder.with_name("counted"), folder.with_name("steps")
            place.mkdir()
            self._lay_out(place, seed=1)
            handle = os.open(log, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
            count = partial(at_step, 1, lambda _: os.write(handle, b"."), writes)
            trial.run(command, place, **LIMITS, before=count)
            os.close(handle)
            self._steps[name] = log.stat().st_size
            shutil.rmtree(place)
            log.unlink()
        return self._steps[name]


def digest(folder: Path) -> str:
    """One hash of all of a folder."""
    found = hashlib.sha256()
    for path in sorted(folder.rglob("*")):
        found.update(path.relative_to(folder).as_posix().encode())
        if path.is_file():
            found.update(path.read_bytes())
    return found.hexdigest()


def _is_whole(world: Path) -> bool:
    """Whether a world's files are what its manifest says."""
    from terrain_forge.base import TerrainForgeError
    from terrain_forge.building import read_manifest
    from terrain_forge.building.manifest import altered_files
    from terrain_forge.model import World

    try:
        World.load(world)
        return not altered_files(world, read_manifest(world))
    except TerrainForgeError:
        return False


def _left(folder: Path) -> list[str]:
    """What lies beside the world that was not there, or is staged within it."""
    names = sorted(path.name for path in folder.iterdir())
    if names != ["recipe.yaml", "world"] or (folder / "world" / ".terrain-forge").exists():
        return [f"left behind: {', '.join(names)}"]
    return []


def at_step(step: int, act: Callable[[str], object], writes: bool = False) -> None:
    """Act from the n-th step of this process in the file system on, or of its writing steps."""
    seen = 0

    def hook(event: str, arguments: tuple[object, ...]) -> None:
        nonlocal seen
        if event in EVENTS and (not writes or _writes(event, arguments)):
            seen += 1
            if seen >= step:
                act(str(arguments[0]) if event != "ctypes.dlsym" else "")

    sys.addaudithook(hook)


def _writes(event: str, arguments: tuple[object, ...]) -> bool:
    """Whether a step takes room on the disk."""
    flags = arguments[2] if event == "open" else 0
    return event in ("os.mkdir", "os.rename") or bool(isinstance(flags, int) and flags & _WRITING)


def _killing(number: int) -> Callable[[str], None]:
    done = []

    def act(_: str) -> None:
        if not done:
            done.append(True)
            os.kill(os.getpid(), number)

    return act


def _refusing(number: int, world: Path) -> Callable[[str], None]:
    """Refuse what happens in the world's folder from then on, a few times."""
    left = [3]

    def act(place: str) -> None:
        if left[0] and str(world.parent) in place:
            left[0] -= 1
            raise OSError(number, os.strerror(number))

    return act


def _limited(size: int) -> Callable[[], None]:
    def act() -> None:
        sys.dont_write_bytecode = True  # or Python's own files are cut off too, and stay
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    return act
