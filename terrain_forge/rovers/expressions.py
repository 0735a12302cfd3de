"""Arithmetic of data files, `${…}`, evaluated without running them as Python."""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Mapping
from typing import Any

Value = bool | float | str | tuple[float, ...]

_FAULTS = SyntaxError, ValueError, ArithmeticError, TypeError, LookupError, RecursionError
_LONGEST = 500
"""Characters of an expression, so that none nests too deep or grows too large."""
_BINARY: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul,
    ast.Div: operator.truediv, ast.Pow: math.pow, ast.Eq: operator.eq, ast.NotEq: operator.ne,
    ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge,
}  # fmt: skip
_UNARY: dict[type, Callable[[Any], Any]] = {
    ast.USub: operator.neg, ast.UAdd: operator.pos, ast.Not: operator.not_,
}  # fmt: skip
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    name: getattr(math, name)
    for name in "sqrt sin cos tan asin acos atan atan2 radians degrees".split()
} | {"abs": abs, "min": min, "max": max}


def evaluate(text: str, names: Mapping[str, Value]) -> Value:
    """The value of an expression.

    It may have numbers, names, + - * / **, comparisons, and, or, not, `a if b else c`, `size[0]`,
    and the functions sqrt, sin, cos, tan, asin, acos, atan, atan2, radians, degrees, abs, min, max.

    Args:
        text: the expression.
        names: values of the names that it may use; `pi` is known.

    Raises:
        ValueError: for anything else, and for what has no finite value.
    """
    try:
        if len(text) > _LONGEST:
            raise ValueError(f"more than {_LONGEST} characters")
        tree = ast.parse(text.strip(), mode="eval")
        value: Value = _value(tree.body, {"pi": math.pi, **names})
        if isinstance(value, float) and not math.isfinite(value):
            raise ValueError("has no finite value")
    except _FAULTS as error:
        raise ValueError(f"${{{text[:80]}}}: {error}") from None
    return value


def substitute(text: str, names: Mapping[str, Value]) -> Value:
    """A text with its `${…}` replaced; where it is one expression alone, that one's value."""
    found = re.fullmatch(r"\$\{([^}]*)\}", text.strip())
    if found:
        return evaluate(found[1], names)
    return re.sub(r"\$\{([^}]*)\}", lambda m: str(evaluate(m[1], names)), text)


def read_value(text: str, names: Mapping[str, Value]) -> Value:
    """`substitute`, and a number or `true` and `false` where that is all the text says."""
    value = substitute(text, names)
    if not isinstance(value, str):
        return value
    for kind in (int, float):
        try:
            return kind(value)
        except ValueError:
            pass
    return {"true": True, "false": False}.get(value.lower(), value)


def _value(node: ast.expr, names: Mapping[str, Value]) -> Any:
    match node:
        case ast.Constant(value=bool() | int() | float() | str() as value):
            return value
        case ast.Name(id=name) if name in names:
            return names[name]
        case ast.Name(id=name):
            raise ValueError(f"unknown name {name!r}, there are: {', '.join(sorted(names))}")
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
            return _BINARY[type(op)](_number(left, names), _number(right, names))
        case ast.UnaryOp(op=op, operand=operand) if type(op) in _UNARY:
            return _UNARY[type(op)](_value(operand, names))
        case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in _BINARY:
            return _BINARY[type(op)](_value(left, names), _value(right, names))
        case ast.BoolOp(op=op, values=values):
            decide = all if isinstance(op, ast.And) else any
            return decide(_value(value, names) for value in values)
        case ast.IfExp(test=test, body=body, orelse=other):
            return _value(body if _value(test, names) else other, names)
        case ast.Subscript(value=ast.Name() as value, slice=ast.Constant(value=int() as index)):
            return _value(value, names)[index]
        case ast.Call(func=ast.Name(id=name), args=given, keywords=[]) if name in _FUNCTIONS:
            return _FUNCTIONS[name](*(_number(value, names) for value in given))
    raise ValueError(f"{ast.unparse(node)!r} is not allowed: only arithmetic is")


def _number(node: ast.expr, names: Mapping[str, Value]) -> float:
    value = _value(node, names)
    if not isinstance(value, (bool, int, float)):
        raise ValueError(f"{ast.unparse(node)!r} is no number")
    return float(value)
