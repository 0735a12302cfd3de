"""Expressions of rovers' files, `${…}`, evaluated on a checked syntax tree: no Python runs."""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

Value = Any
"""bool, int, float, str or None; list, tuple or dict of such; a scope; an XML element."""
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
_DIGITS = 400
"""Digits of a number that a text is."""
_TRUTHS = {"true": True, "True": True, "false": False, "False": False}


class Scope:
    """Properties or macros by their names; what a scope lacks the one above it may have.

    Args:
        above: the scope around it.
        values: what it holds.
        namespace: whether it is that of an included file, rather than that of a macro.
    """

    def __init__(
        self,
        above: Scope | None = None,
        *,
        values: Mapping[str, Value] | None = None,
        namespace: bool = False,
    ) -> None:
        self._above, self._namespace = above, namespace
        self._values: dict[str, Value] = {}
        for name, value in (values or {}).items():
            self.set(name, value)

    def _chain(self) -> Iterator[Scope]:
        scope: Scope | None = self
        while scope is not None:
            yield scope
            scope = scope._above

    def __str__(self) -> str:
        return "a namespace"

    def _holder(self, name: str) -> Scope | None:
        scope: Scope | None = self
        while scope is not None and name not in scope._values:
            scope = scope._above
        return scope

    def __contains__(self, name: str) -> bool:
        return self._holder(name) is not None

    def __getitem__(self, name: str) -> Value:
        if (holder := self._holder(name)) is None:
            raise KeyError(name)
        value = holder._values[name]
        if isinstance(value, _Lazy):
            if value.asked:
                raise ValueError(f"property {name!r} is defined by itself")
            value.asked = True
            value = holder._values[name] = literal(value.evaluate(value.text, holder))
        return value

    def set(
        self, name: str, value: Value, *, lazy: Callable[[str, Scope], Value] | None = None
    ) -> None:
        """Define a value; one that is a text may be `lazy`, evaluated once it is asked for."""
        value = literal(value)
        self._values[name] = _Lazy(value, lazy) if lazy and isinstance(value, str) else value

    def remove(self, name: str) -> None:
        """Forget a value, here and above."""
        for scope in self._chain():
            scope._values.pop(name, None)

    @property
    def top(self) -> Scope:
        """The outermost scope."""
        return [*self._chain()][-1]

    @property
    def caller(self) -> Scope | None:
        """The scope that a macro was called in; a namespace's is the one that includes it."""
        if self._namespace:
            return self._above
        return next((s for s in [*self._chain()][1:] if not s._namespace), None)


@dataclass
class _Lazy:
    """A property's text before anybody asked for its value."""

    text: str
    evaluate: Callable[[str, Scope], Value]
    asked: bool = False


def literal(value: Value) -> Value:
    """A number or a truth value where a text is one; without quotes where it has them."""
    if not isinstance(value, str):
        return value
    if len(value) >= 2 and value[0] == value[-1] == "'":
        return value[1:-1]
    if "_" in value or len(value) > _DIGITS:
        return value
    for kind in (int, float):
        try:
            return kind(value)
        except ValueError:
            pass
    return _TRUTHS.get(value, value)


def truth(value: Value) -> bool:
    """What a condition's value says.

    Raises:
        ValueError: if that is neither true nor false.
    """
    if not isinstance(value, str):
        return bool(value)
    if value in _TRUTHS:
        return _TRUTHS[value]
    try:
        return bool(int(value[:_DIGITS]))
    except ValueError:
        raise ValueError(f"a condition is {value[:80]!r}, neither true nor false") from None


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


def _of_text(kind: type, most: int) -> Callable[[Value], Value]:
    """A number from a number, or from a text of which so many characters count."""
    return lambda value: kind(value[:most] if isinstance(value, str) else _number(value))


def _extreme(choose: Callable[[Iterable[Any]], Value]) -> Callable[..., Value]:
    return lambda *values: choose([*map(_number, values[0] if len(values) == 1 else values)])


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


def _round(value: Value, digits: Value = None) -> Value:
    if digits is not None and not -20 <= _number(digits) <= 20:
        raise ValueError("round: between -20 and 20 digits")
    return round(_number(value), digits)


_OPERATORS: dict[type, Callable[..., Any]] = {
    ast.Add: _add, ast.Sub: _of_numbers(operator.sub), ast.Mult: _of_numbers(operator.mul),
    ast.Div: _of_numbers(operator.truediv), ast.FloorDiv: _of_numbers(operator.floordiv),
    ast.Mod: _of_numbers(operator.mod), ast.Pow: _of_numbers(_power),
    ast.USub: _of_numbers(operator.neg), ast.UAdd: _of_numbers(operator.pos),
    ast.Not: operator.not_, ast.Eq: operator.eq, ast.NotEq: operator.ne,
    ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge,
    ast.In: lambda one, many: one in many, ast.NotIn: lambda one, many: one not in many,
    ast.Is: operator.is_, ast.IsNot: operator.is_not,
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
    "len": len, "str": str, "bool": bool, "int": _of_text(int, 40), "float": _of_text(float, 80),
    "list": list, "tuple": tuple, "dict": dict,
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
    names: Mapping[str, Value] | Scope,
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


@dataclass(frozen=True)
class _Evaluation:
    """Walks a syntax tree."""

    names: Mapping[str, Value] | Scope
    budget: Budget
    functions: Mapping[str, Callable[..., Value]]

    def value(self, node: ast.expr) -> Value:
        """The value of a part of the expression."""
        self.budget.spend("steps")
        value = self._compute(node)
        if isinstance(value, (list, tuple, dict)):
            self.budget.spend("steps", _CONTAINER_STEPS + len(value))
        elif isinstance(value, str):
            self.budget.spend("characters", len(value))
        return value

    def _compute(self, node: ast.expr) -> Value:
        match node:
            case ast.Constant(value=bool() | int() | float() | str() | None as value):
                return _bounded(value)
            case ast.Name() | ast.Attribute() if _is_dotted(node):
                return self._look_up(_dotted(node))
            case ast.Attribute(value=whole, attr=name):
                return _part(self.value(whole), name, name)
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
                return _bounded(_OPERATORS[type(op)](self.value(left), self.value(right)))
            case ast.UnaryOp(op=op, operand=operand) if type(op) in _OPERATORS:
                return _OPERATORS[type(op)](self.value(operand))
            case ast.Compare(left=first, ops=ops, comparators=parts):
                left = self.value(first)
                for comparison, part in zip(ops, parts, strict=True):
                    right = self.value(part)
                    if not _OPERATORS[type(comparison)](left, right):
                        return False
                    left = right
                return True
            case ast.BoolOp(op=op, values=parts):
                decided: Value = None
                for part in parts:
                    decided = self.value(part)
                    if bool(decided) == isinstance(op, ast.Or):
                        break
                return decided
            case ast.IfExp(test=test, body=body, orelse=other):
                return self.value(body if self.value(test) else other)
            case ast.Subscript(value=told, slice=index) if not isinstance(index, ast.Slice):
                many = self.value(told)
                if not isinstance(many, (str, list, tuple, dict)):
                    raise ValueError(f"{str(many)[:40]!r} has no items")
                return many[self.value(index)]
            case ast.List(elts=parts) | ast.Tuple(elts=parts):
                kind = list if isinstance(node, ast.List) else tuple
                return _bounded(kind(map(self.value, parts)))
            case ast.Dict(keys=keys, values=parts) if None not in keys:
                pairs = zip(keys, parts, strict=True)
                return _bounded({self.value(k): self.value(v) for k, v in pairs if k})
            case ast.Call(func=function, args=given, keywords=named):
                return self._call(_dotted(function), given, named)
        raise ValueError(f"{ast.unparse(node)[:80]!r} {_REFUSED}")

    def _look_up(self, dotted: str) -> Value:
        """A name; or one in the namespace of an included file, `arm.length`."""
        first, *rest = dotted.split(".")
        try:
            found = self.names[first]
        except KeyError:
            if dotted in _NAMED:
                return _NAMED[dotted]
            if first in ("math", "python", "xacro"):
                raise ValueError(f"{dotted!r} {_REFUSED}") from None
            raise ValueError(f"unknown name {first!r}") from None
        for name in rest:
            found = _part(found, name, dotted)
        return found

    def _call(self, name: str, given: list[ast.expr], named: list[ast.keyword]) -> Value:
        function = self.functions.get(name)
        told = {word.arg: word.value for word in named if word.arg}
        if function is None or (named and function is not dict) or len(told) < len(named):
            raise ValueError(f"{name[:80]!r} {_REFUSED}")
        values = [self.value(part) for part in given]
        return _bounded(function(*values, **{key: self.value(v) for key, v in told.items()}))


def _part(whole: Value, name: str, told: str) -> Value:
    """What a namespace or a dict has by a name, as xacro lets one say of YAML."""
    if not isinstance(whole, (Scope, dict)) or name.startswith("_"):
        raise ValueError(f"{told[:80]!r} {_REFUSED}")
    return whole[name]


def _is_dotted(node: ast.expr) -> bool:
    while isinstance(node, ast.Attribute):
        node = node.value
    return isinstance(node, ast.Name)


def _dotted(node: ast.expr) -> str:
    """A name, or names joined by dots."""
    match node:
        case ast.Name(id=name):
            return name
        case ast.Attribute(value=value, attr=attribute):
            return f"{_dotted(value)}.{attribute}"
    raise ValueError(f"{ast.unparse(node)[:80]!r} {_REFUSED}")


def _bounded(value: Value) -> Value:
    """The value, if it is not too large with all that it holds."""
    if isinstance(value, int) and abs(value) > _LARGEST:
        raise ValueError("a whole number of more than 128 bits")
    weight, left = 0, [value]
    while left:
        part = left.pop()
        weight += len(part) if isinstance(part, str) else 1
        if weight > _HEAVIEST:
            raise ValueError(f"a text or list of more than {_HEAVIEST} characters or items")
        if isinstance(part, (list, tuple, dict)):
            left += part.items() if isinstance(part, dict) else part
    return value
