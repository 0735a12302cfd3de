"""Light: the Sun and the sky, and what dusty ground makes of them.

Reflectance is the lunar-Lambert law (McEwen 1991, doi:10.1016/0019-1035(91)90228-U) with an
opposition surge.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import inner
from terrain_forge.scene.grain import soil
from terrain_forge.scene.surface import BENT_X, BENT_Y, BENT_Z, RANGE, RED, SHADE, disc_place

Triple = tuple[float, float, float]


class Light(NamedTuple):
    """What shines, already scaled to the picture's exposure."""

    towards_sun: Triple
    """Unit vector to the Sun's middle."""
    upwards: Triple
    """From the Sun's middle to its upper limb, over its distance."""
    sideways: Triple
    """From the Sun's middle to its limb beside, over its distance."""
    sun: Triple
    """Radiance of a white surface that faces the Sun, linear RGB."""
    sky: Triple
    """Radiance of a white surface under the whole sky, linear RGB."""
    bounce: Triple
    """Radiance of a white surface that sees only ground, linear RGB."""
    dome: NDArray[np.float64]
    """The sky's radiance: by the sine of the elevation, (k / (n - 1))², times by the chord to the
    Sun, 2 (k / (n - 1))², linear RGB, shape [2, n, 3]."""
    even: Triple
    """What is added to it all over the sky, linear RGB."""
    through: float
    """What of the Sun's light on level ground gets through the air, directly or as the sky's."""
    plain: Triple
    """Ground beyond the world's edge, linear RGB."""
    haze: float
    """Distance after which 1/e of the contrast is left [m]; infinite without air."""
    airy: bool
    """Whether there is a sky that shines."""
    lunar: float
    """Part of the Lommel-Seeliger term, 0 (Lambert) to 1."""


_ROUGH = 0.05
"""Cosine over which grains that a pixel cannot show soften the edge of night on them."""


@inner
def towards_sun(light, key, column, row, sample):  # type: ignore[no-untyped-def]
    """Direction to a place on the Sun's disc; 0 and 3 of four samples look above 1 and 2.

    Edges of shadows are as soft as the Sun is wide; under a low Sun that hides the grid's cells.
    """
    middle, up, side = light.towards_sun, light.upwards, light.sideways
    a, b = disc_place(key, column, row, sample, np.int64(8))
    return (
        middle[0] + a * up[0] + b * side[0],
        middle[1] + a * up[1] + b * side[1],
        middle[2] + a * up[2] + b * side[2],
    )


@inner
def _reflect(point, towards, light):  # type: ignore[no-untyped-def]
    """Lunar-Lambert reflectance of a point over its albedo, times the cosine of incidence."""
    sun = light.towards_sun
    mu0 = point[BENT_X] * sun[0] + point[BENT_Y] * sun[1] + point[BENT_Z] * sun[2]
    mu0 = 0.5 * (mu0 + np.sqrt(mu0 * mu0 + _ROUGH * _ROUGH))
    mu = -(point[BENT_X] * towards[0] + point[BENT_Y] * towards[1] + point[BENT_Z] * towards[2])
    mu = max(mu, 0.1)
    phase = -(sun[0] * towards[0] + sun[1] * towards[1] + sun[2] * towards[2])
    half = np.sqrt(max(0.0, 1.0 - phase) / (1.0 + phase + 1e-6))
    surge = 1.0 + 0.5 / (1.0 + half / 0.08)
    return surge * (light.lunar * 2.0 * mu0 / (mu0 + mu) + (1.0 - light.lunar) * mu0)


@inner
def _sky_place(light, towards):  # type: ignore[no-untyped-def]
    """Entries of the sky's two tables before a direction, and the parts of the way to the next."""
    sun, last = light.towards_sun, light.dome.shape[1] - 1
    x, y, z = towards[0] - sun[0], towards[1] - sun[1], towards[2] - sun[2]
    up = last * np.sqrt(min(max(towards[2], 0.0), 1.0))
    off = last * np.sqrt(min(0.5 * np.sqrt(x * x + y * y + z * z), 1.0))
    i, j = min(max(int(up), 0), last - 1), min(max(int(off), 0), last - 1)
    return i, up - i, j, off - j


@inner
def _sky(light, i, u, j, v, channel):  # type: ignore[no-untyped-def]
    """Radiance of the sky at a place of its tables."""
    dome = light.dome
    across = dome[0, i, channel] + u * (dome[0, i + 1, channel] - dome[0, i, channel])
    around = dome[1, j, channel] + v * (dome[1, j + 1, channel] - dome[1, j, channel])
    return across * around + light.even[channel]


@inner
def add_surface(pixel, point, lit, open_sky, towards, light, far):  # type: ignore[no-untyped-def]
    """Add a sample's light, faded by the air, to its pixel."""
    direct = (1.0 - 0.7 * point[SHADE]) * _reflect(point, towards, light) if lit else 0.0
    clear = np.exp(-point[RANGE] / light.haze) if far else 1.0
    i, u, j, v = _sky_place(light, towards) if clear < 1.0 else (0, 0.0, 0, 0.0)
    for channel in range(3):
        ambient = light.sky[channel] if open_sky else light.bounce[channel]
        shone = point[RED + channel] * (direct * light.sun[channel] + ambient)
        fade = _sky(light, i, u, j, v, channel) if clear < 1.0 else 0.0
        pixel[channel] += shone * clear + fade * (1.0 - clear)


@inner
def add_sky(pixel, start, towards, step, land, light):  # type: ignore[no-untyped-def]
    """Add what a ray sees that leaves the world: sky, or the plain beyond the edge."""
    i, u, j, v = _sky_place(light, towards)
    if towards[2] >= 0.0:
        for channel in range(3):
            pixel[channel] += _sky(light, i, u, j, v, channel)
        return
    distance = max(start[2] - land.edge, 0.5) / -towards[2]
    east = start[0] + distance * towards[0] + land.shift[0]
    north = start[1] + distance * towards[1] + land.shift[1]
    footprint = distance * step / np.sqrt(max(-towards[2], 0.002))
    tint = 1.0 + 0.35 * soil(land.key, east, north, 80.0, footprint)[0]
    clear = np.exp(-distance / light.haze)
    for channel in range(3):
        shone = light.plain[channel] * tint
        pixel[channel] += shone * clear + _sky(light, i, u, j, v, channel) * (1.0 - clear)
