"""Bad recipes: one clear line with file, line, key, what was found and what is allowed."""

from __future__ import annotations

import re
from dataclasses import replace
from enum import Enum
from pathlib import Path

import numpy as np
import pytest

from terrain_forge import (
    DataError,
    RecipeError,
    TerrainForgeError,
    load_recipe,
    plan,
    save_recipe,
)
from terrain_forge.recipe import export_orders, recipe_from_json, recipe_json
from terrain_forge.rovers import FileRover
from tests.helpers.places import ROOT

HELLO = (ROOT / "recipes" / "hello.yaml").read_text(encoding="utf-8")


def write(folder, old="", new=""):
    """hello.yaml with one change, beside a link to the samples."""
    assert not old or old in HELLO, old
    text = HELLO.replace("../dtm_samples", str(ROOT / "dtm_samples")).replace(old, new, 1)
    path = folder / "recipe.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def prepare(path):
    """What a build does before it writes anything."""
    file = load_recipe(path)
    try:
        export_orders(file.recipe)
        plan(file.recipe, folder=file.folder)
    except TerrainForgeError as error:
        raise RecipeError(file.locate(error)) from None


def complaint(path):
    """What a user reads."""
    with pytest.raises(TerrainForgeError) as caught:
        prepare(path)
    message = str(caught.value)
    assert "\n" not in message
    return message


def line_of(path, text):
    return next(n for n, line in enumerate(path.read_text().splitlines(), 1) if text in line)


@pytest.mark.slow
@pytest.mark.parametrize("recipe", sorted((ROOT / "recipes").glob("*.yaml")), ids=lambda p: p.stem)
def test_rocks_of_shipped_recipes_can_be_packed(recipe):
    plan(recipe)


@pytest.mark.parametrize(
    "recipe",
    [
        pytest.param(path, marks=[pytest.mark.slow] if path.stem == "gale_short" else [])
        for path in sorted((ROOT / "recipes").glob("*.yaml"))
    ],
    ids=lambda p: p.stem,
)
@pytest.mark.usefixtures("few_shapes")
def test_shipped_recipes_are_sound(recipe):
    file = load_recipe(recipe)
    site = plan(file.recipe, folder=file.folder)
    # Laws and craters that rocks lie around are written out; planned again, nothing changes.
    assert replace(site.recipe, rocks=file.recipe.rocks) == file.recipe
    if site.recipe != file.recipe:
        assert plan(site.recipe, folder=file.folder).recipe == site.recipe
    assert recipe_from_json(recipe_json(file.recipe)) == file.recipe


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("spacing_m: 0.1", "spacing: 0.1", ["'spacing'", "did you mean 'spacing_m'"]),
        ("body: mars", "boddy: mars", ["'boddy'", "did you mean 'body'"]),
        ("diameter_m: [0.1, 0.5]", "diameters_m: [0.1, 0.5]", ["did you mean 'diameter_m'"]),
        ("body: mars", "body: pluto", ["'mars', 'mercury' or 'moon'", "pluto"]),
        ("spacing_m: 0.1", "spacing_m: 0", ["greater than or equal to 0.001", "found 0"]),
        ("spacing_m: 0.1", "spacing_m: -0.1", ["greater than or equal to 0.001", "-0.1"]),
        ("spacing_m: 0.1", "spacing_m: fine", ["number", '"fine"']),
        ("spacing_m: 0.1", "spacing_m: '0.1'", ["number", '"0.1"']),
        ("spacing_m: 0.1", "spacing_m: .nan", ["finite"]),
        ("spacing_m: 0.1", "spacing_m: 0.3", ["whole number", "0.3 m"]),
        ("kind: fractal", "kind: fractual", ["did you mean 'fractal'", "displacement_map"]),
        ("kind: golombek, k: 0.05", "kind: golombek, k: 7", ["k", "found 7"]),
        ("diameter_m: [0.1, 0.5]", "diameter_m: [0.5, 0.1]", ["0.5", "0.1", "larg"]),
        ("name: boulders", "name: pebbles", ["pebbles"]),
        ("name: hello-mars", "name: ../../etc", ["name", "../../etc"]),
        ("size_m: [40, 40]", "size_m: [4000, 40]", ["416 × 416"]),
        ("offset_m: [0, 0]", "offset_m: [190, 0]", ["416 × 416", "gale_floor"]),
        ("{offset_m: [0, 0]}", "{offset_m: [0, 0], crs: [1, 2]}", ["one of", "offset_m and crs"]),
        ("gale_floor_synthetic.tif", "missing.tif", ["no such file", "missing.tif"]),
        ("gale_floor_synthetic.tif", "README.md", ["not a raster"]),
        ("source: ", "url: ftp:/",
         ["dtm.url: must be an address that begins with http:// or https://", '"ftp:/']),
        ("[9, -5]", "[29, -5]", ["leaves the terrain", "'loop'"]),
        ("rover: morpheus", "rover: morfeus", ["did you mean 'morpheus'"]),
        ("rover: morpheus", "rover: {kind: skid4, model: big}", ["rover.model", "'detailed'"]),
        ("rover: morpheus", "rover: {kind: file, file: a, wheel: [b]}",
         ["rover.wheel: unknown key", "did you mean 'wheels'"]),
        ("rover: morpheus", "rover: {kind: file, file: a, packages: [b]}",
         ["rover.packages: must be a mapping"]),
        ("rover: morpheus", "rover: {kind: file}", ["rover.file: is missing"]),
        ("rover: morpheus", "rover: {kind: file, file: nowhere.urdf}", ["no such file: nowhere"]),
        ("exports: [sdf, mjcf, usd]", "exports: [sdf, blend]", ["blend", "mjcf, rover, sdf, usd"]),
        ("exports: [sdf, mjcf, usd]", "exports: {truth: {kind: sdf}}", ["'truth'"]),
        ("exports: [sdf, mjcf, usd]", "exports: {sdf: {colour: 1}}", ["unknown key 'colour'"]),
        ("drive: loop", "drive: long", ["'long'", "loop"]),
        ("schema: 1 ", "schema: 2 ", ["schema", "found 2"]),
        ("diameter_m: [0.5, 2.0]", "diameter_m: [30, 40]", ["half the site", "populations[1]"]),
        ("rms_deg: 0.2", "rms_deg: 1.0e9", ["rms_deg", "20"]),
        ("cutoff_hz: 2", "cutoff_hz: 2000", ["half the rate", "paths[0].shake"]),
        ("speed_m_s: 0.38", "speed_m_s: 1.0e-12", ["speed_m_s", "0.001"]),
        ("rate_hz: 12", "rate_hz: 0", ["rate_hz"]),
        ("[8, 6], [0, 9], [-8, 6]", "[9, -5], [0, 9]", ["points 2 and 3", "paths[0].route"]),
        ("exports: [sdf, mjcf, usd]", "exports: {../x: {kind: sdf}}", ["a name without"]),
        ("exports: [sdf, mjcf, usd]", "exports: {sdf: }", ["exports.sdf", "mapping", "nothing"]),
        ("exports: [sdf, mjcf, usd]", "exports: sdf", ["a list or a mapping", '"sdf"']),
        ("exports: [sdf, mjcf, usd]", "exports: {manifest.json: {kind: sdf}}", ["part of every"]),
        ("exports: [sdf, mjcf, usd]", "exports: {sdf: {flavr: gz}}", ["did you mean 'flavour'"]),
        ("name: hello-mars", "name: .git", ["leading dot"]),
        ("seed: 42", "? [a, b]\n: 42", ["a key must be a word"]),
        ("rover: morpheus", "rover:", ["rover", "nothing"]),
        ("seed: 42", "seed: 4.2", ["seed", "found 4.2"]),
        ("seed: 42", "seed: 42\ndataset: {gravity_m_s2: .nan}",
         ["gravity_m_s2: must be 'body' or a finite number, found NaN"]),
        ("seed: 42", "seed: 42\ndataset: {formats: {kitti: {scans: [1, .inf]}}}",
         ["dataset.formats.kitti.scans: must be a finite number"]),
        ("exports: [sdf, mjcf, usd]", "exports: {sdf: {friction: .nan}}",
         ["exports.sdf.friction: must be a finite number, found NaN"]),
        ("exports: [sdf, mjcf, usd]", "exports: {world: {kind: mjcf, friction: -.inf}}",
         ["exports.world.friction: must be a finite number, found -Infinity"]),
    ],
)  # fmt: skip
def test_one_line_with_file_line_and_key(tmp_path, old, new, words):
    path = write(tmp_path, old, new)
    message = complaint(path)
    assert message.startswith(str(path))
    for word in words:
        assert word in message, message


@pytest.mark.parametrize(
    ("old", "new"),
    [("spacing_m: 0.1", "spacing_m: 0"), ("body: mars", "boddy: mars"), ("k: 0.05}", "k: -1}")],
)
def test_the_line_is_right(tmp_path, old, new):
    path = write(tmp_path, old, new)
    found = int(re.match(r".*?\.yaml:(\d+):", complaint(path)).group(1))
    assert found == line_of(path, new)


BEGINNING = "schema: 1\nname: a\nbody: mars\n"
FLAT = f"{BEGINNING}dtm: {{kind: flat, size_m: [4, 4]}}\n"
GROUND = "terrain: {spacing_m: 1}\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("name: !!python/object/apply:os.system [ls]", ["tag", "plain data"]),
        ("name: !mine x", ["tag"]),
        ("seed: &a 42", [":1: seed: YAML anchor"]),
        ("name: [", ["not YAML"]),
        ("dtm:\n\tkind: flat", [":2: not YAML", "indent with spaces"]),
        ("name: a\nname: b", ["duplicate", ":2"]),
        ("- 1", ["mapping", "found a list"]),
        ("", ["mapping", "found nothing"]),
        ("just text", ["mapping", "found a text"]),
        (f"{BEGINNING}{GROUND}dtm:\n", ["dtm", "a mapping", "nothing"]),
        (f"{BEGINNING}{GROUND}dtm: [1]\n", ["dtm", "a mapping", "[1]"]),
        (f"{FLAT}terrain: 3\n", ["terrain", "a mapping", "3"]),
        (f"{BEGINNING}dtm: {{kind: flat, size_m: [4]}}\n{GROUND}", ["dtm.size_m"]),
        (f"{FLAT}{GROUND}paths: 7\n", ["a list"]),
        (f"{BEGINNING}dtm: {{kind: flt, size_m: [4, 4]}}\n{GROUND}", ["'flt'", "flat"]),
    ],
)
def test_recipes_are_plain_data_and_mappings(tmp_path, text, words):
    path = tmp_path / "recipe.yaml"
    path.write_text(text)
    message = complaint(path)
    for word in words:
        assert word in message, message


def test_file_that_is_missing_or_binary(tmp_path):
    assert "no such file" in complaint(tmp_path / "none.yaml")
    write(tmp_path).rename(tmp_path / "gale_floor.yaml")
    assert complaint(tmp_path / "gale_flor.yaml").endswith("(did you mean 'gale_floor.yaml'?)")
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00\x80")
    assert "text" in complaint(tmp_path / "binary.yaml")
    assert str(tmp_path) in complaint(tmp_path)


def test_changes_of_the_command_line(tmp_path):
    path = write(tmp_path)
    changes = ("terrain.spacing_m=0.2", "rocks.populations.1.diameter_m=[0.6, 1.0]", "seed=7")
    recipe = load_recipe(path, changes=changes).recipe
    assert recipe.terrain.spacing_m == 0.2
    assert recipe.rocks.populations[1].diameter_m == (0.6, 1.0)
    assert recipe.seed == 7
    name = recipe.rocks.populations[1].name
    changes = (f"rocks.populations.{name}.diameter_m=[0.6, 1.0]",)
    assert load_recipe(path, changes=changes).recipe.rocks.populations[1].diameter_m == (0.6, 1.0)
    with pytest.raises(RecipeError, match=r"there is no place 'rocks\.populations\.none\.k'"):
        load_recipe(path, changes=("rocks.populations.none.k=1",))
    for bad in ("terrain.spacing_m", "=3"):
        with pytest.raises(RecipeError, match="--set"):
            load_recipe(path, changes=(bad,))
    listed = r"rocks\.populations has 0 \(pebbles\), 1 \(boulders\)"
    for key, why in (
        ("rocks.populations.9.name", listed),
        ("rocks.populations.-1.name", listed),
        ("rocks.populations.boulder.name", listed + r" \(did you mean 'boulders'\?\)"),
        ("rocks.populations.+1", listed),
        ("name.deep", "name is a text, which has no keys"),
        ("seed.deep.er", "seed is a number, which has no keys"),
    ):
        told = f"there is no place '{re.escape(key)}' in the recipe: {why}$"
        with pytest.raises(RecipeError, match=told):
            load_recipe(path, changes=(f"{key}=x",))
    with pytest.raises(RecipeError, match=r"terrain is true or false, which has no keys$"):
        load_recipe(path, changes=("terrain=true", "terrain.deep=x"))
    for change, wrong in (
        ("terrain.spacing_m=-1", r"terrain\.spacing_m: must be greater"),
        ("terrain={layers: []}", r"terrain\.spacing_m: is missing"),
        ("seed=[1", "the value is not YAML: expected ',' or ']'"),
        ("body=mras", r"""body: must be .*, found "mras" \(did you mean 'mars'\?\)"""),
        ("rocks.populations.1.name=3", r"rocks\.populations\[1\]\.name: must be"),
        ("rocks.populations.1.size_frequency.kind=golombk", r"rocks.*unknown kind 'golombk'"),
        ("terrian.spacing_m=0.2", r"terrian: unknown key 'terrian'"),
    ):
        with pytest.raises(RecipeError, match=f"^--set {re.escape(change)}: {wrong}"):
            load_recipe(path, changes=("seed=3", change))
    twice = r"^--set seed=3 and --set seed=4: give seed once"
    with pytest.raises(RecipeError, match=twice):
        load_recipe(path, changes=("seed=3", "body=moon", "seed=4"))
    file = load_recipe(path, changes=("exports=[usb]",))
    with pytest.raises(RecipeError, match=r"usb.*did you mean 'usd'\?") as caught:
        export_orders(file.recipe)
    assert file.locate(caught.value).startswith("--set exports=[usb]: exports.usb: unknown")


def test_a_saved_recipe_that_is_no_json_is_one_line():
    with pytest.raises(DataError, match=r"its recipe is no JSON: Expecting .* column 14"):
        recipe_from_json('{"name": "a" "b"}')


def test_a_recipe_that_cannot_be_written_leaves_the_file_as_it_was(tmp_path):
    path = write(tmp_path)
    before = path.read_text(encoding="utf-8")
    with pytest.raises(RecipeError, match="surrogates"):
        save_recipe(replace(load_recipe(path).recipe, name="\ud800"), path)
    assert path.read_text(encoding="utf-8") == before


def test_options_made_in_python_are_as_finite_as_those_of_a_file():
    nowhere = {"sdf": {"friction": float("nan")}}
    recipe = replace(load_recipe(ROOT / "recipes" / "hello.yaml").recipe, exports=nowhere)
    with pytest.raises(RecipeError, match=r"exports\.sdf\.friction: must be a finite number"):
        recipe.sound()


@pytest.mark.parametrize(
    ("given", "read"),
    [
        ({"glb": {"a": Path("b/c")}}, {"glb": {"a": "b/c"}}),
        ({"glb": {"a": Enum("Form", {"b": "c"})("c")}}, {"glb": {"a": "c"}}),
        ({"glb": {"a": {1.5}}}, {"glb": {"a": [1.5]}}),
        ({"glb": {"a": {np.int64(1): np.float32(0.5)}}}, {"glb": {"a": {"1": 0.5}}}),
        ({Path("glb"): {"a": {(1, 2): 3}}}, {"glb": {"a": {"1,2": 3}}}),
        ({"glb"}, ("glb",)),
    ],
)
def test_values_made_in_python_are_what_they_are_in_a_file(given, read):
    recipe = replace(load_recipe(ROOT / "recipes" / "hello.yaml").recipe, exports=given)
    assert recipe.sound().exports == read


def test_a_file_may_be_named_by_a_path():
    assert FileRover(file=Path("a/b.urdf")).sound().file == "a/b.urdf"
