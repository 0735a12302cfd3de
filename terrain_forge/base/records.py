"""The base of all hand-off types: frozen records of checked, read-only values that can be stored.

A record compares by value, freezes its arrays on construction, and knows how to become plain JSON
plus named arrays and back, so that a saved World equals the built one.
"""

from __future__ import annotations

import reprlib
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cache, wraps
from typing import Any, ClassVar, Self, TypeVar, get_type_hints
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base.errors import DataError
from terrain_forge.base.given import checked, is_of, require_fields

TYPES: dict[str, type[Record]] = {}
_FROZEN: WeakValueDictionary[int, NDArray[Any]] = WeakValueDictionary()
"""Arrays of records by their `id`: one that another record takes needs no second copy."""
R = TypeVar("R", bound="Record")
T = TypeVar("T")


def unchanging(array: NDArray[Any]) -> NDArray[Any]:
    """An array of finite numbers that nothing changes any more: a record takes it as it is."""
    view = array.view()
    view.setflags(write=False)
    _FROZEN[id(view)] = view
    return view


def shaped(*shape: int | str, dtype: Any = np.float64, **more: Any) -> dict[str, Any]:
    """Metadata of a record's field that holds an array: its shape and type, and what else is told.

    Each dimension is a number or a word; equal words are equal lengths in all of the record.
    """
    return {"dtype": dtype, "shape": shape, **more}


def require_indices(indices: NDArray[Any], count: int, what: str) -> None:
    """Refuse numbers of what there is not: compiled code would read beyond its arrays.

    Raises:
        ValueError: with what the numbers are, such as "a rock's shape".
    """
    if indices.size and not (0 <= indices.min() and indices.max() < count):
        raise ValueError(f"{what} is numbered {indices.min()} to {indices.max()}, of {count}")


class RecordError(DataError, ValueError):
    """Ours for a user, and for pydantic, which makes sensors, one of a value."""


def _refusing(check: Callable[[Any], None]) -> Callable[[Any], None]:
    """A record's check of itself, whose refusals are errors of ours."""

    @wraps(check)
    def call(self: Any) -> None:
        try:
            check(self)
        except (TypeError, ValueError) as error:
            raise RecordError(str(error)) from None

    return call


@dataclass(frozen=True, kw_only=True, eq=False)
class Record:
    """A frozen value of several fields; arrays whose shape is told are checked and frozen."""

    __hash__: ClassVar[None]  # type: ignore[assignment]

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        other = TYPES.setdefault(cls.__name__, cls)
        if other.__module__ != cls.__module__:  # a stored record is found by its name
            raise TypeError(f"{other.__module__} has a record of the name {cls.__name__}")
        TYPES[cls.__name__] = cls
        if "__post_init__" in vars(cls):
            cls.__post_init__ = _refusing(cls.__post_init__)  # type: ignore[method-assign]
        if "__repr__" not in vars(cls):  # else the decorator writes one with all arrays
            cls.__repr__ = Record.__repr__  # type: ignore[method-assign]

    def __new__(cls, **given: Any) -> Self:
        """What a user makes has values of the types that are told; what we make, we trust.

        Raises:
            DataError: names the field, what is allowed and what was found.
        """
        require_fields(cls, given)
        return super().__new__(cls)

    def __repr__(self) -> str:
        values = (f"{f.name}={_short(getattr(self, f.name))}" for f in fields(self))
        return f"{type(self).__name__}({', '.join(values)})"

    @_refusing
    def __post_init__(self) -> None:
        lengths: dict[str, int] = {}
        for f in fields(self):
            if "shape" in f.metadata and getattr(self, f.name) is not None:
                self.freeze(f.name, f.metadata["dtype"], f.metadata["shape"], lengths)

    def __eq__(self, other: object) -> bool:
        if type(self) is not type(other):
            return NotImplemented
        return all(_same(getattr(self, f.name), getattr(other, f.name)) for f in fields(self))

    def freeze(
        self,
        name: str,
        dtype: Any,
        shape: tuple[int | str, ...],
        lengths: dict[str, int] | None = None,
    ) -> None:
        """Check, copy and make read-only the array field `name`.

        `shape` gives each dimension as a number, or as a word: equal words are equal lengths, those
        of `lengths` too.

        Raises:
            ValueError: where the shape differs, a float is not finite or a value is masked.
        """
        given, where = getattr(self, name), f"{type(self).__name__}.{name}"
        known = _FROZEN.get(id(given))
        frozen = known is not None and known is given and known.dtype == dtype
        try:
            array = given if frozen else np.array(given, dtype=dtype, order="C", copy=True)
        except (TypeError, ValueError):
            raise ValueError(f"{where}: must be numbers, in rows of one length") from None
        lengths = {} if lengths is None else lengths
        matches = array.ndim == len(shape)
        for wanted, found in zip(shape, array.shape, strict=False):
            expected = lengths.setdefault(wanted, found) if isinstance(wanted, str) else wanted
            matches = matches and expected == found
        if not matches:
            raise ValueError(f"{where}: shape {array.shape}, expected {shape}")
        if frozen:
            return
        if array.dtype.kind == "f" and not np.isfinite(array).all():
            raise ValueError(f"{where}: holds values that are not finite")
        if np.ma.is_masked(given):
            raise ValueError(f"{where}: holds values that are masked")
        array.setflags(write=False)
        # A view of what nobody may write cannot be made writable again.
        object.__setattr__(self, name, unchanging(array))

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed, checked like a new record."""
        values = {f.name: getattr(self, f.name) for f in fields(self) if f.init}
        return type(self)(**(values | changes))


def remembered(function: Callable[[R], T]) -> Callable[[R], T]:
    """A function of one record whose result the record keeps: it is frozen, so that holds.

    For what costs much and is asked again, such as of the shapes that many worlds share.
    """
    name = f"{function.__module__}.{function.__qualname__}"

    @wraps(function)
    def kept(record: R) -> T:
        own = vars(record)
        if name not in own:
            own[name] = function(record)
        found: T = own[name]
        return found

    return kept


@dataclass(frozen=True, kw_only=True, eq=False)
class Rows(Record):
    """A record whose arrays have a row for each of some things; what else it has, they share."""

    @classmethod
    def columns(cls) -> list[str]:
        """Names of the arrays."""
        return [f.name for f in fields(cls) if "shape" in f.metadata]

    def __len__(self) -> int:
        return len(getattr(self, self.columns()[0]))

    @checked
    def select(self, rows: NDArray[np.bool_] | NDArray[np.intp]) -> Self:
        """The rows of a mask or of an index array.

        Raises:
            DataError: if they are not of one dimension, or not among those that there are.
        """
        try:
            taken = np.arange(len(self))[rows]
        except IndexError as error:
            raise DataError(f"{type(self).__name__}.select: {error}") from None
        if taken.ndim != 1:
            raise DataError(f"{type(self).__name__}.select: rows of shape {taken.shape}")
        return self.replace(**{name: getattr(self, name)[rows] for name in self.columns()})

    def joined(self, *others: Self) -> Self:
        """These rows, and those of others after them.

        Raises:
            DataError: for what is of another type.
        """
        for other in others:
            if not isinstance(other, type(self)):
                found, own = type(other).__name__, type(self).__name__
                raise DataError(f"{own}.joined: must be a {own}, found a {found}")
        parts = self, *others
        return self.replace(
            **{n: np.concatenate([getattr(part, n) for part in parts]) for n in self.columns()}
        )


def _short(value: Any) -> str:
    """A field's value for people: of an array its type and shape."""
    if isinstance(value, np.ndarray):
        return f"{value.dtype}[{', '.join(map(str, value.shape))}]"
    if isinstance(value, tuple) and any(isinstance(item, Record) for item in value):
        return f"{len(value)} × {type(value[0]).__name__}"
    return reprlib.repr(value)


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


def from_plain(plain: Any, arrays: dict[str, NDArray[Any]], kind: type[T]) -> T:
    """The value of type `kind` that `to_plain` made this from.

    Raises:
        LookupError: for a record or an array that is not there.
        TypeError: where a value is not of the type that its field has.
    """
    value: T = _from_plain(plain, arrays)
    _require("it", value, kind)
    return value


def _from_plain(plain: Any, arrays: dict[str, NDArray[Any]]) -> Any:
    if isinstance(plain, dict) and "record" in plain:
        body = {k: _from_plain(v, arrays) for k, v in plain.items() if k != "record"}
        record = TYPES.get(plain["record"])
        if record is None:
            raise LookupError(f"{plain['record']}: the package that brings it is not installed")
        for name, kind in _kinds(record).items():  # type: ignore[arg-type]
            if name in body:
                _require(f"{record.__name__}.{name}", body[name], kind)
        return record(**body)
    if isinstance(plain, dict) and set(plain) == {"array"}:
        return arrays[plain["array"]]
    if isinstance(plain, list):
        return tuple(_from_plain(item, arrays) for item in plain)
    return plain


@cache
def _kinds(record: type[Record]) -> dict[str, Any]:
    """The type of each field."""
    hints = get_type_hints(record)
    return {f.name: hints[f.name] for f in fields(record)}


def _require(where: str, value: Any, kind: Any) -> None:
    if not is_of(value, kind):
        wanted = getattr(kind, "__name__", str(kind)) if isinstance(kind, type) else str(kind)
        raise TypeError(f"{where}: {_short(value)}, expected {wanted}")
