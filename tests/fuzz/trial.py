"""One command in a process of its own, watched: how it ended, and what is wrong with that."""

from __future__ import annotations

import faulthandler
import gc
import os
import pkgutil
import re
import resource
import select
import signal
import sys
import time
import traceback
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import terrain_forge
from terrain_forge.base.listed import is_kept, kernel, listed, numba_types
from tests.helpers import command_line

SECONDS = 20.0
"""Processor time that a command may take that builds nothing [s]."""
HANGS = 10.0
"""It hangs after so many times that, less what it waited for a processor: others may be at work."""
MEMORY = 3e9
"""What it may take of memory [bytes]."""
BUILD_SECONDS, BUILD_MEMORY = 90.0, 6e9
_OURS = re.compile(r"^(WARNING: |terrain-forge: (\d+:\d\d |.* is now called ))")
_DISK = "terrain-forge: [Errno 5]"
_BEGINNINGS, _FAILED = ("terrain-forge: ", "interrupted, "), ("world: ", "built: ")
_FRAME = re.compile(r'File "[^"]*?/(terrain_forge|exporters)/([^"]+)", line \d+, in (\S+)')


@dataclass(frozen=True, kw_only=True)
class Ended:
    """How a command ended."""

    status: int | None
    """Its exit status, negative for a signal; None if it was killed for the time that it took."""
    seconds: float
    """Processor time that it took [s]."""
    memory: float
    """Its largest memory [bytes]."""
    stdout: str
    stderr: str


def warm_up(good: Path) -> None:
    """Import all of ours and what commands import late, and check a good recipe.

    A forked command need do neither.
    """
    os.environ.setdefault("PROJ_DEBUG", "0")  # as commands begin
    import mujoco  # noqa: F401
    import rasterio  # noqa: F401
    import scipy.interpolate
    import scipy.optimize
    import scipy.stats  # noqa: F401
    import trimesh  # noqa: F401

    for module in pkgutil.walk_packages(terrain_forge.__path__, "terrain_forge."):
        with suppress(ImportError):  # of programs that are not installed
            import_module(module.name)
    done = command_line.run("check", good)
    assert done.returncode == 0, done.stderr


def load_kernels() -> None:
    """Load the kernels that the cache holds; what was made until now stays shared memory."""
    for room in listed("build").values():
        for name, signature in room.items():
            if is_kept(name, signature):
                kernel(name).compile(numba_types(signature))
    gc.collect()
    gc.freeze()


def run(
    arguments: Sequence[str],
    folder: Path,
    *,
    seconds: float = SECONDS,
    memory: float = MEMORY,
    before: Callable[[], object] | None = None,
    kill: tuple[float, int] | None = None,
) -> Ended:
    """Run `terrain-forge ARGUMENTS` in a folder.

    Args:
        arguments: The command line.
        folder: The working folder.
        seconds: Processor time that it should take.
        memory: What it may allocate [bytes].
        before: Called in its process before it begins.
        kill: When it gets a signal, seconds after its begin, and which.
    """
    logs = [folder.with_name(f"{folder.name}.{name}") for name in ("out", "err")]
    for log in logs:
        log.touch()
    begin = time.monotonic()
    number = os.fork()
    if not number:
        _be_command(arguments, folder, logs, memory, before)
    handle = os.pidfd_open(number)
    try:
        if kill is not None and not select.select([handle], [], [], kill[0])[0]:
            os.kill(number, kill[1])
        while not (ended := select.select([handle], [], [], 1.0)[0]):
            if time.monotonic() - begin - _queued(number) > HANGS * seconds:
                break
        hangs = not ended
        if hangs:
            os.kill(number, signal.SIGABRT)  # it says where its threads are
            select.select([handle], [], [], 5.0)
            os.killpg(number, signal.SIGKILL)
        _, status, usage = os.wait4(number, 0)
    finally:
        os.close(handle)
    out, err = (log.read_text(encoding="utf-8", errors="surrogateescape") for log in logs)
    for log in logs:
        log.unlink()
    return Ended(
        status=None if hangs else os.waitstatus_to_exitcode(status),
        seconds=usage.ru_utime + usage.ru_stime,
        memory=usage.ru_maxrss * 1024.0,
        stdout=out,
        stderr=err,
    )


def _queued(number: int) -> float:
    """How long a process has waited for a processor that others had [s]."""
    waited = [0]
    for thread in Path(f"/proc/{number}/task").glob("*/schedstat"):
        with suppress(OSError):
            waited.append(int(thread.read_text().split()[1]))
    return 1e-9 * max(waited)


def _be_command(
    arguments: Sequence[str],
    folder: Path,
    logs: list[Path],
    memory: float,
    before: Callable[[], object] | None,
) -> None:
    """What the forked process does; it does not return."""
    status = 99
    try:
        os.setsid()
        os.chdir(folder)
        for number, log in enumerate(logs, 1):
            os.dup2(os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
        sys.stdout, sys.stderr = (
            os.fdopen(os.dup(n), "w", buffering=1, errors="backslashreplace") for n in (1, 2)
        )
        resource.setrlimit(resource.RLIMIT_DATA, (int(1.3 * memory), int(1.3 * memory)))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        faulthandler.enable(2)
        warnings.resetwarnings()
        for kind in (DeprecationWarning, PendingDeprecationWarning, ImportWarning, ResourceWarning):
            warnings.simplefilter("ignore", kind)
        from terrain_forge.__main__ import run as be_command

        sys.argv = ["terrain-forge", *arguments]
        if before is not None:
            before()
        be_command()  # ends the process
    except BaseException:
        traceback.print_exc()
    finally:  # whatever print_exc() raises
        os._exit(status)


def faults(
    ended: Ended,
    *,
    allowed: Sequence[int] = (0, 2),
    seconds: float = SECONDS,
    memory: float = MEMORY,
) -> list[str]:
    """What is wrong with how a command ended, each as a signature that alike faults share."""
    found = []
    lines = [line for line in ended.stderr.split("\n") if line and not _OURS.match(line)]
    if ended.status == 0 or len(lines) > 1:  # warnings, beside what is refused
        lines = [line for line in lines if ": has no effect: " not in line]
    if ended.status is None or ended.seconds > seconds:
        how = "hangs" if ended.status is None else f"slow: over {seconds:g} s"
        found.append(how)
    if ended.memory > memory:
        found.append(f"memory: over {memory / 1e9:g} GB")
    if "Traceback (most recent call last)" in ended.stderr:
        frames = _FRAME.findall(ended.stderr)
        place = "/".join(frames[-1][1:]) if frames else "?"
        last = next((line for line in reversed(lines[:-1]) if not line.startswith(" ")), "?")
        found.append(f"traceback: {last.split(':')[0]} in {place}")
    elif ended.status == 3 and ended.stderr.startswith(_DISK) and len(lines) == 1:
        pass
    elif ended.status is not None and ended.status not in allowed:
        found.append(f"status: {ended.status}: {_shape(ended.stderr)}")
    elif ended.status == 0 and lines:
        found.append(f"stderr: {_shape(lines[0])}")
    elif ended.status == 1 and lines and all(line.startswith(_FAILED) for line in lines):
        pass
    elif ended.status and (len(lines) != 1 or not lines[0].startswith(_BEGINNINGS)):
        found.append(f"lines: {len(lines)}: {_shape(lines[0] if lines else '')}")
    elif len(ended.stderr) > 3000:
        found.append(f"long: {len(ended.stderr)} characters: {_shape(ended.stderr)}")
    if any(not c.isprintable() and c != "\n" for c in ended.stdout + ended.stderr):
        found.append(f"control characters: {_shape(ended.stderr)}")
    return found


def _shape(text: str) -> str:
    """A message without what differs from input to input."""
    text = re.sub(r"[-\d.e+]*\d", "N", text.strip()[:300])
    return re.sub(r"'[^']*'|\"[^\"]*\"|/\S+", "…", text)[:110]
