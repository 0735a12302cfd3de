"""What the commands say and leave: at their end, of mistakes, of what is installed."""

import json
import os
import re
import shlex
from dataclasses import fields

import click
import numpy as np
import pytest
import rasterio
from PIL import Image
from terrain_forge.exporters import sdf

import terrain_forge as tf
from terrain_forge.cli import cli
from terrain_forge.recipe import json_schema, starters
from terrain_forge.terminal import Number, names_of, say
from terrain_forge.terrain import slope_statistics
from tests.helpers.command_line import run
from tests.helpers.places import ROOT

RECIPE = """
schema: 1
name: mini
body: moon
dtm: {kind: flat, size_m: [6, 4]}
terrain: {spacing_m: 0.25}
rocks:
  library: {shapes: 1}
  populations:
    - name: stones
      size_frequency: {kind: golombek, k: 0.2}
      diameter_m: [0.3, 0.6]
      dynamic_m: [0.3, 0.4]
paths: [{name: arc, route: {points_m: [[-2, -1], [0, 0], [2, 1]]}, speed_m_s: 1}]
exports: [sdf]
"""


@pytest.fixture(scope="module")
def recipe(tmp_path_factory):
    path = tmp_path_factory.mktemp("recipe") / "mini.yaml"
    path.write_text(RECIPE)
    return path


@pytest.fixture(scope="module")
def built(recipe):
    """A world with an export that its recipe does not name, and what the build said."""
    changes = "--set", "rocks.populations=[]", "--set", "paths=[]"
    return recipe.parent / "out", run(
        "build", recipe, *changes, "-o", recipe.parent / "out", "--only", "geotiff"
    )


def test_a_build_ends_with_verdict_size_time_and_what_comes_next(built):
    out, done = built
    assert done.returncode == 0, done.stderr
    told = done.stdout.splitlines()
    assert re.fullmatch(rf"{out}: all \d+ checks passed", told[0])
    size = r"[\d.]+ [kM]B in (\d+ min )?[\d.]+ s"
    assert re.fullmatch(rf"  0 rocks, 0 paths, geotiff: {size}", told[1])
    assert f"terrain-forge view {out}" in told[2]
    assert told[4] == "    Maps: qgis geotiff/elevation.tif"
    stages = [re.fullmatch(r"terrain-forge: \d:\d\d ([\w ]+)", s) for s in done.stderr.split("\n")]
    told = [stage[1] for stage in stages if stage and stage[1] != "compile"]  # only a first build
    assert told == [stage for stage in tf.pipeline.STAGES if stage != "compile"]


@pytest.mark.slow
def test_an_export_is_failed_by_its_own_checks_and_by_new_ones_only(built, monkeypatch):
    out, _ = built
    (out / "notes.txt").write_text("mine")
    done = run("validate", out, "--quick")
    assert (done.returncode, "1 of" in done.stdout) == (1, True)
    done = run("export", out, "--only", "sdf")
    assert done.returncode == 0, done.stderr
    assert re.match(rf"{out}/sdf: \d+ files, [\d.]+ kB\n  written and validated in", done.stdout)
    assert f"{out}: fails as before: files: added: 1, limit 0 (notes.txt)" in done.stderr
    true = sdf.export
    raised = lambda world, *place, **options: true(  # noqa: E731
        world.replace(ground=world.ground.replace(elevation=world.ground.elevation + 1.0)),
        *place,
        **options,
    )
    monkeypatch.setattr(sdf, "export", raised)
    for _ in range(2):  # nor is it excused the second time
        done = run("export", out, "--only", "sdf")
        assert (done.returncode, "failed: sdf: ground: 1 m" in done.stderr) == (1, True)


def test_one_export_from_python_is_a_text(built, monkeypatch):
    """As the folder is; what a command would write is written."""
    out, _ = built
    monkeypatch.chdir(out.parent)
    assert tf.export(out.name, "geotiff", force=True)
    assert tf.export(str(out), ("geotiff",), force=True)
    assert (out / "geotiff" / "elevation.tif").is_file()
    with pytest.raises(tf.OutputError, match="exporter 'geotif'"):
        tf.export(str(out), "geotif")


def test_preview_draws_and_exports_nothing(recipe, tmp_path):
    done = run("preview", recipe, "-o", tmp_path / "look.png")
    assert done.returncode == 0, done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["look.png"]
    assert np.asarray(Image.open(tmp_path / "look.png")).std() > 10.0
    for line in (
        r"rocks +\d+, \d+ of them dynamic and not settled",
        r"slope +0\.0°",
        "path +arc: ",
    ):
        assert re.search(rf"^  {line}", done.stdout, re.MULTILINE), done.stdout
    assert done.stdout.splitlines()[-1].endswith("look.png")
    assert run("preview", recipe, "-o", tmp_path / "look.png").returncode == 0


def test_preview_tells_the_slope_that_the_report_page_has(tmp_path):
    (tmp_path / "rough.yaml").write_text(
        "schema: 1\nname: rough\nseed: 1\nbody: mars\ndtm: {kind: flat, size_m: [8, 8]}\n"
        "terrain: {spacing_m: 0.1, layers: [{kind: fractal, deviation_1m_m: 0.05, hurst: 0.6}]}\n"
    )
    done = run("preview", tmp_path / "rough.yaml", "-o", tmp_path / "look.png")
    ground = tf.realise(tf.plan(tmp_path / "rough.yaml"), horizon=False).ground
    steepest = slope_statistics(ground).steepest_deg
    assert f"{steepest:.1f}° at its steepest" in done.stdout, done.stderr


def test_a_first_preview_tells_that_it_compiles(recipe, tmp_path, monkeypatch):
    """It does so as a build, before anything else."""

    def compile_few(progress, **_):
        progress("compile: 0 of 2 kernels, once", 0.0)

    monkeypatch.setattr("terrain_forge.base.compile_ahead", compile_few)
    done = run("preview", recipe, "-o", tmp_path / "look.png")
    stages = re.findall(r"^terrain-forge: \d:\d\d ([\w ]+)", done.stderr, re.MULTILINE)
    assert stages == ["compile", *tf.pipeline.MAKING]


def test_preview_takes_the_place_of_nothing_but_a_preview(recipe, tmp_path):
    copy = tmp_path / "r.yaml"
    copy.write_bytes(recipe.read_bytes())
    Image.new("L", (4, 4)).save(tmp_path / "mine.png")
    (tmp_path / "link.png").symlink_to(copy)
    (tmp_path / "dangling.png").symlink_to(tmp_path / "new.png")
    (tmp_path / "folder.png").mkdir()
    os.mkfifo(tmp_path / "pipe.png")
    before = {path: path.read_bytes() for path in (copy, tmp_path / "mine.png")}
    held = sorted(tmp_path.iterdir())
    for name, complaint in (
        *((n, "is no preview: it is not overwritten") for n in ("mine.png", "link.png")),
        *((f"{n}.png", "is no preview: it is") for n in ("dangling", "folder", "pipe")),
        *((n, "a preview is a .png") for n in ("r.yaml", "dem.tif", "look")),
        ("none/look.png", "there is no folder"),
    ):
        done = run("preview", copy, "-o", tmp_path / name)
        assert (done.returncode, done.stderr.count("\n")) == (2, 1), name
        assert complaint in done.stderr
    assert before == {path: path.read_bytes() for path in before}
    assert held == sorted(tmp_path.iterdir())


@pytest.mark.parametrize("name", starters())
def test_each_recipe_that_ships_can_be_begun_with(name, tmp_path):
    assert run("init", tmp_path, "--recipe", name).returncode == 0
    file = tf.load_recipe(tmp_path / f"{name}.yaml")
    source = getattr(file.recipe.dtm, "source", None)
    assert {path.name for path in tmp_path.iterdir()} == {f"{name}.yaml"} | {source} - {None}
    assert run("init", tmp_path, "--recipe", name).returncode == 2


def test_a_command_that_is_told_runs_as_it_stands(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    told = run("init", "--", "-a first one").stdout.partition("  terrain-forge build ")[2]
    assert run("check", *shlex.split(told)).returncode == 0


def test_init_lists_recipes_and_knows_no_others(tmp_path):
    listed = run("init", "--list").stdout.splitlines()
    assert [line.split()[0] for line in listed] == list(starters())
    assert not any("…" in line for line in listed)
    assert {path.stem for path in (ROOT / "recipes").glob("*.yaml")} == set(starters())
    done = run("init", tmp_path / "new", "--recipe", "venus")
    assert (done.returncode, "there are: hello, gale_long" in done.stderr) == (2, True)
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize(
    ("given", "wanted"),
    [("moon_mare", "moon_mare"), ("moon_mare.yaml", "moon_mare"), ("a.yml", "hello")],
)
def test_init_takes_no_recipe_for_a_folder(given, wanted, tmp_path):
    done = run("init", tmp_path / given)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert done.stderr.endswith(f"name a folder, or --recipe {wanted}\n")
    assert not (tmp_path / given).exists()


def test_init_takes_a_folder_that_is_called_almost_like_a_recipe(tmp_path):
    assert run("init", tmp_path / "moon_mare.v2").returncode == 0


def raster(path, driver):
    with rasterio.open(path, "w", driver, 4, 4, 1, dtype="float32") as file:
        file.write(np.ones((1, 4, 4), np.float32))


@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
def test_a_raster_in_the_recipes_place_is_told_what_to_write(tmp_path):
    raster(tmp_path / "dem.img", "ENVI")
    raster(tmp_path / "dem.tif", "GTiff")
    np.save(tmp_path / "dem.npy", np.ones((4, 4)))
    for given, source in (("hdr", "dem.img"), ("img", "dem.img"), ("tif", "dem.tif")):
        for command in ("build", "preview"):
            done = run(command, tmp_path / f"dem.{given}")
            assert (done.returncode, done.stderr.count("\n")) == (2, 1)
            assert f"no recipe: write one with dtm: {{source: {tmp_path / source}," in done.stderr
    label = ROOT / "dtm_samples" / "lola_ldem16_tranquillitatis.LBL"
    assert f"source: {label}," in run("build", label.with_suffix(".IMG")).stderr
    assert run("check", label.with_suffix(".IMG")).stdout == run("check", label).stdout
    done = run("build", tmp_path / "dem.npy")
    assert (done.returncode, "this is an array, no recipe" in done.stderr) == (2, True)
    described = run("check", tmp_path / "dem.hdr")
    assert (described.returncode, "ENVI, 4 × 4 samples" in described.stdout) == (0, True)


@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
def test_a_raster_of_any_ending_is_told_by_what_opens(tmp_path, monkeypatch):
    """Where a header's data have an ending of their own, and a file begins as a raster does."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "maps").mkdir()
    raster(tmp_path / "maps" / "dem.bin", "ENVI")
    for given in ("maps/dem.hdr", "maps/dem.bin"):
        told = run("build", given).stderr
        assert "dtm: {source: maps/dem.bin," in told
        assert "`terrain-forge check maps/dem.bin` describes it" in told
    assert run("check", "maps/dem.bin").returncode == 0
    (tmp_path / "noise.bin").write_bytes(bytes(range(256)))
    assert "is no text in UTF-8" in run("build", "noise.bin").stderr


def test_what_is_named_in_place_of_another_thing_is_told(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mare.yaml").write_text("schema: 1")
    assert "no such file: mare (did you mean 'mare.yaml'?)" in run("build", "mare").stderr
    assert ": `terrain-forge build mare.yaml` makes one" in run("validate", "mare.yaml").stderr
    for number in ("00000", "00001"):
        (tmp_path / "many" / number).mkdir(parents=True)
        (tmp_path / "many" / number / "manifest.json").write_text("{}")
    assert ": name one in it, such as 00000" in run("validate", "many").stderr


def test_only_names_an_exporter_or_a_folder(recipe, tmp_path):
    done = run("build", recipe, "-o", tmp_path / "out", "--only", "sdf,blend")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "--only blend: unknown exporter 'blend', installed: drake" in done.stderr


@pytest.mark.parametrize(
    "line",
    [
        "cut site --size 10,8 --centre nan,0",
        "cut site --centre 0,0 --size inf,8",
        "evaluate hz --map p.ply --area nan,0,1,1",
        "evaluate hz --map p.ply --cell nan",
        "record hz --from nan",
        "record hz --from 0 --to inf",
        "illumination r.yaml --spacing 5 --size nan 40",
        "illumination r.yaml --reach nan",
    ],
)
def test_a_number_is_finite(line):
    option = line.split("--")[-1].split()[0]
    done = run(*line.split())
    assert (done.returncode, len(done.complaints)) == (2, 1), done.stderr
    assert f"Invalid value for '--{option}': " in done.stderr
    assert re.search(r"is no finite number|is not in the range", done.stderr)


@pytest.mark.parametrize(
    ("line", "asked"),
    [
        ("worlds", "terrain-forge worlds --help"),
        ("build r.yaml --onyl usd", "terrain-forge build --help"),
        ("bild r.yaml", "terrain-forge --help"),
    ],
)
def test_a_wrong_line_names_the_help_of_its_command(line, asked):
    done = run(*line.split())
    assert (done.returncode, len(done.complaints)) == (2, 1), done.stderr
    assert done.complaints[0].endswith(f"(see {asked})")


def test_no_option_takes_what_is_no_number():
    """NaN is neither below nor above a bound of click's own types."""
    for name, command in cli.commands.items():
        for option in command.params:
            kinds = getattr(option.type, "types", [option.type])
            plain = [k for k in kinds if isinstance(k, click.types.FloatParamType)]
            assert all(isinstance(kind, Number) for kind in plain), (name, option.name)


@pytest.mark.parametrize("given", ["1", "1,2,3", "a,b", "1,", ""])
def test_two_numbers_are_two(given):
    done = run("cut", "site", "--size", "8,8", "--centre", given)
    assert (done.returncode, len(done.complaints)) == (2, 1), done.stderr
    assert "Invalid value for '--centre'" in done.stderr


def test_no_arguments_show_the_help():
    done = run()
    assert done.returncode == 2
    assert "Usage: terrain-forge" in done.stderr
    assert "  build " in done.stderr


def test_schema_is_the_recipes():
    assert json.loads(run("schema").stdout) == json_schema()


def test_the_schema_knows_exporters_and_their_options():
    """As an editor offers them: in a list, by a folder's own name, and by `kind`."""
    schema = json_schema()
    listed, mapped = schema["properties"]["exports"]["anyOf"]
    names = tf.exporter_names()
    assert listed["items"]["enum"] == names
    assert [*mapped["properties"]] == names
    references = set(re.findall(r'"#/\$defs/([^"]+)"', json.dumps(schema)))
    assert references <= set(schema["$defs"])
    for name in names:
        options = schema["$defs"][f"{name}_options"]
        assert not options["additionalProperties"]
        assert {f.name for f in fields(tf.exporter(name).Options)} <= set(options["properties"])
        assert options["properties"]["kind"]["const"] == name
        assert {"$ref": f"#/$defs/{name}_options"} in mapped["properties"][name]["anyOf"]
        by_kind = {"$ref": f"#/$defs/{name}_options", "required": ["kind"]}
        assert by_kind in schema["$defs"]["export"]["anyOf"]


@pytest.mark.parametrize(
    ("name", "told"), [("own", "our own"), ("embree", "Embree "), ("gpu", r"not .* engine 'gpu'")]
)
def test_doctor_names_the_ray_engine_that_is_used(name, told, monkeypatch):
    monkeypatch.setenv("TERRAIN_FORGE_RAYS", name)
    assert re.search(rf"^  rays +{told}", run("doctor").stdout, re.MULTILINE)


def test_doctor_never_fails(monkeypatch):
    monkeypatch.setenv("PATH", "")
    monkeypatch.setenv("TERRAIN_FORGE_DRAKE_PYTHON", "/nowhere/python")
    monkeypatch.setenv("TERRAIN_FORGE_CACHE", "off")
    monkeypatch.setitem(__import__("sys").modules, "mujoco", None)  # cannot be imported
    done = run("doctor")
    assert done.returncode == 0
    for name in tf.exporter_names():
        assert re.search(rf"^  {name} ", done.stdout, re.MULTILINE)
    assert "cache          off" in done.stdout
    assert re.search(r"physics +not working: ModuleNotFoundError", done.stdout)
    assert "/nowhere/python is no Python" in done.stdout
    assert "pkg-config is not installed" in done.stdout


def test_a_line_stays_short_though_all_of_it_is_escaped(capsys):
    say("\x1b" * 2000 + "end")
    line = capsys.readouterr().out
    assert len(line) < 2100
    assert line.endswith("end\n")


def _commands(group=cli, words=()):
    yield words, group
    for name, command in getattr(group, "commands", {}).items():
        yield from _commands(command, (*words, name))


OPTIONS = [
    (words, param)
    for words, command in _commands()
    for param in command.params
    if isinstance(param, click.Option) and not (param.multiple or param.is_eager)
]


@pytest.mark.parametrize(("words", "option"), OPTIONS, ids=lambda x: str(getattr(x, "name", x)))
def test_an_option_of_one_value_is_refused_the_second_time(words, option):
    """In all commands and by any of its names; the last would win without a word."""
    values = [] if option.is_flag else ["1"] * option.nargs
    for other in option.opts:
        done = run(*words, option.opts[0], *values, other, *values)
        assert done.returncode == 2
        line = f"terrain-forge: {option.opts[-1]} is given twice: it takes one value (see "
        assert done.stderr.startswith(line)


def test_names_of_lists_are_given_at_once_or_one_by_one():
    """All options that take names with commas between them are read by the same function."""
    assert names_of(("a", "b, c")) == ("a", "b", "c")
    assert names_of(()) is None
    takes_names = [
        option.multiple
        for _, command in _commands()
        for option in command.params
        if option.name in ("only", "formats", "systems", "estimates")
    ]
    assert len(takes_names) == 8
    assert all(takes_names)
