"""Every exporter that is installed, with worlds of no rock, one and many."""

from __future__ import annotations

import re

import numpy as np
import pytest

from terrain_forge.model import exporter, exporter_names
from terrain_forge.rovers import find_rover
from tests.helpers.ground_pictures import detailed


def files(folder):
    """The bytes of all files by their paths."""
    return {p.relative_to(folder): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def tiled(module):
    """Options for four tiles, where the format has tiles."""
    names = {"tile_cells": 48, "tiles": "tiled"}
    found = module.Options.__dataclass_fields__
    return module.Options(**{name: value for name, value in names.items() if name in found})


@pytest.fixture(scope="module")
def worlds_of(small_world):
    """Worlds by the number of their rocks, with dynamic ones and visual-only ones among many."""
    world = small_world.replace(rover=find_rover("skid4"))
    row = np.arange(len(world.field))
    dynamic = row % 3 == 0
    many = world.field.replace(dynamic=dynamic, collides=dynamic | (row % 5 > 0))
    world = detailed(world)
    return {
        "none": world.replace(field=world.field.select(row < 0), trajectories=()),
        "one": world.replace(field=world.field.select(row == 5)),
        "many": world.replace(field=many),
    }


@pytest.mark.parametrize("kind", exporter_names())
@pytest.mark.parametrize("rocks", ["none", "one", "many"])
def test_an_export_is_whole_and_repeats(worlds_of, tmp_path, kind, rocks):
    """Its files are those that it names, all in its folder; its losses are sentences."""
    module, world = exporter(kind), worlds_of[rocks]
    before = world.replace()
    reports = []
    for name in ("one", "two"):
        (tmp_path / name / "export").mkdir(parents=True)
        reports.append(module.export(world, tmp_path / name / "export", options=tiled(module)))
    first, second = (files(tmp_path / name) for name in ("one", "two"))
    assert first.keys() == second.keys()
    assert [str(path) for path in first if first[path] != second[path]] == []
    assert reports[0] == reports[1]
    within = {path.relative_to("export") for path in first if path.parts[0] == "export"}
    assert len(within) == len(first) > 0
    assert set(reports[0].files) == within
    assert sorted({p.name for p in tmp_path.iterdir()}) == ["one", "two"]
    assert all(len(content) > 0 for content in first.values())
    for loss in reports[0].losses:
        assert not loss.split()[0].islower(), loss
        assert loss.endswith("."), loss
        assert "  " not in loss, loss
        assert rocks != "none" or not re.search(r"\brocks?\b", loss, re.IGNORECASE), loss
    assert world == before


@pytest.mark.parametrize("kind", exporter_names())
def test_no_file_names_the_place_where_it_was_written(worlds_of, tmp_path, kind):
    module = exporter(kind)
    module.export(worlds_of["many"], tmp_path, options=tiled(module))
    for path, content in files(tmp_path).items():
        assert str(tmp_path).encode() not in content, path
