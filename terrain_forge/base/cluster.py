"""Tasks on a Dask cluster."""

from __future__ import annotations

import asyncio
import logging
import os
import platform
import time
import warnings
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from functools import cache, partial
from importlib import import_module
from itertools import islice
from typing import Any, TypeVar

from terrain_forge.base.errors import OutputError
from terrain_forge.base.registry import their_packages
from terrain_forge.base.threads import ask_for_interrupt, processors, worker_threads
from terrain_forge.base.trying import sendable, tried

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
_SAFE_PATH = "PYTHONSAFEPATH"


def on_dask(
    function: Callable[[T], R],
    items: Iterable[T],
    workers: int | None,
    scheduler: str,
    tries: int,
    told: Callable[[str], None] | None,
) -> Iterator[tuple[T, R | Exception]]:
    """As `run_tasks`, on a Dask cluster."""
    with _connected(scheduler, workers) as client:
        as_completed = partial(import_module("distributed").as_completed, loop=client.loop)
        mine = _require_same(client, scheduler)
        if told and client.dashboard_link:
            told(client.dashboard_link)
        threads = sum(client.nthreads().values())
        most = _AHEAD * threads if scheduler == LOCAL or workers is None else workers
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
        finished: Any = as_completed(out)
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
            for future in _arriving(as_completed([submit(item)]), client, scheduler):
                yield item, ended(future)[0]


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
        with _connected(scheduler, None) as client:
            _require_same(client, scheduler)


@contextmanager
def _connected(scheduler: str, workers: int | None) -> Iterator[Any]:
    """A client of a scheduler, or of one of its own, which ends with it."""
    try:
        distributed: Any = import_module("distributed")
    except ImportError:
        raise OutputError(
            "a scheduler needs Dask: pip install 'terrain-forge[dask]', or leave it out"
        ) from None
    # A traceback for developers, of a scheduler that is lost: that is told in a line.
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
    if scheduler != LOCAL:
        _knock(distributed, scheduler)
        with distributed.Client(scheduler, timeout=_REACH, set_as_default=False) as client:
            yield client
        return
    logging.getLogger("distributed").setLevel(logging.WARNING)  # how it comes and goes
    options = {"n_workers": workers or processors(), "threads_per_worker": 1, "memory_limit": 0}
    with _safe_path():
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Port ", UserWarning)  # its page takes another
            cluster = distributed.LocalCluster(**options)
        with cluster, distributed.Client(cluster) as client:
            yield client


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
    return sendable(tried(function, item, tries))


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
    """What makes the bytes of a world and its files, by name; other packages' parts do so too."""
    from terrain_forge import __version__

    return {"terrain-forge": __version__, **_versions(), **their_packages()}


_MAKERS = "numpy", "scipy", "numba", "rasterio", "pillow", "usd-core"
"""Packages of which some need not be installed."""
