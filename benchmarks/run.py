"""Measures the marks of the project as whole processes: `python benchmarks/run.py [-n RUNS]`.

Prints, for each job, the median and range of wall time, processor time and peak memory of warm runs
(the first run compiles numba's kernels into the cache and is not counted), after a line that
describes the machine. Nothing is asserted: read the table.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

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
    heading(runs)
    print(f"{'job':<40}{'wall s':>20}{'processor s':>20}{'peak MB':>18}")
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


def heading(runs: int) -> None:
    """Print what the machine is, and of how many runs the figures are."""
    print(f"{platform.processor() or platform.machine()}, {model()}, {os.cpu_count()} processors,")
    print(
        f"{platform.system()}, Python {platform.python_version()}, median (min to max) of {runs}\n"
    )


def jobs_alone(
    names: Iterable[str], measure: Callable[[str, int], dict[str, Any]], *, head: str, runs: int
) -> Iterator[tuple[str, dict[str, Any]]]:
    """What the jobs that the command line asks for measure, each in a process of its own.

    Args:
        names: Of all jobs.
        measure: Runs one as often as asked, in this process.
        head: Of the table, which is printed first.
        runs: How often, where the command line does not say.
    """
    parser = argparse.ArgumentParser(description=sys.modules["__main__"].__doc__)
    parser.add_argument("-n", "--runs", type=int, default=runs, help="counted runs of each job")
    parser.add_argument("--job", help=argparse.SUPPRESS)
    parser.add_argument("patterns", nargs="*", help="parts of the names of the jobs to run")
    asked = parser.parse_args()
    if asked.job:
        print(json.dumps(measure(asked.job, asked.runs)))
        return
    heading(asked.runs)
    print(head)
    for name in names:
        if not asked.patterns or any(part in name for part in asked.patterns):
            command = [sys.executable, sys.argv[0], "--job", name, "-n", str(asked.runs)]
            done = subprocess.run(command, stdout=subprocess.PIPE, check=True)
            yield name, json.loads(done.stdout)


def timed(job: Callable[[], object], runs: int) -> tuple[list[float], list[float]]:
    """Wall times, and processor times of all threads, of some runs [s]."""
    walls, works = [], []
    for _ in range(runs):
        wall, work = time.perf_counter(), time.process_time()
        job()
        walls.append(time.perf_counter() - wall)
        works.append(time.process_time() - work)
    return walls, works


def peak() -> float:
    """Peak memory of this process so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def spread(values: Sequence[float], digits: int) -> str:
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
