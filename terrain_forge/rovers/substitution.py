"""What stands in a xacro's texts: `${expression}` and `$(command …)`."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from ruamel.yaml.constructor import ConstructorError, SafeConstructor
from ruamel.yaml.error import YAMLError

from terrain_forge.base import yaml_reader
from terrain_forge.rovers.bounds import read_file
from terrain_forge.rovers.expressions import FUNCTIONS, Budget, Scope, Value, evaluate, literal
from terrain_forge.rovers.packages import Packages

_PIECE = re.compile(
    r"(?P<escaped>\$\$+[{(])|\$\{(?P<expression>[^}]*)\}"
    r"|\$\((?P<command>eval\s(?:[^()]|\((?:[^()]|\([^()]*\))*\))*|[^)]*)\)"
    r"|(?P<text>[^$]+|\$(?=[^{($])|\$$)"
)
_LONGEST = 100_000
"""Characters of one text."""
MOST_YAML = 2**18
"""Bytes of a file of YAML."""
_DEAR = 40
"""How much longer a character of YAML takes to read than one of XML."""
_UNITS = {
    "radians": 1.0, "degrees": math.pi / 180.0, "meters": 1.0, "millimeters": 0.001,
    "foot": 0.3048, "inches": 0.0254,
}  # fmt: skip
_DEEPEST = 50
"""Properties that are made of properties."""


class _Constructor(SafeConstructor):
    """Makes values of YAML, with xacro's units; no merges, by which little text becomes much."""

    def flatten_mapping(self, node: Any) -> None:
        if any(key.tag == "tag:yaml.org,2002:merge" for key, _ in node.value):
            raise ConstructorError(None, None, "merges (<<) are not read", node.start_mark)


def _in_unit(factor: float, constructor: _Constructor, node: Any) -> float:
    """A number, or an expression of one, in a unit."""
    return factor * float(evaluate(constructor.construct_scalar(node), {}))


for _unit, _factor in _UNITS.items():
    _Constructor.add_constructor(f"!{_unit}", partial(_in_unit, _factor))


class Substitution:
    """Makes the values of texts.

    Args:
        packages: Finds what `$(find …)` names.
    """

    def __init__(self, packages: Packages) -> None:
        self.file = Path()
        """The file that is being expanded."""
        self.arguments: dict[str, str] = {}
        """Values of `$(arg …)`."""
        self.budget = Budget()
        """What it may cost."""
        self._packages = packages
        self._read: dict[Path, Value] = {}
        self._depth = 0

    @property
    def files(self) -> tuple[Path, ...]:
        """The files of YAML that were read."""
        return tuple(self._read)

    def text(self, told: str, names: Scope) -> str:
        """A text with everything in it substituted."""
        text = str(self.value(told, names))
        self.budget.spend("characters", len(text))
        return text

    def value(self, told: str, names: Scope) -> Value:
        """The same; where the text is one expression alone, its value.

        Raises:
            ValueError: for what is wrong in it.
        """
        self.budget.spend("characters", len(told))
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
        self.budget.spend("characters", len(text))
        return text

    def _piece(self, found: re.Match[str], names: Scope) -> Value:
        if found["expression"] is not None:
            expression = self.text(found["expression"], names)
            functions = FUNCTIONS | {
                "xacro.arg": self._argument,
                "xacro.load_yaml": self._yaml,
                "load_yaml": self._yaml,
            }
            return evaluate(expression, names, budget=self.budget, functions=functions)
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
                own = Scope(values={**self.arguments, "true": True, "false": False})
                functions: dict[str, Callable[..., Value]] = {
                    **FUNCTIONS,
                    "arg": lambda name: literal(self._argument(name)),
                    "find": self._find,
                    "dirname": self._dirname,
                    "optenv": lambda _, default="": default,
                }
                expression = told.strip().removeprefix("eval")
                return str(evaluate(expression, own, budget=self.budget, functions=functions))
        raise ValueError(
            f"$({told[:80]}) is not known: arg, find, dirname, optenv and eval are; for a file of "
            "yours, `trust: true` runs the package xacro"
        )

    def _argument(self, name: Value) -> str:
        if name not in self.arguments:
            raise ValueError(f"there is no <xacro:arg> {str(name)[:80]!r}")
        return self.arguments[name]

    def _yaml(self, name: Value) -> Value:
        """What a file of YAML says that lies below the package, as the package xacro reads it."""
        path = self._packages.path(str(name), self.file.parent)
        if path not in self._read:
            text = read_file(path, path.name, most=MOST_YAML).decode()
            self.budget.spend("characters", _DEAR * len(text))
            reader = yaml_reader(_Constructor)
            reader.version = (1, 1)  # type: ignore[assignment]  # in which `yes` is true
            try:
                self._read[path] = reader.load(text)
            except YAMLError as error:
                raise ValueError(f"{path.name}: {' '.join(str(error).split())[:200]}") from None
        return self._read[path]

    def _find(self, package: Value) -> str:
        return str(self._packages.folder(str(package)))

    def _dirname(self) -> str:
        return str(self.file.resolve().parent)
