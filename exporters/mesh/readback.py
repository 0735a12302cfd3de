"""Plain meshes in trimesh, which shares nothing with our writers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from shlex import quote
from typing import Any

from terrain_forge.model import Mesh, Opening
from terrain_forge.validation import (
    Consumer,
    Reading,
    Sample,
    free_of_rocks,
    ground_and_rocks,
    highest_on,
    scene_parts,
)


def read_meshes(sample: Sample, folder: Path, options: Any, scratch: Path) -> Reading:
    """An OBJ, STL or PLY export as trimesh has it.

    Where ground and rocks are one mesh, the ground is asked where no rock reaches.
    """
    import trimesh

    del scratch
    more: dict[str, Any] = {}
    if options.format == "obj":
        more = {"split_objects": True, "group_material": False}
    scenes = [
        trimesh.load(file, force="scene", process=False, **more)
        for file in sorted(folder.glob(f"*.{options.format}"))
    ]
    parts = [
        (node, matrix[:3], mesh) for scene in scenes for node, matrix, mesh in scene_parts(scene)
    ]
    ground, solids = ground_and_rocks(sample, parts)
    reasons = dict.fromkeys(("masses", "gravity", "path", "balls"), "a mesh carries shapes alone")
    reading = Reading(
        consumer=f"trimesh {trimesh.__version__}",
        ground=tuple(ground),
        seen=solids,
        rock_error=options.outline_error,
        reasons={**reasons, "findings": "trimesh has no validator"},
    )
    if ground:
        return reading
    surfaces = (  # the files do not tell ground from rocks
        Mesh(vertices=mesh.vertices @ matrix[:, :3].T + matrix[:, 3], faces=mesh.faces)
        for _, matrix, mesh in parts
    )
    return replace(
        reading,
        heights=highest_on(surfaces, sample.points),
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


CONSUMERS = (Consumer(name="trimesh", read=read_meshes),)
"""What reads these exports back."""
