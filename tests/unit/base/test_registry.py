"""Parts that other packages bring: taken kinds, modules with nothing in them."""

import sys
from importlib.metadata import EntryPoint
from types import ModuleType, SimpleNamespace

import click
import pytest

from terrain_forge.base import parts, registry
from terrain_forge.paths import NamedShape
from terrain_forge.paths.named_shape import shortening
from terrain_forge.terminal import run_command
from terrain_forge.terrain import CraterProduction
from tests.helpers.command_line import process_as_it_was

FOREIGN = """
from dataclasses import dataclass
from typing import Literal
from terrain_forge.paths import NamedShape
@dataclass(frozen=True, kw_only=True)
class Mine(NamedShape):
    kind: Literal["spline"] = "spline"
"""


@pytest.fixture(autouse=True)
def _process():
    with process_as_it_was():
        yield


@pytest.fixture
def plugged(monkeypatch):
    """Installs a module of a text behind a group of entry points."""

    def install(name, text, group):
        module = ModuleType(name)
        monkeypatch.setitem(sys.modules, name, module)
        exec(text, vars(module))
        point = EntryPoint(name=name, value=name, group=group)
        monkeypatch.setattr(registry, "entry_points", lambda group: [point])
        package = SimpleNamespace(entry_points=[point])
        monkeypatch.setattr(registry, "distributions", lambda: [package])

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


def test_an_error_of_a_plugin_names_it(plugged, capsys):
    """Also one that it meets in another library; one of ours stays ours."""
    text = (
        "def bad(): return {}['a\\nb']\ndef parse(text): return int(text)\ndef ours(f): return f()"
    )
    plugged("foreign_layer", text, "terrain_forge.layers")
    foreign = sys.modules["foreign_layer"]
    for broken, where in ((foreign.bad, "line 1"), (lambda: foreign.parse("x"), "line 2")):
        assert run_command(click.Command("build", callback=broken), []) == 3
        told = capsys.readouterr().err
        assert told.startswith(f"terrain-forge: layer 'foreign_layer' (foreign_layer, {where}) fai")
        assert told.count("\n") == 1
    broken = click.Command("build", callback=lambda: foreign.ours(lambda: shortening("a", 1.0)))
    assert run_command(broken, []) == 3
    assert "internal error, please report it" in capsys.readouterr().err
