"""Scopes of xacro: properties and macros, each in the scope of the macro that defined it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

Value = Any
"""bool, int, float, str or None; list, tuple or dict of such; a scope; an XML element."""
_LONGEST = 400
"""Digits of a number."""
_TRUTHS = {"true": True, "True": True, "false": False, "False": False}


class Scope:
    """Values by their names; what a scope lacks the one above it may have.

    Args:
        above: the scope around it.
        evaluate: makes the value of a property's text, once it is asked for.
        namespace: whether it is that of an included file, rather than that of a macro.
    """

    def __init__(
        self,
        above: Scope | None = None,
        *,
        evaluate: Callable[[str, Scope], Value] | None = None,
        namespace: bool = False,
    ) -> None:
        self.above = above
        self.namespace = namespace
        self._evaluate: Callable[[str, Scope], Value] | None = evaluate
        if above is not None and evaluate is None:
            self._evaluate = above._evaluate
        self._values: dict[str, Value] = {}
        self._waiting: set[str] = set()
        self._asked: set[str] = set()

    def __str__(self) -> str:
        return "a namespace"

    def __contains__(self, name: str) -> bool:
        return self._holder(name) is not None

    def __getitem__(self, name: str) -> Value:
        holder = self._holder(name)
        if holder is None:
            raise KeyError(name)
        return holder._own(name)

    def _holder(self, name: str) -> Scope | None:
        scope: Scope | None = self
        while scope is not None and name not in scope._values:
            scope = scope.above
        return scope

    def _own(self, name: str) -> Value:
        if name in self._waiting and self._evaluate is not None:
            if name in self._asked:
                raise ValueError(f"property {name!r} is defined by itself")
            self._asked.add(name)
            self._values[name] = literal(self._evaluate(self._values[name], self))
            self._asked.discard(name)
            self._waiting.discard(name)
        return self._values[name]

    def set(self, name: str, value: Value, *, lazy: bool = False) -> None:
        """Define a value; a lazy one that is a text is evaluated when it is first asked for."""
        self._values[name] = literal(value)
        self._waiting.discard(name)
        if lazy and isinstance(self._values[name], str):
            self._waiting.add(name)

    def remove(self, name: str) -> None:
        """Forget a value, here and above."""
        scope: Scope | None = self
        while scope is not None:
            scope._values.pop(name, None)
            scope = scope.above

    @property
    def top(self) -> Scope:
        """The outermost scope."""
        scope = self
        while scope.above is not None:
            scope = scope.above
        return scope

    @property
    def caller(self) -> Scope | None:
        """The scope that a macro was called in; a namespace's is the one that includes it."""
        scope = self.above
        while not self.namespace and scope is not None and scope.namespace:
            scope = scope.above
        return scope


def literal(value: Value) -> Value:
    """A number or a truth value where a text is one; without quotes where it has them."""
    if not isinstance(value, str):
        return value
    if len(value) >= 2 and value[0] == value[-1] == "'":
        return value[1:-1]
    if "_" in value or len(value) > _LONGEST:
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
        return bool(int(value[:_LONGEST]))
    except ValueError:
        raise ValueError(f"a condition is {value[:80]!r}, neither true nor false") from None
