"""How rocks look: their texture with dust on top, its maps, and the colours of those without.

Materials of most formats multiply no colour of a vertex into a texture, so the dust is in it: the
tile that all rocks share lies in it four times side by side, bare and under more and more dust, and
each face shows the one that its rise asks for.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, image_rows, srgb_from_linear
from terrain_forge.model import Mesh, RockField, RockPrototype, World, rotations
from terrain_forge.scene import (
    DUST_VALUE,
    SOILED,
    dust_share,
    dusty_tints,
    soil_colour,
    tint_colours,
)
from terrain_forge.writers import vertex_normals

_UPRIGHT = 0.8
"""Cosine of a rock's lean up to which its shape's top is its own."""
_RISES = 512
"""Steps from level to upright in which vertices' dust is known."""
_STEPS = (0.35, 0.55, 0.75)
"""Rises of faces' normals from which they show the next tile."""
_DUSTY = (0.45, 0.65, 0.9)
"""Rises by which the tiles after the bare one have their dust."""
_MARGIN = 0.375
"""How far the tile goes on to both sides of each copy: rocks are up to 1.7 mean axes long."""
_PITCH = 1.0 + 2.0 * _MARGIN


def lie_upright(rocks: RockField) -> NDArray[np.bool_]:
    """Which rocks lie as their shape does, so that dust is on its top; others have none."""
    return np.asarray(rotations(rocks)[:, 2, 2] > _UPRIGHT)


def skin(shape: RockPrototype, level: int = 0, *, upright: bool = True) -> tuple[Mesh, Array]:
    """A level of detail, or with `CLOSE` the close mesh, and where `rock_texture` lies on it.

    Args:
        shape: The shape.
        level: The level of detail.
        upright: Whether dust lies on its top; if not it is bare.

    Returns:
        The mesh in the prototype's frame, and texture coordinates of its faces' corners, shape
        [faces, 3, 2].
    """
    mesh, uvs = shape.drawn(level)
    u = uvs[..., 0]
    beside = np.any((u < -_MARGIN) | (u > 1.0 + _MARGIN), axis=1, keepdims=True)
    u = np.where(beside, u - np.floor(u.mean(axis=1, keepdims=True)), u)
    copy = np.zeros(len(u))
    if upright:
        rises = vertex_normals(mesh.vertices, mesh.faces)[mesh.faces, 2].mean(axis=1)
        copy = np.searchsorted(_STEPS, rises, side="right")
    across = copy[:, None] * _PITCH + _MARGIN + np.clip(u, -_MARGIN, 1.0 + _MARGIN)
    return mesh, np.stack([across / (_PITCH * (1 + len(_STEPS))), uvs[..., 1]], axis=-1)


def rock_texture(world: World, population: int, *, tinted: bool = False) -> NDArray[np.uint8]:
    """The sRGB image of a population's rocks, which lies on them as `skin` says, first row on top.

    The mean of its bare part is that of the population's colours; `tinted`, for formats whose
    materials multiply it by `rock_factors`, it is the lightest of them in each channel.

    Returns:
        Pixels, shape [rows, columns, 3]; texture coordinates of 1 are the image's width and height.
    """
    # 256 brightnesses at most: colours are looked up, not computed for each pixel.
    colours = tint_colours(world)[population]
    colour = colours.max(axis=0) if tinted else colours.mean(axis=0)
    soil = soil_colour(world) * colour / np.maximum(colours.mean(axis=0), 1e-3)
    bright = np.arange(256) / world.library.texture.mean()
    bare, soiled = bright[:, None] * colour, (1.0 + SOILED * (bright[:, None] - 1.0)) * soil
    copies = [bare]
    for rise in _DUSTY:  # dust keeps to what is bright as to what rises
        share = dust_share(world, rise + DUST_VALUE * (bright - 1.0))[:, None]
        copies.append(bare + share * (soiled - bare))
    lights = np.clip(np.stack(copies), 0.0, 1.0)
    table = np.rint(255.0 * srgb_from_linear(lights)).astype(np.uint8)
    tile = _beside(image_rows(world.library.texture))
    return np.concatenate([own[tile] for own in table], axis=1)


def rock_maps(world: World) -> tuple[NDArray[np.uint8], NDArray[np.uint8]] | None:
    """Images of the rocks' normals and of their roughness, which lie on them as `rock_texture`.

    Returns:
        The normals, -1 to 1 as 0 to 255, shape [rows, columns, 3], and the roughness, 0 to 255,
        shape [rows, columns], first rows on top; None where the library has none.
    """
    normals, roughness = world.library.normals, world.library.roughness
    if normals is None or roughness is None:
        return None
    count = 1 + len(_STEPS)
    across, rough = (_beside(image_rows(image)) for image in (normals, roughness))
    return np.tile(across, (1, count, 1)), np.tile(rough, (1, count))


def _beside(tile: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A tile that goes on to both sides."""
    columns = tile.shape[1]
    first = round(_MARGIN * columns)
    return np.asarray(tile[:, np.arange(-first, round(_PITCH * columns) - first) % columns])


def rock_factors(world: World, population: int) -> Array:
    """What the texture's linear light is multiplied by for each tint, 0 to 1, shape [TINTS, 3]."""
    colours = tint_colours(world)[population]
    return np.asarray(colours / np.maximum(colours.max(axis=0), 1e-9))


def vertex_colours(
    world: World, population: int, tints: NDArray[np.int64], up: Array
) -> NDArray[np.uint8]:
    """Linear colours of rocks' vertices under the dust that lies on them, shape [vertices, 4].

    They are opaque, and multiply `lightest_rock_colour`. Dust lies as our own pictures have it.

    Args:
        world: The world.
        population: Whose rocks.
        tints: Which of its colours the rock of each vertex has, shape [vertices].
        up: How far the vertices' normals rise, -1 to 1, shape [vertices].
    """
    rises = np.linspace(-1.0, 1.0, 2 * _RISES + 1)  # looked up, not computed for each vertex
    lightest = np.maximum(lightest_rock_colour(world, population), 1e-9)
    shares = dusty_tints(world, population, rises) / lightest
    table = np.ones((*shares.shape[:2], 4))
    table[..., :3] = shares
    rounded = np.clip(np.rint(_RISES * up), -_RISES, _RISES).astype(np.intp)
    bytes_ = np.rint(255.0 * np.minimum(table, 1.0)).astype(np.uint8)
    return np.asarray(bytes_[tints, rounded + _RISES])


def lightest_rock_colour(world: World, population: int) -> Array:
    """The lightest that a population's rocks are in each channel, linear, 0 to 1, shape [3]."""
    bare_and_dusty = dusty_tints(world, population, np.array([-1.0, 1.0]))
    return np.asarray(np.minimum(bare_and_dusty.max(axis=(0, 1)), 1.0))


def mean_rock_srgb(world: World, population: int) -> list[float]:
    """Mean colour of a population's rocks, sRGB, 0 to 1: for those of a single one."""
    colour: list[float] = srgb_from_linear(tint_colours(world)[population].mean(axis=0)).tolist()
    return colour
