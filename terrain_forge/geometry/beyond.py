"""What lies beyond a world's edge as one textured mesh, for formats without colours of vertices.

Its texture is a palette: the colours of the ground from dark to bright in the lower half, those of
the rocks in the upper one; each vertex lies where its own brightness is. So it takes a kilobyte,
and between two vertices lie the colours between theirs.
"""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryFile

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, image_rows
from terrain_forge.model import ExportReport, Horizon, TexturedMesh
from terrain_forge.writers import Gltf, write_obj

_SHADES = 256
"""Columns of the palette."""
_ROWS = 8
_LUMA = np.array([0.2126, 0.7152, 0.0722])


def horizon_surface(horizon: Horizon) -> tuple[TexturedMesh, NDArray[np.uint8]]:
    """The mesh, and its palette, sRGB, rows from the top, shape [rows, columns, 3]."""
    colours = horizon.rgb.astype(np.float64)
    coordinates = np.empty((len(colours), 2))
    palette = np.zeros((2, _SHADES, 3))
    parts = (slice(0, horizon.ground_vertices), slice(horizon.ground_vertices, None))
    for half, part in enumerate(parts):
        if len(colours[part]):
            place, palette[half] = _shades(colours[part])
            coordinates[part, 0] = (place + 0.5) / _SHADES
            coordinates[part, 1] = 0.25 + 0.5 * half
    image = np.repeat(np.round(palette).astype(np.uint8), _ROWS // 2, axis=0)
    surface = TexturedMesh(
        vertices=horizon.mesh.vertices,
        normals=horizon.normals.astype(np.float64),
        texture_coordinates=coordinates,
        faces=horizon.mesh.faces,
    )
    return surface, np.asarray(image_rows(image))


def _shades(colours: Array) -> tuple[NDArray[np.int64], Array]:
    """The column of each colour in a palette from dark to bright, and the palette."""
    bright = (colours * _LUMA).sum(axis=1)
    low, high = float(bright.min()), float(bright.max())
    place = ((bright - low) * (_SHADES - 1) / max(high - low, 1e-9) + 0.5).astype(np.int64)
    count = np.bincount(place, minlength=_SHADES)
    known = np.flatnonzero(count)
    columns = [
        np.interp(
            np.arange(_SHADES),
            known,
            np.bincount(place, channel, minlength=_SHADES)[known] / count[known],
        )
        for channel in colours.T
    ]
    return place, np.stack(columns, axis=-1)


def write_horizon_mesh(path: Path, surface: TexturedMesh) -> None:
    """Write the mesh alone, as OBJ or, z up as no glTF of its own would be, as GLB."""
    if path.suffix == ".obj":
        write_obj(
            path,
            vertices=surface.vertices,
            faces=surface.faces,
            normals=surface.normals,
            texture_coordinates=surface.texture_coordinates,
        )
        return
    with TemporaryFile(dir=path.parent) as binary:
        gltf = Gltf(binary)
        gltf.write_mesh(path, [gltf.add_surface(surface)])


def with_horizon_loss(
    report: ExportReport, horizon: Horizon | None, *, shown: bool
) -> ExportReport:
    """A report that says what became of what lies beyond the world's edge."""
    if horizon is None:
        return report
    loss = (
        "What lies beyond the border is for the eye alone: its colours are those of its vertices, "
        "without the fine texture of the ground within."
        if shown
        else "What lies beyond the border is left out."
    )
    return ExportReport(files=report.files, losses=(*report.losses, loss))
