"""Exporters, layers and checks of other packages, installed as a user would, by entry points."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tomllib

import numpy as np
import pytest
import rasterio

from terrain_forge.base import OutputError
from terrain_forge.model import World, packages_gone
from tests.helpers.command_line import run
from tests.helpers.places import ROOT
from tests.helpers.plugins import fresh, install

RECIPE = """
schema: 1
name: plugged
body: moon
horizon: {reach_m: 0}
dtm: {kind: flat, size_m: [6, 4]}
terrain: {spacing_m: 0.25, layers: [{kind: fractal}, {kind: terraces, width_m: 2, rise_m: 0.5}]}
rocks: {library: {shapes: 1}, populations: []}
exports: EXPORTS
"""
BROKEN_POINTS = """[terrain_forge.exporters]
broken = broken_plugin
empty = empty_plugin
loud = loud_plugin
usd = other_usd
[terrain_forge.layers]
broken = broken_plugin
loud = loud_plugin
twin = twin_layer
"""
BROKEN = {
    "broken_plugin.py": "import a_module_that_nobody_has\n",
    "empty_plugin.py": "Options = None\n",
    "loud_plugin.py": "raise RuntimeError('a' * 3 + '\\n' + 'b' * 3)\n",
    "other_usd.py": "Options = None\n",
    "twin_layer.py": "from dataclasses import dataclass\n"
    "from typing import Literal\n"
    "from terrain_forge.terrain.layer import Layer\n"
    "@dataclass(frozen=True, kw_only=True)\n"
    "class Twin(Layer):\n"
    "    kind: Literal['craters'] = 'craters'\n"
    "    def relief(self, **_): return 0.0\n",
}


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """A folder with the example package, and a broken package beside it."""
    site, source = tmp_path_factory.mktemp("site"), ROOT / "tests" / "example_exporter"
    project = tomllib.loads((source / "pyproject.toml").read_text())
    points = "".join(
        f"[{group}]\n" + "".join(f"{name} = {module}\n" for name, module in named.items())
        for group, named in project["project"]["entry-points"].items()
    )
    names = [f"{name}.py" for name in project["tool"]["setuptools"]["py-modules"]]
    install(site, "example", points, {name: (source / name).read_text() for name in names})
    return install(site, "broken", BROKEN_POINTS, BROKEN)


@pytest.mark.slow
def test_the_example_is_installed_by_pip(tmp_path):
    shutil.copytree(ROOT / "tests" / "example_exporter", tmp_path / "source")
    options = ["--no-deps", "--no-build-isolation", "--no-index", "--target", tmp_path / "site"]
    command = [sys.executable, "-m", "pip", "install", *options, tmp_path / "source"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    with fresh(tmp_path / "site"):
        import terrain_forge as tf

        assert "xyz" in tf.exporter_names()
        assert tf.exporter("xyz").Options().every == 1
        assert '"terraces"' in json.dumps(tf.json_schema())


def build(folder, exports):
    path = folder / "plugged.yaml"
    path.write_text(RECIPE.replace("EXPORTS", exports))
    return run("build", path, "-o", folder / "out")


@pytest.fixture(scope="module")
def built(installed, tmp_path_factory):
    """A world of the foreign layer, in the foreign format twice."""
    folder = tmp_path_factory.mktemp("plugged")
    with fresh(installed):
        done = build(folder, "{xyz: {}, thin: {kind: xyz, every: 2, separator: comma}}")
    assert done.returncode == 0, done.stderr
    return folder / "out"


def test_foreign_exporter_and_layer(built):
    points = np.loadtxt(built / "xyz" / "points.xyz")
    assert points.shape == (25 * 17, 3)
    with rasterio.open(built / "truth" / "surface.tif") as file:
        truth = file.read(1)[::-1]
    assert points[:, 2].reshape(17, 25).astype(np.float32).tobytes() == truth.tobytes()
    assert points[:2, :2].tolist() == [[-3, -2], [-2.75, -2]]
    step = points[:, 2][points[:, 0] == 1.0] - points[:, 2][points[:, 0] == 0.75]
    assert abs(step.mean() - 0.5) < 0.2  # the terrace, above the fractal's few centimetres


def test_a_foreign_layer_has_its_file_read_hashed_and_named(installed, tmp_path):
    """Its field is marked, and that is all."""
    faults = tmp_path / "away" / "faults.csv"
    faults.parent.mkdir()
    faults.write_text("x_m,rise_m\n0.1,2.5\n")
    recipe = RECIPE.replace("rise_m: 0.5", f"rise_m: 0, faults: {faults}").replace("EXPORTS", "[]")
    plugged = tmp_path / "plugged.yaml"
    with fresh(installed):
        import terrain_forge as tf

        plugged.write_text(recipe)
        site = tf.plan(tf.load_recipe(plugged).recipe)
        layer = site.recipe.terrain.layers[1]
        assert layer.faults == "faults.csv"
        assert site.table(layer.faults).values.tolist() == [[0.1, 2.5]]
        assert list(dict(site.inputs)) == ["faults.csv"]
        plugged.write_text(recipe.replace("faults.csv", "none.csv"))
        with pytest.raises(tf.TerrainForgeError, match="no such file: "):
            tf.plan(tf.load_recipe(plugged).recipe)


def test_options_and_losses(built):
    points = np.loadtxt(built / "thin" / "points.xyz", delimiter=",")
    assert points.shape == (13 * 9, 3)
    manifest = json.loads((built / "manifest.json").read_text())
    assert manifest["versions"]["example"] == "1.0"
    assert packages_gone(built) == "broken 1.0, example 1.0"
    assert "terrain-forge" not in manifest["versions"]
    thin = manifest["exports"]["thin"]
    assert (thin["kind"], thin["options"]) == ("xyz", {"separator": "comma", "every": 2})
    assert thin["losses"] == [
        "Points have no triangles: the surface between the nodes is left to the reader.",
        "Only every 2. node of the ground is written.",
    ]
    assert "thin/points.xyz" in manifest["outputs"]


def test_a_foreign_export_is_verified_and_opened_like_ours(installed, built, tmp_path):
    """In a build, by `validate`, and after `export`; that its world.xml is no MJCF harms nobody."""
    out = shutil.copytree(built, tmp_path / "out")
    assert (out / "thin" / "world.xml").is_file()
    checks = {check["name"]: check for check in report(out)["checks"]}
    assert checks["thin: ground"]["passed"]
    assert checks["thin: ground"]["group"] == "exports"
    assert checks["ground: relief"]["passed"]
    assert checks["ground: relief"]["group"] == "ground"
    page = (out / "report.html").read_text()
    assert '<h3>Points</h3><div class="command"><pre><code>CloudCompare thin/points.xyz<' in page
    with fresh(installed):
        for command in (("export", out, "--only", "xyz,geotiff"), ("validate", out)):
            done = run(*command)
            assert done.returncode == 0, done.stdout + done.stderr
        manifest = json.loads((out / "manifest.json").read_text())["exports"]
        kinds = {folder: export["kind"] for folder, export in manifest.items()}
        assert kinds == {"geotiff": "geotiff", "thin": "xyz", "xyz": "xyz"}
        assert manifest["xyz"]["options"] == {"separator": "space", "every": 1}
        found = {(e["export"], e["aspect"]): e for e in report(out)["conformance"]}
        for folder in ("thin", "xyz"):
            assert found[folder, "ground"]["consumer"] == f"NumPy {np.__version__}"
            assert found[folder, "ground"]["status"] == found[folder, "frames"]["status"] == "pass"
            assert found[folder, "masses"]["note"] == "points are the ground alone"
        assert found["geotiff", "ground"]["status"] == "pass"
        points = out / "thin" / "points.xyz"
        lines = points.read_text().splitlines()
        points.write_text("\n".join(f"{line[:-1]}9" for line in lines).replace(",0.", ",1."))
        assert run("validate", out, "--quick").returncode == 1
    failing = {check["name"] for check in report(out)["checks"] if not check["passed"]}
    assert failing >= {"files: missing or altered", "thin: reading"}


GONE = "install broken 1.0, example 1.0, with which it was built"


@pytest.mark.parametrize("command", [["validate"], ["export", "--only", "geotiff"], ["record"]])
def test_a_world_names_the_packages_that_are_gone(built, tmp_path, command):
    """Here, where they are not installed."""
    out = shutil.copytree(built, tmp_path / "out")
    done = run(command[0], out, *command[1:])
    assert done.returncode == 2, done.stderr
    assert "unknown kind 'terraces'" in done.complaints[-1]
    assert done.complaints[-1].endswith(f"; {GONE}, or build it anew")


def test_a_world_names_the_version_that_is_not_here(installed, built, tmp_path):
    """Where another one is, that no longer takes its recipe."""
    out = shutil.copytree(built, tmp_path / "out")
    for file in ("manifest.json", "world/world.json"):
        text = (out / file).read_text()
        (out / file).write_text(
            text.replace('"example": "1', '"example": "0').replace("rise_m", "gone_m")
        )
    with fresh(installed):
        done = run("validate", out)
    assert done.returncode == 2, done.stderr
    assert "; install example 0.0, with which it was built" in done.complaints[-1]


def test_a_world_of_records_that_are_gone_names_their_packages(built, tmp_path):
    out = shutil.copytree(built, tmp_path / "out")
    world = out / "world" / "world.json"
    world.write_text(world.read_text().replace('"record": "Wheel"', '"record": "Ski"'))
    with pytest.raises(OutputError, match=rf"Ski: .* is not installed\); {GONE}$"):
        World.load(out)
    (out / "manifest.json").write_text("{}")
    with pytest.raises(OutputError, match=r"is not installed\)$"):
        World.load(out)


def report(out):
    return json.loads((out / "validation" / "report.json").read_text())


WRONG = {
    "{xyz: {every: 0}}": ["option 'every' of xyz", "greater than or equal to 1"],
    "{xyz: {evry: 2}}": ["unknown key 'evry'", "every, separator"],
    "[xzy]": ["unknown exporter 'xzy'", "installed: broken, drake, empty, geotiff, glb, loud"],
    "[broken]": ["is installed but broken: "],
    "[empty]": ["is installed but broken: "],
    "[loud]": ["is installed but broken: "],
}


def test_wrong_exports_are_refused(installed, tmp_path, caplog):
    """And a broken plugin warns, while the others work beside it."""
    with fresh(installed, anew=True):
        import terrain_forge as tf
        from terrain_forge.recipe import export_orders

        path = tmp_path / "plugged.yaml"
        for exports, words in WRONG.items():
            path.write_text(RECIPE.replace("EXPORTS", exports))
            with pytest.raises(tf.RecipeError) as error:
                export_orders(tf.load_recipe(path).recipe)
            assert all(word in str(error.value) for word in words), error.value
    for warning in (
        "layer 'broken' (broken_plugin) is skipped: No module named",
        "exporter 'broken' (broken_plugin) is skipped: No module named",
        "exporter 'empty' (empty_plugin) is skipped: has no export",
        "exporter 'loud' (loud_plugin) is skipped: aaa bbb\n",
        "layer 'loud' (loud_plugin) is skipped: aaa bbb\n",
        "layer 'craters' of twin_layer is skipped: terrain_forge.terrain.layers.craters has that",
        "exporter 'usd' of other_usd is skipped: terrain_forge.exporters.usd has that name\n",
    ):
        assert caplog.text.count(warning) == 1


@pytest.mark.slow
def test_command_line_tells_of_a_broken_plugin(installed, tmp_path):
    with fresh(installed, anew=True):
        done = build(tmp_path, "[broken, xyz]")
    assert done.returncode == 2
    assert "exporter 'broken' (broken_plugin) is skipped" in done.stderr
    assert "is installed but broken" in done.stderr.splitlines()[-1]
    assert not (tmp_path / "out").exists()
