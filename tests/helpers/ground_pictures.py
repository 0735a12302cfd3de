"""Grounds whose pictures tell where they lie, for tests of the textures that were exported."""

from __future__ import annotations

import numpy as np

from terrain_forge.model import GroundDetail

FINER = 4
"""Pixels per node of `PIXELS` along the 97 nodes of the small world."""
PIXELS = 97 * FINER + 3


def speckled(world):
    """The world with nodes that are red, green or blue at random, which soil only makes darker."""
    rows, columns = world.ground.shape
    hues = np.random.default_rng(8).integers(0, 3, (rows, columns))
    colours = np.full((rows, columns, 3), 20, np.uint8)
    np.put_along_axis(colours, hues[..., None], 180, axis=-1)
    return world.replace(appearance=world.appearance.replace(ground_rgb=colours))


def shows_its_nodes(pixels, u, v, world, places):
    """Whether an image, its first row on top, shows the hues of the nodes at these places.

    Args:
        pixels: The image, shape [rows, columns, 3].
        u: Texture coordinate to the east of each place.
        v: Texture coordinate to the north.
        world: The speckled world.
        places: East and north of each place [m], shape [places, 2 or more].
    """
    row, column = (1 - v) * len(pixels), u * pixels.shape[1]
    shown = pixels[row.astype(int), column.astype(int)]
    i, j = nodes(world, places)
    wanted = world.appearance.ground_rgb[j, i].argmax(axis=-1)
    return np.array_equal(shown.argmax(axis=-1), wanted)


def nodes(world, places):
    """Columns and rows of the nodes at these places [m]."""
    ground = world.ground
    return np.rint((places[:, :2] - ground.origin) / ground.spacing).astype(int).T


def detailed(world):
    """The world with a detail tile of 1.31 m and 8² pixels, no two of them alike."""
    normals = np.random.default_rng(9).integers(100, 156, (8, 8, 3)).astype(np.uint8)
    normals[..., 2] = 255
    detail = GroundDetail(size=1.31, brightness=np.full((8, 8), 128), normals=normals)
    return world.replace(appearance=world.appearance.replace(detail=detail))


def shows_its_detail(pixels, s, t, world, places):
    """Whether an image that repeats, its first row on top, shows the detail tile where it belongs.

    Args:
        pixels: The image, shape [8, 8, 3].
        s: Its coordinate to the east of each place, however many times around.
        t: Its coordinate to the north.
        world: The detailed world.
        places: East and north of each place [m], shape [places, 2 or more].
    """
    row, column = (1 - t % 1) * len(pixels), s % 1 * pixels.shape[1]
    detail = world.appearance.detail
    i, j = ((places[:, :2] / detail.size % 1) * 8).astype(int).T
    clear = np.abs(np.stack([row, column]) % 1 - 0.5).max(axis=0) < 0.499  # not between pixels
    shown = pixels[row.astype(int) % 8, column.astype(int) % 8]
    return clear.mean() > 0.9 and np.array_equal(shown[clear], detail.normals[j, i][clear])
