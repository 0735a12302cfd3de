"""The answers of the small programs that run a consumer in a process of its own, and Newton.

A probe prints a line per fact, its parts split by tabs: `consumer` text; `finding` text; `gravity`
x y z; `mesh` vertices faces, whose float64 positions and int32 corners follow each other in a
binary file; `heightmap` span and largest grey level of a mesh that is one; `shape` kind model name
mesh matrix; `body` model mass inertia matrix; `waypoint` path time position quaternion; `ball`
height. A matrix is the twelve upper numbers of a homogeneous one, row by row; kinds are `touched`
and `seen`.
"""

from __future__ import annotations

import json
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, python_words
from terrain_forge.validation.consumer import Consumer, python_with, read_probe, run
from terrain_forge.validation.outlines import ground_and_rocks
from terrain_forge.validation.reading import Body, Reading, Track, rock_of
from terrain_forge.validation.sample import SETTLING, Sample


def read_answer(sample: Sample, text: str, binary: Path | None) -> Reading:
    """The reading that a probe's printed answer tells; without meshes where their file is None."""
    facts = defaultdict[str, list[list[str]]](list)
    for line in text.splitlines():
        word, *parts = line.split("\t")
        facts[word].append(parts)
    meshes = list(_meshes(facts["mesh"], binary)) if binary else []
    shapes = {
        kind: [
            (f"{name}/{model}", np.array(matrix, np.float64).reshape(3, 4), meshes[int(mesh)])
            for found, model, name, mesh, *matrix in (facts["shape"] if meshes else ())
            if found == kind
        ]
        for kind in ("touched", "seen")
    }
    ground, touched = ground_and_rocks(sample, shapes["touched"])
    gravity = facts["gravity"]
    return Reading(
        consumer=", ".join(parts[0] for parts in facts["consumer"]),
        ground=tuple(ground),
        quantum=max((float(span) / float(most) for span, most in facts["heightmap"]), default=0.0),
        touched=touched,
        seen=ground_and_rocks(sample, shapes["seen"])[1],
        gravity=float(gravity[0][2]) if gravity else None,
        bodies=_bodies(facts["body"]),
        tracks=tuple(_tracks(facts["waypoint"])),
        balls=resting_balls(text),
        findings=tuple(parts[0] for parts in facts["finding"]),
    )


def resting_balls(text: str) -> Array | None:
    """Where a probe's balls rest [m]; None where it let none down."""
    heights = [line.split("\t")[1] for line in text.splitlines() if line.startswith("ball\t")]
    return np.array(heights, np.float64) if heights else None


class _Part(NamedTuple):
    """A mesh as it lies in the file, which is read where it is looked at."""

    vertices: Array
    faces: NDArray[np.int32]


def _meshes(sizes: list[list[str]], binary: Path) -> Iterator[_Part]:
    if not sizes:
        return
    content = np.memmap(binary, np.uint8, "r")
    at = 0
    for vertices, faces in sizes:
        middle = at + 24 * int(vertices)
        end = middle + 12 * int(faces)
        yield _Part(
            vertices=content[at:middle].view("<f8").reshape(-1, 3),
            faces=content[middle:end].view("<i4").reshape(-1, 3),
        )
        at = end


def _bodies(lines: list[list[str]]) -> dict[int, Body]:
    found = {}
    for model, *numbers in lines:
        rock, values = rock_of(model), np.array(numbers, np.float64)
        if rock is not None:
            matrix = values[10:].reshape(3, 4)
            inertia = values[1:10].reshape(3, 3)
            found[rock] = Body(float(values[0]), inertia, matrix[:, 3], matrix[:, :3])
    return found


def _tracks(lines: list[list[str]]) -> Iterator[Track]:
    for name in dict.fromkeys(line[0] for line in lines):
        rows = np.array([line[1:] for line in lines if line[0] == name], np.float64)
        yield Track(name=name, time=rows[:, 0], position=rows[:, 1:4], quaternion=rows[:, 4:])


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
            command = python_words(read_probe(__file__, "newton_probe.py"), python)
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
