"""The kernels that a purpose needs, by room and name, with the types that they take."""

from __future__ import annotations

import json
from collections.abc import Iterable
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from numba import types as _types

LISTED = {
    "build": Path(__file__).with_name("kernels.json"),
    "record": Path(__file__).with_name("kernels-record.json"),
}
types: Any = _types


@cache
def listed(purpose: str) -> dict[str, dict[str, list[Any]]]:
    """Signatures by room and name."""
    return dict(json.loads(LISTED[purpose].read_text()))


@cache
def signatures() -> dict[str, list[Any]]:
    """Signatures of the kernels of all purposes, by name."""
    rooms = (room for purpose in LISTED for room in listed(purpose).values())
    return {name: signature for room in rooms for name, signature in room.items()}


def kernel(name: str) -> Any:
    """The kernel of a name `module:function`, ready to be compiled."""
    home, function = name.split(":")
    module = import_module(home)
    used = (one.py_func.__module__ for one in vars(module).values() if hasattr(one, "py_func"))
    for room in {one.rpartition(".")[0] for one in (home, *used)}:
        getattr(import_module(room), "before_compiling", lambda: None)()
    return getattr(module, function)


def is_kept(name: str, signature: list[Any]) -> bool:
    """Whether the cache holds a kernel, as its index says."""
    file, key = place(name, numba_types(signature))
    return key in file._load_index()


def place(name: str, signature: tuple[Any, ...]) -> tuple[Any, Any]:
    """The file of numba's cache that holds a kernel, and its key there for this processor."""
    module, function = name.split(":")
    found = getattr(import_module(module), function)
    key = found._cache._index_key(signature, found.targetctx.codegen())
    return found._cache._cache_file, key


def numba_types(signature: list[Any]) -> tuple[Any, ...]:
    """The types of a signature of `kernels.json`: names, arrays, [tuples], {class: [fields]}."""
    return tuple(map(_type, signature))


def _type(plain: Any) -> Any:
    if isinstance(plain, list):
        return types.BaseTuple.from_types(numba_types(plain))
    if isinstance(plain, dict):
        ((name, fields),) = plain.items()
        module, made = name.split(":")
        return types.BaseTuple.from_types(numba_types(fields), getattr(import_module(module), made))
    name, *rest = plain.split()
    # Beside NumPy 1 Numba has no `types.bool`.
    scalar = types.boolean if name == "bool" else getattr(types, name)
    if not rest:
        return scalar
    layout = "A" if "strided" in rest else "C"
    return types.Array(scalar, int(rest[0][0]), layout, readonly="readonly" in rest)


def plain_types(signature: Iterable[Any]) -> list[Any]:
    """What `numba_types` reads."""
    return [_plain(found) for found in signature]


def _plain(found: Any) -> Any:
    if isinstance(found, types.Array):
        assert found.layout in "CA", found
        strided = "" if found.is_c_contig else " strided"
        return f"{found.dtype} {found.ndim}d{strided}{'' if found.mutable else ' readonly'}"
    if isinstance(found, types.BaseNamedTuple):
        made = found.instance_class
        return {f"{made.__module__}:{made.__qualname__}": plain_types(found)}
    if isinstance(found, types.BaseTuple):
        return plain_types(found)
    assert _type(str(found)) == found, found
    return str(found)
