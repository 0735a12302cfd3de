"""The ground as height fields: exact, since their binary files hold 32-bit floats."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from terrain_forge.base import image_rows
from terrain_forge.geometry import bake_ground, finest_texture, horizon_surface, write_horizon_mesh
from terrain_forge.model import (
    Heightfield,
    Horizon,
    Tile,
    World,
    cells_by_friction,
    material_frictions,
)
from terrain_forge.writers import Lines, Value, element, encode_png

from .blocks import Block, split_ground, wide_rocks
from .frictions import Cells, fields_by_friction
from .materials import sliding
from .options import Options

_BASE = 1.0
"""Thickness of the ground below its lowest node [m]."""
_LARGEST_TEXTURE = 4096
"""Pixels that every OpenGL driver takes."""
_LARGEST_TEXT = 1024
"""Samples up to which a block stands in the XML itself: thousands of files would be worse."""


def ground_elements(
    world: World, tiles: list[Tile], options: Options
) -> tuple[list[Lines], list[Lines], dict[str, bytes]]:
    """The ground's tiles, and the blocks that are touched in their place where they must be.

    Returns:
        Assets, geoms, and the contents of the files that they need, by their path.
    """
    wide = wide_rocks(world.field, world.ground.spacing)
    split = options.split_ground and len(wide) > 0
    felt = cells_by_friction(world, material_frictions(world, options))
    kind = "ground_seen" if split or felt else "ground"
    assets: list[Lines] = []
    geoms: list[Lines] = []
    files: dict[str, bytes] = {}
    for number, tile in enumerate(tiles):
        name = f"ground_{number}" if number else "ground"
        field, place = _height_field(tile.ground, name, files)
        picture = f"assets/{name}.png"
        files[picture] = _picture(tile, options.texture_pixels)
        # MuJoCo spans a height field from edge to edge of its texture, which reaches half a cell
        # beyond the outer nodes: its repeat, which counts from the middle, leaves that out.
        rows, columns = tile.ground.shape
        shown = ((columns - 1) / columns, (rows - 1) / rows)
        looks = {"texture": name, "texrepeat": shown, "specular": 0.0, "shininess": 0.0}
        texture = element("texture", name=name, type="2d", file=picture)
        assets += [texture, element("material", name=name, **looks), field]
        own = {"class": kind, "hfield": name, "material": name}
        geoms.append(element("geom", name=name, **own, pos=place))
    blocks = split_ground(world.ground, wide) if split else whole_blocks(world.ground, tiles)
    for name, part, own in _touched(world.ground, blocks, felt) if split or felt else ():
        small = part.elevation.size <= _LARGEST_TEXT
        field, place = _height_field(part, name, None if small else files)
        assets.append(field)
        named = {"name": name, "hfield": name, "pos": place, **own}
        geoms.append(element("geom", class_="ground_block", **named))
    return assets, geoms, files


def _touched(
    ground: Heightfield, blocks: list[Block], felt: dict[float, Cells]
) -> Iterator[tuple[str, Heightfield, dict[str, Value]]]:
    """The height fields that are touched: their names, ground and attributes of their own."""
    for number, block in enumerate(() if felt else blocks):
        yield f"block_{number}", ground.cut(**block._asdict()), {}
    for name, part, friction in fields_by_friction(ground, blocks, felt):
        yield name, part, {"friction": sliding(friction)}


def whole_blocks(ground: Heightfield, tiles: list[Tile]) -> list[Block]:
    """The tiles of the ground as blocks of it."""
    return [
        Block(
            row=round((tile.ground.origin[1] - ground.origin[1]) / ground.spacing),
            column=round((tile.ground.origin[0] - ground.origin[0]) / ground.spacing),
            rows=tile.ground.shape[0] - 1,
            columns=tile.ground.shape[1] - 1,
        )
        for tile in tiles
    ]


def _height_field(
    ground: Heightfield, name: str, files: dict[str, bytes] | None
) -> tuple[Lines, tuple[float, float, float]]:
    """The asset, and the position of its geom [m]; its samples go into the files or its own text.

    MuJoCo takes the samples as vertices, rows from south to north, cuts cells from south-west to
    north-east as our surface is cut, and rescales samples to 0..1: lowest and range go into the
    geom's height and the field's size. Samples in the XML run from north to south.
    """
    west, south, east, north = ground.bounds
    lowest = float(ground.elevation.min())
    extent = float(ground.elevation.max()) - lowest or 1.0
    samples = ((ground.elevation.astype(np.float64) - lowest) / extent).astype("<f4")
    size = ((east - west) / 2, (north - south) / 2, extent, _BASE)
    rows, columns = ground.shape
    shape = {"name": name, "nrow": rows, "ncol": columns, "size": size}
    if files is None:
        asset = element("hfield", elevation=image_rows(samples), **shape)
    else:
        file = f"assets/{name}.bin"
        files[file] = np.array(ground.shape, dtype="<i4").tobytes() + samples.tobytes()
        asset = element("hfield", file=file, **shape)
    return asset, ((west + east) / 2, (south + north) / 2, lowest)


def _picture(tile: Tile, largest: int) -> bytes:
    """The ground's colours; of a field with more nodes than a texture has pixels, every second.

    `largest` are the pixels of the whole ground's picture along its longer side.
    """
    grounds = ((tile.whole.ground, largest), (tile.ground, _LARGEST_TEXTURE))
    finer = min(finest_texture(ground, pixels) for ground, pixels in grounds)
    colours = bake_ground(tile.world, finer=finer).rgb
    step = -(-max(colours.shape[:2]) // _LARGEST_TEXTURE)
    return encode_png(image_rows(colours[::step, ::step]))


def horizon_elements(horizon: Horizon, directory: Path) -> tuple[list[Lines], list[Lines]]:
    """Assets and geoms of what lies beyond the border, which nothing touches; writes its files."""
    surface, picture = horizon_surface(horizon)
    assets = directory / "assets"
    assets.mkdir(exist_ok=True)
    write_horizon_mesh(assets / "horizon.obj", surface)
    (assets / "horizon.png").write_bytes(encode_png(picture))
    looks = {"texture": "horizon", "specular": 0.0, "shininess": 0.0}
    declared = [
        element("texture", name="horizon", type="2d", file="assets/horizon.png"),
        element("material", name="horizon", **looks),
        element("mesh", name="horizon", file="assets/horizon.obj", inertia="shell"),
    ]
    own = {"class": "horizon", "mesh": "horizon", "material": "horizon"}
    return declared, [element("geom", name="horizon", **own)]
