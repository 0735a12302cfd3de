"""The ground as height fields: exact, since their binary files hold 32-bit floats."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

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
from .materials import sliding
from .options import Options

_BASE = 1.0
"""Thickness of the ground below its lowest node [m]."""
_LARGEST_TEXTURE = 4096
"""Pixels that every OpenGL driver takes."""
_SUNK = 0.005
"""How far a height field sinks below the ground where another has its friction [m]: more than
wheels press in, and so little that its slope there catches nothing."""
_ROUNDS = 50
"""Times that cells are given to their neighbours, at most."""
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
    felt = _separable(cells_by_friction(world, material_frictions(world, options)))
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
    for number, block in enumerate(blocks if split or felt else ()):
        name = f"block_{number}"
        part = world.ground.cut(**block._asdict())
        for own_name, own_part, own in _by_friction(part, block, name, felt):
            small = own_part.elevation.size <= _LARGEST_TEXT
            field, place = _height_field(own_part, own_name, None if small else files)
            assets.append(field)
            named = {"name": own_name, "hfield": own_name, "pos": place, **own}
            geoms.append(element("geom", class_="ground_block", **named))
    return assets, geoms, files


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


def _corners(cells: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The nodes at the corners of some cells."""
    nodes = np.zeros(tuple(count + 1 for count in cells.shape), np.bool_)
    for j, i in product((0, 1), (0, 1)):
        nodes[j : j + cells.shape[0], i : i + cells.shape[1]] |= cells
    return nodes


def _separable(felt: dict[float, NDArray[np.bool_]]) -> dict[float, NDArray[np.bool_]]:
    """The cells of each friction, so that each field can sink below the others' cells.

    It cannot where all corners of a triangle are those of its own cells: such a cell, alone or in a
    strip one cell wide, takes its neighbours' friction.
    """
    felt = {friction: cells.copy() for friction, cells in felt.items()}
    for _ in range(_ROUNDS):
        changed = False
        for friction, cells in felt.items():
            kept = _corners(cells)
            both = kept[:-1, :-1] & kept[1:, 1:]  # the ends of the cut
            taken = both & (kept[:-1, 1:] | kept[1:, :-1]) & ~cells
            if taken.any():
                changed = True
                for other, theirs in felt.items():
                    theirs[taken] = other == friction
        if not changed:
            break
    return felt


def _by_friction(
    part: Heightfield, block: Block, name: str, felt: dict[float, NDArray[np.bool_]]
) -> Iterator[tuple[str, Heightfield, dict[str, Value]]]:
    """A block's ground once for each friction: what is highest has the friction of its cell.

    A height field has one friction. Each of these is as high as the ground where cells of its
    friction are, and beside them a little lower.
    """
    if not felt:
        yield name, part, {}
        return
    rows = slice(block.row, block.row + block.rows)
    columns = slice(block.column, block.column + block.columns)
    for number, (friction, everywhere) in enumerate(felt.items()):
        cells = everywhere[rows, columns]
        if not cells.any():
            continue
        (south, *_, north), (west, *_, east) = (
            np.flatnonzero(cells.any(axis=axis))[[0, -1]] for axis in (1, 0)
        )
        low_row, low_column = max(south - 1, 0), max(west - 1, 0)
        high_row, high_column = min(north + 2, cells.shape[0]), min(east + 2, cells.shape[1])
        near = cells[low_row:high_row, low_column:high_column]
        cut = part.cut(
            column=low_column,
            row=low_row,
            columns=high_column - low_column,
            rows=high_row - low_row,
        )
        kept = _corners(near)
        deep = cut.elevation - np.float32(_SUNK)
        sunk = cut.replace(elevation=np.where(kept, cut.elevation, deep))
        yield f"{name}_{number}", sunk, {"friction": sliding(friction)}


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
