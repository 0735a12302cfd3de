"""Compiled kernels on all processor cores.

Cheaper to compile than numba's own parallel loops, which this replaces.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any

import numpy as np
from numba import get_num_threads

_CHUNKS_PER_THREAD = 4


def over_chunks(kernel: Callable[..., None], count: int, *arguments: Any) -> None:
    """Call `kernel(first, last, *arguments)` for parts of range(count) that together are all of it.

    Args:
        kernel: A kernel compiled with `nogil`. What it writes for one element depends on no other
            element, so that the number of threads and their order change no result.
        count: Number of elements.
        arguments: Passed on, arrays to be written among them.
    """
    threads = get_num_threads()
    chunks = min(count, threads * _CHUNKS_PER_THREAD)
    if threads == 1 or chunks < 2:
        kernel(0, count, *arguments)
        return
    borders = np.linspace(0, count, chunks + 1).astype(int).tolist()
    with ThreadPoolExecutor(threads) as pool:
        for done in [pool.submit(kernel, a, b, *arguments) for a, b in pairwise(borders)]:
            done.result()
