"""The report page: self-contained, escaped, complete, the same bytes for the same world."""

import json
import re
from base64 import b64encode
from hashlib import sha256
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from PIL import UnidentifiedImageError

from terrain_forge.base import DataError
from terrain_forge.model import Export
from terrain_forge.report import write_report_page
from terrain_forge.report.blocks import Block, panels, plot
from terrain_forge.report.describe import describe
from terrain_forge.report.glossary import explained
from terrain_forge.report.lines import ground_lines
from terrain_forge.report.page import render
from terrain_forge.report.section import Built, Section
from terrain_forge.report.sections.checks import check_blocks
from terrain_forge.report.sections.summary import Files
from terrain_forge.report.sections.view import scripts
from terrain_forge.terrain import slope_statistics
from terrain_forge.truth.size_frequency import write_size_frequency
from terrain_forge.writers import write_png
from tests.helpers import worlds
from tests.helpers.pictures import MAP
from tests.helpers.places import ROOT
from tests.unit.truth.test_size_frequency_verification import population, rocks

HOSTILE = "<script>alert('&\"x\"')</script>"
CHECKS = [
    {"name": "mjcf: ground", "figure": 3.25e-6, "unit": "m", "limit": 0.001, "passed": True,
     "note": "2000 points", "group": "exports"},
    {"name": "drive: completed", "figure": True, "unit": "", "limit": True, "passed": True,
     "note": "", "group": "drive"},
    {"name": f"drive: {HOSTILE}", "figure": 0.62, "unit": "m", "limit": 0.5, "passed": False,
     "note": f"at <40 s> {HOSTILE}", "group": "drive"},
    {"name": "rocks: sizes of pebbles", "figure": 0.5, "unit": "", "limit": 0.001, "passed": True,
     "note": "", "group": "rocks"},
    {"name": "rocks: sizes of boulders", "figure": 0.0, "unit": "", "limit": 0.001,
     "passed": False, "note": "", "group": "rocks"},
    {"name": "drive: distance", "figure": 3.0, "unit": "m", "limit": None, "passed": True,
     "note": "", "group": "drive"},
]  # fmt: skip
VOID = {"meta", "img", "rect", "line", "input", "source"}


class Page(HTMLParser):
    """What a browser would see, load and run."""

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.sources, self.words, self.style = [], [], [], [], ""
        self.links, self.anchors, self.scripts, self.policy = [], set(), [], ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        for name, value in attributes:
            assert not name.startswith("on"), name
            if tag == "a":
                self.links += [value] if name == "href" else []
            elif name in ("src", "href", "srcset", "data", "action", "poster"):
                self.sources.append(value)
            if name == "id":
                self.anchors.add(value)
        if ("http-equiv", "Content-Security-Policy") in attributes:
            self.policy = dict(attributes)["content"]
        if tag == "script":
            self.scripts.append("")
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] == "style":
            self.style += data
        elif self.open and self.open[-1] == "script":
            self.scripts[-1] += data
        elif data.strip():
            self.words.append(data.strip())

    @property
    def text(self):
        return " ".join(self.words)


def build(folder, *, name="Gale & co", validated=True, fill=True):
    world = worlds.world()
    recipe = {
        "dtm": {"kind": "raster", "source": f"../dtm/{HOSTILE}.tif"},
    }
    world = world.replace(site=world.site.replace(name=name, recipe_json=json.dumps(recipe)))
    if fill:
        (folder / "truth").mkdir(parents=True)
        specs = (population("pebbles", diameter=(0.2, 0.7)),
                 population("boulders", diameter=(0.7, 1.2)))  # fmt: skip
        write_size_frequency(world, folder / "truth", rocks=rocks(*specs))
        write_png(folder / "preview.png", np.full((72, 128, 3), 90, np.uint8))
    if validated:
        (folder / "validation").mkdir()
        report = {"passed": False, "checks": CHECKS}
        (folder / "validation" / "report.json").write_text(json.dumps(report))
        write_png(folder / "validation" / "drive.png", np.zeros((8, 8, 3), np.uint8))
    options = {"old gazebo": {"flavour": "classic"}}
    kinds = {"sdf": "sdf", "old gazebo": "sdf", "mjcf": "mjcf", "usd": "usd", "gone": "gone"}
    exports = tuple(
        Export(folder=folder, kind=kind, options=options.get(folder, {}))
        for folder, kind in kinds.items()
    )
    return write_report_page(world, folder, exports=exports if fill else ())


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    return build(tmp_path_factory.mktemp("OUT")).read_text(encoding="utf-8")


def test_the_page_needs_nothing_but_itself(report):
    page = Page(report)
    assert page.open == []
    assert len(page.sources) == 6  # the curves of the rocks are two panels
    assert all(re.match(r"data:image/(png|jpeg);base64,[A-Za-z0-9+/=]+$", s) for s in page.sources)
    assert not {"link", "iframe", "object", "base", "form"} & set(page.tags)
    assert "url(" not in page.style
    assert "@import" not in page.style
    for script in page.scripts:
        report = report.replace(script, "")
    assert "://" not in report


def test_the_page_runs_its_own_scripts_and_forbids_the_rest(report):
    page = Page(report)
    model, *ours = page.scripts
    assert tuple(ours) == scripts()
    assert re.fullmatch(r"[A-Za-z0-9+/=]+", model)
    for script in ours:
        assert f"'sha256-{b64encode(sha256(script.encode()).digest()).decode()}'" in page.policy
    assert page.policy.startswith("default-src 'none'; img-src data: blob:; connect-src blob:;")
    assert "unsafe" not in page.policy.partition("script-src")[2]
    assert re.findall(r"https?://[^\"'`) ]*", "".join(ours)) == ["http://www.w3.org/1999/xhtml"]
    assert "Copyright © 2010-2026 three.js authors" in ours[0]


def test_every_link_leads_to_a_section(report):
    page = Page(report)
    assert len(page.links) >= 7
    assert {link.removeprefix("#") for link in page.links} <= page.anchors


def test_what_others_wrote_is_escaped(tmp_path):
    text = build(tmp_path, name=HOSTILE).read_text(encoding="utf-8")
    page = Page(text)
    assert tuple(page.scripts[1:]) == scripts()
    assert page.words.count(HOSTILE) >= 2
    assert f"drive: {HOSTILE}" in page.words
    assert f"../dtm/{HOSTILE}.tif" in page.words


def test_every_check_stands_there_with_figure_limit_and_verdict(report):
    text = Page(report).text
    assert "2 of 5 checks failed" in text
    drive = f"drive: {HOSTILE}: 0.62 m, limit 0.5 m (at <40 s> {HOSTILE})"
    assert f"2 of 5 checks failed {drive}; rocks: sizes of boulders: 0, limit 0.001" in text
    assert "mjcf: ground 2000 points 3.25e\u221206 m 0.001 m pass" in text
    assert "drive: completed yes yes pass" in text
    assert f"drive: {HOSTILE} at <40 s> {HOSTILE} 0.62 m 0.5 m fail" in text


def test_the_proof_of_the_sizes_stands_there(report):
    text = Page(report).text
    assert "Population pebbles boulders together Law golombek, k 0.07, q 3.96" in text
    assert "Diameters 0.2–0.7 m 0.7–1.2 m 0.2–1.2 m" in text
    # The page says what the check of the sizes said, and judges nothing itself.
    assert "Drawn as the law differs –" in text


def test_terms_are_explained_where_they_stand_and_at_the_end(report):
    """The second is for paper and fingers; it has the terms of this page alone, each once."""
    marked = set(re.findall(r'<abbr title="([^"]+)" tabindex="-1">', report))
    listed = re.findall(r"<dt>([^<]+)</dt><dd>([^<]+)</dd>", report.partition('id="terms"')[2])
    assert {meaning for _, meaning in listed} == marked
    assert len(listed) == len(marked) > 15
    assert {"Clark–Evans ratio", "Burial", "Cover"} <= dict(listed).keys()
    assert "Production function" not in dict(listed)  # this world has no craters


@pytest.mark.parametrize(
    ("text", "marked"),
    [
        ("Hurst exponent of the detail", ["Hurst exponent"]),
        ("mean SLIP of the wheels", ["SLIP"]),
        ("z", ["z"]),
        ("agrees, p = 0.2; z-axis of D and p.tif", ["p"]),
        ("posterior, slippery", []),
        (HOSTILE, []),
    ],
)
def test_a_term_is_a_whole_word(text, marked):
    shown = explained(text)
    assert re.findall(r'tabindex="-1">([^<]+)<', shown) == marked
    assert shown.striptags() == " ".join(text.split())


def test_the_reader_meets_verdict_picture_and_commands_first(report):
    places = [report.index(part) for part in (
        "2 of 5 checks failed", 'class="hero"', "python -m mujoco.viewer", "<canvas",
    )]  # fmt: skip
    assert places == sorted(places)
    assert report.count(">Copy</button>") == report.count('<div class="command">') >= 4


def test_each_figure_of_a_drive_stands_there_once(tmp_path):
    (tmp_path / "validation").mkdir()
    drive = {"completed": True, "reason": "arrived", "distance_m": 3.0, "planned_time_s": 9.5,
             "wheels": [{"name": "front", "mean_slip": 0.125}]}  # fmt: skip
    found = {"checks": CHECKS, "drive": drive}
    (tmp_path / "validation" / "report.json").write_text(json.dumps(found))
    text = Page(build(tmp_path, validated=False, fill=False).read_text(encoding="utf-8")).text
    assert text.count("Distance 3 m") == text.count("drive: completed yes") == 1
    assert "Planned time 9.5 s Wheels Name Mean slip front 0.125" in text


def test_panels_of_a_plot_are_parted():
    """A phone shows them below each other; a margin or a narrow gap parts nothing."""
    plotted = np.full((20, 300, 3), 255, np.uint8)
    for begin, end in ((10, 90), (92, 130), (150, 290)):
        plotted[3:17, begin:end] = 80
    first, second = panels(plotted)
    assert (first.shape, second.shape) == ((20, 140, 3), (20, 160, 3))
    assert len(panels(np.full((8, 8, 3), 255, np.uint8))) == 1


def test_each_simulator_has_its_command(report):
    text = Page(report).text
    assert "python -m mujoco.viewer --mjcf=mjcf/scene.xml" in text
    assert 'GZ_SIM_RESOURCE_PATH="$PWD"/sdf/models gz sim sdf/scene.sdf' in text
    assert "GAZEBO_MODEL_PATH=\"$PWD\"/'old gazebo'/models gazebo 'old gazebo'/scene.sdf" in text
    assert "usdview usd/scene.usda" in text
    assert "gone/" not in text


def test_exports_of_others_are_told_by_their_kind_alone(tmp_path):
    directory = tmp_path / "out"
    for name in ("mine", "dataset", "unknown"):
        (directory / name).mkdir(parents=True)
    export = Export(folder="mine", kind="xyz", options={})
    built = Built(directory=directory, world=worlds.world(), exports=(export,))
    (told,) = Files().blocks(built)
    rows = dict(told.rows)
    assert rows["mine"] == "an export: xyz"
    assert rows["dataset"] == "the recording"
    assert rows["unknown"] == ""


def test_what_is_missing_is_said(tmp_path):
    text = Page(build(tmp_path, validated=False, fill=False).read_text(encoding="utf-8")).text
    assert "not validated" in text
    assert "terrain-forge validate" in text
    assert "checks passed" not in text


def test_equal_worlds_have_equal_pages(tmp_path, report):
    (tmp_path / "elsewhere").mkdir()
    assert build(tmp_path / "elsewhere").read_text(encoding="utf-8") == report


def test_what_was_only_measured_is_no_pass():
    checks = [
        {"name": "drive loop: largest tilt", "figure": 12.0, "unit": "deg", "limit": 30.0,
         "passed": True},
        {"name": "drive loop: distance", "figure": 59.68, "unit": "m", "limit": None,
         "passed": True},
        {"name": "drive loop: slip", "figure": -0.25, "unit": "", "limit": None, "passed": True},
    ]  # fmt: skip
    text = Page(render("blocks.html", blocks=list(check_blocks(checks)))).text
    assert text.endswith("pass Measured, without a limit Distance 59.68 m Slip \u22120.25")


def test_any_report_can_be_shown():
    content = {
        "mean_speed_m_s": 0.25,
        "arrived": True,
        "heights_m": list(range(100)),
        "rocks": ["rock_1", "rock_2"],
        "energy": {"driving_j": 1234567, "note": "<b>"},
        "wheels": [{"name": "front_left", "slip": 0.1, "torque_n_m": 4.0}, {"name": "rear_left"}],
        "joints": {"left": {"angle_deg": 2}, "right": {"angle_deg": -3}},
    }
    page = Page(render("blocks.html", blocks=describe(content)))
    assert page.text == (
        "Mean speed 0.25 m/s Arrived yes Rocks rock_1, rock_2 Energy Driving 1\u202f234\u202f567 J "
        "Note <b> Wheels Name Slip Torque [N m] front_left 0.1 4 rear_left – – "
        "Joints Name Angle [°] left 2 right -3"
    )


def test_a_section_for_what_nobody_foresaw(tmp_path):
    (tmp_path / "validation").mkdir()
    found = {"checks": CHECKS, "traversability": {"passable_share": 0.75}}
    (tmp_path / "validation" / "report.json").write_text(json.dumps(found))
    text = Page(build(tmp_path, validated=False, fill=False).read_text(encoding="utf-8")).text
    assert "Further figures Traversability Passable share 0.75" in text


def test_tracks_are_drawn_where_they_were_driven(tmp_path):
    folder = tmp_path / "validation"
    folder.mkdir()
    track = "time_s,x_m,y_m,z_m\n" + "".join(f"{n},{n / 500},2.0,0\n" for n in range(5000))
    (folder / "drive_arc.csv").write_text(track)
    (folder / "drive_arc_wheels.csv").write_text("time_s,front_left_rad_s\n0,1\n1,1\n")
    (folder / "drives.csv").write_text("number,arrived,x_m,y_m,time_s\n0,1,2.0,3.0,4.0\n")
    path, driven = ground_lines(Built(worlds.world(), tmp_path))
    assert (path.name, path.driven, len(path.points)) == ("path arc", False, 240)
    assert (driven.name, driven.driven, len(driven.points)) == ("driven arc", True, 1500)
    np.testing.assert_allclose(driven.points[[0, -1]], [(0, 2), (4999 / 500, 2)])
    shown = build(tmp_path, validated=False, fill=False).read_text(encoding="utf-8")
    across, down = re.findall(r'<polyline points="([0-9.]+),([0-9.]+) ', shown)[1]
    # The world is 24 m wide and 16 m high, its map MAP pixels wide.
    assert float(across) == pytest.approx(12 / 24 * MAP, abs=0.1)
    assert float(down) == pytest.approx(6 / 24 * MAP, abs=0.1)


def test_an_animated_picture_stands_still_for_who_wants_that(tmp_path, monkeypatch):
    from PIL import Image

    frames = [Image.new("RGB", (40, 30), colour) for colour in ("red", "blue", "green")]
    frames[0].save(tmp_path / "drive.gif", save_all=True, append_images=frames[1:])
    page = Page(render("blocks.html", blocks=[plot(tmp_path / "drive.gif", description="A drive")]))
    assert [source.partition(";")[0] for source in page.sources] == [
        "data:image/jpeg", "data:image/gif",
    ]  # fmt: skip
    monkeypatch.setattr("terrain_forge.report.blocks.LARGEST_ANIMATION", 10)
    page = Page(render("blocks.html", blocks=[plot(tmp_path / "drive.gif", description="A drive")]))
    assert page.sources == []
    assert page.text.endswith("drive.gif, beside this page.")


@pytest.mark.skipif(not Path("/proc/self/mem").exists(), reason="no such files here")
@pytest.mark.parametrize("target", ["mem", "maps"])
def test_a_plot_that_is_a_link_to_no_stored_file_is_told(tmp_path, target):
    (tmp_path / "curves.png").symlink_to(f"/proc/self/{target}")
    with pytest.raises((DataError, UnidentifiedImageError)):
        plot(tmp_path / "curves.png", description="Curves")


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


def test_a_section_is_a_class_in_a_module(tmp_path, monkeypatch):
    """It stands in its place, is found in the list of contents, and its values are escaped."""
    from terrain_forge.report import page as page_module

    class Ripples(Section):
        kind, title, place = "ripples", "The ripples", 45

        def blocks(self, built):
            return [Block(kind="paragraph", text=f"{HOSTILE} of {built.world.site.name}", style="")]

    found = page_module.section_types()
    monkeypatch.setattr(page_module, "section_types", lambda: (*found, Ripples))
    page = Page(build(tmp_path).read_text(encoding="utf-8"))
    assert f"{HOSTILE} of Gale & co" in page.words
    place = page.links.index("#the-ripples")
    assert page.links[place - 1 : place + 2] == ["#the-ground", "#the-ripples", "#the-rocks"]


def test_the_section_of_the_documentation_is_one(tmp_path):
    text = (ROOT / "docs" / "report.md").read_text(encoding="utf-8")
    names: dict[str, object] = {}
    exec(re.search(r"```python\n(.*?)```", text, re.DOTALL)[1], names)
    section = names["Ripples"]()
    assert section.blocks(Built(worlds.world(), tmp_path)) == []
    (tmp_path / "truth").mkdir()
    (tmp_path / "truth" / "ripples.json").write_text('{"wavelength_m": 0.4}')
    shown = Page(render("blocks.html", blocks=section.blocks(Built(worlds.world(), tmp_path))))
    assert shown.text == "Wavelength 0.4 m"


def test_a_foreign_section_that_raises_is_left_out(small_world, tmp_path, monkeypatch, caplog):
    class Broken(Section):
        kind, title, place = "broken", "Broken", 5

        def blocks(self, built):
            raise ValueError("boom")

    monkeypatch.setattr("terrain_forge.report.page.section_types", lambda: (Broken,))
    text = write_report_page(small_world, tmp_path).read_text(encoding="utf-8")
    assert "boom" not in text
    where = r"\(tests\.unit\.report\.test_report_page, line \d+\)"
    assert re.search(rf"section 'Broken' of the report {where} is left out: boom", caplog.text)
