"""The mesh files of a rover, which all formats that can name one share."""

from __future__ import annotations

from pathlib import Path

from terrain_forge.model import Rover
from terrain_forge.writers import write_obj


def rover_mesh(link: int, shape: int) -> str:
    """Name of the file of a link's shape, both counted from 0."""
    return f"rover_{link}_{shape}.obj"


def write_rover_meshes(rover: Rover, folder: Path) -> list[str]:
    """Write the meshes of a rover's shapes, in metres; returns the names of the files."""
    names = []
    for number, link in enumerate(rover.links):
        for part, shape in enumerate(link.shapes):
            if shape.mesh is None:
                continue
            folder.mkdir(parents=True, exist_ok=True)
            names.append(rover_mesh(number, part))
            write_obj(folder / names[-1], vertices=shape.mesh.vertices, faces=shape.mesh.faces)
    return names
