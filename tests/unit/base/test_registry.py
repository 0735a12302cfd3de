"""Parts that other packages bring: taken kinds, modules with nothing in them."""

import sys
from importlib import import_module
from importlib.metadata import EntryPoint
from types import ModuleType, SimpleNamespace
from typing import get_args

import click
import pytest

from terrain_forge.base import PluginError, RecipeError, parts, registry, returning, staying
from terrain_forge.datasets import dataset_kinds
from terrain_forge.datasets.writer import RESERVED
from terrain_forge.model import sensor_kinds
from terrain_forge.paths import NamedShape
from terrain_forge.paths.named_shape import shortening
from terrain_forge.report import section_types
from terrain_forge.rocks import Golombek
from terrain_forge.rocks.populations import SizeFrequency
from terrain_forge.sensors import instrument_kinds
from terrain_forge.terminal import run_command
from terrain_forge.terrain import CraterProduction
from terrain_forge.terrain.layer import LAYERS, Layer, layer_types
from terrain_forge.validation import inspections
from tests.helpers.command_line import process_as_it_was

FOREIGN = """
from dataclasses import dataclass
from typing import Literal
from terrain_forge.paths import NamedShape
@dataclass(frozen=True, kw_only=True)
class Mine(NamedShape):
    kind: Literal["spline"] = "spline"
    def outline(self, key): return None
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


FORMAT = """
from terrain_forge.base import Spec
from terrain_forge.datasets import DatasetWriter
class Mine(DatasetWriter):
    title, Options = "mine", Spec
    kind = {!r}
    def write(self, recording, folder, options, progress): return ()
"""


@pytest.mark.parametrize("name", sorted([*RESERVED, "MAV0", "../up", ".writing", "a,b"]))
def test_a_format_that_would_be_a_recording_s_own_folder_is_skipped(plugged, caplog, name):
    plugged("foreign_format", FORMAT.format(name), "terrain_forge.datasets")
    assert dataset_kinds.__wrapped__() == dataset_kinds()
    assert "dataset 'foreign_format' (foreign_format) is skipped: Mine" in caplog.text
    assert f"{name!r}" in caplog.text
    assert "choose another name" in caplog.text


FRAME = """
from dataclasses import dataclass
from typing import Literal
import numpy as np
from terrain_forge.terrain.layer import Layer
@dataclass(frozen=True, kw_only=True)
class Good(Layer):
    kind: Literal["good_layer"] = "good_layer"
    def relief(self, *, site, window, elevation): return 0.0 * elevation
"""
CLASS = "@dataclass(frozen=True, kw_only=True)\nclass Dykes(Good):\n"
UNFIT = {
    CLASS + "    kind: str = 'dykes'": "has not `kind: Literal['dykes'] = 'dykes'`",
    CLASS + "    kind: Literal['dyke'] = 'dykes'": "has not `kind: Literal['dykes'] = 'dykes'`",
    "from __future__ import annotations\n"
    + FRAME
    + CLASS
    + "    kind: Literal['dykes'] = 'dykes'\n"
    "    height_m: Nix = 0.2": "cannot be read from a recipe: name 'Nix' is not defined",
    CLASS + "    kind: Literal['dykes'] = 'dykes'\n    heights: np.ndarray = None": "numpy.ndarray",
    "class Dykes(Good):\n    kind: Literal['dykes'] = 'dykes'": "is no @dataclass(frozen=True",
    "@dataclass(frozen=True, kw_only=True)\nclass Dykes(Layer):\n    kind: Literal['d'] = 'd'": (
        "has no relief"
    ),
}


@pytest.mark.parametrize("number", range(len(UNFIT)))
def test_a_class_that_would_not_work_is_skipped_beside_those_that_do(plugged, caplog, number):
    text, why = list(UNFIT.items())[number]
    module = f"foreign_layers_{number}"
    plugged(module, text if FRAME in text else FRAME + text, LAYERS)
    found = [part.__name__ for part in parts(Layer, "terrain_forge.terrain.layers", LAYERS)]
    assert "Good" in found
    assert "Dykes" not in found
    point = registry.entry_points(LAYERS)[0]
    (told,) = registry.skipped(point, LAYERS)
    assert why in told
    assert f"layer '{module}' ({module}) is skipped: Dykes " in caplog.text
    parts(Layer, "terrain_forge.terrain.layers", LAYERS)
    assert caplog.text.count("is skipped") == 1


LACKING = {
    (
        "terrain_forge.rocks",
        "SizeLaw",
    ): "cover_variance, cumulative_area, cumulative_number, sample",
    ("terrain_forge.paths", "NamedShape"): "outline",
    ("terrain_forge.terrain", "CraterProduction"): "law",
    ("terrain_forge.validation", "Inspection"): "checks, kind",
    ("terrain_forge.sensors", "Frames"): "calibration, measure, streams, folder, kind",
    ("terrain_forge.sensors", "Series"): "calibration, samples, streams, folder, kind",
    ("terrain_forge.datasets", "DatasetWriter"): "write, Options, kind, title",
    ("terrain_forge.report", "Section"): "blocks, kind, place, title",
    ("terrain_forge.model", "Sensor"): "title",
}


@pytest.mark.parametrize(("room", "name"), LACKING)
def test_a_base_says_what_a_part_must_have(room, name):
    base = getattr(import_module(room), name)
    words = registry.unfit(type("Empty", (base,), {})).removeprefix("has no ").split(", ")
    assert sorted(words) == sorted(LACKING[room, name].split(", "))


def test_ours_would_be_taken_from_others_too():
    found = [*layer_types(), *inspections(), *section_types(), *dataset_kinds().values()]
    found += [*instrument_kinds().values(), *sensor_kinds().values()]
    found += get_args(get_args(SizeFrequency)[0])
    assert {part.__name__: why for part in found if (why := registry.unfit(part))} == {}


def test_what_a_part_returns_is_told_as_its_own(plugged):
    """An error of ours goes on, and so does one in the plugin's own lines."""
    plugged("foreign_part", "class Part: pass\ndef bad(): return {}[0]", LAYERS)
    theirs = sys.modules["foreign_part"]
    with pytest.raises(PluginError, match=r"^layer 'x' \(foreign_part\) must return y: 'z'$"):
        with returning(theirs.Part(), "layer 'x'", "y"):
            raise KeyError("z")
    with pytest.raises(KeyError), returning(Golombek(k=0.1), "layer 'x'", "y"):
        raise KeyError("z")
    with pytest.raises(KeyError), returning(theirs, "layer 'x'", "y"):
        theirs.bad()
    with pytest.raises(RecipeError), returning(theirs, "layer 'x'", "y"):
        raise RecipeError("z")


def test_an_error_of_a_plugin_names_it(plugged, capsys):
    """Also one that it meets in another library; one of ours stays ours."""
    text = (
        "def bad(): return {}['a\\nb']\ndef parse(text): return int(text)\ndef ours(f): return f()"
        "\ndef full(): raise MemoryError"
    )
    plugged("foreign_layer", text, "terrain_forge.layers")
    foreign = sys.modules["foreign_layer"]
    for broken, where in ((foreign.bad, "line 1"), (lambda: foreign.parse("x"), "line 2")):
        assert run_command(click.Command("build", callback=broken), []) == 3
        told = capsys.readouterr().err
        assert told.startswith(f"terrain-forge: layer 'foreign_layer' (foreign_layer, {where}) fai")
        assert told.count("\n") == 1
    assert run_command(click.Command("build", callback=foreign.full), []) == 3
    place = "layer 'foreign_layer' (foreign_layer, line 4) failed: MemoryError"
    told = f"terrain-forge: the system gives no more memory: {place}\n"
    assert capsys.readouterr().err == told
    broken = click.Command("build", callback=lambda: foreign.ours(lambda: shortening("a", 1.0)))
    assert run_command(broken, []) == 3
    assert "internal error, please report it" in capsys.readouterr().err


def test_who_removes_the_current_folder_is_told(tmp_path, monkeypatch):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    with pytest.raises(PluginError, match="a layer changed the current folder"), staying("a layer"):
        (tmp_path / "here").rmdir()
