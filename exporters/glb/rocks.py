"""The rocks: large ones as nodes that share meshes, small ones merged per tile and population."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import inlined, kernel, xyzw
from terrain_forge.geometry import (
    coloured_parts,
    grouped,
    lie_upright,
    rock_factors,
    rock_maps,
    rock_texture,
    surface,
)
from terrain_forge.model import CLOSE, Mesh, RockField, Tile, World
from terrain_forge.scene import rock_tints
from terrain_forge.writers import (
    ROCK,
    Gltf,
    encode_texture,
    put_integer,
    put_number,
)

from .ground import matt, tile_corner

_BLOCK = 4096
"""Rocks whose nodes are one text."""
_PIECES = tuple(
    np.frombuffer(piece, np.uint8)
    for piece in (
        f'{{"name":"{ROCK}'.encode(),
        b'","mesh":',
        b',"translation":[',
        b'],"rotation":[',
        b'],"scale":[',
        b"]},",
    )
)
_DECIMALS = 7
"""Of places, turns and sizes: a tenth of a micrometre, finer than the float32 of readers."""
_WIDEST = 400
"""Bytes of a node at most: its words, two numbers of 10 digits and ten of 22 with a comma."""


def rock_meshes(
    world: World, rocks: RockField, gltf: Gltf, levels: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Add the meshes that the rocks share; returns the index of each rock's, shape [rocks].

    A mesh is a level of detail of a shape in the look of a population; those of one shape share
    their arrays. `levels` are the rocks' levels of detail, shape [rocks].
    """
    prototypes = world.library.prototypes
    bumpy = world.library.normals is not None

    @cache
    def shape(kind: int, level: int, upright: int) -> dict[str, Any]:
        return gltf.add_surface(
            surface(prototypes[kind], level, upright=bool(upright)), bumpy=bumpy
        )

    @cache
    def picture(population: int) -> int:
        return gltf.add_texture(
            encode_texture(rock_texture(world, population, tinted=True)), tiles=True
        )

    relief = _add_maps(world, gltf) if len(rocks) else {}

    @cache
    def look(population: int, tint: int) -> int:
        rgb = rock_factors(world, population)[tint].tolist()
        name = f"{world.field.populations[population]}_{tint}"
        made = matt(name, texture=picture(population), rgb=rgb, **relief)
        return gltf.add("materials", made)

    tints = rock_tints(rocks.id, world.site.seed)
    kinds = np.stack(
        [rocks.prototype, levels, rocks.population, tints, lie_upright(rocks)], axis=-1
    )
    distinct, kind_of_rock = np.unique(kinds, axis=0, return_inverse=True)
    meshes = []
    for prototype, level, population, tint, upright in distinct.tolist():
        primitive = {**shape(prototype, level, upright), "material": look(population, tint)}
        detail, dust = "close" if level == CLOSE else level, "" if upright else "_turned"
        kind = f"{prototype:03}_{detail}{dust}"
        name = f"rock_shape_{kind}_{world.field.populations[population]}_{tint}"
        meshes.append(gltf.add("meshes", {"name": name, "primitives": [primitive]}))
    return np.array(meshes, np.int64)[kind_of_rock.reshape(-1)]


def _add_maps(world: World, gltf: Gltf) -> dict[str, Any]:
    """Add the rocks' normals and roughness; returns what `matt` takes of them."""
    maps = rock_maps(world)
    if maps is None:
        return {}
    normals, roughness = maps
    # Green is the roughness, blue whether it is metal.
    rough = np.zeros((*roughness.shape, 3), np.uint8)
    rough[..., 1] = roughness
    return {
        "normals": {"index": gltf.add_texture(encode_texture(normals), tiles=True)},
        "roughness": gltf.add_texture(encode_texture(rough), tiles=True),
    }


def node_texts(rocks: RockField, meshes: NDArray[np.int64]) -> Iterator[str]:
    """The rocks' nodes as JSON, many to a text, with commas between them."""
    text = np.empty(_WIDEST * _BLOCK, np.uint8)
    for first in range(0, len(rocks), _BLOCK):
        some = rocks.select(np.arange(first, min(first + _BLOCK, len(rocks))))
        size = np.repeat(some.scale[:, None], 3, axis=1)
        places = np.hstack([some.position, xyzw(some.quaternion), size])
        used = _put_nodes(text, _PIECES, some.id, meshes[first : first + _BLOCK], places)
        yield text[: used - 1].tobytes().decode("ascii")


def merged_rocks(
    tile: Tile, gltf: Gltf, *, shapes: list[Mesh], materials: list[int]
) -> list[dict[str, Any]]:
    """Add the meshes of one tile's rocks, one or a few per population; returns their nodes.

    The tile's field holds the rocks to be merged alone. A mesh of `shapes` stands for each
    prototype; `materials` are those of the populations.
    """
    corner = tile_corner(tile)
    nodes = []
    for population, rocks in grouped(tile.field):
        parts = coloured_parts(rocks, shapes, tile.whole)
        for number, (vertices, normals, faces, colours) in enumerate(parts):
            part = f"_{number}" if number else ""
            name = f"{tile.name('rocks')}_{rocks.populations[population]}{part}"
            primitive = gltf.add_primitive(vertices - corner, normals, gltf.add_indices(faces))
            primitive["attributes"]["COLOR_0"] = gltf.add_colours(colours)
            primitive["material"] = materials[population]
            mesh = gltf.add("meshes", {"name": name, "primitives": [primitive]})
            nodes.append({"name": name, "mesh": mesh, "translation": corner.tolist()})
    return nodes


@inlined
def _put_piece(text, at, piece):  # type: ignore[no-untyped-def]
    for place in range(len(piece)):
        text[at + place] = piece[place]
    return at + len(piece)


@kernel
def _put_nodes(text, pieces, ids, meshes, places):  # type: ignore[no-untyped-def]
    unit = 10**_DECIMALS
    at = 0
    for rock in range(len(ids)):
        at = _put_piece(text, at, pieces[0])
        at = put_integer(text, at, np.int64(ids[rock]))
        at = _put_piece(text, at, pieces[1])
        at = put_integer(text, at, meshes[rock])
        first = 0
        for piece, count in ((pieces[2], 3), (pieces[3], 4), (pieces[4], 3)):
            at = _put_piece(text, at, piece)
            for number in range(first, first + count):
                at = put_number(text, at, places[rock, number], _DECIMALS, unit)
                text[at] = 44
                at += 1
            at -= 1
            first += count
        at = _put_piece(text, at, pieces[5])
    return at
