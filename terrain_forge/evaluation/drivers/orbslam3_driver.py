"""ORB-SLAM3 over a stereo pair: RECORDING TRAJECTORY VOCABULARY CALIBRATION LEFT RIGHT.

Pictures come at the pace of the recording, as in its own examples: its mapping runs beside.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

import cv2
import pyorbslam3
from recorded import names

dataset, output, vocabulary, calibration, *keys = sys.argv[1:7]
pair = [Path(dataset) / "mav0" / key for key in keys]
pictures = [names(folder) for folder in pair]
if [stamp for stamp, _ in pictures[0]] != [stamp for stamp, _ in pictures[1]]:
    sys.exit(f"{' and '.join(keys)} have pictures of different times")
streams = json.loads((Path(dataset) / "dataset.json").read_text())["streams"]
bits = {one["folder"]: one["channels"]["data"].get("bits", 8) for one in streams}
shifts = [bits[f"mav0/{folder.name}"] - 8 for folder in pair]  # it knows 8 bits alone
slam = pyorbslam3.Slam(
    vocabulary, Path(calibration) / "orbslam3" / "stereo.yaml", pyorbslam3.Sensor.STEREO
)
begin, first = time.monotonic(), pictures[0][0][0]
for (stamp, left), (_, right) in zip(*pictures, strict=True):
    files = pair[0] / "data" / left, pair[1] / "data" / right
    images = [cv2.imread(str(file), cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH) for file in files]
    if any(image is None for image in images):
        sys.exit(f"{files[0]} or {files[1]} is no picture")
    for side, shift in enumerate(shifts):
        if shift > 0:
            images[side] = (images[side] >> shift).astype("uint8")
    time.sleep(max(0.0, begin + (stamp - first) * 1e-9 - time.monotonic()))
    slam.track_stereo(*images, stamp * 1e-9)
slam.shutdown()
slam.save_trajectory_tum(output)
# Each picture in which it was lost has the line of the last one in which it was not.
lines = Path(output).read_text().splitlines(keepends=True)
Path(output).write_text("".join(dict.fromkeys(lines)))
