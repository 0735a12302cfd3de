"""Systems that were evaluated, on the report page; and the paper's tables beside them."""

from __future__ import annotations

import csv
import json
import sys

import numpy as np
import pytest

from terrain_forge.datasets import open_recording
from terrain_forge.evaluation import (
    Adapter,
    ScoreOptions,
    evaluate_recording,
    paper_rows,
    read_errors,
)
from terrain_forge.report import evaluate, evaluate_maps
from terrain_forge.report.page import render
from terrain_forge.report.section import Built
from terrain_forge.report.sections.localisation import Localisation
from tests.helpers import worlds
from tests.helpers.recordings import write_recording
from tests.unit.report.test_report_page import Page

_COPY = "import shutil,sys;shutil.copy(sys.argv[1]+'/truth/cam0.tum',sys.argv[2])"


@pytest.fixture(scope="module")
def evaluated(tmp_path_factory):
    """A folder whose recording is said to be of the paper's path, and its systems' results."""
    out = tmp_path_factory.mktemp("OUT")
    dataset = write_recording(out / "dataset")
    about = json.loads((dataset / "dataset.json").read_text())
    about["world"]["name"] = "gale_short"
    for sensor in about["sensors"]:
        if sensor["kind"] == "lidar":
            sensor |= {"channels": 16, "vertical_fov_deg": 30.0, "elevations_deg": [],
                       "rate_hz": 10.0, "noise_m": 0.01, "snapshot": False,
                       "firing_period_us": 0.0, "horizontal_samples": 1800}  # fmt: skip
    (dataset / "dataset.json").write_text(json.dumps(about))
    command = f'{sys.executable} -c "{_COPY}" {{input}} {{output}}'
    systems = [
        Adapter(name="orb-slam3", command=command, frame="cam0"),
        Adapter(name="mine", command=command, frame="cam0"),
        Adapter(name="a-loam", command="/nowhere/a-loam"),
    ]
    return out, evaluate_recording(dataset, systems, runs=2, options=ScoreOptions(align="origin"))


def test_the_papers_figures_stand_beside_ours(evaluated):
    out, results = evaluated
    folder = out / "dataset/slam"
    with (folder / "paper.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["system"] for row in rows] == [
        "ORB-SLAM2", "RTAB-Map", "LibVISO2", "A-LOAM", "HDL", "LeGO-LOAM", "mine",
    ]  # fmt: skip
    first, loam, mine = rows[0], rows[3], rows[-1]
    assert (first["ATE in the paper [m]"], first["TDr in the paper [%]"]) == ("0.07", "1.91")
    assert first["here by"] == "orb-slam3"
    assert float(first["ATE here [m]"].split()[0]) < 1e-6
    assert (loam["ATE in the paper [m]"], loam["ATE here [m]"]) == ("7.65", "failed")
    assert (mine["ATE in the paper [m]"], mine["here by"]) == ("–", "")
    assert rows[1]["ATE here [m]"] == "not run"
    text = (folder / "paper.txt").read_text()
    assert text.startswith("Table III (Short) of Giubilato et al. 2020")
    for told in (
        "orb-slam3 stands for ORB-SLAM2: its stereo mode is the older one's",
        "in the paper about 60 m",
        "alignment origin by length",
        "runs: 2 here, one in the paper",
        "lidar: 16 beams from -15 to 15 deg, not 64 of ±16; each point at its own time",
        "imu: here, the paper had none",
        "ORB-SLAM: 2000 features of a picture, not 2400",
    ):
        assert told in text, told
    assert text.count("differs: ") == (folder / "paper.tex").read_text().count("% differs: ")
    assert len(paper_rows(results, "gale-long")) == 8


def test_errors_are_kept_of_each_pose(evaluated):
    out, results = evaluated
    rows = read_errors(out / "dataset/slam/mine_2/errors.csv")
    truth = open_recording(out / "dataset").truth_of(open_recording(out / "dataset").sensor("cam0"))
    np.testing.assert_allclose(rows[:, 2:5], truth.position, atol=1e-6)
    assert rows[:, 5].max() < 1e-6
    assert not (out / "dataset/slam/a-loam_1/errors.csv").exists()
    np.testing.assert_allclose(results[0].score.alignment[:3, 3], 0.0, atol=1e-6)


def test_the_section_shows_tables_and_plots(evaluated):
    out, _ = evaluated
    page = Page(render("blocks.html", blocks=Localisation().blocks(Built(worlds.world(), out))))
    kinds = [source.partition(";")[0] for source in page.sources]
    assert kinds == ["data:image/png"] * 2
    for words in (
        "Table III (Short)",
        "ORB-SLAM2 0.07",
        "Differs: runs: 2 here, one in the paper",
        "stands for ORB-SLAM2",
        "2 of 2",
        "failed: /nowhere/a-loam: no such file or directory",
    ):
        assert words in page.text, words


def test_a_world_without_results_has_no_section(tmp_path):
    assert Localisation().blocks(Built(worlds.world(), tmp_path)) == []
    write_recording(tmp_path / "dataset")
    assert Localisation().blocks(Built(worlds.world(), tmp_path)) == []
    folder = tmp_path / "dataset/slam"
    folder.mkdir()
    (folder / "maps.csv").write_text("map,points\ngrid,3\n")
    page = Page(
        render("blocks.html", blocks=Localisation().blocks(Built(worlds.world(), tmp_path)))
    )
    assert "grid 3" in page.text
    for text, why in (
        ("", "evaluation.csv is empty"),
        ("system,ate,tdr\na,1\n", "evaluation.csv: row 2 has 2 of 3 fields"),
    ):
        (folder / "evaluation.csv").write_text(text)
        (block,) = Localisation().blocks(Built(worlds.world(), tmp_path))
        assert "cannot be shown" in block.text
        assert why in block.text


def test_results_are_told_of_a_world_that_cannot_be_loaded(tmp_path, caplog):
    """As where the package of one of its parts is gone."""
    write_recording(tmp_path / "dataset")
    (tmp_path / "world").mkdir()
    command = f'{sys.executable} -c "{_COPY}" {{input}} {{output}}'
    (result,) = evaluate(tmp_path, [Adapter(name="mine", command=command, frame="cam0")])
    assert result.score is not None
    assert "evaluated, but the report page is not written anew: " in caplog.text


def test_an_interrupt_over_the_page_says_what_is_scored(tmp_path):
    def interrupt(stage, _):
        if stage == "report page":
            raise KeyboardInterrupt

    write_recording(tmp_path / "dataset")
    worlds.world().save(tmp_path)
    (tmp_path / "map.txt").write_text("0 0 0\n1 1 0\n")
    command = f'{sys.executable} -c "{_COPY}" {{input}} {{output}}'
    system = Adapter(name="mine", command=command, frame="cam0")
    with pytest.raises(KeyboardInterrupt, match=r"^all runs are scored, the report page is not"):
        evaluate(tmp_path, [system], progress=interrupt)
    with pytest.raises(KeyboardInterrupt, match=r"^the maps are scored, the report page is not"):
        evaluate_maps(tmp_path, [str(tmp_path / "map.txt")], progress=interrupt)
