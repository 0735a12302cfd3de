"""Cuts the LOLA sample out of the global LDEM_16: `python dtm_samples/cut_lola.py LDEM_16.LBL`.

LDEM_16.LBL and .IMG (NASA, public domain; data set LRO-L-LOLA-4-GDR-V1.0) lie in the source
distribution of the Python package pdsimage 1.1.1. The cut keeps the label's text and changes only
what counts its lines and samples.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
NAME = "lola_ldem16_tranquillitatis"
LINE, SAMPLE, SIZE = 1398, 345, 64
"""First line and sample of the cut, from 0, and its size: 21.6° to 25.6° E, 1.4° S to 2.6° N."""


def main() -> None:
    """Write the label and the image."""
    source = Path(sys.argv[1])
    text = source.read_bytes().decode("ascii")
    lines, samples = (int(value(text, key)) for key in ("LINES", "LINE_SAMPLES"))
    pixels = np.fromfile(source.with_suffix(".IMG"), "<i2").reshape(lines, samples)
    cut = pixels[LINE : LINE + SIZE, SAMPLE : SAMPLE + SIZE]
    cut.tofile(HERE / f"{NAME}.IMG")
    resolution = float(value(text, "MAP_RESOLUTION"))
    north, west = 90 - LINE / resolution, SAMPLE / resolution
    changes = {
        "FILE_RECORDS": SIZE,
        "RECORD_BYTES": 2 * SIZE,
        "LINES": SIZE,
        "LINE_SAMPLES": SIZE,
        "MAXIMUM": cut.max(),
        "MINIMUM": cut.min(),
        "LINE_LAST_PIXEL": SIZE,
        "SAMPLE_LAST_PIXEL": SIZE,
        "MAXIMUM_LATITUDE": north,
        "MINIMUM_LATITUDE": north - SIZE / resolution,
        "WESTERNMOST_LONGITUDE": west,
        "EASTERNMOST_LONGITUDE": west + SIZE / resolution,
        "LINE_PROJECTION_OFFSET": float(value(text, "LINE_PROJECTION_OFFSET")) - LINE,
        "SAMPLE_PROJECTION_OFFSET": float(value(text, "SAMPLE_PROJECTION_OFFSET")) - SAMPLE,
    }
    for key, number in changes.items():
        text = re.sub(rf"(?m)^(\s*{key}\s*= )[-\d.]+", rf"\g<1>{number}", text)
    text = text.replace("LDEM_16.IMG", f"{NAME}.IMG")
    (HERE / f"{NAME}.LBL").write_bytes(text.encode("ascii"))


def value(text: str, key: str) -> str:
    """The number of a key in the label."""
    return re.search(rf"(?m)^\s*{key}\s*= ([-\d.]+)", text)[1]


if __name__ == "__main__":
    main()
