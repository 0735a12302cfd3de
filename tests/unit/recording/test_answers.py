"""What instruments and formats of other packages give a recording: judged, told in one line."""

from __future__ import annotations

import re
import shutil

import numpy as np
import pytest

import terrain_forge as tf
from terrain_forge.base import PluginError, Spec
from terrain_forge.datasets import DatasetWriter, dataset_kinds, format_size
from terrain_forge.model import sensor_kinds
from terrain_forge.recording import formats as formats_file
from terrain_forge.rovers import find_rover
from terrain_forge.sensors import Frames, Series, Stream
from terrain_forge.sensors import instrument as instrument_file
from tests.helpers import worlds


class Heights(Series):
    """One column of zeros, or of what a test puts there."""

    kind, folder = "imu", "imu"
    answer = staticmethod(lambda count: {"height [m]": np.zeros(count)})

    def streams(self):
        return (Stream(name="data", suffix=".csv", figures={"columns": ["height [m]"]}),)

    def calibration(self):
        return {}

    def samples(self):
        return self.answer(len(self.times))


class Files(Frames):
    """A file for each measurement with a table beside them, or what a test puts there."""

    kind, folder = "imu", "imu"
    answer = staticmethod(lambda: {"data": b"x"})
    table = staticmethod(lambda count: {"wear": {"wear []": np.zeros(count)}})

    def streams(self):
        return (Stream(name="data", suffix=".bin", figures={}),)

    def calibration(self):
        return {}

    def measure(self, number):
        return self.answer()

    def tables(self, numbers):
        return self.table(len(numbers))


class Notes(DatasetWriter):
    """One file, or what a test does."""

    kind, title, Options = "notes", "notes", Spec
    act = staticmethod(lambda folder: None)
    told = 10

    def size(self, footprints, options):
        return self.told

    def write(self, recording, folder, options, progress):
        (folder / "notes.txt").write_text("x")
        self.act(folder)
        return ()


@pytest.fixture(autouse=True)
def _fakes(monkeypatch):
    monkeypatch.setattr(instrument_file, "instrument_kinds", lambda: {"imu": Heights})
    monkeypatch.setitem(dataset_kinds(), "notes", Notes)
    monkeypatch.setattr(formats_file, "CALIBRATION", "notes")


@pytest.fixture(scope="module")
def world():
    sensors = (sensor_kinds()["imu"](name="imu", rate_hz=10, position_m=(0.0, 0.0, 1.5)),)
    return worlds.world(rover=find_rover("skid4").replace(sensors=sensors))


ANSWERS = {
    "short": (lambda count: {"height [m]": np.zeros(3)}, "found shape (3,) of 'height [m]', not ("),
    "number": (lambda count: {"height [m]": 1.0}, "found shape () of 'height [m]', not ("),
    "texts": (lambda count: {"height [m]": ["a"] * count}, "found <U1 in 'height [m]'"),
    "truths": (lambda count: {"height [m]": np.ones(count, bool)}, "found bool in 'height [m]'"),
    "nan": (
        lambda count: {"height [m]": np.full(count, np.nan)},
        "found what is not finite in 'height [m]'",
    ),
    "other": (
        lambda count: {"depth [m]": np.zeros(count)},
        "found columns ['depth [m]'], and its streams have ['height [m]']",
    ),
    "empty": (lambda count: {}, "found columns [], and its streams have ['height [m]']"),
    "none": (lambda count: None, "'NoneType' object has no attribute 'items'"),
}


@pytest.mark.parametrize("name", ANSWERS)
def test_samples_that_are_no_table_are_the_instrument_s_fault(world, tmp_path, monkeypatch, name):
    answer, found = ANSWERS[name]
    monkeypatch.setattr(Heights, "answer", staticmethod(answer))
    allowed = "a finite number of each column at each of its times"
    told = f"instrument 'imu': samples ({__name__}) must return {allowed}: {found}"
    with pytest.raises(PluginError, match=re.escape(told)):
        tf.record(world, tmp_path, end=1.0)


def test_a_list_of_numbers_is_a_column(world, tmp_path, monkeypatch):
    monkeypatch.setattr(
        Heights, "answer", staticmethod(lambda count: {"height [m]": [*range(count)]})
    )
    folder = tf.record(world, tmp_path, end=1.0).folder
    rows = (folder / "mav0" / "imu0" / "data.csv").read_text().splitlines()
    assert rows[0] == "#timestamp [ns],height [m]"
    assert [row.split(",")[1] for row in rows[1:]] == [str(n) for n in range(len(rows) - 1)]


CALLED = {
    "calibration": (lambda _: {"a": {1, 2}}, "a dict of .*: float.* argument must be .* not 'set'"),
    "streams": (
        lambda _: (Stream(name="../../data", suffix=".csv"),),
        "Streams whose names can name folders: found '../../data' with '.csv'",
    ),
}


@pytest.mark.parametrize("called", CALLED)
def test_what_an_instrument_says_of_itself_is_judged_first(world, tmp_path, monkeypatch, called):
    answer, told = CALLED[called]
    monkeypatch.setattr(Heights, called, answer)
    with pytest.raises(PluginError, match=rf"'imu': {called} \({__name__}\) must return {told}"):
        tf.record(world, tmp_path / "out", end=1.0)
    assert not (tmp_path / "out").exists()


FILES = {
    "none": (lambda: None, "'NoneType' object is not iterable"),
    "text": (lambda: {"data": "x"}, "found str for 'data'"),
    "other": (lambda: {"date": b"x"}, "found ['date'], and its streams are {'data'}"),
    "more": (lambda: {"data": b"", "b": b""}, "found ['b', 'data'], and its streams are {'data'}"),
}
TABLES = {
    "beside": (lambda count: {"../../x": {"a": np.zeros(count)}}, "found a table called '../../x'"),
    "the list": (lambda count: {"data": {"a": np.zeros(count)}}, "found a table called 'data'"),
    "short": (lambda count: {"wear": {"a": [1.0]}}, "found shape (1,) of 'a', not ("),
    "text": (lambda count: {"wear": {"a": ["b"] * count}}, "found <U1 in 'a'"),
    "none": (lambda count: None, "'NoneType' object has no attribute 'items'"),
}


@pytest.mark.parametrize(
    ("part", "answer", "found"),
    [
        *(("answer", *FILES[name]) for name in FILES),
        *(("table", *TABLES[name]) for name in TABLES),
    ],
    ids=[*(f"file {name}" for name in FILES), *(f"table {name}" for name in TABLES)],
)
def test_files_and_tables_that_are_none_are_the_instrument_s_fault(
    world, tmp_path, monkeypatch, part, answer, found
):
    monkeypatch.setattr(instrument_file, "instrument_kinds", lambda: {"imu": Files})
    called = {"answer": "measure", "table": "tables"}[part]
    assert tf.record(world, tmp_path / "right", end=0.5).folder.is_dir()
    monkeypatch.setattr(Files, part, staticmethod(answer))
    told = rf"instrument 'imu': {called} \({__name__}\) must return .*: {re.escape(found)}"
    with pytest.raises(PluginError, match=told):
        tf.record(world, tmp_path / "wrong", end=0.5)
    assert not (tmp_path / "x.csv").exists()


@pytest.mark.parametrize("told", [np.nan, np.inf, -1, "10", None])
def test_a_size_is_a_number_of_bytes(monkeypatch, told):
    monkeypatch.setattr(Notes, "told", told)
    words = f"dataset format 'notes': size ({__name__}) must return a number of bytes: found "
    with pytest.raises(PluginError, match=re.escape(f"{words}{told!r}")):
        format_size("notes", {}, ())
    monkeypatch.setattr(Notes, "told", np.int64(3))
    assert format_size("notes", {}, ()) == 3.0


STRAYS = {
    "beside": (lambda folder: (folder.parent / "a").touch(), "wrote a beside its folder"),
    "above": (
        lambda folder: (folder.parents[1] / "b").touch(),
        "changed b beside its folder",
    ),
    "folder": (
        lambda folder: (folder.parents[1] / "c").mkdir(),
        "changed c beside its folder",
    ),
    "changed": (
        lambda folder: (folder.parents[1] / "dataset.json").write_text("{}"),
        "changed dataset.json beside its folder",
    ),
    "link": (
        lambda folder: (folder / "d").symlink_to("/etc/hosts"),
        "left the link d in its folder",
    ),
    "deep": (
        lambda folder: ((folder / "e").mkdir(), (folder / "e" / "f").symlink_to(folder)),
        "left the link e/f in its folder",
    ),
    "gone": (shutil.rmtree, "removed its folder"),
}


@pytest.mark.parametrize("name", STRAYS)
def test_a_format_leaves_nothing_but_files_in_its_folder(world, tmp_path, monkeypatch, name):
    act, told = STRAYS[name]
    monkeypatch.setattr(Notes, "act", staticmethod(act))
    told = re.escape(f"dataset format 'notes' ({__name__}) {told}")
    for _ in range(1 if name == "folder" else 2):  # a file that it left is not one of before
        with pytest.raises(PluginError, match=told):
            tf.record(world, tmp_path, end=1.0)
    assert not (tmp_path / "dataset" / "notes").exists()


def test_what_lies_beside_a_recording_stays(world, tmp_path):
    mine = tmp_path / "dataset" / "mine.txt"
    mine.parent.mkdir()
    mine.write_text("precious")
    assert (tf.record(world, tmp_path, end=1.0).folder / "notes" / "notes.txt").is_file()
    assert mine.read_text() == "precious"
