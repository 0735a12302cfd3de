"""Compiles the kernels of a first build side by side, before it begins.

`kernels.json` lists them with the types that they are called with, room by room, the slowest first,
`kernels-record.json` what a recording needs besides; `python benchmarks/compiling.py --write`
writes both. A kernel that is not listed compiles when it is
called, as all do where there is one processor core.
"""

from __future__ import annotations

import subprocess
import sys
from concurrent.futures import wait
from contextlib import suppress
from logging import getLogger
from queue import Empty, SimpleQueue
from typing import Any

from numba import config

from terrain_forge.base.interpreter import python_words
from terrain_forge.base.kernels import kernel_threads
from terrain_forge.base.listed import is_kept, kernel, listed, numba_types, signatures
from terrain_forge.base.progress import Progress, silent
from terrain_forge.base.shipped import unpack
from terrain_forge.base.threads import ask_for_interrupt, worker_threads

settings: Any = config
_FEW = 8
_MOST_PROCESSES = 8
_TICK = 0.2
"""How often progress is told [s]."""


def compile_ahead(progress: Progress = silent, *, purpose: str = "build") -> None:
    """Compile all listed kernels that the cache lacks, if these are many, in other processes.

    Args:
        progress: Called a few times a second with how many there are and the share that is done.
        purpose: "build" or "record".
    """
    if settings.DISABLE_JIT:
        return
    missing = _missing(purpose)
    if any(missing.values()) and unpack():
        missing = _missing(purpose)
    threads = kernel_threads()
    count = sum(map(len, missing.values()))
    if threads == 1 or count <= _FEW:
        return
    processes = min(threads, _MOST_PROCESSES)
    waiting: SimpleQueue[str] = SimpleQueue()
    for room, names in missing.items():
        if names:
            waiting.put(room)
    done: SimpleQueue[str] = SimpleQueue()
    with worker_threads(processes) as pool:
        servers = [pool.submit(_serve, waiting, missing, done) for _ in range(processes)]
        try:
            while wait(servers, timeout=_TICK).not_done:
                stage = f"compile: {done.qsize()} of {count} kernels, once"
                progress(stage, done.qsize() / count)
                ask_for_interrupt()
        finally:  # after an interrupt no further room is begun
            with suppress(Empty):
                while True:
                    waiting.get_nowait()


def _missing(purpose: str) -> dict[str, dict[str, list[Any]]]:
    """The listed kernels that the cache lacks, by room."""
    return {
        room: {name: types for name, types in kernels.items() if not is_kept(name, types)}
        for room, kernels in listed(purpose).items()
    }


def _serve(
    waiting: SimpleQueue[str], missing: dict[str, dict[str, list[Any]]], done: SimpleQueue[str]
) -> None:
    """Have one process compile room after room; what it fails to do compiles when it is called."""
    pipes: dict[str, Any] = {
        "stdin": subprocess.PIPE,
        "stdout": subprocess.PIPE,
        "stderr": subprocess.DEVNULL,
    }
    command = python_words(f"from {__name__} import main; main()")
    with suppress(Empty, OSError), subprocess.Popen(command, text=True, **pipes) as child:
        assert child.stdin is not None
        assert child.stdout is not None
        while True:
            for name in missing[waiting.get_nowait()]:
                ask_for_interrupt()
                child.stdin.write(f"{name}\n")
                child.stdin.flush()
                if not child.stdout.readline():
                    ask_for_interrupt()  # the terminal's ends the child too
                    getLogger(__name__).warning(
                        "a process that compiles kernels ended too early, at %s", name
                    )
                    return
                done.put(name)


def main() -> None:
    """Compile the kernels that the input names, and answer after each."""
    for name in map(str.strip, sys.stdin):
        kernel(name).compile(numba_types(signatures()[name]))
        sys.stdout.write(f"{name}\n")
        sys.stdout.flush()
