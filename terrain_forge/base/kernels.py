"""How kernels are compiled, and how they run on all processor cores.

A first build waits for the compiler, so each kernel should compile once and cheaply: the same array
types at every call, numbers and loops rather than array expressions, and no parallel loops, for
which there is `over_chunks`.
"""

from __future__ import annotations

import gc
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any, cast

import numpy as np
from numba import get_num_threads, njit
from numba.core import event as events
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder

_CHUNKS_PER_THREAD = 4

# Numba builds entries from C and from Python for each function unless told not to.
_NOT_FROM_C: dict[str, Any] = {"no_cfunc_wrapper": True}
_NOT_FROM_PYTHON: dict[str, Any] = {"no_cpython_wrapper": True}

kernel: Any = njit(cache=True, nogil=True, error_model="numpy", **_NOT_FROM_C)
"""Compiles a function that Python calls; kept on disk for the next run."""


class _Part(JITCodeLibrary):  # type: ignore[misc]
    """The code of an inner function, which kernels take over and optimise with their own.

    Numba would optimise it by itself too, and make machine code of it that nobody calls: a fifth of
    the time that all kernels take.
    """

    @property
    def codegen(self) -> Any:
        """Itself, which has no environment to set."""
        return self

    def set_env(self, name: str, env: object) -> None:
        """Do nothing: there is no machine code that would look for it."""

    def get_pointer_to_function(self, name: str) -> int:
        """There is none."""
        del name
        return 0

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()  # type: ignore[no-untyped-call]
        self._finalized = True


class _PartCompiler(CompilerBase):  # type: ignore[misc]
    def define_pipelines(self) -> list[Any]:
        """The passes of every function, with a library of ours."""
        state: Any = self.state
        library, passes = cast(Any, _Part), cast(Any, DefaultPassBuilder)
        state.library = library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return [passes.define_nopython_pipeline(state)]


inner: Any = njit(
    error_model="numpy", pipeline_class=_PartCompiler, **_NOT_FROM_C, **_NOT_FROM_PYTHON
)
"""Compiles a function that only kernels call; it is kept within them. Python cannot call it, since
its entry from there would often take longer to compile than itself."""

merged: Any = njit(
    error_model="numpy",
    pipeline_class=_PartCompiler,
    forceinline=True,
    **_NOT_FROM_C,
    **_NOT_FROM_PYTHON,
)
"""Makes an inner function a part of each kernel that calls it: one that takes many arrays costs
more to call than to run."""

inlined: Any = njit(error_model="numpy", inline="always")
"""Makes a function a part of the kernel that calls it, in one place: cheaper than `inner` for large
ones and for those that take many arrays."""


class _CollectorPause(events.Listener):
    """Keeps the garbage collector still while a kernel compiles.

    Walking over the compiler's many objects it would take a sixth of the time, and find nothing.
    """

    def __init__(self) -> None:
        self._depth = 0
        self._enabled = True

    def on_start(self, event: events.Event) -> None:
        """Stop collecting at the outermost function; the compiler's own lock is held here."""
        del event
        if self._depth == 0:
            self._enabled = gc.isenabled()
            gc.disable()
        self._depth += 1

    def on_end(self, event: events.Event) -> None:
        """Go on as before."""
        del event
        self._depth -= 1
        if self._depth == 0 and self._enabled:
            gc.enable()


_register: Any = events.register
_register("numba:compile", _CollectorPause())


def over_chunks(part: Callable[..., None], count: int, *arguments: Any) -> None:
    """Call `part(first, last, *arguments)` for parts of range(count) that together are all of it.

    Args:
        part: A kernel. What it writes for one element depends on no other element, so that the
            number of threads and their order change no result.
        count: Number of elements.
        arguments: Passed on, arrays to be written among them.
    """
    threads = get_num_threads()
    chunks = min(count, threads * _CHUNKS_PER_THREAD)
    if threads == 1 or chunks < 2:
        part(0, count, *arguments)
        return
    borders = np.linspace(0, count, chunks + 1).astype(int).tolist()
    with ThreadPoolExecutor(threads) as pool:
        for done in [pool.submit(part, a, b, *arguments) for a, b in pairwise(borders)]:
            done.result()
