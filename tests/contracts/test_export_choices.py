"""Each choice that an exporter offers, alone: what it writes is read back and holds the world."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from typing import Any, Literal, get_args, get_origin, get_type_hints

import pytest

from terrain_forge.base import RecipeError
from terrain_forge.building import write_export
from terrain_forge.model import exporter, exporter_names
from terrain_forge.recipe import ExportOrder
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
def test_it_is_read_back(kind, choice, small_world, tmp_path):
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
