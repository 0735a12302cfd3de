"""Times the exporters beside Blender's own: `python benchmarks/blender.py [--side NODES]`.

TERRAIN_FORGE_BLENDER_PYTHON names a Python with bpy (`pip install bpy`); without it there is
nothing to compare with, and this says so. Our exporters write one bare ground as OBJ, STL, PLY, GLB
and USD, and bake its texture; Blender reads each, and writes what it has read as the same format.
Both write onto the same disk, one after the other, ours warm. The last column is Blender's time of
writing over ours.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from exports import made_world

from terrain_forge.model import World, exporter

PROBE = Path(__file__).parents[1] / "tests" / "consumers" / "programs" / "blender_world.py"
FORMATS: dict[str, tuple[str, dict[str, Any], str]] = {
    "obj": ("mesh", {"format": "obj"}, "world.obj"),
    "stl": ("mesh", {"format": "stl"}, "world.stl"),
    "ply": ("mesh", {"format": "ply"}, "world.ply"),
    "glb": ("glb", {"tile_cells": 4096}, "world.glb"),
    "usd": ("usd", {"tile_cells": 4096}, "world.usda"),
}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--side", type=int, default=1025, help="nodes of the ground each way")
    side = parser.parse_args().side
    python = os.environ.get("TERRAIN_FORGE_BLENDER_PYTHON")
    if not python:
        sys.exit("TERRAIN_FORGE_BLENDER_PYTHON names no Python with bpy: nothing to compare with")
    world = made_world(side, 0)
    points = np.random.default_rng(1).uniform(-0.4, 0.4, (200, 2)) * (side - 1) * world.site.spacing
    with tempfile.TemporaryDirectory() as folder:
        ours = {name: write(world, Path(folder) / name, name) for name in FORMATS}
        files = [str(Path(folder) / name / file) for name, (_, _, file) in FORMATS.items()]
        order = {"files": files, "points": points.tolist(), "folder": folder}
        done = subprocess.run(
            [python, PROBE], input=json.dumps(order), stdout=subprocess.PIPE, text=True, check=True
        )
    said = json.loads(done.stdout.splitlines()[-1])
    wanted = world.ground.height_at(points[:, 0], points[:, 1])
    print(f"Blender {said['version']}, ground of {side}² nodes; times in s, error in mm")
    print(f"{'':<5}{'ours':>8}{'Blender':>10}{'it reads':>10}{'error':>10}{'ratio':>8}")
    for (name, wrote), answer in zip(ours.items(), said["answers"], strict=True):
        error = 1000.0 * np.abs(np.array(answer["heights"], float) - wanted).max()
        print(
            f"{name:<5}{wrote:>8.2f}{answer['export']:>10.2f}{answer['import']:>10.2f}"
            f"{error:>10.3f}{answer['export'] / wrote:>8.0f}"
        )


def write(world: World, folder: Path, name: str) -> float:
    """Seconds that the second of two exports takes."""
    kind, options, _ = FORMATS[name]
    module = exporter(kind)
    chosen = module.Options(**options)
    with tempfile.TemporaryDirectory() as cold:
        module.export(world, Path(cold), options=chosen)
    folder.mkdir()
    since = time.perf_counter()
    module.export(world, folder, options=chosen)
    return time.perf_counter() - since


if __name__ == "__main__":
    main()
