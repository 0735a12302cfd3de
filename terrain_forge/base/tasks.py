"""Tasks in other processes, on this machine or on a Dask cluster.

A process that ends by a fault, for lack of memory or by a kill takes nothing with it but the task
that it was at, which is tried again. Tasks leave files; what they return should be small.
"""

from __future__ import annotations

import asyncio
import logging
import os
import pickle
import platform
import threading
import time
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager, nullcontext, suppress
from functools import cache
from importlib import import_module
from itertools import islice
from pathlib import Path
from queue import Empty, SimpleQueue
from subprocess import PIPE, Popen
from typing import Any, TypeVar

from terrain_forge.base.errors import OutputError, PluginError, TerrainForgeError
from terrain_forge.base.interpreter import python_words
from terrain_forge.base.registry import FOREIGN_FAILURES, failure_words, plugin_at_fault
from terrain_forge.base.threads import ask_for_interrupt, processors, worker_threads

_log = logging.getLogger(__name__)
T = TypeVar("T")
R = TypeVar("R")
LOCAL = "local"
"""In place of a scheduler's address: a cluster on this machine."""
_TICK = 0.1
"""How often an interrupt is looked for [s]."""
_ASKED = 1.0
"""How often a cluster is asked for its workers [s]."""
_AHEAD = 4
"""Tasks for each thread of a cluster that it is given at once."""
_REACH = 5.0
"""How long a scheduler has to answer [s]."""
PATIENCE = 600.0
"""How long a cluster may be without workers before a build gives up [s]."""
_THREADS = "NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"
_SAFE_PATH = "PYTHONSAFEPATH"
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
        return _on_dask(function, items, workers, scheduler, tries, told)
    if workers == 0:
        return _here(function, items, tries)
    return _in_processes(function, items, workers or processors(), tries)


def _here(
    function: Callable[[T], R], items: Iterable[T], tries: int
) -> Iterator[tuple[T, R | Exception]]:
    for item in items:
        ask_for_interrupt()
        yield item, _tried(function, item, tries)


def _tried(function: Callable[[T], R], item: T, tries: int) -> R | Exception:
    for left in reversed(range(tries)):
        try:
            return function(item)
        except FOREIGN_FAILURES as error:
            if not left:
                return _failure(error)
    raise ValueError(f"tries: {tries}, at least 1")


def _failure(error: BaseException) -> Exception:
    """An error of a task; one in the lines of another package is told as that package's."""
    if isinstance(error, TerrainForgeError | OSError | MemoryError):
        return error
    if told := plugin_at_fault(error):
        failure = PluginError(told)
        failure.__cause__ = error
        return failure
    return error if isinstance(error, Exception) else RuntimeError(failure_words(error))


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
        called = pickle.loads(function)
        while True:
            _send(output, _portable(_tried(called, items.get(), tries)))


def _portable(result: Any) -> Any:
    """A result that can be sent, or the error that says why not."""
    if isinstance(result, Exception):
        result.add_note("".join(traceback.format_exception(result)))
    try:
        pickle.loads(pickle.dumps(result))
    except Exception as error:
        told = result if isinstance(result, Exception) else error
        return RuntimeError(f"{type(told).__name__}: {told}")
    return result


def _on_dask(
    function: Callable[[T], R],
    items: Iterable[T],
    workers: int | None,
    scheduler: str,
    tries: int,
    told: Callable[[str], None] | None,
) -> Iterator[tuple[T, R | Exception]]:
    with _safe_path() if scheduler == LOCAL else nullcontext():
        yield from _on_cluster(function, items, workers, scheduler, tries, told)


@contextmanager
def _safe_path() -> Iterator[None]:
    """No module comes from the current folder, in all that Dask starts meanwhile, or anew."""
    before = os.environ.get(_SAFE_PATH)
    os.environ[_SAFE_PATH] = "1"
    try:
        yield
    finally:
        os.environ.pop(_SAFE_PATH)
        if before is not None:
            os.environ[_SAFE_PATH] = before


def _on_cluster(
    function: Callable[[T], R],
    items: Iterable[T],
    workers: int | None,
    scheduler: str,
    tries: int,
    told: Callable[[str], None] | None,
) -> Iterator[tuple[T, R | Exception]]:
    client = _connected(scheduler, workers)
    distributed, local = import_module("distributed"), scheduler == LOCAL
    try:
        mine = _require_same(client, scheduler)
        if told and client.dashboard_link:
            told(client.dashboard_link)
        threads = sum(client.nthreads().values())
        most = _AHEAD * threads if local or workers is None else workers
        left = iter(items)

        def submit(item: T) -> Any:
            return client.submit(_on_worker, function, item, tries, mine, pure=False)

        def ended(future: Any) -> tuple[Any, bool]:
            try:
                died = future.exception()  # its workers did, again and again
                result = died if died is not None else future.result()
            except (CancelledError, OSError):
                raise OutputError(
                    f"the scheduler at {scheduler} was lost; what is whole stays"
                ) from None
            future.release()
            if isinstance(died, OutputError):  # the worker is of another version
                raise died
            return result, died is not None

        out = {submit(item): item for item in islice(left, most)}
        suspects: list[T] = []
        finished: Any = distributed.as_completed(out, loop=client.loop)
        for future in _arriving(finished, client, scheduler):
            item = out.pop(future)
            result, died = ended(future)
            for following in islice(left, 1):
                out[another := submit(following)] = following
                finished.add(another)
            if died:
                suspects.append(item)
            else:
                yield item, result
        # Dask blames a worker's death on all that it was given: alone, each shows what it does.
        for item in suspects:
            alone = distributed.as_completed([submit(item)], loop=client.loop)
            for future in _arriving(alone, client, scheduler):
                yield item, ended(future)[0]
    finally:
        client.close()
        if local:
            client.cluster.close()


def _arriving(finished: Any, client: Any, scheduler: str) -> Iterator[Any]:
    """Futures as they are done, while there are workers that may do them.

    Raises:
        OutputError: if there have been none for `PATIENCE`.
    """
    seen = time.monotonic()
    asked, warned = seen, False
    while not finished.is_empty():
        ask_for_interrupt()
        if finished.has_ready():
            seen, warned = time.monotonic(), False
            yield next(finished)
            continue
        time.sleep(_TICK)
        now = time.monotonic()
        if now - asked < _ASKED:
            continue
        asked = now
        with suppress(OSError):  # of a scheduler that is lost the futures tell
            if client.nthreads():
                seen, warned = now, False
        if now - seen > PATIENCE:
            raise OutputError(
                f"the scheduler at {scheduler} has had no workers for {PATIENCE:.0f} s; what is "
                "whole stays: start dask worker, and the same command goes on from there"
            )
        if now - seen > _ASKED and not warned:
            warned = True
            _log.warning(
                "the scheduler at %s has no workers: waiting %.0f s for one, start dask worker",
                scheduler,
                PATIENCE,
            )


def require_scheduler(scheduler: str) -> None:
    """Refuse a cluster that cannot do our work, before any is prepared.

    Raises:
        OutputError: if the scheduler cannot be reached, has no workers, or they are of another
            version.
    """
    if scheduler != LOCAL:
        client = _connected(scheduler, None)
        try:
            _require_same(client, scheduler)
        finally:
            client.close()


def _connected(scheduler: str, workers: int | None) -> Any:
    """A client of a scheduler, or of one of its own."""
    try:
        distributed: Any = import_module("distributed")
    except ImportError:
        raise OutputError(
            "a scheduler needs Dask: pip install 'terrain-forge[dask]', or leave it out"
        ) from None
    if scheduler == LOCAL:
        logging.getLogger("distributed").setLevel(logging.WARNING)  # how it comes and goes
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Port ", UserWarning)  # its dashboard takes another
            return distributed.Client(
                n_workers=workers or processors(), threads_per_worker=1, memory_limit=0
            )
    _knock(distributed, scheduler)
    return distributed.Client(scheduler, timeout=_REACH, set_as_default=False)


def _knock(distributed: Any, scheduler: str) -> None:
    """Refuse an address where no Dask scheduler answers.

    A client would wait without end for a server that says nothing, and take what another says for
    the length of a message.
    """

    async def knock() -> None:
        secrets = distributed.Security().get_connection_args("client")
        comm = await distributed.comm.connect(scheduler, timeout=_REACH, **secrets)
        await comm.close()

    try:
        with worker_threads(1) as pool:  # a notebook's own loop runs in this one
            pool.submit(asyncio.run, asyncio.wait_for(knock(), _REACH + 1.0)).result()
    except Exception as error:  # a stranger's bytes raise anything
        why = " ".join(str(error).split())
        if isinstance(error, TimeoutError) and not why:
            why = "what takes the connection says nothing; is it Dask's?"
        elif not isinstance(error, OSError | ValueError):
            why = "what answers is not Dask's"
        raise OutputError(f"no Dask scheduler answers at {scheduler}: {why}") from None


def _on_worker(function: Callable[[T], R], item: T, tries: int, wanted: dict[str, str]) -> Any:
    """What a task returns.

    Raises:
        OutputError: on a worker of another version, which may have joined since the start.
    """
    if (found := software()) != wanted:
        raise OutputError(_differs(platform.node(), found, wanted))
    return _portable(_tried(function, item, tries))


def _require_same(client: Any, scheduler: str) -> dict[str, str]:
    """Refuse a cluster without workers, or of another version than this, which is returned."""
    if not client.nthreads():
        raise OutputError(f"the scheduler at {scheduler} has no workers: start dask worker")
    mine = software()
    for worker, found in client.run(software, on_error="return").items():
        if isinstance(found, Exception):
            raise OutputError(f"worker {worker} cannot run terrain-forge: {found}")
        if found != mine:
            raise OutputError(_differs(worker, found, mine))
    return mine


def _differs(worker: str, found: dict[str, str], mine: dict[str, str]) -> str:
    return f"worker {worker} has {_told(found)}, this machine {_told(mine)}: install the same"


def _told(found: dict[str, str]) -> str:
    return ", ".join(f"{name} {version}" for name, version in found.items())


@cache
def _versions() -> dict[str, str]:
    from importlib.metadata import PackageNotFoundError, version

    found = {}
    for name in _MAKERS:
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def software() -> dict[str, str]:
    """What makes the bytes of a world and its files, by name."""
    from terrain_forge import __version__

    return {"terrain-forge": __version__, **_versions()}


_MAKERS = "numpy", "scipy", "numba", "rasterio", "pillow", "usd-core"
"""Packages of which some need not be installed."""
