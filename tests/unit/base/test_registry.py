"""Parts that other packages bring: taken kinds, modules with nothing in them."""

import sys
from importlib.metadata import EntryPoint
from types import ModuleType

import pytest

from terrain_forge.base import parts, registry
from terrain_forge.paths import NamedShape
from terrain_forge.terrain import CraterProduction

FOREIGN = """
from dataclasses import dataclass
from typing import Literal
from terrain_forge.paths import NamedShape
@dataclass(frozen=True, kw_only=True)
class Mine(NamedShape):
    kind: Literal["spline"] = "spline"
"""


@pytest.fixture
def plugged(monkeypatch):
    """Installs a module of a text behind a group of entry points."""

    def install(name, text, group):
        module = ModuleType(name)
        monkeypatch.setitem(sys.modules, name, module)
        exec(text, vars(module))
        point = EntryPoint(name=name, value=name, group=group)
        monkeypatch.setattr(registry, "entry_points", lambda group: [point])

    return install


def test_kinds_of_ours_are_kept_wherever_they_stand(plugged, caplog):
    group = "terrain_forge.route_shapes"
    plugged("foreign_shape", FOREIGN, group)
    found = parts(NamedShape, "terrain_forge.paths.shapes", group, taken=["spline"])
    assert "Mine" not in {part.__name__ for part in found}
    assert "'spline' of foreign_shape is skipped: terrain_forge has that kind" in caplog.text


def test_a_module_that_brings_nothing_is_told(plugged, caplog):
    group = "terrain_forge.crater_productions"
    plugged("empty", "", group)
    assert parts(CraterProduction, "terrain_forge.terrain.cratering.productions", group)
    assert "crater production 'empty' (empty) is skipped: has no CraterProduction" in caplog.text
