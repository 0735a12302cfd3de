"""YAML with no more in it than can be read in a moment."""

from __future__ import annotations

from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.composer import Composer, ComposerError

MAX_DEPTH = 50
"""Mappings and lists within each other."""
MAX_NODES = 40_000
"""Mappings, lists, keys and values, each of which takes time to read."""


class _Composer(Composer):
    """Makes nodes of text."""

    _count = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        self._count += 1
        if self._count > MAX_NODES:
            problem = f"more than {MAX_NODES:,} keys and values; long lists may stand in files"
            raise ComposerError(None, None, problem, self.parser.peek_event().start_mark)
        return super().compose_node(parent, index)


def yaml_reader(constructor: type) -> YAML:
    """A reader of YAML whose values a constructor of ruamel.yaml makes, within these bounds."""
    yaml = YAML(typ="safe", pure=True)
    yaml.Composer, yaml.Constructor = _Composer, constructor
    yaml.max_depth = MAX_DEPTH + 1  # the whole is one
    return yaml
