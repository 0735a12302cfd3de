"""The ground as a height field: exact, since its binary file holds 32-bit floats."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from terrain_forge.frames import image_rows
from terrain_forge.world import World
from terrain_forge.writers.image import encode_png

from .xml import element

_BASE = 1.0
"""Thickness of the ground below its lowest node [m]."""
_LARGEST_TEXTURE = 4096
"""Pixels that every OpenGL driver takes."""


@dataclass(frozen=True, kw_only=True)
class GroundPart:
    """One tile of the ground in MJCF."""

    assets: tuple[str, ...]
    """Elements of `<asset>`."""
    geom: str
    """Element of `<worldbody>`."""
    files: dict[str, bytes]
    """Contents of the files that it needs, by their path relative to the export's directory."""


def ground_part(tile: World, name: str) -> GroundPart:
    """The height field, texture and geom of a tile.

    MuJoCo takes the samples as vertices, rows from south to north, cuts cells from south-west to
    north-east as our surface is cut, and rescales samples to 0..1: lowest and range go into the
    geom's height and the field's size.
    """
    ground = tile.ground
    west, south, east, north = ground.bounds
    lowest = float(ground.elevation.min())
    extent = float(ground.elevation.max()) - lowest
    heights, picture = f"assets/{name}.bin", f"assets/{name}.png"
    size = ((east - west) / 2, (north - south) / 2, extent or 1.0, _BASE)
    rows, columns = ground.shape
    field = element("hfield", name=name, file=heights, nrow=rows, ncol=columns, size=size)
    texture = element("texture", name=name, type="2d", file=picture)
    material = element("material", name=name, texture=name, specular=0.0, shininess=0.0)
    geom = element(
        "geom",
        name=name,
        class_="ground",
        hfield=name,
        material=name,
        pos=((west + east) / 2, (south + north) / 2, lowest),
    )
    files = {heights: _binary(ground.elevation, lowest, extent), picture: _picture(tile)}
    return GroundPart(assets=(texture, material, field), geom=geom, files=files)


def _binary(elevation: np.ndarray, lowest: float, extent: float) -> bytes:
    """Rows and columns as int32, then float32 samples from 0 to 1, little-endian."""
    shape = np.array(elevation.shape, dtype="<i4").tobytes()
    raised = elevation.astype(np.float64) - lowest
    return shape + (raised / (extent or 1.0)).astype("<f4").tobytes()


def _picture(tile: World) -> bytes:
    """The ground's colours, one pixel per node as far as textures go."""
    colours = tile.appearance.ground_rgb
    step = -(-max(colours.shape[:2]) // _LARGEST_TEXTURE)
    return encode_png(image_rows(colours[::step, ::step]))
