"""A recording: resumed, cut, by many hands, with the same bytes; nothing of a user's touched."""

from __future__ import annotations

import json
import re
import shutil
import threading
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML

import terrain_forge as tf
from terrain_forge.base import DataError, OutputError, RecipeError, StorageError, mix
from terrain_forge.datasets import DatasetWriter, open_recording
from terrain_forge.datasets import writer as writer_file
from terrain_forge.datasets.formats.calibration import Calibration
from terrain_forge.evaluation.bench import RESULTS
from terrain_forge.model import sensor_kinds
from terrain_forge.recipe import DatasetSpec, recipe_json
from terrain_forge.recording import formats as formats_file
from terrain_forge.recording import record as record_file
from terrain_forge.rovers import find_rover
from terrain_forge.sensors import Frames, Series, Stream
from terrain_forge.sensors import instrument as instrument_file
from terrain_forge.terminal import Display
from tests.helpers import worlds
from tests.helpers.command_line import run

EPOCH = 1_600_000_000_000_000_000
CAMERA, LIDAR, IMU = (sensor_kinds()[kind] for kind in ("camera", "lidar", "imu"))


class Picture(Frames):
    """Bytes that hang on the setting, the sensor and the number alone."""

    kind, folder = "camera", "cam"
    made = count()

    def streams(self):
        return (
            Stream(name="data", suffix=".bin", figures={"bits": 8}),
            Stream(name="class", suffix=".bin", figures={"classes": {0: "sky", 1: "ground"}}),
        )

    def calibration(self):
        lens = {"distortion_model": "none", "distortion_coefficients": []}
        return {"resolution": [4, 2], "intrinsics": [1e-5, 2.0, 1.5, 0.5]} | lens

    def measure(self, number):
        next(self.made)
        key = self.setting.key(self.sensor)
        place = self.state(self.times[[number]] / 1e9).position.tobytes()
        data = b"".join(int(mix(key, 1000 * number + n)).to_bytes(8, "little") for n in range(20))
        return {"data": place + data, "class": data[:5]}

    def tables(self, numbers):
        return {"exposure": {"exposure [s]": 1e-3 + 1e-5 * np.array(numbers)}}


class Sweep(Picture):
    """The same for a lidar."""

    kind, folder = "lidar", "lidar"

    def streams(self):
        return (Stream(name="data", suffix=".npy"),)

    def calibration(self):
        figures = {"range_min_m": 0.5, "range_max_m": 100.0, "column_period_s": 5e-5}
        return figures | {"rings": 16, "elevations_deg": [-15.0, 15.0]}

    def measure(self, number):
        return {"data": super().measure(number)["data"]}


class Rates(Series):
    """A table of what turns."""

    kind, folder = "imu", "imu"

    def streams(self):
        return (Stream(name="data", suffix=".csv"),)

    def calibration(self):
        sensor = self.sensor
        return {
            "gyroscope_noise_density": sensor.gyro_noise,
            "gyroscope_random_walk": sensor.gyro_walk,
            "accelerometer_noise_density": sensor.accelerometer_noise,
            "accelerometer_random_walk": sensor.accelerometer_walk,
        }

    def samples(self):
        state = self.state(self.times / 1e9)
        return {"w_RS_S_z [rad s^-1]": state.rate[:, 2], "ticks []": np.arange(len(self.times))}


class Heat(Picture):
    """Files of another kind than pictures and sweeps; `data` is none of them, or not the first."""

    kind, folder = "sun_sensor", "heat"

    def streams(self):
        more = (Stream(name="data", suffix=".bin"),) if self.sensor.name == "both" else ()
        return (Stream(name="fan", suffix=".txt"), *more)

    def measure(self, number):
        files = {"fan": f"{number}\n".encode(), "data": bytes([number])}
        return {stream.name: files[stream.name] for stream in self.streams()}

    def tables(self, numbers):
        return {}


KINDS = {kind.kind: kind for kind in (Picture, Sweep, Rates)}


@pytest.fixture(autouse=True)
def _fakes(monkeypatch):
    monkeypatch.setattr(instrument_file, "instrument_kinds", lambda: KINDS)
    monkeypatch.setattr(Picture, "made", count())


@pytest.fixture(scope="module")
def world():
    sensors = (
        CAMERA(name="eye", rate_hz=2, position_m=(0.3, 0, 0.8), rpy_deg=(0, 12, 0)),
        LIDAR(name="lidar", rate_hz=1, position_m=(0, 0, 1)),
        IMU(name="imu", rate_hz=100, position_m=(0.1, 0, 0.2), rpy_deg=(0, 0, 90)),
    )
    return worlds.world(rocks=3, rover=find_rover("skid4").replace(sensors=sensors))


@pytest.fixture(scope="module")
def whole(world, tmp_path_factory):
    """The recording of it all."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(instrument_file, "instrument_kinds", lambda: KINDS)
        out = tmp_path_factory.mktemp("whole")
        result = tf.record(world, out, workers=1)
    return out / "dataset", result


def install(monkeypatch, **kinds):
    """Have these formats be all that there are, beside the calibration."""
    for module in (writer_file, formats_file):
        monkeypatch.setattr(module, "dataset_kinds", lambda: {**kinds, "calibration": Calibration})


def files(folder: Path) -> dict[str, bytes]:
    """All of a recording."""
    paths = {p.relative_to(folder).as_posix(): p for p in folder.rglob("*") if p.is_file()}
    return {name: p.read_bytes() for name, p in paths.items()}


def table(path: Path) -> list[list[str]]:
    return [line.split(",") for line in path.read_text().splitlines()]


def test_the_folder_is_laid_out_as_readers_expect(whole, world):
    folder, result = whole
    about = json.loads((folder / "dataset.json").read_text())
    assert [s["folder"] for s in about["streams"]] == ["mav0/cam0", "mav0/lidar0", "mav0/imu0"]
    assert result.streams == {s["folder"][5:]: s["count"] for s in about["streams"]}
    assert (about["body"], about["gravity_m_s2"]) == ("imu0", pytest.approx(3.711, abs=0.02))
    assert about["classes"] == {"0": "sky", "1": "ground"}
    head, *rows = table(folder / "mav0/cam0/data.csv")
    assert head == ["#timestamp [ns]", "filename"]
    assert [int(row[0]) - EPOCH for row in rows] == [n * 500_000_000 for n in range(len(rows))]
    assert all((folder / "mav0/cam0/data" / row[1]).is_file() for row in rows)
    yaml = YAML(typ="safe").load((folder / "mav0/cam0/sensor.yaml").read_text())
    assert yaml["intrinsics"] == [1e-5, 2.0, 1.5, 0.5]
    assert yaml["rate_hz"] == 2.0
    pose = np.reshape(yaml["T_BS"]["data"], (4, 4))
    # The IMU is turned by 90°: its y axis is the rover's backward x.
    assert pose[:3, 3] == pytest.approx([0.0, -0.2, 0.6])
    ahead, right = pose[:3, 2], pose[:3, 0]
    assert ahead == pytest.approx([0.0, -np.cos(np.radians(12)), -np.sin(np.radians(12))])
    assert right == pytest.approx([-1.0, 0.0, 0.0])
    gyro = table(folder / "mav0/imu0/data.csv")
    assert gyro[0] == ["#timestamp [ns]", "w_RS_S_z [rad s^-1]", "ticks []"]
    assert gyro[7][::2] == [str(EPOCH + 60_000_000), "6"]


def test_no_format_of_others_has_a_name_of_the_folder(whole):
    assert {path.name for path in whole[0].iterdir()} <= writer_file.RESERVED
    assert {formats_file.MASTER, formats_file.CALIBRATION, RESULTS} <= writer_file.RESERVED


def test_the_truth_is_that_of_the_motion_at_each_sensor_s_own_times(whole, world):
    folder, _ = whole
    with tf.open_setting(world) as setting:
        for name, place in (("eye", "cam0"), ("lidar", "lidar0"), ("imu", "imu0")):
            rows = np.loadtxt(folder / "truth" / f"{place}.tum")
            instrument = tf.find_instrument(setting, name)
            state = instrument.state(instrument.times / 1e9)
            assert rows[:, 1:4] == pytest.approx(state.position, abs=1e-12)
            x, y, z, w = rows[:, 4:].T
            ahead = np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], 1)
            if place == "cam0":  # the optical axis looks along the sensor's x
                assert ahead == pytest.approx(state.rotation[:, :, 0], abs=1e-12)
    head, *rows = table(folder / "mav0/state_groundtruth_estimate0/data.csv")
    assert len(head) == 17
    assert np.diff([int(row[0]) for row in rows]) == pytest.approx(5_000_000)  # 200 Hz
    values = np.array([row[1:] for row in rows], float)
    tum = np.loadtxt(folder / "truth/imu0.tum")
    assert values[::2, :3] == pytest.approx(tum[:, 1:4], abs=1e-12)
    speed = np.diff(values[:, :3], axis=0) / 0.005
    assert speed == pytest.approx(0.5 * (values[1:, 7:10] + values[:-1, 7:10]), abs=1e-4)
    first = (folder / "truth/cam0.tum").read_text().splitlines()[2]
    assert first.startswith("1600000000.500000000 ")


@pytest.mark.parametrize("workers", [2, 5])
def test_any_number_of_hands_makes_the_same_bytes(whole, world, tmp_path, workers):
    result = tf.record(world, tmp_path, workers=workers)
    assert files(result.folder) == files(whole[0])


@pytest.mark.parametrize("after", [1, 9, 40])
def test_what_was_killed_goes_on_where_it_was(whole, world, tmp_path, monkeypatch, after):
    folder, _ = whole
    numbers = count()
    put = record_file.Store.put

    def killed(store, name, content):
        if next(numbers) == after:
            (store.folder / ".writing").write_bytes(content[:3])  # half of it
            raise SystemError("killed")
        put(store, name, content)

    with monkeypatch.context() as patch:
        patch.setattr(record_file.Store, "put", killed)
        with pytest.raises(SystemError):
            tf.record(world, tmp_path, workers=2)
    list_file = tmp_path / "dataset" / "written.csv"
    with list_file.open("a") as file:
        file.write("17,mav0/cam0/da")  # a line that was cut
    there = sorted((tmp_path / "dataset" / "mav0").rglob("*.*"))
    if there:
        there[0].write_bytes(b"")  # the disk lost it
    result = tf.record(world, tmp_path)
    assert files(result.folder) == files(folder)
    again = tf.record(world, tmp_path)
    assert again.made == 0
    assert files(result.folder) == files(folder)


@pytest.mark.parametrize("wrong", ['"spans_ns"= ', '"spans_nt": ', '"spans_ns":0'])
def test_a_damaged_index_is_told_in_a_line(whole, world, tmp_path, wrong):
    shutil.copytree(whole[0], tmp_path / "out" / "dataset")
    index = tmp_path / "out" / "dataset" / "dataset.json"
    text = index.read_text()
    assert text.count('"spans_ns": ') == 1
    index.write_text(text.replace('"spans_ns": ', wrong))
    with pytest.raises(DataError, match=r"^dataset\.json cannot be read: "):
        tf.record(world, tmp_path / "out", workers=1)


def test_a_part_has_the_bytes_of_the_whole_and_parts_add_up(whole, world, tmp_path):
    folder, _ = whole
    wanted = files(folder)
    tf.record(world, tmp_path, begin=4.0, end=7.0, only="lidar")
    part = tf.record(world, tmp_path, begin=4.0, end=7.0)
    found = files(part.folder)
    stamps = [int(Path(name).stem) - EPOCH for name in found if name.startswith("mav0/cam0/data/")]
    assert sorted(stamps) == [round(n * 5e8) for n in range(8, 14)]
    assert all(content == wanted[n] for n, content in found.items() if n.endswith((".bin", ".npy")))
    shutters = found["mav0/cam0/exposure.csv"].splitlines()
    assert len(shutters) == 7
    assert set(shutters) < set(wanted["mav0/cam0/exposure.csv"].splitlines())
    rows = found["mav0/imu0/data.csv"].splitlines()
    assert set(rows) <= set(wanted["mav0/imu0/data.csv"].splitlines())
    assert len(rows) == 301
    with tf.open_setting(world) as setting:
        alone = tf.find_instrument(setting, "eye").measure(9)
    assert alone["data"] == wanted[f"mav0/cam0/data/{EPOCH + 4_500_000_000}.bin"]
    tf.record(world, tmp_path, begin=0.0, end=4.0, only=("lidar", "imu"))
    tf.record(world, tmp_path, only="lidar")
    tf.record(world, tmp_path)
    rest = files(part.folder)
    assert rest.keys() == wanted.keys()
    differing = {n for n in rest if rest[n] != wanted[n]}
    assert differing == set()


def test_another_recording_is_refused_and_replaced_on_demand(world, tmp_path):
    first = tf.record(world, tmp_path, end=2.0)
    mine = first.folder / "mav0" / "cam0" / "notes.txt"
    mine.write_text("precious")
    with pytest.raises(tf.OutputError, match=r"still_s 3\.0, not 1\.0; --force replaces it"):
        tf.record(world, tmp_path, still_s=1.0)
    slower = world.rover.sensors[0].replace(rate_hz=1.0)
    rover = world.rover.replace(sensors=(slower, *world.rover.sensors[1:]))
    other = world.replace(rover=rover)
    with pytest.raises(tf.OutputError, match=r"sensors\.eye\.rate_hz 2, not 1\.0"):
        tf.record(other, tmp_path)
    tf.record(other, tmp_path, end=2.0, force=True)
    assert mine.read_text() == "precious"
    assert len(list((first.folder / "mav0/cam0/data").iterdir())) == 2
    in_the_way = first.folder / "mav0/cam0/data" / f"{EPOCH + 3_000_000_000}.bin"
    in_the_way.write_text("precious")
    with pytest.raises(tf.OutputError, match=r"3000000000\.bin is in the way"):
        tf.record(other, tmp_path)
    assert in_the_way.read_text() == "precious"


def test_bad_orders_are_refused_before_anything_is_written(world, tmp_path):
    refused = (
        ({"path": "ark"}, RecipeError, r"'ark' \(did you mean 'arc'\?\), the world has: arc"),
        ({"only": ("ey",)}, tf.OutputError, r"--only ey: .*did you mean 'eye'"),
        ({"begin": 99.0}, tf.OutputError, r"--from 99: .* ends at 2\d"),
        ({"begin": 5.0, "end": 4.0}, tf.OutputError, "--to 4: it must be after --from 5"),
        ({"begin": 0.1, "end": 0.2}, tf.OutputError, r"'eye' measures nothing between 0\.1 and"),
        ({"workers": 0}, tf.OutputError, "--workers 0: at least 1"),
        ({"still_s": -1.0}, RecipeError, r"still_s: .*greater than or equal to 0"),
        ({"formats": ("kitti", "kitti")}, RecipeError, "kitti is named twice"),
        ({"formats": ("lusnar",)}, RecipeError, "'lusnar' needs two cameras, and the rover has "),
        ({"formats": ("tum",), "profile": "quick"}, RecipeError, "needs depth, .*profile: full"),
    )
    for changes, kind, told in refused:
        with pytest.raises(kind, match=told):
            tf.record(world, tmp_path, **changes)
    arc = world.trajectories[0]
    short = arc.replace(time=arc.time[:2], position=arc.position[:2], rpy=arc.rpy[:2])
    with pytest.raises(tf.OutputError, match=r"lasts 0\.0833 s, sensor 'eye' takes 0\.5 s"):
        tf.record(world.replace(trajectories=(short,)), tmp_path, still_s=0.0, ramp_s=0.0)
    with pytest.raises(RecipeError, match="a recording needs a path that the rover follows"):
        tf.record(world.replace(trajectories=()), tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_disk_too_small_is_refused_and_a_full_one_leaves_no_half(world, tmp_path, monkeypatch):
    usage = shutil.disk_usage(tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=2**24 + 5000))
        with pytest.raises(
            StorageError, match=r"about [\d.]+ kB and 16\.8 MB to spare, the disk has 16\.8 MB free"
        ):
            tf.record(world, tmp_path)
    assert not (tmp_path / "dataset").exists()
    written = Path.write_bytes
    numbers = count()

    def full(path, content):
        if next(numbers) == 12:
            written(path, content[:7])
            raise OSError(28, "No space left on device")
        return written(path, content)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_bytes", full)
        with pytest.raises(StorageError, match="cannot be written: No space left on device"):
            tf.record(world, tmp_path)
    whole = {len(p.read_bytes()) for p in (tmp_path / "dataset/mav0").rglob("*.bin")}
    assert whole == {5, 184}
    assert not (tmp_path / "dataset/.writing").exists()


def _at(name):
    def progress(stage, share=0.0):
        if stage.startswith(name):
            raise KeyboardInterrupt

    return progress


def test_an_interrupt_says_how_to_go_on(world, tmp_path, monkeypatch):
    with pytest.raises(
        KeyboardInterrupt, match=r"^\d+ of \d+ missing measurements are in .*goes on"
    ):
        tf.record(world, tmp_path, progress=_interrupting)
    for stage in ("tables", "formats"):
        with pytest.raises(
            KeyboardInterrupt, match=r"^(\d+) of \1 missing measurements are in .*goes on"
        ):
            tf.record(world, tmp_path, formats={"calibration": {}}, progress=_at(stage))
    assert threading.active_count() < 20
    assert list(tmp_path.glob(".terrain-forge*")) == []


def test_what_an_interrupt_left_beyond_the_end_is_not_listed(whole, world, tmp_path):
    with pytest.raises(KeyboardInterrupt):  # three pictures are there
        tf.record(world, tmp_path, progress=_interrupting)
    before = tf.record(world, tmp_path, end=0.25)
    assert before.streams["cam0"] == 1
    text = (before.folder / "mav0/cam0/data.csv").read_text()
    assert [line.split(",")[0] for line in text.splitlines()[1:]] == [str(EPOCH)]
    again = tf.record(world, tmp_path)
    wanted = files(whole[0])
    assert {name: content for name, content in files(again.folder).items()} == wanted


def test_an_interrupt_over_the_page_says_that_all_is_recorded(world, tmp_path):
    world.save(tmp_path)
    manifest = {"format": 2, "outputs": {}, "varying": [], "exports": {}}
    (tmp_path / "manifest.json").write_text(json.dumps(manifest))
    told = "^the recording is complete, its report page is not renewed$"
    with pytest.raises(KeyboardInterrupt, match=told):
        tf.record(tmp_path, only=("eye",), end=0.5, progress=_at("report page"))


def test_the_command_ends_with_one_line_and_its_status(world, tmp_path, monkeypatch):
    world.save(tmp_path)
    manifest = {"format": 2, "outputs": {}, "varying": [], "exports": {}}
    (tmp_path / "manifest.json").write_text(json.dumps(manifest))
    with monkeypatch.context() as patch:
        patch.setattr(Display, "__call__", lambda _, stage, share=0.0: _interrupting(stage, share))
        done = run("record", tmp_path, "--only", "eye")
    assert done.returncode == 130
    assert re.search(
        r"^interrupted, 5 of 58 missing measurements are in .*goes on from there$",
        done.stderr,
        re.M,
    )
    done = run("record", tmp_path, "--only", "eye", "--to", "10", "--workers", "2")
    assert done.returncode == 0, done.stderr
    assert f"{tmp_path}/dataset: cam0 20\n" in done.stdout
    assert "15 new measurements in" in done.stdout
    done = run("record", tmp_path, "--quick")
    assert done.returncode == 2
    (told,) = done.complaints
    assert 'dataset holds another recording, with dataset.profile "full", not "quick"' in told
    assert told.endswith("--force replaces it")


def _interrupting(stage, share):
    if re.match(r"recording: 5 of", stage):
        raise KeyboardInterrupt


class Counting(DatasetWriter):
    """Writes how many measurements each sensor has."""

    kind, title = "counts", "numbers"

    @dataclass(frozen=True, kw_only=True)
    class Options(tf.Spec):
        """None but a greeting."""

        greeting: str = ""
        """What it begins with."""

    def check(self, recording, options):
        if not recording.cameras:
            raise tf.ExportError("counts needs a camera")

    def write(self, recording, folder, options, progress):
        assert recording.body_poses.stamps[0] == EPOCH
        assert len(recording.truth_of(recording.sensor("eye"))) == len(recording.cameras[0].stamps)
        numbers = [str(len(one.stamps)) for one in recording.sensors]
        (folder / "sub").mkdir()
        (folder / "sub" / "numbers.txt").write_text(options.greeting + " ".join(numbers))
        return ("All else.",)


def test_formats_are_written_once_and_again_when_the_recording_grew(world, tmp_path, monkeypatch):
    install(monkeypatch, counts=Counting)
    with pytest.raises(RecipeError, match=r"'count' \(did you mean 'counts'\?\), .*euroc, counts,"):
        tf.record(world, tmp_path, formats=("count",))
    with pytest.raises(RecipeError, match="greetings: unknown key 'greetings'"):
        tf.record(world, tmp_path, formats={"counts": {"greetings": "hi"}})
    with pytest.raises(tf.ExportError, match="needs a camera"):  # before hours of work
        tf.record(world, tmp_path, formats=("counts",), only=("imu", "lidar"))
    assert list(tmp_path.iterdir()) == []
    first = tf.record(world, tmp_path, formats=("euroc", "counts"), end=4.0)
    text = first.folder / "counts" / "sub" / "numbers.txt"
    assert text.read_text() == "8 4 400"
    assert first.losses == {"counts": ("All else.",)}
    assert tf.record(world, tmp_path, formats=("counts",), end=4.0).losses == {}
    text.unlink()
    assert tf.record(world, tmp_path, formats=("counts",), end=4.0).losses.keys() == {"counts"}
    tf.record(world, tmp_path, formats={"counts": {"greeting": "hi "}}, end=5.0)
    assert text.read_text() == "hi 10 5 500"
    with (first.folder / "written.csv").open("a") as file:
        file.write("0,counts/\n")  # killed before the folder was taken note of
    tf.record(world, tmp_path, formats=("counts",), end=5.0)
    assert text.read_text() == "10 5 500"
    (first.folder / "counts" / "mine.txt").write_text("precious")
    with pytest.raises(tf.OutputError, match="counts exists: remove it"):
        tf.record(world, tmp_path, formats=("counts",), end=6.0)
    assert (first.folder / "counts" / "mine.txt").read_text() == "precious"


def test_a_format_of_an_earlier_state_is_told(world, tmp_path, monkeypatch):
    install(monkeypatch, counts=Counting)
    first = tf.record(world, tmp_path, formats=("counts",), only=("eye",), end=2.0)
    assert first.stale == ()
    told = "counts is of an earlier state of this recording"
    (line,) = tf.record(world, tmp_path, only=("imu",), end=2.0).stale
    assert line == f"{told} (without imu0): the same command with --formats counts renews it"
    world.save(tmp_path)
    manifest = {"format": 2, "outputs": {}, "varying": [], "exports": {}}
    (tmp_path / "manifest.json").write_text(json.dumps(manifest))
    done = run("record", tmp_path, "--only", "imu", "--to", "2")
    assert done.stdout.count(line) == 1
    again = tf.record(world, tmp_path, formats={"counts": {"greeting": "hi "}}, end=2.0)
    assert again.stale == ()
    (line,) = tf.record(world, tmp_path, end=3.0).stale
    assert line == f"{told}: tf.record(…, formats={{'counts': {{'greeting': 'hi '}}}}) renews it"
    shutil.rmtree(first.folder / "counts")
    assert tf.record(world, tmp_path, end=3.0).stale == ()


class Deep(Counting):
    """A format with tum's option."""

    kind = "tum"

    @dataclass(frozen=True, kw_only=True)
    class Options(tf.Spec):
        """A factor and a greeting."""

        greeting: str = ""
        """What it begins with."""
        depth_factor: int = 5000
        """Values in a metre."""


def test_calibration_has_the_factor_of_tum(world, tmp_path, monkeypatch):
    install(monkeypatch, tum=Deep)
    options = {"depth_factor": 1000}

    def factor(**how):
        folder = tf.record(world, tmp_path, end=2.0, **how).folder
        return json.loads((folder / "formats.json").read_text())["calibration"]["options"]

    assert factor() == {}
    assert factor(formats={"tum": {"greeting": "hi", **options}}) == options
    assert factor() == options  # tum's folder is still there
    assert factor(formats=("tum",)) == {}


def test_a_part_leaves_out_formats_of_the_recipe_that_it_cannot_have(world, tmp_path, monkeypatch):
    install(monkeypatch, counts=Counting)
    recipe = replace(world.site.recipe, dataset=DatasetSpec(formats=("counts",)))
    wanting = world.replace(site=world.site.replace(recipe_json=recipe_json(recipe)))
    part = tf.record(wanting, tmp_path, only=("imu",), end=2.0)
    assert part.losses == {"counts": ("not made: counts needs a camera",)}
    assert not (part.folder / "counts").exists()
    assert tf.record(wanting, tmp_path, end=2.0).losses == {"counts": ("All else.",)}


def test_the_order_in_which_formats_were_made_is_told_nowhere(world, tmp_path, monkeypatch):
    install(monkeypatch, counts=Counting, tum=Deep)
    tf.record(world, tmp_path / "later", end=2.0, formats=("tum",))
    late, once = (
        files(tf.record(world, tmp_path / out, end=2.0, formats=("counts", "tum")).folder)
        for out in ("later", "once")
    )
    assert late == once


def test_a_quick_look_is_every_few_of_the_same_measurements(world, tmp_path):
    rover = world.rover
    often = world.replace(
        rover=rover.replace(sensors=(rover.sensors[0].replace(rate_hz=12.0), *rover.sensors[1:]))
    )
    quick = tf.record(often, tmp_path / "quick", profile="quick", end=2.0, only=("eye", "imu"))
    full = tf.record(often, tmp_path / "full", end=2.0, only=("eye",))
    assert quick.streams == {"cam0": 8, "imu0": 200}
    few, many = files(quick.folder), files(full.folder)
    pictures = [name for name in few if name.startswith("mav0/cam0/data/")]
    assert all(few[name] == many[name] for name in pictures)
    some, all_of_them = (set(found["mav0/cam0/exposure.csv"].splitlines()) for found in (few, many))
    assert len(some) == 1 + 8
    assert some < all_of_them
    about = open_recording(quick.folder)
    assert (about.cameras[0].rate, about.imus[0].rate) == (4.0, 100.0)
    assert set(np.diff(about.cameras[0].stamps)) == {250_000_000}


def test_another_process_that_writes_is_respected(world, tmp_path):
    from terrain_forge.building import holding

    with holding(tmp_path), pytest.raises(tf.OutputError, match="by another terrain-forge"):
        tf.record(world, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_recording_is_not_made_behind_a_link(world, tmp_path):
    (tmp_path / "home").mkdir()
    (tmp_path / "dataset").symlink_to("home")
    with pytest.raises(OutputError, match="dataset is a link"):
        tf.record(world, tmp_path)
    assert not list((tmp_path / "home").iterdir())


def test_files_of_any_kind_are_read_back(world, tmp_path, monkeypatch):
    monkeypatch.setattr(instrument_file, "instrument_kinds", lambda: KINDS | {Heat.kind: Heat})
    more = [
        sensor_kinds()[Heat.kind](name=name, rate_hz=2.0, position_m=(0, 0, 1))
        for name in ("heat", "both")
    ]
    world = world.replace(rover=world.rover.replace(sensors=(*world.rover.sensors, *more)))
    bag = {"rosbag2": {"sensors": ("heat",)}}
    told = tf.record(world, tmp_path, end=2.0, formats=bag).losses
    both = open_recording(tmp_path).sensor("both")
    assert [both.file(n).read_bytes() for n in range(4)] == [bytes([n]) for n in range(4)]
    heat = open_recording(tmp_path).sensor("heat")
    assert (heat.key, len(heat.stamps)) == ("heat0", 4)
    assert [heat.file(n, "fan").read_text() for n in range(4)] == [f"{n}\n" for n in range(4)]
    with pytest.raises(DataError, match="heat0 has no 'data'"):
        heat.file(0)
    assert any(line.startswith("No message of ROS is written for") for line in told["rosbag2"])
