"""Parts of other packages in a site in tiles: judged, named, and the same in all tiles."""

from __future__ import annotations

import json
import shutil
import sys

import pytest

from tests.helpers.command_line import run
from tests.helpers.odd_package import HEAD, SPEC
from tests.helpers.plugins import fresh, install

RECIPE = """
name: tiled
body: moon
horizon: {reach_m: 0}
dtm: {kind: flat, size_m: [6, 3]}
terrain: {spacing_m: 0.25, layers: [{kind: odd, what: LAYER}]}
rocks: {library: {shapes: 1}}
tiles: {size_m: 3}
exports: EXPORTS
"""
POINTS = """[terrain_forge.layers]
odd = tiled_layer
[terrain_forge.exporters]
tiled = tiled_exporter
unjoined = unjoined_exporter
"""
MODULES = {
    "tiled_layer.py": HEAD
    + "from terrain_forge.terrain import Layer\n"
    + SPEC
    + "class Odd(Layer):\n    kind: Literal['odd'] = 'odd'\n    what: str = 'ok'\n"
    + "    def relief(self, *, site, window, elevation):\n"
    + "        if self.what == 'nowhere': return elevation / 0\n"
    + "        if self.what == 'raise' and site.axes(window)[0].max() > 1: raise KeyError(1)\n"
    + "        if self.what == 'memory' and site.axes(window)[0].max() > 1: raise MemoryError\n"
    + "        if self.what == 'both' and site.axes(window)[0].max() > 1:\n"
    + "            raise KeyError(1) if site.axes(window)[0].max() > 2.9 else MemoryError\n"
    + "        return np.zeros(elevation.shape)\n",
    "unjoined_exporter.py": HEAD
    + "from terrain_forge.base import Spec\n"
    + SPEC
    + "class Options(Spec): pass\n"
    + "def export(world, directory, *, options): pass\n"
    + "def export_tile(tile, directory, *, grid, options): return {}\n",
    "tiled_exporter.py": HEAD
    + "from terrain_forge.base import Spec\n"
    + SPEC
    + "class Options(Spec):\n    what: str = ''\n"
    + "def export(world, directory, *, options): pass\n"
    + "def begin_tiles(world, directory, *, options):\n"
    + "    if options.what == 'begin': (directory / 'mine').symlink_to(__file__)\n"
    + "def export_tile(tile, directory, *, grid, options):\n"
    + "    if options.what == 'tile': (directory / 'mine').symlink_to(__file__)\n"
    + "    if options.what == 'beside': (directory.parent / 'mine').mkdir()\n"
    + "    if options.what == 'nothing': return None\n"
    + "    return {'a': {'set': {1}, 'nan': np.nan}.get(options.what, 1)}\n"
    + "def join_tiles(tiled, directory, *, options):\n"
    + "    if options.what == 'join': (directory / 'mine').symlink_to(__file__)\n"
    + "    if options.what == 'joined': (directory.parent / 'mine').mkdir()\n"
    + "    return {'text': 'none', 'none': None}.get(options.what, ())\n",
}


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    return install(tmp_path_factory.mktemp("site"), "tiled", POINTS, MODULES)


def build(folder, exports="[]", layer="ok"):
    path = folder / "tiled.yaml"
    path.write_text(RECIPE.replace("EXPORTS", exports).replace("LAYER", layer))
    return run("build", path, "-o", folder / "out", "--workers", 0)


FIGURES = "exporter 'tiled': export_tile (tiled_exporter) must return a dict that JSON can hold: "
LOSSES = "exporter 'tiled': join_tiles (tiled_exporter) must return a tuple of texts: "


@pytest.mark.parametrize(
    ("what", "told"),
    [
        ("nothing", f"tiles/000/001: {FIGURES}found NoneType"),
        ("set", f"tiles/000/001: {FIGURES}Object of type set"),
        ("nan", f"tiles/000/001: {FIGURES}Out of range"),
        ("text", f"{LOSSES}found the text 'none'"),
        ("none", f"{LOSSES}'NoneType' object is not iterable"),
        ("begin", "exporter 'tiled' (tiled_exporter) left the link mine in its folder"),
        ("tile", "exporter 'tiled' (tiled_exporter) left the link mine in its folder"),
        ("join", "exporter 'tiled' (tiled_exporter) left the link mine in its folder"),
        ("beside", "exporter 'tiled' (tiled_exporter) wrote mine beside its folder"),
        ("joined", "exporter 'tiled' (tiled_exporter) wrote mine beside its folder"),
    ],
)
def test_what_an_exporter_may_not_is_one_line_that_names_it(installed, tmp_path, what, told):
    with fresh(installed):
        done = build(tmp_path, f"{{tiled: {{what: '{what}'}}}}")
    assert done.returncode == 3, done.stderr
    assert "Traceback" not in done.stderr
    assert told in done.complaints[-1]


def test_an_exporter_that_cannot_join_tiles_is_refused_before_any(installed, tmp_path):
    with fresh(installed):
        done = build(tmp_path, "[unjoined]")
    assert done.returncode == 2, done.stderr
    assert "unjoined is not written tile by tile" in done.complaints[-1]
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["site", "Tiles", "map.png", "border.npz"])
def test_an_export_has_not_the_name_of_what_a_site_has(installed, tmp_path, name):
    with fresh(installed):
        done = build(tmp_path, f"{{{name}: {{kind: tiled}}}}")
    assert done.returncode == 2, done.stderr
    told = f"tiled.yaml:9: exports.{name}: {name!r} is part of every site in tiles"
    assert told in done.complaints[-1]
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("layer", "told"),
    [
        ("raise", "layer 'odd' (tiled_layer, line 11) failed: KeyError: 1"),
        ("memory", "MemoryError"),
        ("both", "layer 'odd' (tiled_layer, line 14) failed: KeyError: 1"),
    ],
)
def test_a_tile_that_its_code_or_the_system_fails_is_no_wrong_input(
    installed, tmp_path, layer, told
):
    with fresh(installed):
        done = build(tmp_path, layer=layer)
    assert done.returncode == 3, done.stderr
    assert f"2 tiles failed twice, tiles/000/000, tiles/000/001: {told}; " in done.complaints[-1]


def test_a_site_is_of_the_packages_that_it_was_begun_with(installed, tmp_path):
    with fresh(installed):
        assert build(tmp_path).returncode == 0
        shutil.rmtree(tmp_path / "out/tiles/000/001")
        order = tmp_path / "out/site/order.json"
        told = json.loads(order.read_text())
        assert told["made_by"]["tiled"] == "1.0"
        manifest = json.loads((tmp_path / "out/manifest.json").read_text())
        assert manifest["versions"]["tiled"] == "1.0"
        order.write_text(order.read_text().replace('"tiled": "1.0"', '"tiled": "0.9"'))
        done = build(tmp_path)
    assert done.returncode == 2, done.stderr
    assert "was begun by " in done.complaints[-1]
    assert "tiled 0.9" in done.complaints[-1]
    assert not (tmp_path / "out/tiles/000/001").exists()


def test_of_two_versions_of_a_package_the_first_counts(installed, tmp_path):
    """That is the one which is imported; a package without metadata counts as none."""
    with fresh(install(tmp_path, "tiled", POINTS, MODULES)):
        (tmp_path / "tiled-1.0.dist-info").rename(tmp_path / "Tiled-2.0.dist-info")
        metadata = tmp_path / "Tiled-2.0.dist-info/METADATA"
        metadata.write_text("Metadata-Version: 2.1\nName: Tiled\nVersion: 2.0\n")
        install(tmp_path, "broken", POINTS, {})
        (tmp_path / "broken-1.0.dist-info/METADATA").unlink()
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("sys.path", [*sys.path, str(installed)])
            from terrain_forge.base import their_packages

            assert their_packages() == {"Tiled": "2.0"}


@pytest.mark.parametrize("command", [["validate"], ["cut", "--centre", "0,0", "--size", "2,2"]])
def test_a_site_names_the_packages_that_are_gone(installed, tmp_path, command):
    """Here, where they are not installed."""
    with fresh(installed):
        assert build(tmp_path).returncode == 0
    (tmp_path / "out/manifest.json").unlink()  # it need not be finished
    done = run(command[0], tmp_path / "out", *command[1:])
    assert done.returncode == 2, done.stderr
    assert done.complaints[-1].endswith("; install tiled 1.0, with which it was built")


def test_a_layer_that_makes_no_ground_leaves_no_site(installed, tmp_path):
    with fresh(installed):
        done = build(tmp_path, layer="nowhere")
    assert done.returncode == 3, done.stderr
    assert not (tmp_path / "out").exists()
    with fresh(installed):
        assert build(tmp_path).returncode == 0
