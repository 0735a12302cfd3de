"""What shines in a black sky besides the Sun: the Earth as a disc, and stars as points."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from typing import NamedTuple

import numpy as np

from terrain_forge.base import Array, portable
from terrain_forge.model import Lighting
from terrain_forge.sky.above import SUN_RADIUS
from terrain_forge.sky.orbits import AU, unit

_EARTH_RGB = np.array([0.27, 0.30, 0.38])
"""Albedo of the Earth as a sphere of Lambert's: an assumption, bluish, about its Bond albedo of 0.3
(Goode et al. 2001, doi:10.1029/2000GL012580) in the mean. Land and clouds are not known of."""
_POINT = 1e-3
"""An Earth of a smaller diameter [rad] is a point."""
_SUN_MAGNITUDE, _SUN_COLOUR = -26.76, 0.65
"""Visual magnitude of the Sun from 1 au (Willmer 2018, doi:10.3847/1538-4365/aabfdf), and B - V."""
_BANDS = np.array([0.61, 0.55, 0.465])
"""Wavelengths of red, green and blue [µm]."""
_HEAT = 14_387.77
"""Second radiation constant [µm K]."""


class Disc(NamedTuple):
    """A sphere far away."""

    towards: Array
    """Unit vector to its middle, shape [3]."""
    radius: float
    """Half the angle that it fills [rad]."""
    sun: Array
    """Unit vector from it to the Sun, shape [3]."""
    rgb: Array
    """Radiance where the Sun stands overhead, over that of white that faces the Sun here."""

    def radiance(self, towards: Array, soft: Array | float) -> Array:
        """Radiance in directions, over that of white that faces the Sun, shape [..., 3].

        Its edge is as soft as `soft` [rad], which is to be a pixel.
        """
        off = (towards - self.towards) / self.radius
        away = portable.norm(off)
        flat = off / np.maximum(away, 1.0)[..., None]
        out = flat - np.sqrt(np.maximum(1.0 - portable.norm(flat) ** 2, 0.0))[..., None] * (
            self.towards
        )
        lit = np.maximum((out * self.sun).sum(axis=-1), 0.0)
        covered = np.clip(0.5 + (1.0 - away) * self.radius / soft, 0.0, 1.0)
        return np.asarray((lit * covered)[..., None] * self.rgb)


class Points(NamedTuple):
    """Things too small to be seen as more than a point."""

    towards: Array
    """Unit vectors to them, shape [points, 3]."""
    rgb: Array
    """Their irradiance over the Sun's here, linear red, green, blue, shape [points, 3]."""


def earth_disc(lighting: Lighting) -> Disc | None:
    """The Earth as far as it is more than a point of a black sky."""
    earth = _earth(lighting)
    return earth if earth is not None and 2.0 * earth.radius >= _POINT else None


def sky_points(lighting: Lighting) -> Points:
    """Stars, where the lighting wants them, and the Earth, where it is no more than a point."""
    towards, rgb = np.empty((0, 3)), np.empty((0, 3))
    if lighting.celestial is not None and _is_black(lighting):
        stars, strength = _catalogue()
        towards = portable.product(stars, lighting.celestial.T)
        rgb = strength * lighting.star_gain * _sun_distance(lighting) ** 2
    earth = _earth(lighting)
    if earth is not None and 2.0 * earth.radius < _POINT:
        # A sphere of Lambert's from an angle that is π less that between what it looks at.
        cosine = float(-(earth.towards * earth.sun).sum())
        phase = float(portable.arctan2(np.sqrt(max(0.0, 1.0 - cosine**2)), cosine))
        share = 2.0 / 3.0 * (np.sin(phase) + (np.pi - phase) * cosine) / np.pi
        towards = np.concatenate([towards, earth.towards[None]])
        rgb = np.concatenate([rgb, (share * earth.radius**2 * earth.rgb)[None]])
    return Points(towards, rgb)


def _is_black(lighting: Lighting) -> bool:
    return lighting.dust is None and not max(lighting.sky_rgb) > 0.0


def _earth(lighting: Lighting) -> Disc | None:
    if lighting.earth is None or lighting.earth_sun is None or not _is_black(lighting):
        return None
    towards_sun = np.array(lighting.earth_sun)
    return Disc(
        towards=np.array(lighting.earth),
        radius=0.5 * lighting.earth_diameter,
        sun=unit(towards_sun),
        rgb=_EARTH_RGB / float((towards_sun**2).sum()),
    )


def _sun_distance(lighting: Lighting) -> float:
    """In astronomical units."""
    return 2.0 * SUN_RADIUS / AU / lighting.sun_diameter if lighting.sun_diameter else 1.0


@cache
def _catalogue() -> tuple[Array, Array]:
    """Unit vectors to the stars in the celestial frame of J2000, irradiance over the Sun's at 1 au.

    Colours are those of black bodies of the temperatures that Ballesteros 2012
    (doi:10.1209/0295-5075/97/34008) gives for B - V, over the Sun's.
    """
    text = files("terrain_forge.sky").joinpath("stars.csv").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if line and line[0].isdigit()]
    ra, dec, magnitude, colour = np.array([[float(x) for x in line.split(",")] for line in lines]).T
    ra, dec = np.radians(ra), np.radians(dec)
    towards = np.stack([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)], axis=-1)
    tint = _black_body(colour) / _black_body(np.array([_SUN_COLOUR]))
    tint /= tint[:, 1:2]  # magnitudes are of green light
    power = portable.power(10.0, -0.4 * (magnitude - _SUN_MAGNITUDE))
    return towards, power[:, None] * tint


def _black_body(colour: Array) -> Array:
    """Radiance of black bodies of some B - V, of any scale, shape [bodies, 3]."""
    heat = 4600.0 * (1.0 / (0.92 * colour + 1.7) + 1.0 / (0.92 * colour + 0.62))
    return np.asarray(1.0 / portable.expm1(_HEAT / (_BANDS * heat[:, None])))
