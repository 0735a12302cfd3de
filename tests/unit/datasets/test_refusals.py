"""What is refused, early and in one line; nothing half-written stays."""

from __future__ import annotations

import gc
import resource
import sys
from dataclasses import replace

import pytest

from terrain_forge.base import ExportError, OutputError, RecipeError, Spec, StorageError
from terrain_forge.datasets import DatasetWriter, dataset_kinds, open_recording, write_dataset
from tests.helpers.recordings import EPOCH, write_recording


@pytest.fixture(scope="module")
def bare(tmp_path_factory):
    """A recording without a lidar, through bent lenses."""
    folder = tmp_path_factory.mktemp("bare")
    bent = {"distortion_model": "radial-tangential", "distortion_coefficients": [-0.2, 0, 0, 0]}
    return open_recording(write_recording(folder, seconds=0.2, lidar=False, **bent))


def test_formats(tmp_path, recording):
    assert set(dataset_kinds()) == {
        *("kitti", "tum", "rosbag1", "rosbag2", "clouds", "lusnar", "calibration")
    }
    with pytest.raises(RecipeError, match=r"'kity' \(did you mean 'kitti'\?\), installed: calib"):
        write_dataset(recording, "kity", tmp_path / "out")
    with pytest.raises(RecipeError, match="'tum': depth_factor"):
        write_dataset(recording, "tum", tmp_path / "out", {"depth_factor": 7})
    with pytest.raises(RecipeError, match="has no effect: a map is always deskewed"):
        write_dataset(recording, "clouds", tmp_path / "out", {"map": True, "deskew": True})
    assert list(tmp_path.iterdir()) == []


def test_what_a_format_needs(tmp_path, bare, recording):
    cases = {
        ("kitti", bare): "pictures without distortion, and those of stereo_left have radtan",
        ("clouds", bare): "clouds needs a lidar, and the recording has none",
    }
    for (kind, found), message in cases.items():
        with pytest.raises(ExportError, match=message):
            write_dataset(found, kind, tmp_path / "out")
    with pytest.raises(
        ExportError, match=r"clouds: no lidar 'top' was recorded, there are: lidar0 \("
    ):
        write_dataset(recording, "clouds", tmp_path / "out", {"lidar": "top"})
    mast = recording.about | {"moving_links": ["mast"], "links": {"lidar0": "mast"}}
    for kind, options in (("kitti", {}), ("clouds", {"map": True}), ("clouds", {"deskew": True})):
        with pytest.raises(ExportError, match="it sits on 'mast', which moves against base_link"):
            write_dataset(replace(recording, about=mast), kind, tmp_path / "out", options)
    options = {"storage": "sqlite3", "compression": "zstd"}
    with pytest.raises(ExportError, match="zstd needs storage mcap"):
        write_dataset(recording, "rosbag2", tmp_path / "out", options)
    assert list(tmp_path.iterdir()) == []


def test_sensors_that_measured_nothing_are_as_none(tmp_path):
    """As of a recording from 10.1 to 10.15 s."""
    folder = write_recording(tmp_path / "dataset", seconds=0.3, extras=True)
    for key in ("cam0", "cam1", "lidar0", "sun0", "odometry0"):
        for path in (folder / f"mav0/{key}/data.csv", folder / f"truth/{key}.tum"):
            path.write_text(
                f"{path.read_text().splitlines()[0]}\n" if path.suffix == ".csv" else ""
            )
    for kind, message in {
        "kitti": "kitti needs a stereo pair of cameras, and the recording has none",
        "tum": "tum needs a camera with depth, and the recording has none",
        "clouds": "clouds needs a lidar, and the recording has none",
        "lusnar": "lusnar needs a stereo pair",
    }.items():
        with pytest.raises(ExportError, match=message):
            write_dataset(folder, kind, tmp_path / "out")
    (folder / "mav0/cam0/data.csv").write_text(f"#timestamp [ns],filename\n{EPOCH},{EPOCH}.png\n")
    (folder / "mav0/cam1/data.csv").write_text(f"#timestamp [ns],filename\n{EPOCH},{EPOCH}.png\n")
    pose = (folder / "truth/base_link.tum").read_text().splitlines()[0]
    (folder / "truth/cam0.tum").write_text(f"{pose}\n")
    for kind in ("rosbag1", "rosbag2", "calibration", "kitti"):
        assert write_dataset(folder, kind, tmp_path / kind).files


def test_a_folder_that_holds_something_stays(tmp_path, recording):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine").write_text("x")
    with pytest.raises(OutputError, match="out exists: remove it"):
        write_dataset(recording, "calibration", tmp_path / "out")
    assert [p.name for p in tmp_path.rglob("*")] == ["out", "mine"]
    with pytest.raises(StorageError, match="/dev/null/x cannot be written: Not a directory"):
        write_dataset(recording, "calibration", "/dev/null/x")
    with pytest.raises(StorageError, match="cannot be written: File name too long"):
        write_dataset(recording, "calibration", tmp_path / ("a" * 300))
    with pytest.raises(OutputError, match="lies in the recording itself"):
        write_dataset(recording, "calibration", recording.folder / "mav0" / "new")


FILES = {
    "rosbag1": ("rosbag1", {}),
    "mcap": ("rosbag2", {}),
    "sqlite3": ("rosbag2", {"storage": "sqlite3"}),
    "ply": ("clouds", {"map": True}),
    "laz": ("clouds", {"map": True, "encoding": "laz"}),
    "text": ("lusnar", {}),
}


@pytest.mark.filterwarnings("ignore:unclosed database:ResourceWarning")  # rosbags leaves it open
@pytest.mark.parametrize(
    "what",
    [pytest.param(w, marks=pytest.mark.slow) if w in ("mcap", "laz") else w for w in FILES],
)
def test_a_disk_that_takes_no_more_leaves_nothing(what, tmp_path, recording, monkeypatch):
    """The system refuses files of more than 8 kB, whatever library writes them."""
    kind, options = FILES[what]
    monkeypatch.setattr("sys.dont_write_bytecode", True)  # or Python's own are cut off too
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (8_000, limits[1]))
    try:
        with pytest.raises(StorageError, match=r"out cannot be written: \w+"):
            write_dataset(recording, kind, tmp_path / "out", options)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert list(tmp_path.iterdir()) == []
    gc.collect()  # Python 3.13 warns once it is gone, in whatever test that is


@pytest.mark.parametrize(
    ("kind", "module", "options"),
    [
        ("rosbag1", "rosbags", {}),
        ("rosbag2", "rosbags", {}),
        ("clouds", "laspy", {"encoding": "laz"}),
    ],
)
def test_a_missing_extra_is_named(kind, module, options, tmp_path, recording, monkeypatch):
    for name in [one for one in sys.modules if one.split(".")[0] == module]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ExportError, match=r"pip install 'terrain-forge\[datasets\]'"):
        write_dataset(recording, kind, tmp_path / "out", options)


def test_importing_the_room_imports_no_extra():
    import subprocess

    script = (
        "import sys; from terrain_forge import datasets as d; d.dataset_kinds();"
        "print({'rosbags', 'laspy', 'cv2', 'mcap'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert done.stdout.strip() == "set()", done.stderr


def test_a_format_of_a_third_party(tmp_path, recording):
    """A subclass is all that it takes; what it raises leaves nothing."""

    class Broken(DatasetWriter):
        kind = "broken"
        title = "broken"
        Options = Spec

        def write(self, recording, folder, options, progress):
            (folder / "half").write_text("x")
            raise ValueError("bug")

    dataset_kinds()["broken"] = Broken
    try:
        with pytest.raises(ValueError, match="bug"):
            write_dataset(recording, "broken", tmp_path / "out")
    finally:
        del dataset_kinds()["broken"]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", ["kitti", "tum", "rosbag2"])
def test_a_picture_that_is_a_link_is_not_packed(kind, tmp_path):
    """A recording from elsewhere would carry a picture of the user's into what he shares."""
    if kind == "rosbag2":
        pytest.importorskip("rosbags")
    folder = write_recording(tmp_path / "there", seconds=0.5)
    recording = open_recording(folder)
    picture = recording.cameras[0].file(1)
    picture.rename(tmp_path / "mine.png")
    picture.symlink_to(tmp_path / "mine.png")
    with pytest.raises(OutputError, match=f"{picture.name} is a link, which is not followed"):
        write_dataset(recording, kind, tmp_path / "out")
    assert not (tmp_path / "out").exists()
