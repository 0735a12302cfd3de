"""What pydantic refuses is told in our words, wherever it is read."""

from __future__ import annotations

import json

import pytest
from pydantic import ValidationError

from terrain_forge.base import DataError, RecipeError, TerrainForgeError, complaint
from terrain_forge.datasets import checked_options
from terrain_forge.evaluation import find_system, read_options
from terrain_forge.recipe import load_recipe, recipe_from_json
from terrain_forge.recipe.schema import adapter
from terrain_forge.rovers import find_rover

RECIPE = {
    "name": "mini",
    "body": "moon",
    "dtm": {"kind": "flat", "size_m": [3, 2]},
    "terrain": {"spacing_m": 0.25},
}
LIDAR = {"name": "a", "kind": "lidar", "preset": "vlp-16", "range_min_m": 30, "range_max_m": 2}
FAR = "range_min_m must be below range_max_m"
LAYER = {"terrain": {"spacing_m": 0.25, "layers": [{"kind": "craters"}]}}
WRONG = [
    ({"name": ""}, "name: must not be empty"),
    ({"name": "x" * 101}, "name: takes at most 100 characters, has 101"),
    ({"sensors": [{"name": "", "kind": "imu"}]}, "sensors[0].name: must not be empty"),
    ({"sensors": [LIDAR]}, f"sensors[0]: {FAR}"),
    ({"sensors": {"add": [LIDAR]}}, f"sensors.add[0]: {FAR}"),
    (LAYER, "terrain.layers[0]: craters need a production function, a file, or both"),
    ({"exports": 5, "dataset": {"fromats": 6}}, "dataset.fromats: unknown key 'fromats'"),
    ({"exports": 5, "dataset": {"formats": 6}}, "mapping, found 5 (and 1 more error)"),
    ({"dataset": {"formats": 5, "motoin": "path"}}, "dataset.motoin: unknown key 'motoin'"),
    (
        {"dataset": {"still_s": "x", "formats": [5]}},
        'dataset.still_s: must be a valid number, found "x" (and 1 more error)',
    ),
    ({"rover": {"kind": "file"}}, "rover.file: is missing"),
    (
        {"paths": [{"route": {"points_m": [[0, 0]]}}]},
        "paths[0].name: is missing, and so is speed_m_s (and 1 more error)",
    ),
    ({"dtm": {"kind": "flat", "size_m": 80}}, "dtm.size_m: must be a list of 2, found 80"),
    ({"paths": 3}, "paths: must be a list, found 3"),
    ({"exports": ["sdf", {"usd": {}}]}, "exports[1]: must be a name; for options write a mapping"),
    ({"rover": {"kind": "file", "file": 3}}, "rover.file: must be a valid string, found 3"),
    ({"seed": list(range(100))}, "seed: must be a valid integer, found a list of 100"),
    ({"seed": {f"word{n}": n for n in range(9)}}, "found a mapping of word0, word1, word2, word3"),
    (
        {"paths": [{"name": "a", "speed_m_s": 1, "route": {"points_m": [[0, 0]]}}]},
        "paths[0].route.points_m: needs at least 2, has 1",
    ),
]


@pytest.mark.parametrize(("changes", "words"), WRONG)
def test_a_recipe_from_a_file_and_from_json_is_refused_in_the_same_words(tmp_path, changes, words):
    text = json.dumps(RECIPE | changes)
    (tmp_path / "mini.yaml").write_text(text)
    with pytest.raises(RecipeError) as from_file:
        load_recipe(tmp_path / "mini.yaml")
    with pytest.raises(RecipeError) as from_json:
        recipe_from_json(text)
    assert words in str(from_json.value)
    assert str(from_file.value) == f"{tmp_path / 'mini.yaml'}:1: {from_json.value}"
    assert not any(word in str(from_json.value) for word in ("Input should", "Value error"))
    assert "{" not in str(from_json.value)


def test_all_that_is_wrong_is_counted():
    text = json.dumps({"name": "mini", "body": "venus", "sead": 3})
    with pytest.raises(ValidationError) as caught:
        adapter().validate_json(text)
    told = complaint(caught.value, adapter(), json.loads(text))
    assert told.key == ("sead",)
    assert told.words.startswith(
        "unknown key 'sead' (did you mean 'seed'?), allowed: body, dataset"
    )
    assert told.more == 3
    assert str(told) == f"sead: {told.words} (and 3 more errors)"


@pytest.mark.parametrize(
    ("level", "words"),
    [
        (1.5, "must be less than or equal to 1, found 1.5"),
        ("high", "must be a valid number"),
        ([0, 2], "must be less than or equal to 1, found 2"),
        ({"low": 0}, "must be a valid number, found "),
    ],
)
def test_of_a_number_or_two_it_is_told_what_is_wrong(level, words):
    text = json.dumps({**RECIPE, "worlds": {"difficulty": {"level": level}}})
    with pytest.raises(ValidationError) as caught:
        adapter().validate_json(text)
    told = complaint(caught.value, adapter(), json.loads(text))
    assert told.key[:3] == ("worlds", "difficulty", "level")
    assert told.words.startswith(words)
    assert "float" not in str(told)


@pytest.mark.parametrize(
    ("misplaced", "hint"),
    [
        ({"appearance": {}}, "'appearance' (is terrain.appearance meant?), allowed: body"),
        ({"terrain": {"size_m": 3}}, "'size_m' (is dtm.size_m or tiles.size_m meant?), allowed: "),
        ({"max_fused": 1}, "'max_fused', allowed: body"),
    ],
)
def test_a_key_in_another_keys_place_is_told_its_own(misplaced, hint):
    text = json.dumps(misplaced)
    with pytest.raises(ValidationError) as caught:
        adapter().validate_json(text)
    words = complaint(caught.value, adapter(), json.loads(text)).words
    assert words.startswith(f"unknown key {hint}")


def test_other_readers_use_the_same_words(tmp_path):
    system = tmp_path / "system.yaml"
    system.write_text("comand: [x]\n")
    calls = {
        "dataset format 'kitti': camra: unknown key 'camra' (did you mean 'camera'?), allowed: "
        "camera, lidar, scans, sequence": lambda: checked_options("kitti", {"camra": "x"}),
        "dataset format 'kitti': camera: must be a valid string, found 3": (
            lambda: checked_options("kitti", {"camera": 3})
        ),
        "--set alig: unknown key 'alig' (did you mean 'align'?), allowed: align, assoc": (
            lambda: read_options(["alig=all"])
        ),
        "--set align: must be 'first_third', 'all', 'origin' or 'none', found \"x\"": (
            lambda: read_options(["align=x"])
        ),
        f"{system}: comand: unknown key 'comand' (did you mean 'command'?), allowed: about": (
            lambda: find_system(str(system))
        ),
        "rover 'morpheus': grouser: unknown key 'grouser' (did you mean 'grousers'?)": (
            lambda: find_rover("morpheus", grouser=1)
        ),
    }
    for words, call in calls.items():
        with pytest.raises(TerrainForgeError) as caught:
            call()
        assert isinstance(caught.value, RecipeError | DataError)
        assert str(caught.value).startswith(words)
