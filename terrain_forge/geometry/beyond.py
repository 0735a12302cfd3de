"""What lies beyond a world's edge as one textured mesh, for formats without colours of vertices.

Its texture is a palette: the colours of the ground from dark to bright in the lower half, those of
the rocks in the upper one; each vertex lies where its own brightness is. Ground of several tints,
as of materials, has a row for each of some, all of one brightness above each other. So it takes
some kilobytes, and between two vertices lie the colours between theirs.
"""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryFile

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, image_rows
from terrain_forge.model import ExportReport, GroundDetail, Horizon, TexturedMesh
from terrain_forge.writers import Gltf, write_obj

_SHADES = 256
"""Columns of the palette."""
_ROWS = 8
"""Rows of a palette of one tint for the ground and one for the rocks."""
_TINTS = 16
"""Rows of ground of several tints."""
_LUMA = np.array([0.2126, 0.7152, 0.0722])
_PAIRS = (0, 1), (0, 2), (1, 2)
"""Channels by whose difference tints are told apart: by that which tells most."""
_SLANT = 0.7
"""Metres that soil on rocks moves, both ways, for each of height."""
_SAME = 48.0
"""How much that difference varies among colours of one tint, at most, of 255."""


def horizon_surface(horizon: Horizon) -> tuple[TexturedMesh, NDArray[np.uint8]]:
    """The mesh, and its palette, sRGB, rows from the top, shape [rows, columns, 3]."""
    colours = horizon.rgb.astype(np.float64)
    coordinates = np.empty((len(colours), 2))
    ground, rocks = slice(0, horizon.ground_vertices), slice(horizon.ground_vertices, None)
    place, tint, shades = _tints(colours[ground])
    rows = len(shades)
    coordinates[ground, 0] = (place + 0.5) / _SHADES
    coordinates[ground, 1] = 0.5 * (tint + 0.5) / rows
    above = np.zeros((1, _SHADES, 3))
    if len(colours[rocks]):
        place, above[0] = _shades(colours[rocks])
        coordinates[rocks, 0] = (place + 0.5) / _SHADES
        coordinates[rocks, 1] = 0.75
    half = max(rows, _ROWS // 2)
    halves = [np.repeat(part, half // len(part), axis=0) for part in (shades, above)]
    image = np.round(np.concatenate(halves)).astype(np.uint8)
    surface = TexturedMesh(
        vertices=horizon.mesh.vertices,
        normals=horizon.normals.astype(np.float64),
        texture_coordinates=coordinates,
        faces=horizon.mesh.faces,
    )
    return surface, np.asarray(image_rows(image))


def horizon_detail(horizon: Horizon, detail: GroundDetail) -> Array:
    """Where the tile of soil lies at the vertices: u east, v north, shape [vertices, 2].

    It goes on from the ground as it lies there. On rocks it is laid along a slanting line rather
    than straight down, which would draw it out on their walls.
    """
    place, height = horizon.mesh.vertices[:, :2].copy(), horizon.mesh.vertices[:, 2:]
    place[horizon.ground_vertices :] += _SLANT * height[horizon.ground_vertices :]
    return np.asarray(place / detail.size)


def _tints(colours: Array) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
    """Column and row of each colour in a palette of shades and tints, and the palette."""
    place, shades = _shades(colours)
    mean = colours.sum(axis=0) / len(colours)
    usual = mean / max(float((mean * _LUMA).sum()), 1e-9)
    bright = (colours * _LUMA).sum(axis=1)
    apart = colours - bright[:, None] * usual
    along = np.stack([apart[:, a] - apart[:, b] for a, b in _PAIRS], axis=-1)
    number = int(np.argmax(np.abs(along).max(axis=0)))
    tint = along[:, number]
    low, high = float(tint.min()), float(tint.max())
    if high - low <= _SAME:
        return place, np.zeros(len(place), np.int64), shades[None]
    row = ((tint - low) * (_TINTS - 1) / (high - low) + 0.5).astype(np.int64)
    steps = low + (high - low) * np.arange(_TINTS) / (_TINTS - 1)
    # Where no colour lies the palette goes on smoothly, since others lie between two vertices.
    levels = np.linspace(float(bright.min()), float(bright.max()), _SHADES)
    shades = levels[:, None] * usual
    palette = np.repeat(shades[None], _TINTS, axis=0)
    for channel, sign in zip(_PAIRS[number], (0.5, -0.5), strict=True):
        palette[..., channel] += sign * steps[:, None]
    palette += (levels - (palette * _LUMA).sum(axis=-1))[..., None]
    cell = row * _SHADES + place
    count = np.bincount(cell, minlength=_TINTS * _SHADES)
    known = count > 0
    for channel in range(3):
        total = np.bincount(cell, colours[:, channel], minlength=len(count))
        filled = palette[..., channel].ravel()
        filled[known] = total[known] / count[known]
        palette[..., channel] = filled.reshape(_TINTS, _SHADES)
    return place, row, np.clip(palette, 0.0, 255.0)


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
    losses = (*report.losses, *horizon_losses(horizon, shown=shown))
    return ExportReport(files=report.files, losses=losses)


def horizon_losses(horizon: Horizon | None, *, shown: bool) -> tuple[str, ...]:
    """What became of what lies beyond the world's edge, if anything does."""
    if horizon is None:
        return ()
    if not shown:
        return ("What lies beyond the border is left out.",)
    return (
        "What lies beyond the border is visual-only: its colours are those of its vertices, "
        "without the fine texture of the ground within.",
    )
