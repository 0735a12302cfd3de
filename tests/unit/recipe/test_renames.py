"""Keys that were renamed: the old ones are read, and told with file and line."""

from __future__ import annotations

import json
import warnings

import pytest

from terrain_forge import OutputError, RecipeError, World, load_recipe
from terrain_forge.base import RecipeWarning
from terrain_forge.recipe import export_orders, json_schema
from terrain_forge.recipe.renames import RENAMES
from tests.helpers.command_line import run

OLD = """schema: 1
name: old
body: mars
dtm: {kind: flat, size_m: [20, 10]}
terrain: {spacing_m: 0.25}
rocks:
  keep_out:
    - {centre_m: [1, 2], radius_m: 2}
  populations:
    - name: a
      size_frequency: {kind: golombek, k: 0.05}
      diameter_m: [0.2, 1]
      loose_m: [0.2, 0.4]
paths:
  - name: p
    route:
      kind: file
      file: track.csv
      timing: recorded
      stance: recorded
    speed_m_s: 0.1
exports:
  drake: {loose_modulus_pa: 2.0e8}
  stiff:
    kind: drake
    loose_modulus_pa: 3.0e8
  usd: {}
"""
TOLD = [
    "7: rocks.keep_out is now called exclusion_zones",
    "13: rocks.populations[0].loose_m is now called dynamic_m",
    "20: paths[0].route.stance is now called attitude",
    "23: exports.drake.loose_modulus_pa is now called dynamic_modulus_pa",
    "26: exports.stiff.loose_modulus_pa is now called dynamic_modulus_pa",
]


def renamed(text):
    for rename in RENAMES:
        text = text.replace(f"{rename.old}:", f"{rename.new}:")
    return text


def write(tmp_path, text):
    path = tmp_path / "recipe.yaml"
    path.write_text(text)
    return path


def test_old_keys_are_read_and_told_with_file_and_line(tmp_path):
    path = write(tmp_path, OLD)
    with pytest.warns(RecipeWarning) as caught:
        old = load_recipe(path)
    assert [str(warning.message) for warning in caught] == [f"{path}:{line}" for line in TOLD]
    assert {warning.filename for warning in caught} == {__file__}
    new = load_recipe(write(tmp_path, renamed(OLD)))  # a warning would be an error
    assert old.recipe == new.recipe
    assert old.lines == new.lines
    stiff = next(order for order in export_orders(old.recipe) if order.folder == "stiff")
    assert stiff.options.dynamic_modulus_pa == 3.0e8


@pytest.mark.filterwarnings("ignore::terrain_forge.base.RecipeWarning")
def test_errors_in_old_keys_have_their_line_and_the_new_name(tmp_path):
    path = write(tmp_path, OLD.replace("loose_m: [0.2, 0.4]", "loose_m: [0.2, -1]"))
    with pytest.raises(RecipeError) as caught:
        load_recipe(path)
    assert str(caught.value).startswith(f"{path}:13: rocks.populations[0].dynamic_m[1]: must be")


@pytest.mark.filterwarnings("ignore::terrain_forge.base.RecipeWarning")
@pytest.mark.parametrize("rename", RENAMES, ids=lambda rename: rename.old)
def test_both_names_are_refused(tmp_path, rename):
    start = OLD.index(f"{rename.old}:")
    line = OLD.count("\n", 0, start) + 1
    flow = OLD[start - 1] == "{"
    gap = ", " if flow else "\n" + " " * (start - OLD.rindex("\n", 0, start) - 1)
    text = f"{OLD[:start]}{rename.new}: 1{gap}{OLD[start:]}"
    path = write(tmp_path, text)
    with pytest.raises(RecipeError) as caught:
        load_recipe(path)
    message = str(caught.value)
    assert f"{rename.old!r} is the old name of {rename.new!r}: give one of them" in message
    assert message.startswith(f"{path}:{line + (not flow)}: ")


def test_keys_of_the_command_line(tmp_path):
    path = write(tmp_path, renamed(OLD))
    changes = (
        "rocks.populations.0.loose_m=[0.3, 0.4]",
        "rocks.keep_out[0].radius_m=3",
        "exports.stiff={kind: drake, loose_modulus_pa: 4.0e+8}",
    )
    with pytest.warns(RecipeWarning) as caught:
        recipe = load_recipe(path, changes=changes).recipe
    assert [str(warning.message) for warning in caught] == [
        "--set: rocks.populations[0].loose_m is now called dynamic_m",
        "--set: rocks.keep_out is now called exclusion_zones",
        "--set: exports.stiff.loose_modulus_pa is now called dynamic_modulus_pa",
    ]
    assert recipe.rocks.populations[0].dynamic_m == (0.3, 0.4)
    assert recipe.rocks.exclusion_zones[0].radius_m == 3.0
    assert recipe.exports["stiff"]["dynamic_modulus_pa"] == 4.0e8
    both = "exports.stiff={kind: drake, loose_modulus_pa: 1, dynamic_modulus_pa: 1}"
    with pytest.raises(RecipeError, match=r"--set exports\.stiff.*give one of them"):
        load_recipe(path, changes=(both,))


def saved(world, folder, old_keys):
    """A saved world whose recipe has other keys."""
    recipe = json.loads(world.site.recipe_json)
    recipe["rocks"] |= {"keep_out": recipe["rocks"].pop("exclusion_zones")} | old_keys
    text = json.dumps(recipe, sort_keys=True, separators=(",", ":"))
    world.replace(site=world.site.replace(recipe_json=text)).save(folder)
    return folder / "world" / "world.json"


def test_saved_worlds(small_world, tmp_path):
    file = saved(small_world, tmp_path, {})
    with pytest.warns(RecipeWarning) as caught:
        world = World.load(tmp_path)
    (told,) = [str(warning.message) for warning in caught]
    line = next(n for n, text in enumerate(file.read_text().splitlines(), 1) if "keep_out" in text)
    assert told == f"{file}:{line}: rocks.keep_out is now called exclusion_zones"
    assert caught[0].filename == __file__
    assert world == small_world
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert world.site.recipe == small_world.site.recipe
    saved(small_world, tmp_path, {"exclusion_zones": []})
    with pytest.raises(OutputError, match=r"world\.json: rocks\.keep_out: .* give one of them"):
        World.load(tmp_path)


def test_the_command_line_tells_each_in_one_line(tmp_path):
    track = "time,x,y,z,qw,qx,qy,qz\n0,0,0,0,1,0,0,0\n9,2,0,0,1,0,0,0\n20,4,1,0,1,0,0,0\n"
    (tmp_path / "track.csv").write_text(track)
    path = write(tmp_path, OLD)
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        done = run("check", path)
    assert done.stderr.splitlines() == [f"terrain-forge: {path}:{line}" for line in TOLD]
    assert done.returncode == 0


def test_the_schema_knows_the_new_names_alone():
    text = json.dumps(json_schema())
    for rename in RENAMES:
        assert f'"{rename.old}"' not in text
        assert f'"{rename.new}"' in text or rename.where.startswith("exports")


@pytest.mark.parametrize("rename", RENAMES, ids=lambda rename: rename.old)
def test_a_misspelt_key_is_told_from_the_new_names(tmp_path, rename):
    path = write(tmp_path, renamed(OLD).replace(f"{rename.new}:", f"{rename.new[:-1]}:"))
    with pytest.raises(RecipeError) as caught:
        export_orders(load_recipe(path).recipe)
    assert f"(did you mean {rename.new!r}?)" in str(caught.value)
    assert f" {rename.old}" not in str(caught.value)
