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
from collections.abc import Callable
from pathlib import Path

from tests.fuzz import samples, trial

EVENTS = {"open", "os.mkdir", "os.rename", "os.rmdir", "os.remove", "ctypes.dlsym", "os.scandir"}
"""What Python tells of the file system (its audit events)."""
LIMITS = {"seconds": trial.BUILD_SECONDS, "memory": trial.BUILD_MEMORY}
STEPS = 1200
"""Steps at which a command is met, at most."""
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT
_REFUSALS = (errno.ENOSPC, errno.EROFS, errno.EDQUOT, errno.EIO)


class Kills:
    """Draws commands on a built world that end before their time.

    Args:
        rng: where chance comes from.
        world: a good one.
    """

    def __init__(self, rng: random.Random, world: Path) -> None:
        self._rng, self._world = rng, world

    def attempt(self, folder: Path) -> list[str]:
        """Meet one command; what is wrong with what came of it."""
        rng = self._rng
        world = folder / "world"
        shutil.copytree(self._world, world, symlinks=True)
        samples.write_recipe({**samples.of_rocks(samples.STONES), "seed": rng.randrange(9)}, folder)
        command = rng.choice((
            ("build", "recipe.yaml", "-o", "world"),
            ("build", "recipe.yaml", "-o", "world"),
            ("export", "world", "--only", "geotiff"),
            ("validate", "world", "--quick"),
        ))  # fmt: skip
        older = digest(world)
        kind = rng.randrange(4)
        if kind == 0:
            number = rng.choice((signal.SIGKILL, signal.SIGTERM, signal.SIGINT))
            when = rng.uniform(0.0, 4.0)
            ended = trial.run(command, folder, **LIMITS, kill=(when, number))
            allowed = [0, 1, 130] if number != signal.SIGKILL else [0, 1, -signal.SIGKILL]
        elif kind == 1:
            limit = int(10 ** rng.uniform(3.7, 6))
            ended = trial.run(command, folder, **LIMITS, before=_limited(limit))
            allowed = [0, 1, 3]
        else:
            number = rng.choice((signal.SIGKILL, signal.SIGTERM, signal.SIGINT))
            step = int(STEPS ** rng.random())
            act = _killing(number) if kind == 2 else _refusing(rng.choice(_REFUSALS), world)
            writes = kind == 3
            ended = trial.run(command, folder, **LIMITS, before=lambda: at_step(step, act, writes))
            allowed = [0, 1, 3] if kind == 3 else [0, 1, 130, -number]
        found = []
        if ended.status not in (-signal.SIGKILL, -signal.SIGTERM):  # the latter before it listens
            found = trial.faults(ended, allowed=allowed, **LIMITS)
        if ended.status != -signal.SIGKILL and kind != 3:  # a disk may refuse the tidying too
            found += _left(folder)
        whole = digest(world)
        if command[0] == "build" and whole != older and not _is_whole(world):
            found.append(f"lost: {command[0]} ended {ended.status}")
        # What an export or a validation has left half done, the same command makes good.
        for after in dict.fromkeys((command, ("build", "recipe.yaml", "-o", "world"))):
            again = trial.run(after, folder, **LIMITS)
            faults = [*trial.faults(again, allowed=(0, 1), **LIMITS), *_left(folder)]
            found += [f"{after[0]} after {command[0]}: {fault}" for fault in faults]
        return found


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


def at_step(step: int, act: Callable[[str], None], writes: bool = False) -> None:
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
    return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
