"""Plain meshes, read piece by piece: they may be larger than the memory."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from shlex import quote
from typing import Any

import numpy as np

from terrain_forge.model import Mesh, Opening
from terrain_forge.validation import (
    Consumer,
    Reading,
    Sample,
    free_of_rocks,
    ground_and_rocks,
    highest_on,
    read_objects,
    read_triangles,
)

_UNMOVED = np.eye(4)[:3]


def read_meshes(sample: Sample, folder: Path, options: Any, scratch: Path) -> Reading:
    """An OBJ, STL or PLY export; nothing of how it is read is shared with what writes it."""
    del scratch
    files = sorted(folder.glob(f"*.{options.format}"))
    reasons = dict.fromkeys(("masses", "gravity", "path", "balls"), "a mesh carries shapes alone")
    reading = Reading(
        consumer="lines" if options.format == "obj" else "triangles",
        rock_error=options.outline_error,
        reasons={**reasons, "findings": "plain meshes have no validator"},
    )
    found = (_objects if options.format == "obj" else _triangles)(sample, files, reading)
    if options.rocks == "none":
        left_out = dict.fromkeys(("rock tops", "rock outlines", "frames"), "rocks: none")
        found = replace(found, seen=None, hidden=None, reasons={**found.reasons, **left_out})
    return found


def _objects(sample: Sample, files: list[Path], reading: Reading) -> Reading:
    """Files whose objects have names."""
    objects = ((name, _UNMOVED, mesh) for file in files for name, mesh in read_objects(file))
    ground, solids = ground_and_rocks(sample, objects)
    return replace(reading, ground=tuple(ground), seen=solids)


def _triangles(sample: Sample, files: list[Path], reading: Reading) -> Reading:
    """Files that do not tell ground from rocks: the ground is asked where no rock reaches."""
    heights, near = np.full(len(sample.points), np.nan), [np.zeros((0, 3))]
    for mesh in (some for file in files for some in read_triangles(file)):
        heights = np.fmax(heights, highest_on([mesh], sample.points))
        faces = mesh.faces[sample.near(mesh.vertices[mesh.faces[:, 0]])]
        near.append(mesh.vertices[faces].reshape(-1, 3))
    corners = np.concatenate(near)
    rocks = Mesh(vertices=corners, faces=np.arange(len(corners), dtype=np.int32).reshape(-1, 3))
    return replace(
        reading,
        seen=ground_and_rocks(sample, [("", _UNMOVED, rocks)])[1],
        heights=heights,
        hidden=~free_of_rocks(sample.world, sample.points, margin=0.0),
        reasons={**reading.reasons, "frames": "ground and rocks are one mesh"},
    )


def opening(folder: Path, options: Any) -> Opening:
    """How the folder is opened."""
    files = "*" if options.tiles == "tiled" else "world"
    return Opening(
        title="Meshes",
        commands=f"meshlab {quote(folder.name)}/{files}.{options.format}"
        "   # or any reader of meshes; metres, z up",
    )


CONSUMERS = (Consumer(name="files", read=read_meshes),)
"""What reads these exports back."""
