"""How kernels are compiled, and how they run on all processor cores.

A first build waits for the compiler, so each kernel should compile once and cheaply: the same array
types at every call, numbers and loops rather than array expressions, and no parallel loops, for
which there is `over_chunks`.
"""

from __future__ import annotations

import os
import stat
import tempfile
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numba import config, njit

from terrain_forge.base.compiler import KernelCompiler, PartCompiler
from terrain_forge.base.errors import StorageError
from terrain_forge.base.threads import hold_interrupts, worker_threads

settings: Any = config
_CHUNKS_PER_THREAD = 4
_TRIED = 1024  # of so many parts one is done alone, then as many again as are done …
_ALONE = 3e-4  # … for so long [s]: if work is left then, it pays for starting threads

# Numba builds entries from C and from Python for each function unless told not to.
_NOT_FROM_C: dict[str, Any] = {"no_cfunc_wrapper": True}
_NOT_FROM_PYTHON: dict[str, Any] = {"no_cpython_wrapper": True}

kernel: Any = njit(
    cache=True,
    nogil=True,
    error_model="numpy",
    pipeline_class=KernelCompiler,
    **_NOT_FROM_C,
)
"""Compiles a function that Python calls; kept on disk for the next run."""


inner: Any = njit(
    error_model="numpy", pipeline_class=PartCompiler, **_NOT_FROM_C, **_NOT_FROM_PYTHON
)
"""Compiles a function that only kernels call; it is kept within them. Python cannot call it, since
its entry from there would often take longer to compile than itself."""

merged: Any = njit(
    error_model="numpy",
    pipeline_class=PartCompiler,
    forceinline=True,
    **_NOT_FROM_C,
    **_NOT_FROM_PYTHON,
)
"""Makes an inner function a part of each kernel that calls it: one that takes many arrays costs
more to call than to run."""

inlined: Any = njit(error_model="numpy", inline="always")
"""Makes a function a part of the kernel that calls it, in one place: cheaper than `inner` for large
ones and for those that take many arrays."""


def kernel_threads() -> int:
    """How many threads kernels run on: NUMBA_NUM_THREADS, else one for each processor.

    Numba's own way to ask launches threads that none of our kernels uses, with a lock between
    processes, which from Python 3.14 on is told to have leaked where a process ends at once.
    """
    return int(settings.NUMBA_NUM_THREADS)


def over_chunks(part: Callable[..., None], count: int, *arguments: Any) -> None:
    """Call `part(first, last, *arguments)` for parts of range(count) that together are all of it.

    Args:
        part: A kernel. What it writes for one element depends on no other element, so that the
            number of threads and their order change no result.
        count: Number of elements.
        arguments: Passed on, arrays to be written among them.
    """
    threads = kernel_threads()
    done, last = 0, -(-count // _TRIED) if threads > 1 else count
    with hold_interrupts():  # it may be compiled
        begin = perf_counter()
        while done < count and perf_counter() - begin < _ALONE:
            part(done, last, *arguments)
            done, last = last, min(2 * last, count)
    if done == count:
        return
    chunks = min(count - done, threads * _CHUNKS_PER_THREAD)
    borders = np.linspace(done, count, chunks + 1).astype(int).tolist()
    with worker_threads(threads) as pool:
        list(pool.map(lambda border: part(*border, *arguments), pairwise(borders)))


def _find_place() -> None:
    """Keep kernels in a folder for temporary files where no other takes them.

    Raises:
        StorageError: if there is none, or others can write what is there.
    """
    try:
        njit(cache=True)(_find_place)  # asks for a place, and compiles nothing
    except RuntimeError:
        try:
            folder = Path(tempfile.gettempdir(), f"terrain-forge-kernels-{os.getuid()}")
            folder.mkdir(mode=0o700, exist_ok=True)
            found = folder.lstat()  # kernels are code: nobody else may have put them there
            mine = stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid()
            if not mine or found.st_mode & 0o077:
                raise FileExistsError(f"{folder} is not yours alone")
        except OSError as error:
            raise StorageError(
                f"no folder takes the compiled kernels ({error}): name one in NUMBA_CACHE_DIR"
            ) from error
        os.environ["NUMBA_CACHE_DIR"] = str(folder)  # other processes of this run share it
        settings.CACHE_DIR = str(folder)


_find_place()
