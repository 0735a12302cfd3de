"""Systems that are known: binaries of the user's, files of his own, installations."""

from __future__ import annotations

import re
import sys
from dataclasses import replace

import numpy as np
import pytest

from terrain_forge.base import DataError
from terrain_forge.datasets import open_recording
from terrain_forge.evaluation import (
    catalogue,
    chosen_systems,
    evaluate_recording,
    find_system,
    install_system,
    known_systems,
    system_lines,
)
from terrain_forge.evaluation.bench import truth_of
from terrain_forge.evaluation.catalogue import read_system, with_binaries
from terrain_forge.evaluation.needs import sensor_places
from terrain_forge.evaluation.paper import paper_figure
from tests.helpers import command_line


def test_a_binary_is_named_by_its_path(dataset, tmp_path):
    """ORB-SLAM2 as documented: its three arguments, its file, its format."""
    program = tmp_path / "ORB_SLAM2" / "Examples" / "Stereo" / "stereo_kitti"
    program.parent.mkdir(parents=True)
    program.write_text(
        f"#!{sys.executable}\nimport shutil, sys\n"
        "vocabulary, settings, sequence = sys.argv[1:]\n"
        "assert open(vocabulary).read() == 'words'\n"
        "assert 'Camera.bf' in open(settings).read()\n"
        "assert len(open(f'{sequence}/times.txt').readlines()) == 5\n"
        "shutil.copy(f'{sequence}/../../poses/00.txt', 'CameraTrajectory.txt')\n"
    )
    program.chmod(0o755)
    (tmp_path / "ORB_SLAM2" / "Vocabulary").mkdir()
    (tmp_path / "ORB_SLAM2" / "Vocabulary" / "ORBvoc.txt").write_text("words")
    systems = chosen_systems("orb-slam2", dataset, [f"orb-slam2={program}"])
    (result,) = evaluate_recording(dataset, systems)
    assert result.run.status == "done", result.run.log
    assert result.score.ate.rms < 1e-9
    systems = chosen_systems("wheel-odometry", dataset, ["orb-slam2=/nope"])
    other, missing = evaluate_recording(dataset, systems)
    assert (missing.run.status, missing.run.why) == ("failed", "orb-slam2: no such program: /nope")
    assert other.run.why != missing.run.why  # it went on
    for told, why in {
        "orb-slam2": "NAME=PATH",
        "orb-slam=/x": r"unknown system 'orb-slam' \(did you mean",
        "kiss-icp=/x": "kiss-icp: that system runs no program of yours",
    }.items():
        with pytest.raises(DataError, match=why):
            with_binaries([], [told])


def test_libviso2s_binary_is_given_a_sequence(dataset, tmp_path):
    program = tmp_path / "program"
    program.write_text(
        f"#!{sys.executable}\nimport shutil, sys\nsource, target = sys.argv[1:]\n"
        "assert 'P1:' in open(f'{source}/calib.txt').read()\n"
        "shutil.copy(f'{source}/../../poses/00.txt', target)\n"
    )
    program.chmod(0o755)
    (result,) = evaluate_recording(dataset, with_binaries([], [f"libviso2={program}"]))
    assert result.run.status == "done", result.run.log
    assert result.score.ate.rms < 1e-9


def test_without_a_vocabulary_its_making_is_told(dataset, monkeypatch, tmp_path):
    monkeypatch.setenv("TERRAIN_FORGE_CACHE", str(tmp_path / "none"))
    (result,) = evaluate_recording(dataset, with_binaries([], ["orb-slam2=/bin/true"]))
    assert result.run.why == (
        "orb-slam2 needs a vocabulary: terrain-forge evaluate --install orb-slam2"
    )


def test_the_catalogue_is_whole(dataset):
    six = {"orb-slam2", "rtab-map", "libviso2", "a-loam", "lego-loam", "hdl-graph-slam"}
    assert six <= known_systems().keys()
    places = dict.fromkeys(find_system("imu").PLACES, "x")
    for name, adapter in known_systems().items():
        assert adapter.name == name
        assert adapter.about
        assert len(adapter.words(places)) > 1
        assert adapter.needs_binary == (name in six)
        frame = adapter.frame_of(sensor_places(open_recording(dataset)))
        if adapter.needs != ("odometry",):
            assert len(truth_of(open_recording(dataset), frame).time) > 1
        told = "".join(adapter.needs)  # a frame whose truth it needs not have is not its own
        assert {"lidar0": "lidar", "cam0": "stereo"}.get(frame, "") in told
        assert not re.search("cam[0-9]|lidar[0-9]|imu[0-9]", f"{adapter.frame} {adapter.command}")
    listed = command_line.run("evaluate", "--list").stdout
    assert [line.split()[0] for line in listed.splitlines()] == list(known_systems())
    with pytest.raises(DataError, match="needs no packages"):
        install_system(find_system("imu"))


def test_by_default_those_that_are_there_and_find_their_sensors(dataset, monkeypatch, tmp_path):
    monkeypatch.setenv("TERRAIN_FORGE_CACHE", str(tmp_path))  # nothing is installed
    monkeypatch.setattr(catalogue, "find_spec", lambda _: None)
    assert [one.name for one in chosen_systems(None, dataset)] == ["imu"]
    listed = {line.split("  ")[0]: line for line in system_lines()}
    assert " not installed " in listed["stereo-odometry"]
    with pytest.raises(DataError, match=r"stereo-odometry needs the module cv2: pip install '"):
        install_system(find_system("stereo-odometry"))
    with pytest.raises(DataError, match="imu needs the module mine: install it for /"):
        catalogue.require_ready(replace(find_system("imu"), modules=("mine",)))
    monkeypatch.setattr(catalogue, "find_spec", lambda _: True)
    assert [one.name for one in chosen_systems(None, dataset)] == ["imu", "stereo-odometry"]
    more = chosen_systems(None, dataset, ["libviso2=viso"])
    assert [one.binary for one in more] == ["", "", "viso"]


WRONG = {
    "- a list": "a system is a mapping of keys",
    "needs: [radar]\ncommand: x": r"needs\[0\]: must be 'mono', 'stereo'",
    "needs: [imu]": "command: ",
    "command: x\nformat: ply": "format: must be 'tum'",
    "command: x\nspeed: 3": "speed: ",
    "command: [x": "expected",
}


@pytest.mark.parametrize("text", WRONG)
def test_a_wrong_file_is_told(tmp_path, text):
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    with pytest.raises(DataError, match=WRONG[text]) as error:
        read_system(path)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


def test_the_papers_figures_stand_beside_those_of_its_paths():
    assert paper_figure("lego-loam", "gale-short").ate == 0.63
    assert paper_figure("orb-slam3", "gale_long").system == "ORB-SLAM2"
    assert paper_figure("orb-slam2", "hello-mars") is None
    assert paper_figure("kiss-icp", "gale-long") is None
    drift = [paper_figure(name, "gale-long").drift for name in ("libviso2", "hdl-graph-slam")]
    np.testing.assert_allclose(drift, [0.0034, 0.603])


@pytest.mark.parametrize("place", ["/tmp/victim", "..", ".", "a/b"])
def test_an_environment_lies_nowhere_else(tmp_path, place):
    path = tmp_path / "mine.yaml"
    path.write_text(f"command: x\npackages: [x]\nenvironment_of: {place}\n")
    with pytest.raises(DataError, match="environment_of"):
        find_system(str(path))


def test_an_installation_removes_only_what_an_earlier_one_made(tmp_path, monkeypatch):
    monkeypatch.setenv("TERRAIN_FORGE_CACHE", str(tmp_path / "cache"))
    path, notes = tmp_path / "mine.yaml", tmp_path / "cache/systems/mine/notes.txt"
    path.write_text("command: x\npackages: [/no/such/package]\n")
    notes.parent.mkdir(parents=True)
    notes.write_text("precious")
    with pytest.raises(DataError, match="mine is no environment that was made here"):
        install_system(find_system(str(path)))
    assert notes.read_text() == "precious"
