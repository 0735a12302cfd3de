"""Tests use what is public: a name with a leading underscore may change without notice."""

from __future__ import annotations

import ast
import re

import pytest

from tests.helpers.places import ROOT, parsed

FILES = sorted((ROOT / "tests").rglob("*.py"))
PRIVATE = re.compile(r"(^|\.)_[A-Za-z]")
SPECIFIED = {"_replace", "_asdict", "_fields", "_make", "_exit", "_repr_html_"}
"""Of named tuples, of `os` and of notebooks: public in spite of their names."""


def reached(tree):
    """Private names of our package that a module imports, reads or patches."""
    nodes = [*ast.walk(tree)]
    ours = {
        alias.asname or alias.name
        for node in nodes
        if isinstance(node, (ast.Import, ast.ImportFrom))
        for alias in node.names
        if "terrain_forge" in (getattr(node, "module", None) or alias.name)
    }
    for node in nodes:
        if isinstance(node, ast.ImportFrom) and "terrain_forge" in (node.module or ""):
            yield from (alias.name for alias in node.names if PRIVATE.match(alias.name))
        elif isinstance(node, ast.Attribute) and PRIVATE.match(node.attr):
            own = isinstance(node.value, ast.Name) and node.value.id in ("self", "cls")
            if not own and node.attr not in SPECIFIED:
                yield ast.unparse(node)
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            if node.func.attr in ("setattr", "getattr", "delattr"):
                texts = [a.value for a in node.args[:2] if isinstance(a, ast.Constant)]
                named = ast.unparse(node.args[0])
                if "terrain_forge" in named or named.split(".")[0] in ours:
                    yield from (t for t in texts if isinstance(t, str) and PRIVATE.search(t))


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_no_private_name_is_used(path):
    assert list(reached(parsed(path))) == []
