"""Compiles the kernels of a first build side by side, before it begins.

`kernels.json` lists them with the types that they are called with, room by room, the slowest first;
`python benchmarks/compiling.py --write` writes it. A kernel that is not listed compiles when it is
called, as all do where there is one processor core.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterable
from concurrent.futures import wait
from contextlib import suppress
from functools import cache
from importlib import import_module
from logging import getLogger
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

from numba import config, get_num_threads
from numba import types as _types

from terrain_forge.base.progress import Progress, silent
from terrain_forge.base.threads import ask_for_interrupt, worker_threads

LISTED = Path(__file__).with_name("kernels.json")
types: Any = _types
settings: Any = config
_FEW = 8
_MOST_PROCESSES = 8
_TICK = 0.2
"""How often progress is told [s]."""


def compile_ahead(progress: Progress = silent) -> None:
    """Compile all listed kernels that the cache lacks, if these are many, in other processes.

    Args:
        progress: Called a few times a second with how many there are and the share that is done.
    """
    threads = get_num_threads()
    if threads == 1 or settings.DISABLE_JIT:
        return
    rooms = _listed()
    missing = {
        room: [name for name, signature in kernels.items() if not is_kept(name, signature)]
        for room, kernels in rooms.items()
    }
    count = sum(map(len, missing.values()))
    if count <= _FEW:
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


def _serve(
    waiting: SimpleQueue[str], missing: dict[str, list[str]], done: SimpleQueue[str]
) -> None:
    """Have one process compile room after room; what it fails to do compiles when it is called."""
    pipes: dict[str, Any] = {
        "stdin": subprocess.PIPE,
        "stdout": subprocess.PIPE,
        "stderr": subprocess.DEVNULL,
    }
    command = [sys.executable, "-m", __name__]
    with suppress(Empty, OSError), subprocess.Popen(command, text=True, **pipes) as child:
        assert child.stdin is not None
        assert child.stdout is not None
        while True:
            for name in missing[waiting.get_nowait()]:
                ask_for_interrupt()
                child.stdin.write(f"{name}\n")
                child.stdin.flush()
                if not child.stdout.readline():
                    getLogger(__name__).warning(
                        "a process that compiles kernels ended too early, at %s", name
                    )
                    return
                done.put(name)


@cache
def _listed() -> dict[str, dict[str, list[Any]]]:
    """Signatures by room and name."""
    return dict(json.loads(LISTED.read_text()))


def main(names: Iterable[str]) -> None:
    """Compile kernels, and answer after each."""
    signatures = {name: one for room in _listed().values() for name, one in room.items()}
    for name in map(str.strip, names):
        kernel(name).compile(numba_types(signatures[name]))
        sys.stdout.write(f"{name}\n")
        sys.stdout.flush()


def kernel(name: str) -> Any:
    """The kernel of a name `module:function`, ready to be compiled."""
    module, function = name.split(":")
    room = import_module(module.rpartition(".")[0])
    getattr(room, "before_compiling", lambda: None)()
    return getattr(import_module(module), function)


def is_kept(name: str, signature: list[Any]) -> bool:
    """Whether the cache holds a kernel, as its index says."""
    module, function = name.split(":")
    found = getattr(import_module(module), function)
    cache = found._cache
    key = cache._index_key(numba_types(signature), found.targetctx.codegen())
    return key in cache._cache_file._load_index()


def numba_types(signature: list[Any]) -> tuple[Any, ...]:
    """The types of a signature of `kernels.json`: names, arrays, [tuples], {class: [fields]}."""
    return tuple(map(_type, signature))


def _type(plain: Any) -> Any:
    if isinstance(plain, list):
        return types.BaseTuple.from_types(numba_types(plain))
    if isinstance(plain, dict):
        ((name, fields),) = plain.items()
        module, made = name.split(":")
        return types.BaseTuple.from_types(numba_types(fields), getattr(import_module(module), made))
    name, *rest = plain.split()
    scalar = getattr(types, name)
    if not rest:
        return scalar
    return types.Array(scalar, int(rest[0][0]), "C", readonly="readonly" in rest)


def plain_types(signature: Iterable[Any]) -> list[Any]:
    """What `numba_types` reads."""
    return [_plain(found) for found in signature]


def _plain(found: Any) -> Any:
    if isinstance(found, types.Array):
        assert found.is_c_contig, found
        return f"{found.dtype} {found.ndim}d{'' if found.mutable else ' readonly'}"
    if isinstance(found, types.BaseNamedTuple):
        made = found.instance_class
        return {f"{made.__module__}:{made.__qualname__}": plain_types(found)}
    if isinstance(found, types.BaseTuple):
        return plain_types(found)
    assert getattr(types, str(found)) == found, found
    return str(found)


if __name__ == "__main__":
    main(sys.stdin)
