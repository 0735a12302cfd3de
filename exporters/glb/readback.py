"""GLB scenes in trimesh, which shares nothing with our writers."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from pathlib import Path
from shlex import quote
from typing import Any

import numpy as np

from terrain_forge.base import Array
from terrain_forge.model import Opening
from terrain_forge.validation import (
    Consumer,
    Reading,
    Sample,
    Track,
    ground_and_rocks,
    scene_parts,
)

_Z_UP = np.array([(1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0)])
"""From glTF's axes, y up, to the world's."""


def read_glb(sample: Sample, folder: Path, options: Any, scratch: Path) -> Reading:
    """A GLB as trimesh has it, turned to the world's axes; its animations as the file has them."""
    import trimesh

    del scratch
    path = folder / "world.glb"
    scene = trimesh.load(path, force="scene", process=False)
    parts = ((node, _Z_UP @ matrix[:3], mesh) for node, matrix, mesh in scene_parts(scene))
    ground, solids = ground_and_rocks(sample, parts)
    unsaid = "glTF has no physics"
    reasons = dict.fromkeys(("masses", "gravity", "balls"), unsaid)
    return Reading(
        consumer=f"trimesh {trimesh.__version__}",
        ground=tuple(ground),
        seen=solids,
        rock_error=options.outline_error,
        close=options.close_within_m > 0.0,
        tracks=tuple(_animations(path)),
        reasons={**reasons, "findings": "trimesh has no validator"},
    )


def _animations(path: Path) -> Iterator[Track]:
    """The moving nodes of a GLB, turned to the world's axes; trimesh leaves animations out.

    A node's motion is in the frame of its parent, the root, whose own turn makes it y up.
    """
    content = path.read_bytes()
    length, _ = struct.unpack_from("<II", content, 12)
    asset = json.loads(content[20 : 20 + length])
    binary = memoryview(content)[20 + length + 8 :]

    def values(accessor: int) -> Array:
        said = asset["accessors"][accessor]
        view = asset["bufferViews"][said["bufferView"]]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[said["type"]]
        start = view.get("byteOffset", 0) + said.get("byteOffset", 0)
        found = np.frombuffer(binary, "<f4", count=width * said["count"], offset=start)
        return found.reshape(-1, width).astype(np.float64)

    for animation in asset.get("animations", []):
        found = {}
        for channel in animation["channels"]:
            sampler = animation["samplers"][channel["sampler"]]
            found[channel["target"]["path"]] = values(sampler["output"])
            found["time"] = values(sampler["input"])[:, 0]
        yield Track(
            name=animation["name"],
            time=found["time"],
            position=found["translation"],
            quaternion=np.roll(found["rotation"], 1, axis=1),
        )


def opening(folder: Path, options: Any) -> Opening:
    """How the folder is opened."""
    del options
    load = f'import bpy; bpy.ops.import_scene.gltf(filepath="{folder.name}/world.glb")'
    return Opening(
        title="Blender, glTF",
        commands=f"blender --python-expr {quote(load)}   # or any viewer of glTF",
    )


CONSUMERS = (Consumer(name="trimesh", read=read_glb),)
"""What reads these exports back."""
