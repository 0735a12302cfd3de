"""Runs RTAB-Map's kitti_dataset, and tells what its database has beside the poses that it writes.

`rtab_map_driver.py PROGRAM … --output . SEQUENCE`: into the folder that it runs in it writes, as
`times.txt`, of which frames the poses are, and its loop closures as `loops.txt`.
"""

from __future__ import annotations

import os
import signal
import sqlite3
import struct
import subprocess
import sys
from contextlib import closing
from pathlib import Path

_DATABASE = Path("rtabmap.db")
_GLOBAL_CLOSURE = 1
"""Links of frames that were recognised; those of neighbours and of what is near are others."""
_CLOSURES = """
SELECT a.stamp, b.stamp, transform FROM Link
JOIN Node AS a ON a.id = from_id JOIN Node AS b ON b.id = to_id
WHERE type = ? AND from_id < to_id ORDER BY to_id, from_id
"""


def main(words: list[str]) -> int:
    """Run the program, and end as it does."""
    signal.signal(signal.SIGTERM, lambda *_: None)  # it gets that too, and is waited for
    try:
        status = subprocess.call(words)
    except OSError as error:
        sys.exit(f"{words[0]}: {(error.strerror or str(error)).lower()}")
    if status < 0:
        if -status != signal.SIGKILL:
            signal.signal(-status, signal.SIG_DFL)
        os.kill(os.getpid(), -status)
    if status == 0 and _DATABASE.is_file():
        with closing(sqlite3.connect(_DATABASE)) as database:
            _tell(database)
    return status


def _tell(database: sqlite3.Connection) -> None:
    """Write the times of its poses, and both times [s] and the motion [m] of loop closures."""
    times = database.execute("SELECT stamp FROM Node ORDER BY id")
    Path("times.txt").write_text("".join(f"{stamp:.9f}\n" for (stamp,) in times), encoding="ascii")
    closures = database.execute(_CLOSURES, (_GLOBAL_CLOSURE,))
    rows = (f"{a:.9f} {b:.9f} {_in_camera(motion)}\n" for a, b, motion in closures)
    Path("loops.txt").write_text("".join(rows), encoding="ascii")


def _in_camera(motion: bytes) -> str:
    """The place of a 3 × 4 matrix, from x forward, y left to the camera's x right, y down."""
    values = struct.unpack("12f", motion)
    return f"{-values[7]:.6f} {-values[11]:.6f} {values[3]:.6f}"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
