"""Tasks in other processes: results, errors, deaths."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import pytest

import terrain_forge.base.cluster as clusters
from terrain_forge.base import OutputError, RecipeError, run_tasks


def work(folder: Path, item: int) -> int:
    """Square an item; 3 is refused, 5 kills its process the first time, 7 each time."""
    os.write(1, b"noise on the output")
    if item == 3:
        raise RecipeError("no threes", key=("seed",))
    if item == 5 and not (folder / "5").exists():
        (folder / "5").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    if item == 7:
        os._exit(9)
    return item**2


def check_results(found: dict[int, int | Exception]) -> None:
    """That all came that should, and the others with their error."""
    assert sorted(found) == list(range(10))
    refused, dead = found.pop(3), found.pop(7)
    assert isinstance(refused, RecipeError)
    assert refused.key == ("seed",)
    assert isinstance(dead, Exception)
    assert found == {item: item**2 for item in found}


@pytest.mark.parametrize("workers", [pytest.param(1, marks=pytest.mark.slow), 3])
def test_a_dead_process_takes_nothing_with_it_but_its_task(tmp_path: Path, workers: int) -> None:
    check_results(dict(run_tasks(partial(work, tmp_path), range(10), workers=workers)))


def test_a_generator_that_is_left_ends_its_processes(tmp_path: Path) -> None:
    results = run_tasks(partial(work, tmp_path), iter(range(10**9)), workers=1)
    assert next(results) == (0, 0)
    results.close()


def interrupted(item: int) -> int:
    """Interrupted, as by a signal that meets its process alone."""
    raise KeyboardInterrupt


def test_a_process_that_is_interrupted_ends() -> None:
    (found,) = dict(run_tasks(interrupted, [1], workers=1)).values()
    assert "its process ended: exit status 130" in str(found)


def test_tasks_run_here_too(tmp_path: Path) -> None:
    assert dict(run_tasks(partial(work, tmp_path), [1, 2], workers=0)) == {1: 1, 2: 4}


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_cluster_gives_the_same(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    work_there = partial(work, tmp_path)
    check_results(dict(run_tasks(work_there, range(10), workers=2, scheduler="local")))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_workers_of_another_version_are_refused(tmp_path: Path, monkeypatch: Any) -> None:
    pytest.importorskip("distributed")
    there = clusters.software
    monkeypatch.setattr(
        clusters, "software", Elsewhere({**there(), "terrain-forge": "0.0.1"}, there)
    )
    with pytest.raises(OutputError, match=r"worker tcp://.* this machine terrain-forge 0\.0\.1"):
        next(run_tasks(partial(work, tmp_path), [1], workers=1, scheduler="local"))


class Elsewhere:
    """Tells other versions here than there."""

    def __init__(self, here: dict[str, str], there: Callable[[], dict[str, str]]) -> None:
        self.here, self.there = here, there

    def __call__(self) -> dict[str, str]:
        return self.here

    def __reduce__(self) -> tuple[Any, ...]:
        return getattr, (clusters, "software")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    ("said", "why"),
    [
        (None, "Timed out"),
        (b"", "says nothing"),
        (b"HTTP/1.1 400 Bad Request\r\n\r\n" + bytes(100), "not Dask's"),
    ],
    ids=["nobody", "silence", "web"],
)
def test_what_is_no_scheduler_is_named(said: bytes | None, why: str) -> None:
    pytest.importorskip("distributed")
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = "tcp://{}:{}".format(*server.getsockname())
        connections = []

        def answer() -> None:
            with suppress(OSError):
                connections.append(server.accept()[0])
                connections[-1].sendall(said)

        if said is None:
            server.close()
        else:
            threading.Thread(target=answer, daemon=True).start()
        with pytest.raises(OutputError, match=f"no Dask scheduler answers at {address}: .*{why}"):
            next(run_tasks(str, [1], scheduler=address))
    for one in connections:
        one.close()


def slowly(item: int) -> int:
    """An item, after a while."""
    time.sleep(0.2)
    return item


@pytest.fixture
def cluster() -> Iterator[Any]:
    distributed: Any = pytest.importorskip("distributed")
    options = {"n_workers": 1, "threads_per_worker": 1, "memory_limit": 0, "processes": False}
    with distributed.LocalCluster(**options, dashboard_address=":0") as made:
        yield made


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_worker_of_another_version_that_joins_later_is_refused(
    cluster: Any, monkeypatch: Any
) -> None:
    done = run_tasks(slowly, range(20), scheduler=cluster.scheduler_address)
    next(done)
    there = {**clusters.software(), "rasterio": "0.0.1"}
    monkeypatch.setattr(clusters, "software", lambda: there)
    with pytest.raises(OutputError, match=r"worker .* rasterio 0\.0\.1.*: install the same"):
        list(done)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_cluster_that_lost_all_its_workers_is_waited_for_a_while(
    cluster: Any, monkeypatch: Any, caplog: Any
) -> None:
    monkeypatch.setattr(clusters, "PATIENCE", 5.0)
    done = run_tasks(slowly, range(20), scheduler=cluster.scheduler_address)
    next(done)
    cluster.scale(0)
    with pytest.raises(OutputError, match=r"no workers for 5 s; what is whole stays"):
        list(done)
    assert "has no workers: waiting 5 s for one" in caplog.text


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_cluster_whose_workers_come_back_goes_on(cluster: Any) -> None:
    done = run_tasks(slowly, range(12), scheduler=cluster.scheduler_address)
    found = [next(done)]
    cluster.scale(0)
    threading.Timer(3.0, cluster.scale, [1]).start()
    found += done
    assert sorted(found) == [(item, item) for item in range(12)]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_scheduler_that_is_lost_is_told_without_a_traceback(tmp_path: Path, caplog: Any) -> None:
    pytest.importorskip("distributed")
    command = [sys.executable, "-m", "distributed.cli.dask_"]
    own = "--scheduler-file", str(tmp_path / "address"), "--no-dashboard"
    rest = {"scheduler": ("--host", "127.0.0.1", "--port", "0"), "worker": ("--no-nanny",)}
    programs = [
        subprocess.Popen([*command[:2], command[2] + name, *own, *more], cwd=tmp_path)
        for name, more in rest.items()
    ]
    try:
        while not (tmp_path / "address").exists():
            time.sleep(0.1)
        time.sleep(0.5)
        address = json.loads((tmp_path / "address").read_text())["address"]
        done = run_tasks(time.sleep, [0.3 + 0.001 * n for n in range(30)], scheduler=address)
        next(done)
        programs[0].kill()
        with pytest.raises(OutputError, match="was lost; what is whole stays"):
            list(done)
    finally:
        for program in programs:
            program.kill()
            program.wait()
    assert "Traceback" not in caplog.text
