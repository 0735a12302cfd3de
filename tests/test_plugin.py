"""Exporters and layers from other packages, installed as a user would: found by entry point."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import rasterio

ROOT = Path(__file__).parents[1]
RECIPE = """
schema: 1
name: plugged
body: moon
dtm: {kind: flat, size_m: [6, 4]}
terrain: {spacing_m: 0.25, layers: [{kind: fractal}, {kind: terraces, width_m: 2, rise_m: 0.5}]}
exports: EXPORTS
"""
BROKEN = {
    "broken-1.0.dist-info/METADATA": "Metadata-Version: 2.1\nName: broken\nVersion: 1.0\n",
    "broken-1.0.dist-info/entry_points.txt": "[terrain_forge.exporters]\n"
    "broken = broken_plugin\nempty = empty_plugin\n"
    "[terrain_forge.layers]\nbroken = broken_plugin\n",
    "broken_plugin.py": "import a_module_that_nobody_has\n",
    "empty_plugin.py": "Options = None\n",
}


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """A folder with the example package as pip installs it, and a broken package beside it."""
    work = tmp_path_factory.mktemp("plugin")
    shutil.copytree(ROOT / "tests" / "example_exporter", work / "source")
    options = ["--no-deps", "--no-build-isolation", "--no-index", "--disable-pip-version-check"]
    command = [sys.executable, "-m", "pip", "install", *options, "--target", work / "site"]
    done = subprocess.run([*command, work / "source"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    for name, text in BROKEN.items():
        path = work / "site" / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    return work / "site"


def python(installed, *arguments):
    environment = os.environ | {"PYTHONPATH": str(installed)}
    command = [sys.executable, *map(str, arguments)]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def build(installed, folder, exports):
    path = folder / "plugged.yaml"
    path.write_text(RECIPE.replace("EXPORTS", exports))
    return python(installed, "-m", "terrain_forge", "build", path, "-o", folder / "out")


def test_foreign_exporter_and_layer(installed, tmp_path):
    done = build(installed, tmp_path, "[xyz]")
    assert done.returncode == 0, done.stderr
    points = np.loadtxt(tmp_path / "out" / "xyz" / "points.xyz")
    assert points.shape == (25 * 17, 3)
    with rasterio.open(tmp_path / "out" / "truth" / "surface.tif") as file:
        truth = file.read(1)[::-1]
    assert points[:, 2].reshape(17, 25).astype(np.float32).tobytes() == truth.tobytes()
    assert points[:2, :2].tolist() == [[-3, -2], [-2.75, -2]]
    step = points[:, 2][points[:, 0] == 1.0] - points[:, 2][points[:, 0] == 0.75]
    assert abs(step.mean() - 0.5) < 0.2  # the terrace, above the fractal's few centimetres


def test_options_and_losses(installed, tmp_path):
    done = build(installed, tmp_path, "{thin: {kind: xyz, every: 2, separator: comma}}")
    assert done.returncode == 0, done.stderr
    points = np.loadtxt(tmp_path / "out" / "thin" / "points.xyz", delimiter=",")
    assert points.shape == (13 * 9, 3)
    script = (
        "import sys, terrain_forge as tf\n"
        "world = tf.World.load(sys.argv[1])\n"
        "result = tf.write_world(world, sys.argv[2])\n"
        "print(*result.losses['thin'], sep='\\n')"
    )
    done = python(installed, "-c", script, tmp_path / "out", tmp_path / "again")
    assert done.stdout.splitlines() == [
        "Points have no triangles: the surface between the nodes is left to the reader.",
        "Only every 2. node of the ground is written.",
    ], done.stderr


@pytest.mark.parametrize(
    ("exports", "words"),
    [
        ("{xyz: {every: 0}}", ["option 'every' of xyz", "greater than or equal to 1"]),
        ("{xyz: {evry: 2}}", ["no option 'evry'", "every, separator"]),
        ("[xzy]", ["unknown exporter 'xzy'", "installed: broken, empty, mjcf, sdf, usd, xyz"]),
        ("[broken]", ["exporter 'broken' is installed but broken"]),
        ("[empty]", ["exporter 'empty' is installed but broken"]),
    ],
)
def test_wrong_exports_are_refused(installed, tmp_path, exports, words):
    done = build(installed, tmp_path, exports)
    assert done.returncode == 2
    last = done.stderr.splitlines()[-1]
    for word in words:
        assert word in last
    assert not (tmp_path / "out").exists()


def test_broken_plugins_warn_and_are_skipped(installed, tmp_path):
    """The others work, though every recipe asks all layers for their kinds."""
    done = build(installed, tmp_path, "[xyz]")
    assert done.returncode == 0
    assert "layer 'broken' (broken_plugin) is skipped: No module named" in done.stderr
    done = build(installed, tmp_path, "[broken, xyz]")
    assert "exporter 'broken' (broken_plugin) is skipped: No module named" in done.stderr
    done = build(installed, tmp_path, "[empty]")
    assert "exporter 'empty' (empty_plugin) is skipped: has no export" in done.stderr
