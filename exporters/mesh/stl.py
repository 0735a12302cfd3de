"""Binary STL: the triangles alone."""

from __future__ import annotations

from pathlib import Path

from terrain_forge.geometry import cell_bands, grid_faces, grid_vertices
from terrain_forge.writers import write_stl_faces, write_stl_header

from .part import Part


def write_stl_part(part: Part, path: Path, *, rocks: bool) -> None:
    """Write a part, with its rocks or without."""
    count = 0
    with path.open("wb") as file:
        write_stl_header(file, 0)
        for _, band in cell_bands(part.tile.ground):
            faces = grid_faces(*band.shape)
            write_stl_faces(file, grid_vertices(band), faces)
            count += len(faces)
        for _, vertices, faces in part.merged_rocks() if rocks else ():
            write_stl_faces(file, vertices, faces)
            count += len(faces)
        file.seek(0)
        write_stl_header(file, count)
