"""The documentation: its snippets run, its links lead to files, its made pages are current."""

from __future__ import annotations

import ast
import importlib
import json
import re
import subprocess
import sys

import pytest

import terrain_forge as tf
from terrain_forge.base import DataError
from terrain_forge.pipeline import check
from tests.helpers import worlds
from tests.helpers.places import ROOT
from tests.helpers.rovers import morpheus

PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])


@pytest.mark.slow
def test_api_tour_runs(tmp_path, monkeypatch):
    """In order, in one namespace, as a reader would."""
    page = ROOT / "docs" / "api.md"
    text = page.read_text(encoding="utf-8")
    blocks = list(re.finditer(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL))
    assert len(blocks) > 10
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PKG_CONFIG_LIBDIR", "")  # no probe is compiled for Gazebo's library
    namespace: dict[str, object] = {"__name__": "tour"}
    for block in blocks:
        line = text.count("\n", 0, block.start(1))
        code = compile("\n" * line + block.group(1), str(page), "exec", dont_inherit=True)
        exec(code, namespace)
    assert (tmp_path / "garden" / "sdf" / "world.sdf").is_file()
    assert len((tmp_path / "points.xyz").read_text().splitlines()) == 97 * 129


@pytest.mark.parametrize("kind", ["mjcf", "geotiff", "usd"])
def test_pages_of_exporters_open_them_as_they_say(kind, tmp_path, monkeypatch):
    """In order, in one namespace, in the world's folder."""
    page = ROOT / "docs" / "exporters" / f"{kind}.md"
    blocks = re.findall(r"^```py\n(.*?)^```", page.read_text(encoding="utf-8"), re.M | re.S)
    assert blocks
    world, exporter = worlds.world(rover=morpheus()), tf.exporter(kind)
    (tmp_path / kind).mkdir()
    exporter.export(world, tmp_path / kind, options=exporter.Options())
    monkeypatch.chdir(tmp_path)
    namespace: dict[str, object] = {}
    for block in blocks:
        exec(block.replace("loop", world.trajectories[0].name), namespace)


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_links_lead_to_files(page):
    links = re.findall(r"\]\(([^)#]*)(?:#[^)]*)?\)", page.read_text(encoding="utf-8"))
    local = [link for link in links if link and "://" not in link]
    assert [link for link in local if not (page.parent / link).exists()] == []


@pytest.mark.parametrize("path", sorted(ROOT.glob("benchmarks/*.py")), ids=lambda p: p.stem)
def test_benchmarks_name_what_there_is(path):
    """What they import of ours is there; they are run by hand."""
    for part in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(part, ast.ImportFrom) and (part.module or "").startswith("terrain_forge"):
            room = importlib.import_module(part.module)
            assert [name.name for name in part.names if not hasattr(room, name.name)] == []


BASE = {
    "name": "task",
    "body": "moon",
    "dtm": {"kind": "flat", "size_m": [40, 40]},
    "terrain": {"spacing_m": 0.1},
    "paths": [
        {
            "name": "loop",
            "route": {"kind": "spline", "points_m": [[0, 0], [5, 0], [5, 5]]},
            "speed_m_s": 0.3,
        }
    ],
}
PIECES = [
    pytest.param(piece, id=f"{page}: {piece.split(':', 1)[0]}")
    for page in ("tasks", "lidars", "sensors")
    for piece in re.findall(
        r"^```yaml\n(.*?)^```",
        (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8"),
        re.MULTILINE | re.DOTALL,
    )
]


@pytest.mark.parametrize("piece", PIECES)
def test_pieces_of_recipes_pass_check_but_for_files_that_they_name(piece, tmp_path):
    """With the default rover, on a plain world."""
    recipe = tmp_path / "recipe.yaml"
    kept = {key: value for key, value in BASE.items() if not re.search(f"^{key}:", piece, re.M)}
    recipe.write_text(f"{piece}\n" + "".join(f"{k}: {json.dumps(v)}\n" for k, v in kept.items()))
    told = tf.load_recipe(recipe).recipe
    try:
        lines = list(check(told, folder=tmp_path))
    except DataError as error:
        if "no such file: " not in str(error):
            raise
    else:
        assert lines


def test_generated_pages_are_current():
    command = [sys.executable, ROOT / "docs" / "make_pages.py", "--check"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_citation_names_the_version():
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {tf.__version__}\n" in text


def test_every_key_has_a_meaning():
    """Those of a part's bases too, such as a layer's mask; a kind may speak for itself."""
    rows = re.findall(r"^\| `(\w+)` \|.*\|  \|$", (ROOT / "docs/recipe.md").read_text(), re.M)
    assert set(rows) == {"kind"}
