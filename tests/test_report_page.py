"""The report page: self-contained, escaped, complete, the same bytes for the same world."""

import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from terrain_forge.report.page import write_report_page
from terrain_forge.terrain.statistics import slope_statistics
from terrain_forge.truth.size_frequency import write_size_frequency
from terrain_forge.writers.image import write_png
from tests import worlds
from tests.test_proof import population, rocks

HOSTILE = "<script>alert('&\"x\"')</script>"
CHECKS = [
    {"name": "mjcf: ground", "figure": 3.25e-6, "unit": "m", "limit": 0.001, "passed": True,
     "note": "2000 points"},
    {"name": "drive: completed", "figure": True, "unit": "", "limit": True, "passed": True,
     "note": ""},
    {"name": f"drive: {HOSTILE}", "figure": 0.62, "unit": "m", "limit": 0.5, "passed": False,
     "note": f"at <40 s> {HOSTILE}"},
]  # fmt: skip
VOID = {"meta", "img", "rect", "line"}


class Page(HTMLParser):
    """What a browser would see, load and run."""

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.sources, self.words, self.style = [], [], [], [], ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        for name, value in attributes:
            assert not name.startswith("on"), name
            if name in ("src", "href", "srcset", "data", "action", "poster"):
                self.sources.append(value)
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] == "style":
            self.style += data
        elif data.strip():
            self.words.append(data.strip())

    @property
    def text(self):
        return " ".join(self.words)


def build(folder, *, name="Gale & co", validated=True, fill=True):
    world = worlds.world()
    classic = {"kind": "sdf", "flavour": "classic"}
    recipe = {
        "dtm": {"kind": "raster", "source": f"../dtm/{HOSTILE}.tif"},
        "exports": {"sdf": {}, "old gazebo": classic},
    }
    world = world.replace(site=world.site.replace(name=name, recipe_json=json.dumps(recipe)))
    if fill:
        (folder / "truth").mkdir(parents=True)
        specs = (population("pebbles", diameter=(0.2, 0.7)),
                 population("boulders", diameter=(0.7, 1.2)))  # fmt: skip
        write_size_frequency(world, folder / "truth", rocks=rocks(*specs))
        write_png(folder / "preview.png", np.full((72, 128, 3), 90, np.uint8))
        for path in ("sdf/scene.sdf", "old gazebo/scene.sdf", "mjcf/scene.xml", "usd/scene.usdc"):
            (folder / path).parent.mkdir()
            (folder / path).touch()
    if validated:
        (folder / "validation").mkdir()
        report = {"passed": False, "checks": CHECKS}
        (folder / "validation" / "report.json").write_text(json.dumps(report))
        write_png(folder / "validation" / "drive.png", np.zeros((8, 8, 3), np.uint8))
    return write_report_page(world, folder)


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    return build(tmp_path_factory.mktemp("OUT")).read_text(encoding="utf-8")


def test_the_page_needs_nothing_but_itself(report):
    page = Page(report)
    assert page.open == []
    assert len(page.sources) == 5
    assert all(re.match(r"data:image/(png|jpeg);base64,[A-Za-z0-9+/=]+$", s) for s in page.sources)
    assert not {"script", "link", "iframe", "object", "base", "a"} & set(page.tags)
    assert "url(" not in page.style
    assert "@import" not in page.style
    assert "://" not in report


def test_what_others_wrote_is_escaped(tmp_path):
    text = build(tmp_path, name=HOSTILE).read_text(encoding="utf-8")
    page = Page(text)
    assert "script" not in page.tags
    assert page.words.count(HOSTILE) >= 2
    assert f"drive: {HOSTILE}" in page.words
    assert f"../dtm/{HOSTILE}.tif" in page.words


def test_every_check_stands_there_with_figure_limit_and_verdict(report):
    text = Page(report).text
    assert "1 of 3 checks failed" in text
    assert "mjcf: ground 3.25e-06 m 0.001 m pass 2000 points" in text
    assert "drive: completed yes yes pass" in text
    assert "0.62 m 0.5 m fail at <40 s>" in text


def test_the_proof_of_the_sizes_stands_there(report):
    text = Page(report).text
    for words in ("pebbles golombek, k 0.07, q 3.96 0.2–0.7", "boulders", "together", "differs"):
        assert words in text


def test_each_simulator_has_its_command(report):
    text = Page(report).text
    assert "python -m mujoco.viewer --mjcf=mjcf/scene.xml" in text
    assert 'GZ_SIM_RESOURCE_PATH="$PWD"/sdf/models gz sim sdf/scene.sdf' in text
    assert "GAZEBO_MODEL_PATH=\"$PWD\"/'old gazebo'/models gazebo 'old gazebo'/scene.sdf" in text
    assert "usdview usd/scene.usdc" in text


def test_what_is_missing_is_said(tmp_path):
    text = Page(build(tmp_path, validated=False, fill=False).read_text(encoding="utf-8")).text
    assert "not validated" in text
    assert "terrain-forge validate" in text
    assert "checks passed" not in text


def test_equal_worlds_have_equal_pages(tmp_path, report):
    (tmp_path / "elsewhere").mkdir()
    assert build(tmp_path / "elsewhere").read_text(encoding="utf-8") == report


def test_slopes_of_a_plane_are_its_own():
    ground = worlds.ground()
    plane = 0.3 * ground.east[None, :] - 0.4 * ground.north[:, None]
    found = slope_statistics(ground.replace(elevation=plane))
    slope = np.degrees(np.arctan(0.5))
    assert found.steepest_deg == pytest.approx(slope, abs=1e-3)
    assert found.rms_deg == pytest.approx(slope, abs=1e-3)
    assert found.median_deg == pytest.approx(slope, abs=0.011)
    assert found.shares[26] == pytest.approx(1.0)


def test_slopes_are_those_of_the_triangles():
    # One raised node: six of the eight triangles around a cell's corner meet it.
    elevation = np.zeros((3, 3))
    elevation[1, 1] = 1.0
    found = slope_statistics(worlds.ground().replace(elevation=elevation, spacing=1.0))
    assert found.shares[0] == pytest.approx(2 / 8)
    assert found.shares[45] == pytest.approx(4 / 8)
    assert found.shares[54] == pytest.approx(2 / 8)
    assert found.rms_deg == pytest.approx(np.degrees(np.arctan(1.0)))
