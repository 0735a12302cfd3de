"""Where compiled kernels are kept, and how they run side by side."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numba.core import config

from terrain_forge.base import over_chunks

LOCATED = pytest.mark.skipif(
    not hasattr(config, "CACHE_LOCATOR_CLASSES"), reason="this numba takes no list of places"
)


def _run(temporary: Path, code: str) -> subprocess.CompletedProcess[str]:
    """Run Python where numba finds no place of its own, as in a read-only container."""
    own = os.environ | {
        "NUMBA_CACHE_LOCATOR_CLASSES": "UserProvidedCacheLocator",
        "NUMBA_CACHE_DIR": "",
        "TMPDIR": str(temporary),
    }
    return subprocess.run(
        [sys.executable, "-c", code], env=own, capture_output=True, text=True, check=False
    )


@LOCATED
def test_kernels_lie_among_temporary_files_where_no_other_folder_takes_them(tmp_path: Path) -> None:
    tmp_path.chmod(0o2700)  # what is made in it belongs to its group
    found = _run(tmp_path, "from terrain_forge.base.seeds import zigzag; print(zigzag(-2))")
    assert found.stdout == "3\n", found.stderr
    (folder,) = tmp_path.iterdir()
    assert list(folder.rglob("seeds.zigzag*.nbi"))


@LOCATED
@pytest.mark.parametrize("mode", [0o755, 0o770])
def test_kernels_that_others_may_have_written_are_not_run(tmp_path: Path, mode: int) -> None:
    (tmp_path / f"terrain-forge-kernels-{os.getuid()}").mkdir()
    (tmp_path / f"terrain-forge-kernels-{os.getuid()}").chmod(mode)
    found = _run(tmp_path, "import terrain_forge.base.kernels")
    assert "is not yours alone): name one in NUMBA_CACHE_DIR" in found.stderr


@pytest.mark.parametrize("count", [0, 1, 31, 33, 5000])
def test_parts_are_all_of_it_once(count: int, use_threads: Callable[[int], None]) -> None:
    use_threads(3)
    done = np.zeros(count, np.int64)

    def part(first: int, last: int) -> None:
        done[first:last] += 1
        time.sleep(1e-4)

    over_chunks(part, count)
    assert (done == 1).all()


def test_work_that_begins_light_is_shared_too(use_threads: Callable[[int], None]) -> None:
    """As a picture that begins with sky."""
    use_threads(2)
    threads = set()

    def part(first: int, last: int) -> None:
        threads.add(threading.current_thread())
        if last > 40:
            time.sleep(1e-3 * (last - max(first, 40)))

    over_chunks(part, 200)
    assert threads - {threading.current_thread()}


def test_no_lock_between_processes_is_left_behind() -> None:
    """Python 3.14 begins processes so by default; it tells of locks that an ended one has left."""
    code = """
import multiprocessing, os
multiprocessing.set_start_method("forkserver")
from terrain_forge.base import kernel_threads, over_chunks
over_chunks(lambda first, last: None, 1 << 20)
os._exit(kernel_threads() == 3)
"""
    environment = os.environ | {"NUMBA_NUM_THREADS": "3"}
    command = [sys.executable, "-c", code]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert (run.returncode, run.stderr) == (1, "")
