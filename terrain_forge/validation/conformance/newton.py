"""MJCF and USD worlds in Newton, in an interpreter of its own where ours does not have it."""

from __future__ import annotations

import json
import tempfile
from dataclasses import replace
from functools import partial
from pathlib import Path

from terrain_forge.validation.agreement import usd_layer
from terrain_forge.validation.conformance.consumer import PROBES, Consumer, python_with, run
from terrain_forge.validation.conformance.probe import read_answer
from terrain_forge.validation.conformance.reading import Reading
from terrain_forge.validation.conformance.sample import SETTLING, Sample

VARIABLE = "TERRAIN_FORGE_NEWTON_PYTHON"
"""The environment variable that names a Python with Newton."""


def read_newton(sample: Sample, folder: Path, scratch: Path, *, kind: str) -> Reading:
    """An export as Newton's importer has it, with balls that come to rest in its solver.

    Raises:
        NotRun: if there is no Python with Newton.
        SimulationError: if Newton fails.
    """
    python = python_with("newton", VARIABLE)
    world = folder / "world.xml" if kind == "mjcf" else usd_layer(folder)
    with tempfile.TemporaryDirectory(dir=scratch) as temporary:
        binary, answer = Path(temporary) / "meshes.bin", Path(temporary) / "answer.txt"
        order = {
            "world": str(world.absolute()),
            "binary": str(binary),
            "answer": str(answer),
            "balls": sample.balls.start.tolist(),
            "radius": sample.balls.radius,
            "seconds": SETTLING,
        }
        command = [python, PROBES / "newton_probe.py"]
        run(command, text=json.dumps(order), log=scratch / f"newton-{kind}.log")
        reading = read_answer(sample, answer.read_text(encoding="utf-8"), binary)
    reasons = {
        "path": "Newton imports no motion",
        "findings": "Newton has no validator",
        "gravity": "Newton takes none from MJCF",
    }
    gravity = None if kind == "mjcf" else reading.gravity
    return replace(reading, gravity=gravity, tracks=None, seen=None, findings=None, reasons=reasons)


NEWTON_MJCF = Consumer(name="Newton", kinds=("mjcf",), read=partial(read_newton, kind="mjcf"))
"""Newton's importer of MJCF, and its solver."""
NEWTON_USD = Consumer(name="Newton", kinds=("usd",), read=partial(read_newton, kind="usd"))
"""Newton's importer of USD, and its solver."""
