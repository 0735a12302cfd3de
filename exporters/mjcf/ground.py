"""The ground as height fields: exact, since their binary files hold 32-bit floats."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from terrain_forge.base import image_rows
from terrain_forge.geometry import bake_ground, finest_texture
from terrain_forge.model import Heightfield, Tile
from terrain_forge.writers import encode_png

from .blocks import Block
from .xml import element

_BASE = 1.0
"""Thickness of the ground below its lowest node [m]."""
_LARGEST_TEXTURE = 4096
"""Pixels that every OpenGL driver takes."""
_LARGEST_TEXT = 1024
"""Samples up to which a field stands in the XML itself: thousands of files would be worse."""


@dataclass(frozen=True, kw_only=True)
class GroundPart:
    """One tile or block of the ground in MJCF."""

    assets: tuple[str, ...]
    """Elements of `<asset>`."""
    geom: str
    """Element of `<worldbody>`."""
    files: dict[str, bytes]
    """Contents of the files that it needs, by their path relative to the export's directory."""


def ground_part(tile: Tile, name: str, *, kind: str, largest: int) -> GroundPart:
    """The height field, texture and geom of a tile.

    MuJoCo spans a height field from edge to edge of its texture, which reaches half a cell beyond
    the outer nodes: its repeat, which counts from the middle, leaves that out.

    `kind` is the geom's default class, `largest` the pixels of the whole ground's picture along its
    longer side.
    """
    picture = f"assets/{name}.png"
    asset, place, files = _height_field(tile.ground, name, in_text=False)
    texture = element("texture", name=name, type="2d", file=picture)
    rows, columns = tile.ground.shape
    shown = ((columns - 1) / columns, (rows - 1) / rows)
    material = element(
        "material", name=name, texture=name, texrepeat=shown, specular=0.0, shininess=0.0
    )
    return GroundPart(
        assets=(texture, material, asset),
        geom=element("geom", name=name, class_=kind, hfield=name, material=name, pos=place),
        files=files | {picture: _picture(tile, largest)},
    )


def ground_block(ground: Heightfield, block: Block, name: str) -> GroundPart:
    """The height field and geom of a block of a tile's ground, which is touched and not seen."""
    part = ground.cut(column=block.column, row=block.row, columns=block.columns, rows=block.rows)
    small = part.elevation.size <= _LARGEST_TEXT
    asset, place, files = _height_field(part, name, in_text=small)
    geom = element("geom", name=name, class_="ground_block", hfield=name, pos=place)
    return GroundPart(assets=(asset,), geom=geom, files=files)


def _height_field(
    ground: Heightfield, name: str, *, in_text: bool
) -> tuple[str, tuple[float, float, float], dict[str, bytes]]:
    """The asset, the position of its geom [m], and its file unless the samples are in the XML.

    MuJoCo takes the samples as vertices, rows from south to north, cuts cells from south-west to
    north-east as our surface is cut, and rescales samples to 0..1: lowest and range go into the
    geom's height and the field's size. Samples in the XML run from north to south.
    """
    west, south, east, north = ground.bounds
    lowest = float(ground.elevation.min())
    extent = float(ground.elevation.max()) - lowest or 1.0
    samples = ((ground.elevation.astype(np.float64) - lowest) / extent).astype("<f4")
    files: dict[str, bytes] = {}
    size = ((east - west) / 2, (north - south) / 2, extent, _BASE)
    rows, columns = ground.shape
    shape = {"name": name, "nrow": rows, "ncol": columns, "size": size}
    if in_text:
        asset = element("hfield", elevation=image_rows(samples), **shape)
    else:
        file = f"assets/{name}.bin"
        files[file] = np.array(ground.shape, dtype="<i4").tobytes() + samples.tobytes()
        asset = element("hfield", file=file, **shape)
    return asset, ((west + east) / 2, (south + north) / 2, lowest), files


def _picture(tile: Tile, largest: int) -> bytes:
    """The ground's colours; of a field with more nodes than a texture has pixels, every second."""
    grounds = ((tile.whole.ground, largest), (tile.ground, _LARGEST_TEXTURE))
    finer = min(finest_texture(ground, pixels) for ground, pixels in grounds)
    colours = bake_ground(tile.world, finer=finer).rgb
    step = -(-max(colours.shape[:2]) // _LARGEST_TEXTURE)
    return encode_png(image_rows(colours[::step, ::step]))
