"""What rocks are besides their shape: rigid bodies that can be pushed, and how they look."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, image_rows, portable, srgb_from_linear
from terrain_forge.model import RockField, RockLibrary, World
from terrain_forge.scene import dusty_factors, tint_colours

_RISES = 512
"""Steps from level to upright in which vertices' dust is known."""


def inertias(field: RockField, library: RockLibrary) -> Array:
    """Inertia tensors about the centres of mass in the rocks' own axes [kg m²], [rocks, 3, 3].

    A prototype's tensor is for 1 kg/m³ and grows with the fifth power of size.
    """
    of_shape = np.array([prototype.inertia for prototype in library.prototypes])
    density = field.mass / field.volume
    return of_shape[field.prototype] * (density * portable.power(field.scale, 5.0))[:, None, None]


def principal_axes(inertia: Array) -> tuple[Array, Array]:
    """Principal moments and axes of inertia tensors, shape [n, 3, 3].

    Returns:
        Moments in ascending order, shape [n, 3], and quaternions (w, x, y, z) from the principal
        axes to those of the tensors, shape [n, 4].
    """
    from scipy.spatial.transform import Rotation

    moments, axes = np.linalg.eigh(inertia)
    axes[..., 2] *= np.linalg.det(axes)[..., None]  # eigenvectors may come as a mirrored frame
    return moments, np.roll(Rotation.from_matrix(axes).as_quat(), 1, axis=-1)


def rock_texture(
    world: World, population: int, *, tinted: bool = False, dusty: bool = False
) -> NDArray[np.uint8]:
    """The sRGB image that tiles over a population's rocks, first row on top.

    Its mean is that of the population's colours; `tinted`, for formats whose materials multiply it
    by `rock_factors`, it is the lightest of them in each channel; `dusty`, for those whose vertices
    multiply it by `vertex_dust`, it has all of the dust.

    Returns:
        Pixels, shape [rows, columns, 3]; texture coordinates of 1 are the image's width and height.
    """
    # 256 brightnesses at most: colours are looked up, not computed for each pixel.
    colours = tint_colours(world)[population]
    colour = colours.max(axis=0) if tinted else colours.mean(axis=0)
    if dusty:
        colour = colour * _lightest(world, population)
    shades = np.arange(256)[:, None] / world.library.texture.mean() * colour
    table = np.rint(255.0 * srgb_from_linear(np.minimum(shades, 1.0))).astype(np.uint8)
    pixels: NDArray[np.uint8] = table[image_rows(world.library.texture)]
    return pixels


def rock_factors(world: World, population: int) -> Array:
    """What the texture's linear light is multiplied by for each tint, 0 to 1, shape [TINTS, 3]."""
    colours = tint_colours(world)[population]
    return np.asarray(colours / np.maximum(colours.max(axis=0), 1e-9))


def vertex_dust(world: World, population: int, up: Array) -> NDArray[np.uint8]:
    """Linear colours of vertices by the dust that lies on them, opaque, shape [vertices, 4].

    They multiply a colour that has all of the dust. Dust lies as our own pictures have it.

    Args:
        world: The world.
        population: Whose rocks.
        up: How far the vertices' normals rise, -1 to 1, shape [vertices]; -1 where no dust lies.
    """
    rises = np.linspace(-1.0, 1.0, 2 * _RISES + 1)  # looked up, not computed for each vertex
    share = dusty_factors(world, population, rises) / _lightest(world, population)
    opaque = np.ones((len(rises), 1))
    table = np.rint(255.0 * np.minimum(np.hstack([share, opaque]), 1.0)).astype(np.uint8)
    rounded = np.clip(np.rint(_RISES * up), -_RISES, _RISES).astype(np.intp)
    return np.asarray(table[rounded + _RISES])


def _lightest(world: World, population: int) -> Array:
    """The largest that dust can make of a population's colours, at least 1, shape [3]."""
    return np.asarray(np.maximum(dusty_factors(world, population, np.ones(1))[0], 1.0))


def rock_maps(world: World) -> tuple[NDArray[np.uint8], NDArray[np.uint8]] | None:
    """Images of the rocks' normals and of their roughness, which lie on them as `rock_texture`.

    Returns:
        The normals, -1 to 1 as 0 to 255, shape [rows, columns, 3], and the roughness, 0 to 255,
        shape [rows, columns], first rows on top; None where the library has none.
    """
    normals, roughness = world.library.normals, world.library.roughness
    if normals is None or roughness is None:
        return None
    return image_rows(normals), image_rows(roughness)


def mean_rock_colour(world: World, population: int, *, dusty: bool = False) -> Array:
    """Mean linear colour of a population's rocks, 0 to 1, shape [3]: for those without texture.

    With all of the dust where it is `dusty`, as `rock_texture`.
    """
    mean = tint_colours(world)[population].mean(axis=0)
    return np.asarray(np.minimum(mean * _lightest(world, population), 1.0) if dusty else mean)


def mean_rock_srgb(world: World, population: int) -> list[float]:
    """`mean_rock_colour` as sRGB, 0 to 1."""
    colour: list[float] = srgb_from_linear(mean_rock_colour(world, population)).tolist()
    return colour
