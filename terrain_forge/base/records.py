"""The base of all hand-off types: frozen records of checked, read-only values that can be stored.

A record compares by value, freezes its arrays on construction, and knows how to become plain JSON
plus named arrays and back, so that a saved World equals the built one.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

TYPES: dict[str, type[Record]] = {}


@dataclass(frozen=True, kw_only=True, eq=False)
class Record:
    """A frozen value of several fields. Subclasses call `freeze` for their arrays."""

    __hash__: ClassVar[None]  # type: ignore[assignment]

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        other = TYPES.setdefault(cls.__name__, cls)
        if other.__module__ != cls.__module__:  # a stored record is found by its name
            raise TypeError(f"{other.__module__} has a record of the name {cls.__name__}")
        TYPES[cls.__name__] = cls

    def __eq__(self, other: object) -> bool:
        if type(self) is not type(other):
            return NotImplemented
        return all(_same(getattr(self, f.name), getattr(other, f.name)) for f in fields(self))

    def freeze(self, name: str, dtype: Any, shape: tuple[int | str, ...]) -> None:
        """Check, copy and make read-only the array field `name`.

        `shape` gives each dimension as a number, or as a word: equal words are equal lengths.

        Raises:
            ValueError: where the shape differs or a float is not finite.
        """
        array = np.array(getattr(self, name), dtype=dtype, order="C", copy=True)
        where = f"{type(self).__name__}.{name}"
        lengths: dict[str, int] = {}
        matches = array.ndim == len(shape)
        for wanted, found in zip(shape, array.shape, strict=False):
            expected = lengths.setdefault(wanted, found) if isinstance(wanted, str) else wanted
            matches = matches and expected == found
        if not matches:
            raise ValueError(f"{where}: shape {array.shape}, expected {shape}")
        if array.dtype.kind == "f" and not np.isfinite(array).all():
            raise ValueError(f"{where}: holds values that are not finite")
        array.setflags(write=False)
        object.__setattr__(self, name, array)

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed, checked like a new record."""
        values = {f.name: getattr(self, f.name) for f in fields(self) if f.init}
        return type(self)(**(values | changes))


def _same(one: Any, other: Any) -> bool:
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        return one.dtype == other.dtype and np.array_equal(one, other)
    if isinstance(one, tuple) and isinstance(other, tuple):
        return len(one) == len(other) and all(map(_same, one, other))
    return bool(one == other)


def to_plain(value: Any, arrays: dict[str, NDArray[Any]], path: str = "") -> Any:
    """Turn a record into JSON values; its arrays go into `arrays` under their path."""
    if isinstance(value, Record):
        body = {
            f.name: to_plain(getattr(value, f.name), arrays, f"{path}/{f.name}")
            for f in fields(value)
            if f.init
        }
        return {"record": type(value).__name__, **body}
    if isinstance(value, np.ndarray):
        arrays[path] = value
        return {"array": path}
    if isinstance(value, tuple):
        return [to_plain(item, arrays, f"{path}/{n}") for n, item in enumerate(value)]
    if isinstance(value, np.generic):
        return value.item()
    return value


def from_plain(plain: Any, arrays: dict[str, NDArray[Any]]) -> Any:
    """The value that `to_plain` made this from."""
    if isinstance(plain, dict) and "record" in plain:
        body = {k: from_plain(v, arrays) for k, v in plain.items() if k != "record"}
        if plain["record"] not in TYPES:
            raise LookupError(f"{plain['record']}: the package that brings it is not installed")
        return TYPES[plain["record"]](**body)
    if isinstance(plain, dict) and set(plain) == {"array"}:
        return arrays[plain["array"]]
    if isinstance(plain, list):
        return tuple(from_plain(item, arrays) for item in plain)
    return plain
