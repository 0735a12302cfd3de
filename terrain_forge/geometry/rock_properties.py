"""What rocks are besides their shape: rigid bodies that can be pushed, and how they look."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, image_rows, linear_from_srgb, portable, srgb_from_linear
from terrain_forge.model import RockField, RockLibrary, World


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


def rock_texture(world: World, population: int) -> NDArray[np.uint8]:
    """The sRGB image that tiles over a population's rocks, first row on top.

    Returns:
        Pixels, shape [rows, columns, 3]; texture coordinates of 1 are the image's width and height.
    """
    # 256 brightnesses at most: colours are looked up, not computed for each pixel.
    shades = np.arange(256)[:, None] / 255.0 * _linear(world, population)
    table = np.rint(255.0 * srgb_from_linear(np.minimum(shades, 1.0))).astype(np.uint8)
    pixels: NDArray[np.uint8] = table[image_rows(world.library.texture)]
    return pixels


def mean_rock_colour(world: World, population: int) -> Array:
    """The texture's mean as linear colour, 0 to 1, shape [3]: for rocks that show no texture."""
    return linear_from_srgb(world.appearance.rock_rgb[population] / 255.0)


def mean_rock_srgb(world: World, population: int) -> list[float]:
    """`mean_rock_colour` as sRGB, 0 to 1."""
    colour: list[float] = srgb_from_linear(mean_rock_colour(world, population)).tolist()
    return colour


def _linear(world: World, population: int) -> Array:
    """What the texture's brightness multiplies, so that its mean is the population's colour."""
    colour = linear_from_srgb(world.appearance.rock_rgb[population] / 255.0)
    return np.asarray(colour * (255.0 / world.library.texture.mean()))
