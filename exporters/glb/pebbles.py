"""Pebbles near the paths, in a file of their own: its readers must know of instances."""

from __future__ import annotations

import json
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

import numpy as np

from terrain_forge.base import xyzw
from terrain_forge.model import RockField, World
from terrain_forge.writers import Gltf

from .ground import Z_UP_TO_Y_UP
from .rocks import rock_meshes

FILE = "pebbles.glb"
INSTANCING = "EXT_mesh_gpu_instancing"


def write_pebbles(world: World, rocks: RockField, path: Path) -> None:
    """Write a node for each shape in each look, with the places of all its pebbles."""
    coarsest = np.array([len(shape.meshes) - 1 for shape in world.library.prototypes])
    with TemporaryFile(dir=path.parent) as binary:
        gltf = Gltf(binary)
        meshes = rock_meshes(world, rocks, gltf, coarsest[rocks.prototype])
        nodes: list[dict[str, Any]] = []
        for mesh in np.unique(meshes).tolist():
            some = rocks.select(meshes == mesh)
            laid = {
                "TRANSLATION": some.position,
                "ROTATION": xyzw(some.quaternion),
                "SCALE": np.repeat(some.scale[:, None], 3, axis=1),
            }
            told = {name: gltf.add_samples(rows.astype(np.float32)) for name, rows in laid.items()}
            places = {INSTANCING: {"attributes": told}}
            nodes.append({"name": f"pebbles_{mesh}", "mesh": mesh, "extensions": places})
        root = {
            "name": "pebbles",
            "rotation": Z_UP_TO_Y_UP,
            **({"children": list(range(1, 1 + len(nodes)))} if nodes else {}),
        }
        gltf.write(
            path,
            nodes=map(json.dumps, [root, *nodes]),
            in_nodes=[INSTANCING],
            # Else one that does not know it would show one pebble of each kind, in the middle.
            extensionsRequired=[INSTANCING],
            scene=0,
            scenes=[{"name": "pebbles", "nodes": [0]}],
        )
