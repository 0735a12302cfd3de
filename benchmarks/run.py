"""Measures the marks of the project as whole processes: `python benchmarks/run.py [-n RUNS]`.

Prints, for each job, the median and range of wall time, processor time and peak memory of warm runs
(the first run compiles numba's kernels into the cache and is not counted), after a line that
describes the machine. Nothing is asserted: read the table.
"""

from __future__ import annotations

import argparse
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).parent

JOBS = {
    "terrain-forge --help": ["--help"],
    "check hello.yaml": ["check", str(HERE.parent / "recipes" / "hello.yaml")],
    "build 1025², 20k rocks, SDF+MJCF+USD": ["build", str(HERE / "build_1025.yaml"), "-o", "OUT"],
    "the same, USD only": [
        "build", str(HERE / "build_1025.yaml"), "-o", "OUT", "--only", "usd",
    ],
}  # fmt: skip


def main() -> None:
    """Run all jobs and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-n", "--runs", type=int, default=5, help="counted runs of each job")
    runs = parser.parse_args().runs
    print(f"{platform.processor() or platform.machine()}, {model()}, {os.cpu_count()} processors,")
    print(f"{platform.system()}, Python {platform.python_version()}, median (min to max) of {runs}")
    print(f"\n{'job':<40}{'wall s':>20}{'processor s':>20}{'peak MB':>18}")
    for name, arguments in JOBS.items():
        once(arguments)
        rows = [once(arguments) for _ in range(runs)]
        columns = [
            spread(values, digits)
            for values, digits in zip(zip(*rows, strict=True), (2, 2, 0), strict=True)
        ]
        print(f"{name:<40}{columns[0]:>20}{columns[1]:>20}{columns[2]:>18}")


def once(arguments: list[str]) -> tuple[float, float, float]:
    """Wall time [s], processor time [s] and peak memory [MB] of one run into a new folder."""
    with tempfile.TemporaryDirectory() as folder:
        command = [a.replace("OUT", f"{folder}/out") for a in arguments]
        start = time.perf_counter()
        process = subprocess.Popen(
            [sys.executable, "-m", "terrain_forge", *command], stdout=subprocess.DEVNULL
        )
        _, status, usage = os.wait4(process.pid, 0)
        wall = time.perf_counter() - start
    if status:
        sys.exit(f"{arguments}: status {os.waitstatus_to_exitcode(status)}")
    return wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def spread(values: tuple[float, ...], digits: int) -> str:
    """Median and range."""
    middle = statistics.median(values)
    return f"{middle:.{digits}f} ({min(values):.{digits}f}-{max(values):.{digits}f})"


def model() -> str:
    """The processor's name."""
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return "unknown processor"


if __name__ == "__main__":
    main()
