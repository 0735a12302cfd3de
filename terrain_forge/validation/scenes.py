"""Scenes of named meshes as trimesh has them, which shares nothing with our writers."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from terrain_forge.base import Array
from terrain_forge.model import Mesh
from terrain_forge.validation.names import is_ground, rock_of
from terrain_forge.validation.outlines import split_merged
from terrain_forge.validation.reading import SolidsOfRocks
from terrain_forge.validation.sample import Sample


def scene_parts(scene: Any) -> Iterator[tuple[str, Array, Any]]:
    """Name, matrix and mesh of every node of a trimesh scene that has one."""
    for node in scene.graph.nodes_geometry:
        matrix, geometry = scene.graph[node]
        yield str(node), matrix, scene.geometry[geometry]


def ground_and_rocks(
    sample: Sample, parts: Iterable[tuple[str, Array, Any]]
) -> tuple[list[Mesh], SolidsOfRocks]:
    """Ground and rocks of placed meshes."""
    ground: list[Mesh] = []
    solids = SolidsOfRocks(sample.rocks)
    for name, matrix, mesh in parts:
        rock = rock_of(name)
        if rock is not None and not solids.wants(rock):
            continue
        vertices = mesh.vertices @ matrix[:, :3].T + matrix[:, 3]
        placed = Mesh(vertices=vertices, faces=mesh.faces)
        if rock is not None:
            solids.add(rock, vertices)
        elif is_ground(name):
            ground.append(placed)
        else:
            solids.add_merged(*split_merged(sample, placed))
    return ground, solids
