"""The driver of ORB-SLAM3, with modules in its place and in OpenCV's."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

from terrain_forge import evaluation

DRIVER = Path(evaluation.__file__).parent / "drivers" / "orbslam3_driver.py"
SLAM = """
class Sensor:
    STEREO = "stereo"

class Slam:
    def __init__(self, vocabulary, calibration, sensor):
        self.lines = []

    def track_stereo(self, left, right, seconds):
        # Lost from the third picture to the fifth.
        assert (left.dtype, left[0, 0], right[0, 0]) == ("uint8", 200, 200)
        line = f"{seconds:.6f} {len(self.lines)} 0 0 0 0 0 1\\n"
        self.lines.append(self.lines[-1] if 2 < len(self.lines) < 5 else line)

    def shutdown(self):
        pass

    def save_trajectory_tum(self, path):
        open(path, "w").write("".join(self.lines))
"""


CV2 = """
import numpy
IMREAD_GRAYSCALE, IMREAD_ANYDEPTH = 0, 2

def imread(name, flags):
    deep = flags & IMREAD_ANYDEPTH and "cam1" in name
    value = 3200 if deep else 12 if "cam1" in name else 200
    return numpy.full((2, 3), value, "uint16" if deep else "uint8")
"""


def test_pictures_in_which_it_was_lost_have_no_pose(tmp_path):
    """And those of 12 bits, here the right ones, come as their upper 8."""
    (tmp_path / "pyorbslam3.py").write_text(SLAM)
    (tmp_path / "cv2.py").write_text(CV2)
    channels = {"cam0": {"data": {}}, "cam1": {"data": {"bits": 12}}}
    streams = [{"folder": f"mav0/{key}", "channels": told} for key, told in channels.items()]
    (tmp_path / "dataset.json").write_text(json.dumps({"streams": streams}))
    for camera in ("cam0", "cam1"):
        folder = tmp_path / "mav0" / camera
        folder.mkdir(parents=True)
        rows = (f"{number * 10**7},{number}.png" for number in range(7))
        (folder / "data.csv").write_text("\n".join(("#timestamp [ns],filename", *rows)))
    told = tmp_path / "told.tum"
    subprocess.run(
        [sys.executable, DRIVER, tmp_path, told, "vocabulary", tmp_path, "cam0", "cam1"],
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        check=True,
    )
    poses = [line.split()[1] for line in told.read_text().splitlines()]
    assert poses == ["0", "1", "2", "5", "6"]
