"""Numba's compiler as our functions need it: the same machine code for less time.

All of it rests on numba's internals, none of them on a result: what numba would do besides, and
what it would do again, is left out.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from typing import Any, cast

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.types.functions import BaseFunction

_NEEDLESS = frozenset(
    {
        "WithLifting",
        "InlineClosureLikes",
        "RewriteSemanticConstants",
        "RewriteDynamicRaises",
        "MakeFunctionToJitFunction",
        "FindLiterallyCalls",
        "LiteralUnroll",
        "LiteralPropagationSubPipelinePass",
        "InlineOverloads",
        "NoPythonSupportedFeatureValidation",
        "NopythonRewrites",
        "DumpParforDiagnostics",
    }
)
"""Passes for what our functions do not hold: closures, `with`, literals, array expressions."""

_known: dict[bool, dict[Hashable, tuple[object, Any]]] = {False: {}, True: {}}
"""The signatures of numba's own functions, with the functions themselves, whose ids are part of the
keys; apart for functions that force their callees into them."""


class _Compiler(CompilerBase):  # type: ignore[misc]
    """Compiles a function with the passes that it needs."""

    def compile_extra(self, func: Any) -> Any:
        """Compile, without asking twice how a function of numba's is called."""
        state: Any = self.state
        with _without_collecting(), _remembering(_known[bool(state.flags.forceinline)]):
            return cast(Any, super()).compile_extra(func)

    def define_pipelines(self) -> list[Any]:
        """The passes of every function but the needless."""
        state: Any = self.state
        passes = cast(Any, DefaultPassBuilder).define_nopython_pipeline(state)
        passes.passes = [one for one in passes.passes if one[0].__name__ not in _NEEDLESS]
        passes.finalize()
        return [passes]


class KernelCompiler(_Compiler):
    """Compiles a function that Python calls."""


class PartCompiler(_Compiler):
    """Compiles a function that only kernels call."""

    def define_pipelines(self) -> list[Any]:
        """The passes of every function, with a library of ours."""
        state: Any = self.state
        library = cast(Any, _Part)
        state.library = library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return super().define_pipelines()


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

    def _optimize_functions(self, ll_module: Any) -> None:
        ll_module.data_layout = cast(Any, self)._codegen._data_layout

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()  # type: ignore[no-untyped-call]
        self._finalized = True


@contextmanager
def _without_collecting() -> Iterator[None]:
    """Keep the garbage collector still.

    Walking over the compiler's many objects it would take a sixth of the time, and find nothing.
    """
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


@contextmanager
def _remembering(known: dict[Hashable, tuple[object, Any]]) -> Iterator[None]:
    """Look the type of a call up before numba tries all variants of a function anew.

    `a + b` has forty. The compiler's lock is held here.
    """
    usual = cast(Any, BaseFunction).get_call_type
    original = getattr(usual, "original", usual)
    cast(Any, BaseFunction).get_call_type = _by_memory(original, known)
    try:
        yield
    finally:
        cast(Any, BaseFunction).get_call_type = usual


def _by_memory(
    original: Callable[..., Any], known: dict[Hashable, tuple[object, Any]]
) -> Callable[..., Any]:
    def get_call_type(self: Any, context: Any, args: Any, kws: Any) -> Any:
        key = id(self), id(context), args, tuple(dict(kws).items())
        found = known.get(key)
        if found is None:
            found = self, original(self, context, args, kws)
            known[key] = found
        return found[1]

    cast(Any, get_call_type).original = original
    return get_call_type
