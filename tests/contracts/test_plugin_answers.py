"""What the parts of other packages return: judged where it comes in, told in one line."""

from __future__ import annotations

import json

import pytest

from tests.helpers.command_line import run
from tests.helpers.odd_package import MODULES, POINTS
from tests.helpers.plugins import fresh, install

RECIPE = """
schema: 1
name: odd
body: moon
horizon: {reach_m: 0}
dtm: {kind: flat, size_m: [6, 4]}
terrain: {spacing_m: 0.25, layers: [LAYERS]}
rocks: {library: {shapes: 1}, populations: [ROCKS]}
paths: [PATHS]
exports: EXPORTS
"""
ROCKS = "{name: a, size_frequency: {kind: odd, wrong: WRONG}, diameter_m: [0.2, 0.4]}"


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    return install(tmp_path_factory.mktemp("site"), "odd", POINTS, MODULES)


def build(folder, **parts):
    text = RECIPE
    for name in ("layers", "rocks", "paths", "exports"):
        text = text.replace(name.upper(), parts.get(name, "[]" if name == "exports" else ""))
    path = folder / "odd.yaml"
    path.write_text(text)
    return run("build", path, "-o", folder / "out")


def complaint(installed, folder, parts, status=3):
    """The last line of a build that is refused, of which nothing is left."""
    with fresh(installed):
        done = build(folder, **parts)
    assert done.returncode == status, done.stderr
    assert "Traceback" not in done.stderr
    assert not (folder / "out").exists()
    return done.complaints[-1]


def _rocks(wrong):
    return {"rocks": ROCKS.replace("WRONG", wrong)}


REFUSED = [
    ({"layers": "{kind: odd}"}, "layer 'odd' (terrain.layers[0]): relief (odd_layer)"),
    ({"layers": "{kind: odd, what: none}"}, "layer 'odd' (terrain.layers[0]): relief (odd_layer)"),
    ({"layers": "{kind: odd, what: shape}"}, "layer 'odd' (terrain.layers[0]): relief (odd_layer)"),
    ({"layers": "{kind: odd, what: far}"}, "layer 'odd' (terrain.layers[0]): relief (odd_layer)"),
    *(
        (
            {"layers": f"{{kind: odd, what: {what}}}"},
            "layer 'odd' (terrain.layers[0]): relief (odd_layer)",
        )
        for what in ("number", "truths", "masked")
    ),
    ({"layers": "{kind: odd, what: low}"}, "layer 'odd': reach (odd_layer)"),
    ({"layers": "{kind: odd, what: text}"}, "layer 'odd': reach (odd_layer)"),
    ({"layers": "{kind: odd, what: ok}"}, "layer 'odd': brightness (odd_layer)"),
    (_rocks("number"), "size law 'odd': cumulative_number (odd_law)"),
    (_rocks("sample"), "size law 'odd': sample (odd_law)"),
    (_rocks("report"), "size law 'odd': report (odd_law)"),
    *(
        (
            {"paths": f"{{name: p, route: {{kind: odd, size_m: 2, what: {what}}}, speed_m_s: 1}}"},
            "route shape 'odd': outline (odd_shape)",
        )
        for what in ("none", "far", "side", "wrapped")
    ),
    ({"exports": "[weighed]"}, "exporter 'weighed': bytes_each (weighed_exporter)"),
    ({"exports": "[silent]"}, "exporter 'silent': export (odd_exporter)"),
    ({"exports": "[liar]"}, "exporter 'liar': export (liar_exporter)"),
    ({"exports": "[splitter]"}, "exporter 'splitter': export (splitting_exporter)"),
    ({"exports": "{liar: {file: link}}"}, "exporter 'liar': export (liar_exporter)"),
    ({"exports": "{liar: {file: ../../odd.yaml}}"}, "exporter 'liar': export (liar_exporter)"),
]
LEAVING = [
    ({"layers": "{kind: odd, what: exit}"}, 3, "(odd_layer, line "),
    ({"exports": "[leaver]"}, 3, "exporter 'leaver' (leaving_exporter, line "),
    ({"exports": "[ending]"}, 2, "exporter 'ending' (ending_exporter) is installed but broken: "),
]


@pytest.mark.parametrize("number", range(len(REFUSED)))
def test_what_cannot_be_used_is_one_line_that_names_the_module(installed, tmp_path, number):
    parts, named = REFUSED[number]
    told = complaint(installed, tmp_path, parts)
    assert f"terrain-forge: {named} must return " in told


@pytest.mark.parametrize("number", range(len(LEAVING)))
def test_a_plugin_cannot_end_a_build_as_if_it_were_done(installed, tmp_path, number):
    parts, status, named = LEAVING[number]
    told = complaint(installed, tmp_path, parts, status)
    assert named in told
    assert "SystemExit: 0" in told


@pytest.mark.parametrize(
    ("parts", "told"),
    [
        ({"layers": "{kind: odd, what: place}"}, "read-only"),
        ({"exports": "[strayer]"}, "an exporter (straying_exporter) wrote mine beside its folder"),
        ({"exports": "{strayer: {what: go}}"}, "(straying_exporter) changed the current folder"),
        ({"exports": "{strayer: {what: keep}}"}, "'meddler' (meddling_check) changed strayer/kept"),
        (
            {"exports": "{spoilt: {kind: strayer, what: none}}"},
            "(meddling_check) changed validation/report.json",
        ),
        (
            {"exports": "{strayer: {what: link}}"},
            "exporter 'strayer' (straying_exporter) left the link mine in its folder",
        ),
        ({"exports": "{strayer: {what: pipe}}"}, "left 'mine', which is neither a file nor a "),
        ({"exports": "{strayer: {what: bytes}}"}, r"left 'mine\udcff', a name with what cannot "),
        (
            {"exports": "{strayer: {what: log}}"},
            "consumer 'reader' (straying_exporter) changed log",
        ),
        (
            {"exports": "{strayer: {what: leave}}"},
            "what reads an export back changed the current folder",
        ),
        ({"layers": "{kind: odd, what: go}"}, "relief (odd_layer) changed the current folder"),
    ],
)
def test_a_plugin_changes_nothing_but_its_own(installed, tmp_path, parts, told):
    assert told in complaint(installed, tmp_path, parts)


@pytest.mark.parametrize(
    ("parts", "told"),
    [
        ({"layers": "{kind: odd, what: file}"}, " (odd_layer, line "),
        ({"exports": "{strayer: {what: read}}"}, "exporter 'strayer' (straying_exporter, line "),
        ({"exports": "{strayer: {what: lost}}"}, "exporter 'strayer' (straying_exporter, line "),
        ({"exports": "{strayer: {what: full}}"}, "out cannot be written: No space left on device"),
        ({"exports": "{strayer: {what: locked}}"}, "out cannot be written: Permission denied"),
    ],
)
def test_the_output_folder_is_blamed_for_what_is_refused_there(installed, tmp_path, parts, told):
    found = complaint(installed, tmp_path, parts)
    assert told in found
    assert ("failed: FileNotFoundError: " in found) == (", line " in told)


def test_what_a_layer_tells_is_judged(installed, tmp_path):
    path = tmp_path / "odd.yaml"
    text = RECIPE.replace("LAYERS", "{kind: odd, what: ok}").replace("EXPORTS", "[]")
    path.write_text(text.replace("ROCKS", "").replace("PATHS", ""))
    with fresh(installed):
        done = run("check", path)
    assert done.returncode == 3, done.stderr
    assert "terrain-forge: layer 'odd': facts (odd_layer) must return pairs" in done.stderr


def test_how_to_open_an_export_is_judged_and_told_once(installed, tmp_path):
    with fresh(installed):
        done = build(tmp_path, exports="[worded]")
    assert (tmp_path / "out").exists()
    told = "how to open worded is not known: exporter 'worded': opening (worded_exporter) must"
    assert done.stderr.count(told) == 1, done.stderr


@pytest.mark.parametrize("workers", [0, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("what", ["exit", "raise", "file"])
def test_a_plugin_that_fails_in_a_task_is_named(installed, tmp_path, workers, what):
    recipe = RECIPE.replace("LAYERS", f"{{kind: odd, what: {what}}}").replace("EXPORTS", "[]")
    (tmp_path / "odd.yaml").write_text(recipe.replace("ROCKS", "").replace("PATHS", ""))
    out = tmp_path / "many"
    with fresh(installed):
        done = run(
            *("worlds", tmp_path / "odd.yaml", "-o", out, "--count", 1, "--workers", workers)
        )
    assert done.returncode == 1, done.stderr
    assert "not made     00000: layer " in done.stdout
    assert " (odd_layer, line " in done.stdout
    told = {"exit": "SystemExit: 0", "raise": "KeyError: 'raise'", "file": "FileNotFoundError: "}
    assert told[what] in done.stdout


def test_a_check_that_cannot_be_written_has_failed_and_the_world_is_kept(installed, tmp_path):
    """And a law's report needs no kind."""
    with fresh(installed):
        done = build(tmp_path, **_rocks("''"))
        assert run("view", tmp_path / "out", "--no-browser").returncode == 0
    assert done.returncode == 1, done.stderr
    report = json.loads((tmp_path / "out" / "validation" / "report.json").read_text())
    found = {one["name"]: one["note"] for one in report["checks"] if not one["passed"]}
    assert found.keys() == {
        "odd: figure",
        "odd: report",
        "thief: report",
        "none: check",
        "leaver: check",
    }
    assert found["odd: figure"] == "figure nan, not finite"
    assert found["thief: report"] == (
        "cannot be made (odd_check): checks of validation/report.json is another's"
    )
    assert "odd" not in report
    assert "more" not in report
    assert report["kept"] == 1
    counts = json.loads((tmp_path / "out" / "truth" / "size_frequency.json").read_text())
    assert counts["populations"][0]["law"] == {"kind": "odd", "rate": 1.0}


LEFT_OUT = {
    "text": " is left out: its blocks must be Blocks, found 'abc'",
    "nothing": " is left out: 'NoneType' object is not iterable",
    "single": ", line 14) is left out: a row of facts must be a name and what it is, found ('a',)",
    "number": ", line 18) is left out: must be text or a Cell, found 3.5",
    "late": ", line 23) is left out: KeyError",
    "made": " is left out: 'unheard of.html' not found",
    "bare": " is left out: 'terrain_forge.report.blocks.Block object' has no attribute 'rows'",
}


def test_a_section_that_cannot_be_shown_is_left_out_and_the_world_is_kept(installed, tmp_path):
    with fresh(installed):
        done = build(tmp_path)
    page = (tmp_path / "out" / "report.html").read_text()
    assert done.returncode == 1, done.stderr  # for the checks
    assert page.count("kept") == 2
    assert "never shown" not in page
    assert done.stderr.count(" of the report (odd_section") == len(LEFT_OUT)
    for title, why in LEFT_OUT.items():
        (line,) = (one for one in done.complaints if f"section {title!r} of" in one)
        assert line.startswith(f"section {title!r} of the report (odd_section")
        assert why in line, line


UNNAMED = (
    "cannot name a folder, choose another name: up to 100 characters without / \\ : commas, "
    "a leading dot or control ones"
)


PART = "is part of every recording, choose another name"


@pytest.mark.parametrize("name", ["truth", "../evil"])
def test_an_exporter_whose_name_can_be_no_folder_is_refused(installed, tmp_path, name):
    path = tmp_path / "odd.yaml"
    text = RECIPE.replace("EXPORTS", f"{{x: {{kind: {name}}}}}")
    path.write_text(text.replace("LAYERS", "").replace("ROCKS", "").replace("PATHS", ""))
    with fresh(installed):
        named = run("build", path, "-o", tmp_path / "out")
        only = run("build", path, "-o", tmp_path / "out", "--only", name)
    for done in (named, only):
        assert done.returncode == 2, done.stderr
        assert "choose another name" in done.complaints[-1]
    assert not list(tmp_path.glob("*evil*"))
    assert not (tmp_path / "out").exists()


def test_a_system_s_file_that_cannot_be_used_is_skipped_beside_those_that_can(installed):
    with fresh(installed, anew=True):
        done = run("evaluate", "--list")
    assert done.returncode == 0, done.stderr
    names = [line.split()[0] for line in done.stdout.splitlines()]
    assert {"mine", "kiss-icp"} <= set(names)
    assert not {"broken", "keyed", "lacking"} & set(names)
    folder = installed / "odd_systems"
    for file, why in {
        "broken.yaml": " cannot be read: while parsing a flow sequence",
        "keyed.yaml": " cannot be read: keys must be",
        "kiss-icp.yaml": ": there is a system of that name",
        "lacking.yaml": ": command: is missing",
    }.items():
        told = f"system 'fleet' (odd_systems) is skipped: {folder / file}{why}"
        assert done.stderr.count(told) == 1, done.stderr
    assert "system 'none' (odd_layer) is skipped: has no .yaml file of a system" in done.stderr


def test_doctor_lists_the_parts_of_others(installed):
    with fresh(installed, anew=True):
        done = run("doctor")
    assert done.returncode == 0
    assert "hello" not in done.stdout  # what a module prints as it is imported
    lines = [" ".join(line.split()) for line in done.stdout.splitlines()]
    for line in (
        "layer odd works (odd_layer)",
        "layer typo not working (typo_layer): Typo has not `kind: Literal['tpyo'] = 'tpyo'`",
        "size law odd works (odd_law)",
        "layer moved not working (moved_layer): as it is imported it changed the current folder",
        "check odd works as leaver, none, odd, thief (odd_check)",
        "body rock works (rock_body)",
        "report section odd not working (odd_section): Placed has place = '46', which is no int",
        "layer misnamed not working (odd_layer): nothing is looked for in terrain_forge.layer",
        "exporter truth not working (liar_exporter): 'truth' is part of every world, "
        "choose another name",
        f"exporter ../evil not working (liar_exporter): '../evil' {UNNAMED}",
        f"exporter a,b not working (liar_exporter): 'a,b' {UNNAMED}",
        "system none not working (odd_layer): has no .yaml file of a system",
        "exporter gone not working (gone_exporter): No module named 'a_module_that_nobody_has'",
        "exporter lone not working (lone_exporter): "
        "has CONSUMERS, a Consumer: no tuple of Consumers",
        f"instrument odd not working (odd_instruments): Up has a wrong folder: '../up' {UNNAMED}; "
        f"Eye has a wrong folder: 'cam' {PART}; "
        f"True_ has a wrong folder: 'state_groundtruth_estimate' {PART}",
    ):
        assert line in lines, done.stdout
    assert f"system fleet not working (odd_systems): {installed}/odd_systems/broken.yaml" in (
        " ".join(done.stdout.split())
    )
    assert done.stderr.count("a_module_that_nobody_has") == 1
