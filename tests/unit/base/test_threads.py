"""Other threads, and interrupts that wait for them."""

from __future__ import annotations

import signal
import threading
from concurrent.futures import Future
from queue import SimpleQueue

import pytest

from terrain_forge.base import (
    ask_for_interrupt,
    hold_interrupts,
    in_turn,
    listen_for_interrupts,
    worker_threads,
)


@pytest.fixture(autouse=True)
def _heeded():
    """A shell that starts the tests in the background has Ctrl-C ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def interrupt() -> None:
    """What Ctrl-C does, from whatever thread."""
    signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)


def test_an_interrupt_waits_for_the_end_of_the_outermost_block():
    done = []

    def work() -> None:
        with hold_interrupts():
            interrupt()
            done.append("after it")
            with hold_interrupts():
                done.append("in a block within")
            done.append("after that")
            with pytest.raises(KeyboardInterrupt):
                ask_for_interrupt()
        done.append("outside")

    with pytest.raises(KeyboardInterrupt):
        work()
    assert done == ["after it", "in a block within", "after that"]
    ask_for_interrupt()  # it was told
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_two_interrupts_are_told_once():
    def work() -> None:
        with hold_interrupts(), hold_interrupts():
            interrupt()
            interrupt()

    with pytest.raises(KeyboardInterrupt):
        work()
    ask_for_interrupt()


def test_what_ignores_a_signal_goes_on_to():
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with hold_interrupts():
        interrupt()
    ask_for_interrupt()


def test_an_error_that_an_interrupt_became_is_none():
    def work() -> None:
        with listen_for_interrupts():
            try:
                interrupt()
            except KeyboardInterrupt as error:
                raise ImportError("some module") from error

    with pytest.raises(KeyboardInterrupt):
        work()
    ask_for_interrupt()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_after_an_interrupt_the_task_that_runs_ends_and_no_other_begins():
    begun, ended, may_end = [], [], threading.Event()

    def task(number: int) -> None:
        begun.append(number)
        interrupt()
        may_end.wait(10.0)
        ended.append(number)

    def work() -> None:
        with worker_threads(1) as pool:
            futures = [pool.submit(task, number) for number in range(3)]
            try:
                next(in_turn(futures))
            finally:
                may_end.set()

    with pytest.raises(KeyboardInterrupt):
        work()
    assert (begun, ended) == ([0], [0])


def test_after_an_error_no_task_begins():
    begun = []

    def task(number: int) -> float:
        begun.append(number)
        return 1.0 / number

    def until_cancelled(later: SimpleQueue[Future[float]]) -> None:
        gate = threading.Event()
        later.get().add_done_callback(lambda _: gate.set())
        gate.wait(10.0)

    def work() -> None:
        with worker_threads(1) as pool:
            later: SimpleQueue[Future[float]] = SimpleQueue()
            failing = pool.submit(task, 0)
            pool.submit(until_cancelled, later)
            later.put(pool.submit(task, 1))
            failing.result()

    with pytest.raises(ZeroDivisionError):
        work()
    assert begun == [0]


def test_results_come_in_order():
    with worker_threads(3) as pool:
        assert [*pool.map(lambda n: n * n, range(20))] == [n * n for n in range(20)]
        done = {future.result() for future in in_turn([pool.submit(abs, n) for n in (-4, 5)])}
    assert done == {4, 5}
