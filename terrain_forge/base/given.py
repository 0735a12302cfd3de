"""What a Python user gives to a function: refused with a line of ours where it is of another type.

`checked` holds a function to the annotations of its parameters; `given_numbers` and
`require_measurement` look at values that annotations cannot describe.
"""

from __future__ import annotations

import collections.abc
import operator
import sys
import threading
import typing
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache, wraps
from inspect import get_annotations, unwrap
from itertools import chain, repeat
from numbers import Integral, Real
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, ParamSpec, Self, TypeVar, Union, get_args, get_origin

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrain_forge.base.arrays import Array
from terrain_forge.base.errors import DataError

P = ParamSpec("P")
T = TypeVar("T")
_BOUNDS = {
    "ge": ("at least", operator.ge),
    "gt": ("above", operator.gt),
    "le": ("at most", operator.le),
    "lt": ("below", operator.lt),
}
_trust = threading.local()
_LONGEST = 60
"""Characters of a value that are shown."""


def given_numbers(values: ArrayLike, what: str) -> Array:
    """Values in double precision, of any shape.

    Args:
        values: What is given.
        what: What it is, for the message.

    Raises:
        DataError: if they are no finite numbers.
    """
    try:
        numbers = np.asarray(values, np.float64)
    except (TypeError, ValueError):
        raise DataError(f"{what} must be numbers, in rows of one length") from None
    if not np.isfinite(numbers).all():
        raise DataError(f"{what} must be finite")
    return numbers


def require_kind(value: Any, kind: Any, what: str) -> None:
    """Refuse a value that is not of an annotated type.

    Raises:
        DataError: says what it is, what is allowed and what was found.
    """
    if not is_of(value, kind):
        raise DataError(f"{what} must be {_words(kind)}, found {_shown(value)}")


def require_alike(**values: ArrayLike) -> None:
    """Refuse values of shapes that do not go together.

    Raises:
        DataError: names them.
    """
    shapes = {name: np.shape(value) for name, value in values.items()}
    try:
        np.broadcast_shapes(*shapes.values())
    except ValueError:
        told = ", ".join(f"{name} of shape {tuple(shape)}" for name, shape in shapes.items())
        raise DataError(f"{told}: alike, or one of one") from None


def require_measurement(number: int, count: int, whose: str) -> None:
    """Refuse what is not the number, from 0, of one of some measurements.

    Raises:
        DataError: says which there are.
    """
    whole = isinstance(number, Integral) and not isinstance(number, bool)
    if not whole or not 0 <= number < count:
        raise DataError(f"{whose} has no measurement {number}: 0 to {count - 1}")


@contextmanager
def trusting() -> Iterator[None]:
    """Within it nothing is checked, in this thread."""
    before, _trust.now = getattr(_trust, "now", False), True
    try:
        yield
    finally:
        _trust.now = before


def checked(function: Callable[P, T]) -> Callable[P, T]:
    """A function that refuses arguments that are not of the types of its parameters.

    Specs among them, a method's own too, are held to the limits of their fields. What a type's
    name does not tell (`TYPE_CHECKING` hides it) is not checked, nor are calls that the function
    makes itself: those are ours.

    Raises:
        DataError: from the function: names it, the parameter, what is allowed and what was found.
        RecipeError: for a spec whose fields are wrong.
    """
    code = unwrap(function).__code__
    names = code.co_varnames[: code.co_argcount]
    rest = code.co_varnames[code.co_argcount + code.co_kwonlyargcount :][: bool(code.co_flags & 4)]

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> T:
        if getattr(_trust, "now", False):
            return function(*args, **kwargs)
        with trusting():
            kinds = _kinds(function)
            each = chain(names, repeat(*rest)) if rest else names
            given = [_taken(function, kinds, name, value) for name, value in zip(each, args)]  # noqa: B905
            given += args[len(given) :]  # too many, which Python tells
            named = {name: _taken(function, kinds, name, value) for name, value in kwargs.items()}
            return function(*given, **named)

    return call


def _taken(function: Callable[..., Any], kinds: dict[str, Any], name: str, value: Any) -> Any:
    """An argument as the function takes it; raises what `checked` says."""
    where = function.__qualname__.rpartition("<locals>.")[2]
    require_kind(value, kinds.get(name, Any), f"{where}: {name}")
    return _sound(value)


def require_fields(owner: type, given: Mapping[str, Any]) -> None:
    """Refuse values that are not of the types of a class's fields, arrays aside.

    What a type's name does not tell, and what the class makes itself, is not checked.

    Raises:
        DataError: names the class, the field, what is allowed and what was found.
    """
    if getattr(_trust, "now", False):
        return
    kinds = _field_kinds(owner)
    for name, value in given.items():
        require_kind(value, kinds.get(name, Any), f"{owner.__name__}: {name}")


@cache
def _field_kinds(owner: type) -> dict[str, Any]:
    """The types of a class's fields, as far as their names are known; those of arrays left out."""
    kinds: dict[str, Any] = {}
    for base in reversed(owner.__mro__):
        names = vars(sys.modules.get(base.__module__, typing))
        kinds |= _known(get_annotations(base), names)
    return {name: kind for name, kind in kinds.items() if not _may_be_array(kind)}


def _may_be_array(kind: Any) -> bool:
    kind = _unfolded(kind)
    if get_origin(kind) in (Union, UnionType):
        return any(map(_may_be_array, get_args(kind)))
    return get_origin(kind) is np.ndarray


def _sound(value: Any) -> Any:
    if isinstance(value, tuple):
        parts = tuple(map(_sound, value)) if type(value) is tuple else value
        return value if all(map(lambda a, b: a is b, parts, value)) else parts
    sound = getattr(type(value), "sound", None)
    return sound(value) if sound else value


@cache
def _kinds(function: Callable[..., Any]) -> dict[str, Any]:
    """The types of a function's parameters, as far as their names are known."""
    real = unwrap(function)
    return _known(real.__annotations__, real.__globals__)


def _known(annotations: Mapping[str, Any], names: dict[str, Any]) -> dict[str, Any]:
    """Types by the names that a module knows."""
    kinds = {}
    for name, kind in annotations.items():
        try:
            kinds[name] = eval(kind, names) if isinstance(kind, str) else kind
        except (NameError, TypeError, AttributeError):
            continue
    return kinds


def _unfolded(kind: Any) -> Any:
    """What an alias stands for, as `type A = B` makes them; since NumPy 2.5 `NDArray` is one."""
    alias, inner = get_origin(kind) or kind, get_args(kind)
    if not hasattr(alias, "__value__"):
        return kind
    return _unfolded(alias.__value__[inner] if inner else alias.__value__)


def is_of(value: Any, kind: Any) -> bool:
    """Whether a value is of an annotated type, as a type checker would say.

    A list or an array may stand for a tuple; what has the members of a protocol is of it.
    """
    if kind == ArrayLike:
        return _is_numeric(value)
    kind = _unfolded(kind)
    outer, inner = get_origin(kind), get_args(kind)
    if kind in (Any, Self) or isinstance(kind, TypeVar):
        return True
    if outer is np.ndarray:
        return isinstance(value, np.ndarray) and _is_array_of(value, inner[-1])
    if outer in (Union, UnionType):
        return any(is_of(value, one) for one in inner)
    if outer is Annotated:
        return is_of(value, inner[0]) and all(_keeps(value, mark) for mark in inner[1:])
    if outer is Literal:
        return isinstance(value, str | int | NoneType) and value in inner
    if outer is tuple:
        if not isinstance(value, tuple | list | np.ndarray):
            return False
        each = inner[:1] * len(value) if inner[1:] == (...,) else inner
        return len(value) == len(each) and all(map(is_of, value, each))
    return _is_one(value, outer, inner, kind)


def _is_one(value: Any, outer: Any, inner: tuple[Any, ...], kind: Any) -> bool:
    """`is_of`, for what holds others or is a class."""
    if isinstance(value, bool | np.bool_):
        return kind is bool
    if kind is float:
        number = isinstance(value, Real) or (isinstance(value, np.ndarray) and value.ndim == 0)
        return number and not (isinstance(value, int) and abs(value) > sys.maxsize)
    if kind is int:
        return isinstance(value, Integral)
    if outer is collections.abc.Callable:
        return callable(value)
    base: Any = NoneType if kind is None else outer or kind
    if getattr(base, "_is_protocol", False):
        return all(hasattr(value, name) for name in _members(base))
    if not isinstance(value, base):
        return False
    if outer in (collections.abc.Sequence, collections.abc.Iterable, list) and inner:
        if isinstance(value, str | bytes):  # a text holds texts, but was not meant to
            return False
        return not isinstance(value, list | tuple) or all(is_of(one, inner[0]) for one in value)
    if outer in (collections.abc.Mapping, dict):
        return all(is_of(key, inner[0]) and is_of(one, inner[1]) for key, one in value.items())
    return True


@cache
def _members(protocol: Any) -> tuple[str, ...]:
    """Names that an object of a protocol has."""
    own = [n for base in protocol.__mro__ for n in (*vars(base), *get_annotations(base))]
    return tuple(n for n in own if n == "__call__" or not n.startswith("_"))


def _is_array_of(value: NDArray[Any], kind: Any) -> bool:
    """Whether an array holds what `kind` (`np.dtype[np.float64]`) does, or what becomes it."""
    wanted = (*get_args(kind), Any)[0]
    allowed = {"b": "b", "i": "iu", "u": "iu", "f": "biuf"}
    if not isinstance(wanted, type):
        return True
    return value.dtype.kind in allowed.get(np.dtype(wanted).kind, value.dtype.kind)


def _is_numeric(value: Any) -> bool:
    try:
        return np.asarray(value).dtype.kind in "biuf"
    except ValueError:  # rows of several lengths
        return False


def _keeps(value: Any, mark: Any) -> bool:
    """Whether a value keeps a mark of `annotated_types`."""
    for name, (_, holds) in _BOUNDS.items():
        limit = getattr(mark, name, None)
        if limit is not None and not holds(value, limit):
            return False
    least, most = getattr(mark, "min_length", None) or 0, getattr(mark, "max_length", None)
    if (least or most) and not least <= len(value) <= (sys.maxsize if most is None else most):
        return False
    return not hasattr(mark, "func") or bool(mark.func(value))


def _words(kind: Any) -> str:
    """A type in words."""
    array_like, kind = kind == ArrayLike, _unfolded(kind)
    outer, inner = get_origin(kind), get_args(kind)
    plain = {float: "a number", int: "a whole number", str: "a text", bool: "true or false"}
    if kind in (None, NoneType):
        return "None"
    if array_like or outer is np.ndarray:
        return "numbers, in rows of one length"
    if outer in (Union, UnionType):
        return " or ".join(dict.fromkeys(map(_words, inner)))
    if outer is Annotated:
        marks = [
            f"{words} {getattr(mark, name):g}"
            for mark in inner[1:]
            for name, (words, _) in _BOUNDS.items()
            if getattr(mark, name, None) is not None
        ]
        return " ".join([_words(inner[0]), *(" and ".join(marks),) * bool(marks)])
    if outer is Literal:
        return " or ".join(map(repr, inner))
    if outer is tuple:
        many = inner[1:] == (...,)
        return (
            f"a tuple, each {_words(inner[0])}"
            if many
            else f"{len(inner)} values, each {_words(inner[0])}"
        )
    if outer is collections.abc.Callable:
        return "a function"
    if outer in (collections.abc.Sequence, collections.abc.Iterable, list) and inner:
        return f"a list, each {_words(inner[0])}"
    return plain.get(kind) or f"a {getattr(outer or kind, '__name__', kind)}"


def _shown(value: Any) -> str:
    if value is None:
        return "None"
    simple = isinstance(value, str | bytes | Real | np.generic | tuple | list)
    text = repr(value.item() if isinstance(value, np.generic) else value) if simple else ""
    return text if 0 < len(text) <= _LONGEST else f"a {type(value).__name__}"
