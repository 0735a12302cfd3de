"""Measures what a first build compiles: `python benchmarks/compiling.py [--write] [RECIPE …]`.

Builds the recipes (by default hello, moon_craters and mars_ripples) in this process with an empty
cache, records half a second in the first, and prints the processor time that each kernel took to
compile and that all took besides; rock shapes are made anew. With `--write` the lists that later
builds and recordings compile ahead are written anew.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
import time
from collections import defaultdict
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
RECIPES = ("hello", "moon_craters", "mars_ripples")


def main() -> None:
    """Build, print the table and write the list where that is wanted."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recipes", nargs="*", default=[f"{r}.yaml" for r in RECIPES])
    parser.add_argument("--write", action="store_true", help="write the list of kernels anew")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        os.environ["NUMBA_CACHE_DIR"] = f"{folder}/kernels"  # numba reads it as it is imported
        os.environ["TERRAIN_FORGE_CACHE"] = f"{folder}/made"  # or no rock shapes would be made
        os.environ["NUMBA_NUM_THREADS"] = "1"  # else other processes compile ahead, unseen
        from numba.core import event

        from terrain_forge.base import compiling
        from terrain_forge.base.listed import LISTED
        from terrain_forge.pipeline import build, record
        from terrain_forge.recipe import load_recipe

        compiling.unpack = lambda: False  # nor is what a wheel brings along taken
        if arguments.write:  # what is listed may not be there any more
            for file in LISTED.values():
                file.write_text("{}")
        listener = _listener(event.Listener)
        event.register("numba:compile", listener)
        begin = time.process_time()
        for n, recipe in enumerate(arguments.recipes):
            path = HERE.parent / "recipes" / recipe
            build(load_recipe(path).recipe, f"{folder}/{n}", folder=path.parent)
        built = len(listener.rows)
        record(f"{folder}/0", begin=10.0, end=10.5)
        whole = time.process_time() - begin
    for seconds, kernel, _ in sorted(listener.rows, key=lambda row: -row[0]):
        print(f"{seconds:8.2f} s  {kernel}")
    compiled = sum(seconds for seconds, _, _ in listener.rows)
    count = len(listener.rows)
    print(f"{compiled:8.2f} s  {count} kernels, {compiled / (whole - compiled):.2f} × the rest")
    if arguments.write:
        _write("build", listener.rows[:built])
        _write("record", listener.rows[built:])


def _write(purpose: str, rows: list[tuple[float, str, Any]]) -> None:
    """Write the list of what a purpose compiles, slowest first."""
    from terrain_forge.base.listed import LISTED, plain_types

    rooms: dict[str, dict[str, Any]] = defaultdict(dict)
    cost: dict[str, float] = defaultdict(float)
    for seconds, kernel, signature in sorted(rows, key=lambda row: -row[0]):
        room = ".".join(kernel.split(":")[0].split(".")[:-1])
        rooms[room][kernel] = plain_types(signature)
        cost[room] += seconds
    slowest = sorted(rooms, key=lambda room: -cost[room])
    LISTED[purpose].write_text(json.dumps({room: rooms[room] for room in slowest}, indent=1) + "\n")


def _listener(base: Any) -> Any:
    class Compiled(base):  # type: ignore[misc]
        """Notes the kernels that are compiled for Python, with seconds and types."""

        def __init__(self) -> None:
            self.begun: list[float] = []
            self.rows: list[tuple[float, str, Any]] = []

        def on_start(self, event: Any) -> None:
            del event
            self.begun.append(time.thread_time())

        def on_end(self, event: Any) -> None:
            seconds = time.thread_time() - self.begun.pop()
            function = event.data["dispatcher"].py_func
            if not self.begun and function.__module__.startswith("terrain_forge"):
                kernel = f"{function.__module__}:{function.__name__}"
                self.rows.append((seconds, kernel, event.data["args"]))

    return Compiled()


if __name__ == "__main__":
    main()
