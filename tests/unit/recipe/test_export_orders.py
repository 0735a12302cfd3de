"""The exports of a recipe before any work: names, kinds, options, folders said twice."""

import json
from dataclasses import replace

import pytest
from click.testing import CliRunner

from terrain_forge.base import ExportError, OutputError, RecipeError
from terrain_forge.cli import cli
from terrain_forge.model import check_capacity, exporter, exporter_names
from terrain_forge.pipeline import check
from terrain_forge.recipe import export_orders, load_recipe, recipe_json

RECIPE = """schema: 1
name: orders
body: moon
dtm: {kind: flat, size_m: [6, 4]}
terrain: {spacing_m: 0.25}
exports:
"""
SAND = [
    "      size_frequency: {kind: power_law, exponent: 3, number_per_m2: 1.0e-4}",
    "      diameter_m: [0.01, 0.02]",
]
WRONG = [
    (["  'a,b': {kind: usd}"], 7, "exports.a,b", "'a,b' cannot name a folder"),
    (["  usd: {}", "  Stage: {kind: usd}"], 8, "exports.Stage", "same options as 'usd'"),
    (["  a: {kind: usd}", "  A: {kind: glb}"], 8, "exports.A", "the same, case aside"),
    (["  usd: {kind: 3}"], 7, "exports.usd.kind", "must be the name of an exporter, found 3"),
    (["  usd: {kind: [usd]}"], 7, "exports.usd.kind", "must be the name of an exporter"),
    (["  usd:", "    friction: -1"], 8, "exports.usd.friction", "greater than or equal to 0"),
    (
        ["  m: {kind: mesh,", "    format: stl,", "    rocks: objects}"],
        9,
        "exports.m.rocks",
        "stl has",
    ),
    (["  m:", "    kind: mesh", "    format: stl", "    texture_pixels: 9"], 10, "", "no textures"),
    (
        ["  geotiff:", "    products: [slope, slope]"],
        8,
        "exports.geotiff.products",
        "slope is named",
    ),
]

MANIFEST = '{"terrain_forge": "0", "format": 2, "outputs": {}, "varying": [], "exports": {}}'


def found(tmp_path, lines, recipe=RECIPE):
    path = tmp_path / "recipe.yaml"
    path.write_text(recipe + "\n".join(lines) + "\n", encoding="utf-8")
    return load_recipe(path)


@pytest.mark.parametrize(("lines", "line", "key", "words"), WRONG)
def test_what_cannot_be_meant_is_refused_where_it_stands(tmp_path, lines, line, key, words):
    file = found(tmp_path, lines)
    with pytest.raises(RecipeError) as caught:
        export_orders(file.recipe)
    message = file.locate(caught.value)
    assert message.startswith(f"{file.path}:{line}: {key}")
    assert words in message
    assert "\n" not in message


def test_one_format_with_other_options_is_another_export(tmp_path):
    lines = ["  usd: {}", "  coarse: {kind: usd, tile_cells: 128}", "  glb: {}"]
    orders = export_orders(found(tmp_path, lines).recipe)
    assert [(order.folder, order.kind) for order in orders] == [
        ("usd", "usd"), ("coarse", "usd"), ("glb", "glb"),
    ]  # fmt: skip


TOO_LARGE = {
    "mesh": ({}, 2e9, 0, "choose tiles: tiled"),
    "glb": ({}, 1e9, 0, "the format usd"),
    "mjcf": ({}, 1e4, 1e6, "usd"),
    "sdf": ({"individual_min_m": 0.0}, 1e4, 45_000, "a larger individual_min_m"),
    "drake": ({"individual_min_m": 0.0}, 1e4, 45_000, "a larger individual_min_m"),
}


@pytest.mark.parametrize("kind", TOO_LARGE)
def test_formats_refuse_before_the_world_is_made(kind):
    options, nodes, rocks, words = TOO_LARGE[kind]
    module = exporter(kind)
    check_capacity(module, module.Options(**options), nodes=1e4, rocks=100)
    with pytest.raises(ExportError, match=words):
        check_capacity(module, module.Options(**options), nodes=nodes, rocks=rocks)


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("gazebo", " (sdf is for it)"),
        ("stl", " (mesh is for it)"),
        ("Isaac Sim", " (usd is for it)"),
        ("USD", " (did you mean 'usd'?)"),
        ("world", ""),
        ("", ""),
    ],
)
def test_a_program_is_answered_by_its_exporter(name, hint):
    with pytest.raises(RecipeError) as told:
        exporter(name)
    assert str(told.value).startswith(f"unknown exporter {name!r}{hint}, installed: ")


def test_every_exporter_of_ours_has_documented_options():
    for name in exporter_names():
        schema = json.dumps(exporter(name).Options.__doc__)
        assert "Options of the" in schema


def test_a_build_refuses_before_it_begins(tmp_path):
    """And so does `check`, with the line of the export."""
    wide = RECIPE.replace("[6, 4]", "[100, 100]")
    file = found(
        tmp_path, ["  mjcf: {}", "rocks:", "  populations:", "    - name: sand", *SAND], wide
    )
    for command in ("check", "build"):
        arguments = [command, str(file.path)] + (
            ["-o", str(tmp_path / "out")] * (command == "build")
        )
        done = CliRunner().invoke(cli, arguments)
        assert isinstance(done.exception, ExportError)
        assert f"{file.path}:7: exports.mjcf: some " in str(done.exception)
        assert not (tmp_path / "out").exists()


def test_check_counts_rocks_and_no_craters(tmp_path):
    """A list of craters is a table of the site too, and holds no rocks."""
    rows = [f"{n},0,1.5" for n in (-2, 0, 2)]
    (tmp_path / "craters.csv").write_text("\n".join(["x_m,y_m,diameter_m", *rows]) + "\n")
    layer = "terrain: {spacing_m: 0.25, layers: [{kind: craters, file: craters.csv}]}"
    recipe = RECIPE.replace("terrain: {spacing_m: 0.25}", layer)
    file = found(tmp_path, ["  usd: {}"], recipe)
    lines = list(check(file.recipe, folder=tmp_path))
    assert any(line.startswith("  rocks        about 0,") for line in lines)


@pytest.mark.parametrize(
    ("was", "now", "words"),
    [
        (
            '"usd":{}',
            '"usd":{"friktion":1}',
            "option 'friktion' of usd: unknown key",
        ),
        ('"usd":{}', '"sdf":{"heightmap_bits":8}', "exports.sdf.heightmap_bits: has no effect"),
        ('"usd":{}', '"gone":{}', "exports.gone: unknown exporter"),
        ('"spacing_m"', '"spacing"', "terrain.spacing: unknown key"),
    ],
)
def test_a_world_of_an_earlier_version_is_refused_in_one_line(
    small_world, tmp_path, was, now, words
):
    text = recipe_json(replace(small_world.site.recipe, exports={"usd": {}}))
    assert was in text
    world = small_world.replace(
        site=small_world.site.replace(recipe_json=text.replace(was, now, 1))
    )
    world.save(tmp_path)
    (tmp_path / "manifest.json").write_text(MANIFEST)
    # An export does not need the others of the recipe.
    again = [["export", "--only", "usd"]] if "usd" in now or "spacing" in now else []
    for command in (["validate"], *again):
        result = CliRunner().invoke(cli, [command[0], str(tmp_path), *command[1:]])
        message = str(result.exception)
        assert isinstance(result.exception, OutputError)
        assert words in message
        assert "build it anew" in message
        assert len(message) < 500
