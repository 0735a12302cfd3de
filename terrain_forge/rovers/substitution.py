"""What stands in a xacro's texts: `${expression}` and `$(command …)`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from xml.etree.ElementTree import Element

from terrain_forge.rovers.expressions import FUNCTIONS, Budget, evaluate
from terrain_forge.rovers.packages import Packages
from terrain_forge.rovers.scopes import Scope, Value, literal

_PIECE = re.compile(
    r"(?P<escaped>\$\$+[{(])|\$\{(?P<expression>[^}]*)\}"
    r"|\$\((?P<command>eval\s(?:[^()]|\((?:[^()]|\([^()]*\))*\))*|[^)]*)\)"
    r"|(?P<text>[^$]+|\$(?=[^{($])|\$$)"
)
_LONGEST = 100_000
"""Characters of one text."""
_DEEPEST = 50
"""Properties that are made of properties."""


class Substitution:
    """Makes the values of texts.

    Args:
        packages: Finds what `$(find …)` names.
        budget: What it may cost.
    """

    def __init__(self, packages: Packages, budget: Budget) -> None:
        self.file = Path()
        """The file that is being expanded."""
        self.arguments: dict[str, str] = {}
        """Values of `$(arg …)`."""
        self._packages = packages
        self._budget = budget
        self._depth = 0

    def scope(self, names: Mapping[str, Value]) -> Scope:
        """A scope of its own that holds these values."""
        scope = Scope(evaluate=self.value)
        for name, value in names.items():
            scope.set(name, value)
        return scope

    def text(self, told: str, names: Scope) -> str:
        """A text with everything in it substituted."""
        text = str(self.value(told, names))
        self._budget.spend("characters", len(text))
        return text

    def value(self, told: str, names: Scope) -> Value:
        """The same; where the text is one expression alone, its value.

        Raises:
            ValueError: for what is wrong in it.
        """
        self._budget.spend("characters", len(told))
        if "$" not in told:
            return told
        self._depth += 1
        if self._depth > _DEEPEST:
            raise ValueError(f"{told[:80]!r}: values are made of values more than {_DEEPEST} deep")
        values, at = list[Value](), 0
        while at < len(told):
            found = _PIECE.match(told, at)
            if not found:
                raise ValueError(f"{told[at : at + 80]!r} has no end")
            values.append(self._piece(found, names))
            at = found.end()
        self._depth -= 1
        if len(values) == 1:
            return values[0]
        text = "".join(map(str, values))
        if len(text) > _LONGEST:
            raise ValueError(f"a text of more than {_LONGEST} characters")
        self._budget.spend("characters", len(text))
        return text

    def _piece(self, found: re.Match[str], names: Scope) -> Value:
        if found["expression"] is not None:
            expression = self.text(found["expression"], names)
            functions = FUNCTIONS | {"xacro.arg": self._argument}
            return evaluate(expression, names, budget=self._budget, functions=functions)
        if found["command"] is not None:
            return self._command(self.text(found["command"], names))
        return found["escaped"][1:] if found["escaped"] else found["text"]

    def _command(self, told: str) -> str:
        match told.split():
            case ["arg", name]:
                return self._argument(name)
            case ["find", package]:
                return self._find(package)
            case ["dirname"]:
                return self._dirname()
            case ["optenv", _, *default]:
                return " ".join(default)
            case ["env", *_]:
                raise ValueError(
                    f"$({told[:80]}): the environment is not read; `$(optenv NAME default)` takes "
                    "its default"
                )
            case ["eval", *_]:
                own = self.scope({**self.arguments, "true": True, "false": False})
                functions = FUNCTIONS | {
                    "arg": lambda name: literal(self._argument(name)),
                    "find": self._find,
                    "dirname": self._dirname,
                    "optenv": lambda _, default="": default,
                }
                expression = told.strip().removeprefix("eval")
                return str(evaluate(expression, own, budget=self._budget, functions=functions))
        raise ValueError(
            f"$({told[:80]}) is not known: arg, find, dirname, optenv and eval are; for a file of "
            "yours, `trust: true` runs the package xacro"
        )

    def _argument(self, name: Value) -> str:
        if name not in self.arguments:
            raise ValueError(f"there is no <xacro:arg> {str(name)[:80]!r}")
        return self.arguments[name]

    def _find(self, package: Value) -> str:
        return str(self._packages.folder(str(package)))

    def _dirname(self) -> str:
        return str(self.file.resolve().parent)


def attribute(element: Element, name: str) -> str:
    """An attribute that an element must have.

    Raises:
        ValueError: if it has not.
    """
    if name not in element.attrib:
        raise ValueError(f"<{element.tag[:80]}> lacks {name!r}")
    return element.attrib[name]
