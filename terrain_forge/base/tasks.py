"""Tasks in other processes, on this machine or on a Dask cluster.

A process that ends by a fault, for lack of memory or by a kill takes nothing with it but the task
that it was at, which is tried again. Tasks leave files; what they return should be small.
"""

from __future__ import annotations

import os
import pickle
import threading
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from subprocess import PIPE, Popen
from typing import Any, TypeVar

from terrain_forge.base.cluster import on_dask
from terrain_forge.base.interpreter import python_words
from terrain_forge.base.threads import ask_for_interrupt, processors, worker_threads
from terrain_forge.base.trying import sendable, tried

T = TypeVar("T")
R = TypeVar("R")
_TICK = 0.1
"""How often an interrupt is looked for [s]."""
_THREADS = "NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"
_SERVE = "from terrain_forge.base import serve_tasks; serve_tasks()"


def run_tasks(
    function: Callable[[T], R],
    items: Iterable[T],
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    tries: int = 2,
    told: Callable[[str], None] | None = None,
) -> Iterator[tuple[T, R | Exception]]:
    """Each item with what a function returns for it, or the error it raised at last, in any order.

    Args:
        function: Found by its module and name, or a `functools.partial` of such a one.
        items: What it is called with, taken as workers become free.
        workers: Processes on this machine, which use one core each, by default one for each core;
            0 calls it here. On a cluster the tasks that are out at once, by default four for each
            of its threads.
        scheduler: Address of a Dask scheduler, such as `tcp://host:8786`, or `local` for a cluster
            on this machine; by default plain processes.
        tries: How often an item is tried before its error is returned.
        told: Called with the address of the cluster's dashboard, where there is one.

    Raises:
        OutputError: if the scheduler cannot be reached, its workers cannot do our work, or there
            have been none for `PATIENCE`.
    """
    if scheduler is not None:
        return on_dask(function, items, workers, scheduler, tries, told)
    if workers == 0:
        return _here(function, items, tries)
    return _in_processes(function, items, workers or processors(), tries)


def _here(
    function: Callable[[T], R], items: Iterable[T], tries: int
) -> Iterator[tuple[T, R | Exception]]:
    for item in items:
        ask_for_interrupt()
        yield item, tried(function, item, tries)


def _in_processes(
    function: Callable[[T], R], items: Iterable[T], workers: int, tries: int
) -> Iterator[tuple[T, R | Exception]]:
    start = pickle.dumps((pickle.dumps(function), tries))
    waiting, done, lock = iter(items), SimpleQueue[Any](), threading.Lock()
    stopped = threading.Event()
    children: list[_Child] = []

    def serve() -> None:
        child = _Child(start)
        children.append(child)
        try:
            while not stopped.is_set():
                with lock:
                    item = next(waiting, _END)
                if item is _END:
                    return
                for left in reversed(range(tries)):
                    result, died = child.ask(item)
                    if not died or not left or stopped.is_set():
                        break
                done.put((item, result))
        finally:
            child.end()
            done.put(_END)

    with worker_threads(workers) as pool:
        futures = [pool.submit(serve) for _ in range(workers)]
        try:
            serving = workers
            while serving:
                ask_for_interrupt()
                with suppress(Empty):
                    found = done.get(timeout=_TICK)
                    if found is _END:
                        serving -= 1
                    else:
                        yield found
        finally:
            stopped.set()
            for child in children:
                child.kill()
        for future in futures:
            future.result()


_END: Any = object()


class _Child:
    """A process that is given one item after another; where it dies another takes its place."""

    def __init__(self, start: bytes) -> None:
        self._start = start
        self._environment = {**os.environ, **dict.fromkeys(_THREADS, "1")}
        self._process: Popen[bytes] | None = None

    def ask(self, item: Any) -> tuple[Any, bool]:
        """The result or error of an item, and whether the process died over it."""
        process = self._process or self._begun()
        try:
            _send(process.stdin, item)
            return pickle.load(process.stdout), False  # type: ignore[arg-type]
        except (EOFError, OSError, pickle.UnpicklingError):
            process.kill()
            status = process.wait()
            self.end()
            why = f"signal {-status}" if status < 0 else f"exit status {status}"
            return OSError(f"its process ended: {why}"), True

    def _begun(self) -> Popen[bytes]:
        command = python_words(_SERVE)
        given: dict[str, Any] = {"stdin": PIPE, "stdout": PIPE, "env": self._environment}
        # An interrupt from the keyboard is for us alone, we end the others.
        self._process = process = Popen(command, start_new_session=True, **given)
        with suppress(OSError):  # it has ended: asking tells
            process.stdin.write(self._start)  # type: ignore[union-attr]
        return process

    def end(self) -> None:
        """Let the process end."""
        if self._process is not None:
            with suppress(OSError):
                self._process.stdin.close()  # type: ignore[union-attr]
            self._process.wait()
            self._process.stdout.close()  # type: ignore[union-attr]
            self._process = None

    def kill(self) -> None:
        """End the process, whatever it does."""
        if (process := self._process) is not None:
            process.kill()


def _send(pipe: Any, content: Any) -> None:
    pipe.write(pickle.dumps(content))
    pipe.flush()


def serve_tasks() -> None:
    """What such a process does: results of items, from its input to its output.

    It ends where its input does, at once, whatever it is at: nobody waits for it any more.
    """
    given, output = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    with Path(os.devnull).open("rb") as nothing:
        os.dup2(nothing.fileno(), 0)  # what others read, or close as `exit` does, is not the pipe
    os.dup2(2, 1)  # nor is what they print for it
    function, tries = pickle.load(given)
    items: SimpleQueue[Any] = SimpleQueue()

    def read() -> None:
        try:
            while True:
                items.put(pickle.load(given))
        except BaseException:
            os._exit(0)

    with worker_threads(1) as pool:
        pool.submit(read)
        try:
            called = pickle.loads(function)
            while True:
                _send(output, sendable(tried(called, items.get(), tries)))
        except KeyboardInterrupt:
            os._exit(130)
        except BaseException:
            with suppress(OSError):
                traceback.print_exc()
            os._exit(1)
