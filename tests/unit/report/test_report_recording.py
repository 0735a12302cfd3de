"""A recording on the report page: its figures against closed forms, and what is said of it."""

import importlib.util
import json
import logging
import re

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from terrain_forge.building import altered_files, read_manifest
from terrain_forge.datasets import open_recording
from terrain_forge.report import renew_report_page
from terrain_forge.report import renewal as renewal_file
from terrain_forge.report.page import render
from terrain_forge.report.recorded.film import main_camera, make_film
from terrain_forge.report.recorded.measures import (
    first_sweep,
    imu_errors,
    picture_statistics,
    ring_counts,
    stereo_coverage,
)
from terrain_forge.report.section import Built
from terrain_forge.report.sections.recording import Recorded
from tests.helpers import worlds
from tests.helpers.recordings import GRAVITY, IMU, LIDAR, base_pose, write_recording
from tests.unit.report.test_report_page import Page


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    folder = tmp_path_factory.mktemp("OUT")
    write_recording(folder / "dataset", extras=True)
    return folder


@pytest.fixture(scope="module")
def recording(out):
    return open_recording(out)


@pytest.fixture(scope="module")
def shown(out):
    return Page(render("blocks.html", blocks=Recorded().blocks(Built(worlds.world(), out))))


def test_the_section_shows_each_sensor_and_needs_nothing_else(shown):
    kinds = [source.partition(";")[0].removeprefix("data:image/") for source in shown.sources]
    assert kinds[:2] == ["jpeg", "webp"]
    assert set(kinds[2:]) == {"png"}
    assert len(kinds) == 2 + 2 + 2  # the plots of sweep and IMU are two panels each
    for words in (
        "stereo_left mav0/cam0 camera 5 Hz 5 0.000 s 0.800 s",
        "lidar mav0/lidar0 lidar 10 Hz 9",
        "Gravity that IMUs feel 3.711 m/s²",
        "Beside the pictures of stereo_left and stereo_right: depth, class.",
        "5 of 5 pictures",
        "Formats EuRoC",
    ):
        assert words in shown.text


def test_nothing_recorded_is_nothing_shown_and_a_broken_recording_is_told(tmp_path):
    assert Recorded().blocks(Built(worlds.world(), tmp_path)) == []
    folder = write_recording(tmp_path / "dataset")
    next((folder / "mav0/cam0/data").iterdir()).unlink()
    (told,) = Recorded().blocks(Built(worlds.world(), tmp_path))
    assert re.match(r"The recording in dataset/ cannot be shown: .*cam0/data/\d+\.png", told.text)


def test_errors_of_an_imu_are_what_it_tells_off_the_motion(recording):
    """Against differences of the closed form itself, a hundred times finer."""
    found = imu_errors(recording, recording.imus[0])
    truth, step = found.told[2:-2] - found.errors, 1e-4
    for row, time in list(zip(truth, found.times[2:-2], strict=True))[::40]:
        before, now, after = (base_pose(time + k * step) @ IMU for k in (-1, 0, 1))
        turn = Rotation.from_matrix(before[:3, :3].T @ after[:3, :3]).as_rotvec() / (2 * step)
        pull = (after - 2 * now + before)[:3, 3] / step**2 + [0, 0, GRAVITY]
        np.testing.assert_allclose(row[:3], turn, atol=1e-6)
        np.testing.assert_allclose(row[3:], now[:3, :3].T @ pull, atol=1e-5)


def test_errors_are_those_of_the_longest_part_without_a_gap(tmp_path):
    """A recording of parts has gaps, and its truth the stamps of all sensors."""
    folder = write_recording(tmp_path)
    whole = imu_errors(open_recording(folder), open_recording(folder).imus[0])
    table = folder / "mav0/imu0/data.csv"
    head, *rows = table.read_text().splitlines()
    table.write_text("\n".join([head, *rows[:40], *rows[60:], ""]))
    recording = open_recording(folder)
    found = imu_errors(recording, recording.imus[0])
    assert len(found.told) == len(rows) - 20
    np.testing.assert_array_equal(found.errors, whole.errors[60:])


def test_a_sweep_lies_on_the_plane_without_the_rover(recording):
    sweep = first_sweep(recording)
    np.testing.assert_allclose(sweep.points[:, 2], 0.0, atol=2e-6)
    np.testing.assert_allclose(sweep.lidar, (base_pose(0.0) @ LIDAR)[:3, 3], atol=1e-9)
    counts = ring_counts(recording.lidars[0])
    assert counts.ground.tolist() == pytest.approx([90.0, 90.0, 90.0, 0.0])
    assert counts.rover.tolist() == pytest.approx([1.0, 0.0, 0.0, 0.0])


def test_the_film_shows_the_picture_its_depth_and_labels(recording):
    film = make_film(recording, main_camera(recording))
    assert (film.frames, film.parts) == (5, ("depth", "class"))
    assert film.speed == pytest.approx(0.8 / (4 * 0.12))
    assert {key.name for key in film.keys} == {"ground", "crater", "rock", "rover", "sky"}
    colours = {key.name: tuple(bytes.fromhex(key.colour[1:])) for key in film.keys}
    below, wide = film.still[480:], film.still.shape[1] // 2
    assert tuple(below[2, wide + 2]) == colours["sky"]
    assert tuple(below[100, wide + 100]) == colours["ground"]
    assert tuple(below[-2, wide + 2]) == colours["rock"]
    assert below[2, 2].max() < 30  # no depth of the sky


def test_a_long_film_is_thinned_until_the_page_takes_it(recording, monkeypatch):
    whole = make_film(recording, main_camera(recording))
    limit = len(whole.content) - 1
    monkeypatch.setattr("terrain_forge.report.recorded.film.LARGEST_ANIMATION", limit)
    assert make_film(recording, main_camera(recording)).frames == 3


def test_statistics_are_of_the_rows_between_sky_and_rover(tmp_path):
    """Noise there, flat elsewhere: white noise has a flat spectrum and Gaussian differences."""
    folder = write_recording(tmp_path, resolution=[256, 256])
    labels = np.zeros((256, 256), np.uint8)
    labels[:80], labels[230:] = 6, 5
    for number, path in enumerate(sorted((folder / "mav0/cam0/data").iterdir())):
        noise = np.random.default_rng(number).normal(120, 8, labels.shape)
        Image.fromarray(np.where(labels == 0, noise, 250).astype(np.uint8)).save(path)
        Image.fromarray(labels).save(folder / "mav0/cam0/class" / path.name)
    recording = open_recording(folder)
    found = picture_statistics(recording, recording.cameras[0])
    assert abs(found.slope) < 0.2
    assert found.kurtosis == pytest.approx(3.0, abs=0.3)
    assert found.dark == 0.0


def test_coverage_says_what_found_it(recording, monkeypatch):
    pair = recording.pairs[0]
    if importlib.util.find_spec("cv2"):
        assert "OpenCV's semi-global matching" in stereo_coverage(recording, pair).by
    monkeypatch.setattr("terrain_forge.report.recorded.measures.find_spec", lambda _: None)
    assert stereo_coverage(recording, pair) is None  # nor was the disparity recorded


def test_coverage_without_opencv_is_what_both_eyes_see(tmp_path, monkeypatch):
    monkeypatch.setattr("terrain_forge.report.recorded.measures.find_spec", lambda _: None)
    folder = write_recording(tmp_path)
    index = json.loads((folder / "dataset.json").read_text())
    index["streams"][0]["channels"] |= {"disparity": {}, "occlusion": {}}
    (folder / "dataset.json").write_text(json.dumps(index))
    there, hidden = np.zeros((48, 64), np.uint16), np.zeros((48, 64), np.uint8)
    there[8:], hidden[:, :16] = 500, 255
    for path in (folder / "mav0/cam0/data").iterdir():
        for name, image in (("disparity", there), ("occlusion", hidden)):
            (folder / "mav0/cam0" / name).mkdir(exist_ok=True)
            Image.fromarray(image).save(folder / "mav0/cam0" / name / path.name)
    recording = open_recording(folder)
    found = stereo_coverage(recording, recording.pairs[0])
    assert found.share == pytest.approx(0.75)
    assert found.by.startswith("the truth")


def test_a_page_is_renewed_alone_and_the_manifest_knows_it(tmp_path, caplog):
    from terrain_forge.pipeline import write_world

    world = worlds.world()
    out = write_world(world, tmp_path / "OUT", exports=()).directory
    before = read_manifest(out)["outputs"]
    write_recording(out / "dataset")
    (out / "paths" / "note.txt").write_text("mine")
    renew_report_page(world, out)
    assert caplog.records == []
    assert 'id="recording"' in (out / "report.html").read_text(encoding="utf-8")
    after = read_manifest(out)
    assert altered_files(out, after) == {}
    assert {name for name in before if before[name] != after["outputs"][name]} == {"report.html"}
    assert after["outputs"].keys() == before.keys()
    assert (out / "paths" / "note.txt").read_text() == "mine"
    with (out / "report.html").open("a", encoding="utf-8") as page:
        page.write("mine")
    renew_report_page(world, out)
    assert "1 file changed since it was built: report.html" in caplog.text
    assert (out / "report.html").read_text(encoding="utf-8").endswith("mine")
    renew_report_page(world, out, force=True)
    assert altered_files(out, read_manifest(out)) == {}


def test_a_page_that_fails_is_one_line_and_the_older_stays(tmp_path, monkeypatch, caplog):
    from terrain_forge.pipeline import write_world

    world = worlds.world()
    out = write_world(world, tmp_path / "OUT", exports=()).directory
    older = (out / "report.html").read_bytes()

    def broken(*_, **__):
        raise RuntimeError("no\nfonts")

    monkeypatch.setattr(renewal_file, "write_report_page", broken)
    with caplog.at_level(logging.WARNING):
        renew_report_page(world, out)
    (record,) = caplog.records
    told = "recorded, but the report page is not written anew: no fonts"
    assert record.getMessage() == told
    assert (out / "report.html").read_bytes() == older
