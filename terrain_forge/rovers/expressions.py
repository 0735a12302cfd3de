"""Expressions of rovers' files, `${…}`, evaluated on a checked syntax tree: no Python runs."""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Protocol

from terrain_forge.rovers.scopes import Scope, Value

FAULTS = (
    *(SyntaxError, ValueError, ArithmeticError, TypeError, LookupError, RecursionError),
    MemoryError,  # Python's parser raises it where parentheses nest too deep
)
"""What an expression can raise."""
_LONGEST = 1000
"""Characters of an expression, so that none nests too deep or grows too large."""
_HEAVIEST = 10_000
"""Characters of a text, and items and characters of a list with all that it holds."""
_LARGEST = 2**128
_CONTAINER_STEPS = 50
"""What it costs to look at a list, in steps of an expression, besides one for each item."""


class Names(Protocol):
    """What an expression may name."""

    def __getitem__(self, name: str, /) -> Value: ...


class Budget:
    """What the expansion of one file may cost, so that no file grows without end."""

    def __init__(self) -> None:
        self._left = {"elements": 200_000, "steps": 500_000, "characters": 20_000_000}

    def spend(self, what: str, amount: int = 1) -> None:
        """Take from what is left.

        Raises:
            ValueError: if that is less than nothing.
        """
        self._left[what] -= amount
        if self._left[what] < 0:
            told = {"steps": "steps of expressions"}.get(what, what)
            raise ValueError(f"it takes too many {told} to expand")


def _number(value: Value) -> Value:
    if not isinstance(value, (bool, int, float)):
        raise ValueError(f"{str(value)[:40]!r} is no number")
    return value


def _of_numbers(calculate: Callable[..., Value]) -> Callable[..., Value]:
    """The same, of numbers alone."""
    return lambda *values: calculate(*map(_number, values))


def _add(left: Value, right: Value) -> Value:
    if type(left) is type(right) and isinstance(left, (str, list, tuple)):
        return left + right
    return _number(left) + _number(right)


def _power(base: Value, exponent: Value) -> Value:
    """Base to the exponent; one that would grow beyond a float is a float's overflow."""
    whole = isinstance(base, int) and isinstance(exponent, int) and exponent >= 0
    if whole and base.bit_length() * exponent <= 128:
        return base**exponent
    return math.pow(base, exponent)


def _extreme(choose: Callable[[Iterable[Any]], Value]) -> Callable[..., Value]:
    def choice(*values: Value) -> Value:
        many = values[0] if len(values) == 1 else values
        return choose([_number(value) for value in many])

    return choice


def _round(value: Value, digits: Value = None) -> Value:
    if digits is not None and not -20 <= _number(digits) <= 20:
        raise ValueError("round: between -20 and 20 digits")
    return round(_number(value), digits)


def _whole(value: Value) -> int:
    return int(value[:40] if isinstance(value, str) else _number(value))


def _real(value: Value) -> float:
    return float(value[:80] if isinstance(value, str) else _number(value))


_BINARY: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: _add,
    ast.Sub: _of_numbers(operator.sub),
    ast.Mult: _of_numbers(operator.mul),
    ast.Div: _of_numbers(operator.truediv),
    ast.FloorDiv: _of_numbers(operator.floordiv),
    ast.Mod: _of_numbers(operator.mod),
    ast.Pow: _of_numbers(_power),
}
_COMPARISONS: dict[type, Callable[[Any, Any], Any]] = {
    ast.Eq: operator.eq, ast.NotEq: operator.ne,
    ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge,
    ast.In: lambda one, many: one in many, ast.NotIn: lambda one, many: one not in many,
    ast.Is: operator.is_, ast.IsNot: operator.is_not,
}  # fmt: skip
_UNARY: dict[type, Callable[[Any], Any]] = {
    ast.USub: _of_numbers(operator.neg), ast.UAdd: _of_numbers(operator.pos), ast.Not: operator.not_
}  # fmt: skip
_CONSTANTS = {name: getattr(math, name) for name in ("pi", "e", "tau")}
_MATH = {
    name: _of_numbers(getattr(math, name))
    for name in (
        "acos acosh asin asinh atan atan2 atanh ceil copysign cos cosh degrees exp fabs floor fmod "
        "hypot log log10 log2 pow radians sin sinh sqrt tan tanh trunc"
    ).split()
}
_BUILT_IN: dict[str, Callable[..., Value]] = {
    "abs": _of_numbers(abs), "min": _extreme(min), "max": _extreme(max), "round": _round,
    "len": len, "str": str, "bool": bool, "int": _whole, "float": _real, "list": list,
    "tuple": tuple, "dict": dict,
}  # fmt: skip
FUNCTIONS: dict[str, Callable[..., Value]] = {
    **_MATH, **_BUILT_IN,
    **{f"math.{name}": function for name, function in _MATH.items()},
    **{f"python.{name}": function for name, function in _BUILT_IN.items()},
}  # fmt: skip
"""What an expression may call."""
_NAMED = {**_CONSTANTS, **{f"math.{name}": value for name, value in _CONSTANTS.items()}}
_REFUSED = (
    "is not allowed: only arithmetic is; for a file of yours, `trust: true` runs its Python with "
    "the package xacro"
)


def evaluate(
    text: str,
    names: Names,
    *,
    budget: Budget | None = None,
    functions: Mapping[str, Callable[..., Value]] = FUNCTIONS,
) -> Value:
    """The value of an expression.

    It may have numbers, texts, lists, tuples and dicts and their items, names, + - * / // % **,
    comparisons, in, and, or, not, `a if b else c`, and the functions of `FUNCTIONS`.

    Args:
        text: the expression.
        names: values of the names that it may use; pi, e and tau are known.
        budget: what it may cost.
        functions: what it may call.

    Raises:
        ValueError: for anything else, and for what has no finite value.
    """
    try:
        if len(text) > _LONGEST:
            raise ValueError(f"more than {_LONGEST} characters")
        tree = ast.parse(text.strip(), mode="eval")
        value = _Evaluation(names, budget or Budget(), functions).value(tree.body)
        if isinstance(value, float) and not math.isfinite(value):
            raise ValueError("has no finite value")
    except RecursionError:
        raise ValueError(f"${{{text[:80]}}}: it nests too deep") from None
    except FAULTS as error:
        why = str(error) or "it cannot be read"
        raise ValueError(why if "${" in why else f"${{{text[:80]}}}: {why}") from None
    return value


class _Evaluation:
    """Walks a syntax tree."""

    def __init__(
        self, names: Names, budget: Budget, functions: Mapping[str, Callable[..., Value]]
    ) -> None:
        self._names, self._budget, self._functions = names, budget, functions

    def value(self, node: ast.expr) -> Value:
        """The value of a part of the expression."""
        self._budget.spend("steps")
        value = self._compute(node)
        if isinstance(value, (list, tuple, dict)):
            self._budget.spend("steps", _CONTAINER_STEPS + len(value))
        elif isinstance(value, str):
            self._budget.spend("characters", len(value))
        return value

    def _compute(self, node: ast.expr) -> Value:
        match node:
            case ast.Constant(value=bool() | int() | float() | str() | None as value):
                return _bounded(value)
            case ast.Name() | ast.Attribute():
                return self._look_up(node)
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
                return _bounded(_BINARY[type(op)](self.value(left), self.value(right)))
            case ast.UnaryOp(op=op, operand=operand) if type(op) in _UNARY:
                return _UNARY[type(op)](self.value(operand))
            case ast.Compare():
                return self._compare(node)
            case ast.BoolOp(op=op, values=values):
                decided: Value = None
                for part in values:
                    decided = self.value(part)
                    if bool(decided) == isinstance(op, ast.Or):
                        break
                return decided
            case ast.IfExp(test=test, body=body, orelse=other):
                return self.value(body if self.value(test) else other)
            case ast.Subscript(value=many, slice=index) if not isinstance(index, ast.Slice):
                return self._item(self.value(many), self.value(index))
            case ast.List(elts=parts):
                return _bounded([self.value(part) for part in parts])
            case ast.Tuple(elts=parts):
                return _bounded(tuple(self.value(part) for part in parts))
            case ast.Dict(keys=keys, values=values) if None not in keys:
                pairs = zip(keys, values, strict=True)
                return _bounded({self.value(k): self.value(v) for k, v in pairs if k})
            case ast.Call(func=function, args=given, keywords=named):
                return self._call(function, given, named)
        raise ValueError(f"{ast.unparse(node)[:80]!r} {_REFUSED}")

    def _look_up(self, node: ast.expr) -> Value:
        """A name; or one in the namespace of an included file, `arm.length`."""
        first, *rest = _dotted(node).split(".")
        try:
            found = self._names[first]
        except KeyError:
            if _dotted(node) in _NAMED:
                return _NAMED[_dotted(node)]
            if first in ("math", "python", "xacro"):
                raise ValueError(f"{_dotted(node)!r} {_REFUSED}") from None
            raise ValueError(f"unknown name {first!r}") from None
        for name in rest:
            if not isinstance(found, Scope) or name.startswith("_"):
                raise ValueError(f"{ast.unparse(node)[:80]!r} {_REFUSED}")
            found = found[name]
        return found

    def _compare(self, node: ast.Compare) -> bool:
        left = self.value(node.left)
        for op, part in zip(node.ops, node.comparators, strict=True):
            right = self.value(part)
            if not _COMPARISONS[type(op)](left, right):
                return False
            left = right
        return True

    def _item(self, many: Value, index: Value) -> Value:
        if not isinstance(many, (str, list, tuple, dict)):
            raise ValueError(f"{str(many)[:40]!r} has no items")
        return many[index]

    def _call(self, node: ast.expr, given: list[ast.expr], named: list[ast.keyword]) -> Value:
        name = _dotted(node)
        function = self._functions.get(name)
        told = {word.arg: word.value for word in named if word.arg}
        if function is None or (named and function is not dict) or len(told) < len(named):
            raise ValueError(f"{(name or ast.unparse(node))[:80]!r} {_REFUSED}")
        values = [self.value(part) for part in given]
        return _bounded(function(*values, **{key: self.value(v) for key, v in told.items()}))


def _dotted(node: ast.expr) -> str:
    """A name, or names joined by dots."""
    match node:
        case ast.Name(id=name):
            return name
        case ast.Attribute(value=value, attr=attribute):
            return f"{_dotted(value)}.{attribute}"
    raise ValueError(f"{ast.unparse(node)[:80]!r} {_REFUSED}")


def _bounded(value: Value) -> Value:
    """The value, if it is not too large."""
    if isinstance(value, int) and abs(value) > _LARGEST:
        raise ValueError("a whole number of more than 128 bits")
    if isinstance(value, (str, list, tuple, dict)) and _weight(value, _HEAVIEST) > _HEAVIEST:
        raise ValueError(f"a text or list of more than {_HEAVIEST} characters or items")
    return value


def _weight(value: Value, most: int) -> int:
    """How much a value holds, itself included; it stops counting where that is too much."""
    if isinstance(value, str):
        return len(value)
    total = 1
    if isinstance(value, (list, tuple, dict)):
        for part in value.items() if isinstance(value, dict) else value:
            total += _weight(part, most - total)
            if total > most:
                break
    return total
