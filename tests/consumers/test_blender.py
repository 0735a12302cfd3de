"""Exports in Blender, where a Python with bpy is named by TERRAIN_FORGE_BLENDER_PYTHON."""

import json
import os
import subprocess

import numpy as np
import pytest

from terrain_forge.model import exporter
from tests.helpers.places import PROGRAMS
from tests.helpers.surfaces import random_points

PROBE = PROGRAMS / "blender_world.py"
PYTHON = os.environ.get("TERRAIN_FORGE_BLENDER_PYTHON", "")
EXPORTS = {
    "obj": ("mesh", {"format": "obj", "rocks": "objects"}, "world.obj"),
    "ply": ("mesh", {"format": "ply", "rocks": "none"}, "world.ply"),
    "stl": ("mesh", {"format": "stl", "rocks": "none"}, "world.stl"),
    "glb": ("glb", {"instances_min_m": 0.0, "tile_cells": 48}, "world.glb"),
    "usd": ("usd", {"tile_cells": 48}, "scene.usda"),
}


@pytest.fixture(scope="module")
def blender(small_world, tmp_path_factory):
    """What Blender says of each export, and the points that it was asked for."""
    if not PYTHON:
        pytest.skip("TERRAIN_FORGE_BLENDER_PYTHON names no Python with bpy")
    files = []
    for name, (kind, options, file) in EXPORTS.items():
        folder = tmp_path_factory.mktemp(name)
        module = exporter(kind)
        module.export(small_world, folder, options=module.Options(**options))
        files.append(str(folder / file))
    points = random_points(small_world.ground, 300, 5)
    order = json.dumps({"files": files, "points": points.tolist(), "folder": None})
    done = subprocess.run([PYTHON, PROBE], input=order, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    answers = json.loads(done.stdout.splitlines()[-1])["answers"]
    return dict(zip(EXPORTS, answers, strict=True)), points


@pytest.mark.consumer
@pytest.mark.parametrize("name", EXPORTS)
def test_blender_has_the_ground(small_world, blender, name):
    answers, points = blender
    found = np.array(answers[name]["heights"], float)
    wanted = small_world.ground.height_at(points[:, 0], points[:, 1])
    assert np.abs(found - wanted).max() < 1e-4


@pytest.mark.consumer
@pytest.mark.parametrize("name", EXPORTS)
def test_blender_has_the_dimensions(small_world, blender, name):
    answer = blender[0][name]
    west, south, east, north = small_world.ground.bounds
    assert answer["low"][:2] == pytest.approx((west, south), abs=1e-4)
    assert answer["high"][:2] == pytest.approx((east, north), abs=1e-4)
    assert answer["high"][2] >= small_world.ground.elevation.max() - 1e-4


@pytest.mark.consumer
@pytest.mark.parametrize("name", ["glb", "usd"])
def test_all_that_blender_draws_has_a_material(blender, name):
    assert blender[0][name]["bare"] == 0


@pytest.mark.consumer
@pytest.mark.parametrize("name", ["obj", "glb"])
def test_blender_has_each_rock_as_an_object(small_world, blender, name):
    names = set(blender[0][name]["names"])
    assert {f"rock_{rock}" for rock in small_world.field.id} <= names
