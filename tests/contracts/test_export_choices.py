"""Each choice that an exporter offers, alone: what it writes is read back and holds the world."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from typing import Any, Literal, get_args, get_origin, get_type_hints

import pytest

from terrain_forge.base import RecipeError
from terrain_forge.building import write_export
from terrain_forge.making import plan
from terrain_forge.model import exporter, exporter_names
from terrain_forge.pipeline import realise
from terrain_forge.recipe import ExportOrder
from terrain_forge.validation import probe
from terrain_forge.validation.suite import conformance, quick_checks


def choices(options: Any) -> Iterator[dict[str, Any]]:
    """Values of its fields that have a few, but for the defaults."""
    types = get_type_hints(options)
    for field in fields(options):
        of = types[field.name]
        few = get_args(of) if get_origin(of) is Literal else (False, True) if of is bool else ()
        for value in few:
            if field.name != "kind" and value != field.default:
                yield {field.name: value}


KINDS = [kind for kind in exporter_names() if kind != "rover"]  # which holds no world
CHOICES = [(kind, one) for kind in KINDS for one in choices(exporter(kind).Options)]


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "choice"), CHOICES, ids=lambda one: str(one))
def test_it_is_read_back(kind, choice, small_world, tmp_path, monkeypatch):
    monkeypatch.delenv(probe.VARIABLE, raising=False)  # Newton cuts hulls of these shapes down
    module = exporter(kind)
    try:
        options = module.Options(**choice)
        options.refuse_idle()
    except RecipeError as error:
        pytest.skip(f"it wants others beside it: {error}")
    order = ExportOrder(folder=kind, kind=kind, exporter=module, options=options)
    export = write_export(small_world, tmp_path, order)
    entries = conformance(small_world, tmp_path, [export], points=400)
    found = [entry for entry in entries if entry.export == kind]  # not of the paths' own files
    checks = [entry.check for entry in found if entry.check]
    checks += quick_checks(small_world, tmp_path, [export], points=400)
    assert [check for check in checks if not check.passed] == []
    assert checks


FLAT = """
name: near
body: mars
dtm: {kind: flat, size_m: [16, 12]}
terrain: {spacing_m: 0.25}
rocks:
  library: {shapes: 6, seed: 0, families: [slab]}
  populations:
    - {name: large, size_frequency: {kind: power_law, number_per_m2: 0.05, exponent: 2.2},
       diameter_m: [0.25, 1]}
paths: [{name: way, speed_m_s: 0.3, route: {kind: spline, points_m: [[-5, 0], [5, 0]]}}]
exports: []
"""


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["usd", "glb", "sdf"])
def test_close_meshes_of_rocks_may_be_off_by_what_they_are(kind, tmp_path):
    path = tmp_path / "near.yaml"
    path.write_text(FLAT)
    world = realise(plan(path))
    module = exporter(kind)
    options = module.Options(close_within_m=6.0)
    order = ExportOrder(folder=kind, kind=kind, exporter=module, options=options)
    export = write_export(world, tmp_path, order)
    checks = [e.check for e in conformance(world, tmp_path, [export], points=400) if e.check]
    checks += quick_checks(world, tmp_path, [export], points=400)
    own = [check for check in checks if check.name.startswith(kind)]
    assert own
    assert [check for check in own if not check.passed] == []
