"""Worlds in Newton, in an interpreter of its own where ours does not have it."""

from __future__ import annotations

import json
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

from terrain_forge.validation.consumer import Consumer, python_with, read_probe, run
from terrain_forge.validation.probe import read_answer
from terrain_forge.validation.reading import Reading
from terrain_forge.validation.sample import SETTLING, Sample

VARIABLE = "TERRAIN_FORGE_NEWTON_PYTHON"
"""The environment variable that names a Python with Newton."""


def newton(file: str, *, rock_error: float = 0.0, gravity_kept: bool = True) -> Consumer:
    """Newton's importer of an export, and its solver.

    Args:
        file: Name of the MJCF or USD file in the export's folder.
        rock_error: How far the format's rocks may be off, besides what the options allow.
        gravity_kept: Whether Newton takes gravity from such a file.
    """
    reasons = {
        "path": "Newton imports no motion",
        "findings": "Newton has no validator",
        "gravity": "Newton takes none from MJCF",
    }

    def read(sample: Sample, folder: Path, options: Any, scratch: Path) -> Reading:
        python, world = python_with("newton", VARIABLE), folder / file
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
            command: list[str | Path] = [python, "-c", read_probe(__file__, "newton_probe.py")]
            run(command, text=json.dumps(order), log=scratch / f"newton-{world.suffix[1:]}.log")
            reading = read_answer(sample, answer.read_text(encoding="utf-8"), binary)
        return replace(
            reading,
            gravity=reading.gravity if gravity_kept else None,
            rock_error=rock_error + getattr(options, "outline_error", 0.0),
            tracks=None,
            seen=None,
            findings=None,
            reasons=reasons,
        )

    return Consumer(name="Newton", read=read)
