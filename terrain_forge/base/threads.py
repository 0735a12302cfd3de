"""Work in other threads, and interrupts that wait until they can do no harm.

Python raises KeyboardInterrupt in the main thread wherever that is. In an import, in the kernels'
compiler or in a library it loads that leaves a lock held which the other threads then wait for, or
half made what they go on to use: a build hangs, or ends by a fault in machine code. So while there
are others an interrupt is only noted, and raised where somebody asks for it.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from typing import Any, TypeVar

S = TypeVar("S")
T = TypeVar("T")
_SIGNALS = signal.SIGINT, signal.SIGTERM, signal.SIGHUP
_TICK = 0.1
"""How often the main thread asks while it waits for others [s]."""
_noted: list[int] = []
_deaf: list[bool] = []
"""Blocks that are not interrupted even where they ask."""


@contextmanager
def listen_for_interrupts() -> Iterator[None]:
    """Take Ctrl-C, a polite kill and the terminal's end alike; what is ignored stays ignored.

    Python drops what a callback or a finaliser raises, so one that came can be asked for until the
    block ends.
    """
    handlers = {number: signal.getsignal(number) for number in _SIGNALS}
    former = {n: one for n, one in handlers.items() if one not in (signal.SIG_IGN, None)}
    try:
        for number in former:
            signal.signal(number, _raise)
        yield
    except Exception as error:  # an interrupt in an import becomes an ImportError
        cause = error.__cause__
        if isinstance(cause, KeyboardInterrupt) and str(cause):  # click's error has ours inside
            raise cause from None
        ask_for_interrupt()
        raise
    finally:
        for number, handler in former.items():
            signal.signal(number, handler)
        _noted.clear()


def ask_for_interrupt() -> None:
    """Raise KeyboardInterrupt where one has come."""
    if _noted and not _deaf:
        raise KeyboardInterrupt


@contextmanager
def telling_interrupts(left: Callable[[], str]) -> Iterator[None]:
    """Have an interrupt say what it leaves."""
    try:
        yield
    except KeyboardInterrupt:
        raise KeyboardInterrupt(left()) from None


@contextmanager
def hold_interrupts(*, wholly: bool = False) -> Iterator[None]:
    """Raise none in the block but where it asks; one that came is raised after it.

    Where one goes up through the block already, that stays: it may say what was left.

    Args:
        wholly: Raise none even where it asks: what clears up after an interrupt asks in vain.
    """
    former: dict[int, Any] = {}
    try:
        if wholly:
            _deaf.append(True)
        if threading.current_thread() is threading.main_thread():
            for one in _SIGNALS:
                if callable(handler := signal.getsignal(one)):
                    former[one] = handler
                    signal.signal(one, _note)
        yield
    finally:
        if wholly and _deaf:
            _deaf.pop()
        for number, handler in former.items():
            signal.signal(number, handler)
        if former and _noted:
            came = _noted.pop()
            _noted.clear()  # who presses Ctrl-C twice means one interrupt
            going_up = isinstance(sys.exc_info()[1], KeyboardInterrupt)
            try:
                former[came](came, None)
            except KeyboardInterrupt:
                if not going_up:
                    raise


def processors() -> int:
    """How many processors this process may use, where the system tells; else how many there are."""
    return len(getattr(os, "sched_getaffinity", lambda _: ())(0)) or os.cpu_count() or 1


@contextmanager
def worker_threads(count: int, *, leave: bool = False) -> Iterator[Workers]:
    """So many threads to give tasks to; after an error or an interrupt no further task is begun.

    Args:
        count: Number of threads.
        leave: Whether after one of these nobody waits for the tasks that run: they must use nothing
            that ends before they do.
    """
    with hold_interrupts():
        pool = ThreadPoolExecutor(count)
        try:
            yield Workers(pool)
        except BaseException:
            pool.shutdown(wait=not leave, cancel_futures=True)
            raise
        pool.shutdown()


class Workers:
    """Threads whose tasks begin only where no interrupt has come."""

    def __init__(self, pool: ThreadPoolExecutor) -> None:
        self._pool = pool

    def submit(self, task: Callable[..., T], *given: Any) -> Future[T]:
        """Have a task carried out."""
        return self._pool.submit(_unless_interrupted, task, *given)

    def map(self, task: Callable[[S], T], members: Iterable[S]) -> Iterator[T]:
        """The results of a task for each member, in their order."""
        futures = [self.submit(task, member) for member in members]
        return (done.result() for future in futures for done in in_turn([future]))


def in_turn(futures: Iterable[Future[T]]) -> Iterator[Future[T]]:
    """Tasks in the order in which they are done; an interrupt is raised meanwhile."""
    left = {*futures}
    while left:
        done, left = wait(left, timeout=_TICK, return_when=FIRST_COMPLETED)
        ask_for_interrupt()
        yield from done


def _unless_interrupted(task: Callable[..., T], *given: Any) -> T:
    ask_for_interrupt()
    return task(*given)


def _note(number: int, frame: object) -> None:
    del frame
    _noted.append(number)


def _raise(number: int, frame: object) -> None:
    _note(number, frame)
    raise KeyboardInterrupt
