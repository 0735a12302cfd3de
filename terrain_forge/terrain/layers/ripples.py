"""Ripples and transverse ridges of the wind: crests across it that wander, fork and end.

The crests are the phase of a complex field G = E exp(2πi s / λ), s the way downwind, which a
profile turns into heights (phasor noise: Tricard et al. 2019, doi:10.1145/3306346.3322990). E is 1
plus complex noise: where E is 0 a crest ends or two join, and the more noise, the more of these
defects. Around them the heights fade, since the phase has no value there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from annotated_types import Interval

from terrain_forge.base import (
    Array,
    FileName,
    Fraction,
    Positive,
    RecipeError,
    inner,
    kernel,
    mix,
    over_chunks,
    portable,
    stage_key,
    uniform,
)
from terrain_forge.model import Site, Window
from terrain_forge.terrain.layer import Layer
from terrain_forge.terrain.masks import fade, steepness, stencil_cells
from terrain_forge.terrain.noise import gradient_noise

REPOSE_DEG = 34.0
"""Slope at which loose sand begins to slide [degrees]."""
INDEX = 15.0
"""Wavelength over height where no height is given; ripples have 10 to 20."""
FEWEST_NODES = 4.0
"""Spacings that a wavelength must be long."""

_ALONG_WIND, _ALONG_CREST = 3.5, 6.0  # lattice of the noise, in wavelengths
_UNIT = 3.2  # makes the standard deviation of each part of the complex noise 1 / √2
_WANDER = 1.6  # wavelengths that the crests are pushed by noise of 1 at a sinuosity of 1
_FADE = 0.45  # |E| below which heights fade
_STEP = 1 / 6  # wavelengths between the samples of what varies slowly, between which it is linear
_TURN_COS, _TURN_SIN = 0.4472135954999579, 0.8944271909999159  # by atan 2


@dataclass(frozen=True, kw_only=True)
class Ripples(Layer):
    """Bedforms of the wind, crests across it: ripples, large ripples, transverse ridges.

    They keep the mean height of the ground, wander, fork and end, and are lower on steep ground and
    where the recipe's rocks are expected to cover it. Large ripples of Mars have wavelengths of 1
    to 5 m and heights from 0.1 m (Lapôtre et al. 2016, doi:10.1126/science.aaf3206); transverse
    ridges some 20 to 60 m at heights of 1 to 6 m, their flanks alike (`stoss: 0.5`).
    """

    kind: Literal["ripples"] = "ripples"
    name: FileName = "ripples"
    """Name, unique among the named layers; it addresses their randomness."""
    wind_from_deg: Annotated[float, Interval(ge=-360, le=360)] = 270.0
    """Compass direction that the wind comes from, clockwise from north [degrees]."""
    wavelength_m: Annotated[float, Interval(gt=0, le=1e4)]
    """Mean distance of the crests [m], 4 spacings at least."""
    height_m: Positive | None = None
    """Height from trough to crest on level bare ground [m]; without it the 15th part of the
    wavelength. The lee side must not be steeper than sand rests at, 34°."""
    stoss: Annotated[float, Interval(ge=0.5, le=0.9)] = 0.65
    """Part of a wavelength that rises downwind; 0.5 is symmetrical."""
    sharpness: Fraction = 0.3
    """0 for round crests, 1 for sharp ones between broad troughs."""
    sinuosity: Fraction = 0.4
    """How much the crests bend."""
    defects: Fraction = 0.4
    """How often crests fork and end; 0 for never."""
    slope_deg: tuple[
        Annotated[float, Interval(ge=0, le=89)], Annotated[float, Interval(ge=0, le=89)]
    ] = (10.0, 20.0)
    """Slope of the ground up to which the height is full, and from which there are none [degrees];
    it is measured over a wavelength."""
    rock_cover: tuple[Fraction, Fraction] | None = (0.05, 0.25)
    """Part of the ground covered by scattered rocks up to which the height is full, and from which
    there are none; null lets rocks not matter."""

    def __post_init__(self) -> None:
        for name in ("slope_deg", "rock_cover"):
            pair = getattr(self, name)
            if pair is not None and pair[0] > pair[1]:
                raise ValueError(f"{name} {list(pair)}: the lower value first")

    @property
    def height(self) -> float:
        """Height from trough to crest on level bare ground [m]."""
        return self.height_m or self.wavelength_m / INDEX

    def check(self, *, site: Site, key: tuple[str | int, ...]) -> None:
        """Refuse bedforms that the grid cannot show or sand cannot form."""
        if self.wavelength_m < FEWEST_NODES * site.spacing:
            raise RecipeError(
                f"{self.wavelength_m:g} m at a spacing of {site.spacing:g} m, at least "
                f"{FEWEST_NODES:g} spacings, {FEWEST_NODES * site.spacing:g} m",
                key=(*key, "wavelength_m"),
            )
        ratio = self.height / self.wavelength_m
        lee = steepest_lee(ratio=ratio, stoss=self.stoss, sharpness=self.sharpness)
        if np.degrees(lee) > REPOSE_DEG:
            most = self.height * portable.tan(np.radians(REPOSE_DEG)) / portable.tan(lee)
            raise RecipeError(
                f"a height of {self.height:g} m makes lee sides of {np.degrees(lee):.0f}°, sand "
                f"rests at up to {REPOSE_DEG:g}°: at most {most:.3g} m, or a smaller stoss",
                key=(*key, "height_m"),
            )

    def reach(self, site: Site) -> float:
        """Half a wavelength: the ground's slope is measured over one."""
        return stencil_cells(self.wavelength_m, site.spacing) * site.spacing

    def relief(self, *, site: Site, window: Window, elevation: Array) -> Array:
        """Crests and troughs about the ground so far."""
        rise = steepness(elevation, stencil_cells(self.wavelength_m, site.spacing), site.spacing)
        full, none = (float(portable.tan(np.radians(angle))) for angle in self.slope_deg)
        factor = fade(rise, full, none)  # less on steep and on rocky ground
        if self.rock_cover is not None:
            cover = site.recipe.rocks.expected_cover(site, window)
            factor = factor * fade(cover, *self.rock_cover)
        height = self.height * factor
        key = stage_key(site.seed, f"terrain/{self.name}")
        return self.bedforms(key, *site.axes(window), spacing=site.spacing, height=height)

    def bedforms(
        self, key: np.uint64, east: Array, north: Array, *, spacing: float, height: Array
    ) -> Array:
        """Heights about a mean of zero at the nodes of a grid [m], shape [north, east].

        They reach `height` from trough to crest, which is 0 where there are none. `spacing` is the
        same to the bit in every window.
        """
        towards = np.radians(self.wind_from_deg + 180.0)
        pattern = key, (float(np.sin(towards)), float(np.cos(towards))), self.wavelength_m
        step = max(_STEP * self.wavelength_m, spacing)
        # Samples lie at whole steps from the site's origin, so that windows share them.
        corner = int(np.floor(east[0] / step)), int(np.floor(north[0] / step))
        columns = int(np.floor(east[-1] / step)) + 2 - corner[0]
        rows = int(np.floor(north[-1] / step)) + 2 - corner[1]
        slow = np.empty((rows, columns, 3))
        vary, shape = (self.sinuosity, self.defects), (self.stoss, self.sharpness)
        over_chunks(_vary, rows, *pattern, vary, corner, step, slow)
        heights = np.zeros((len(north), len(east)))
        grid = slow, corner, step, east, north, np.ascontiguousarray(height), heights
        over_chunks(_raise, len(north), *pattern, shape, *grid)
        return heights


def steepest_lee(*, ratio: float, stoss: float, sharpness: float) -> float:
    """Slope of the steepest part of the lee side [rad]; `ratio` is height over wavelength."""
    away = np.linspace(0.0, np.pi, 181)
    fall = (1.0 - sharpness) * np.sin(away) + sharpness * np.cos(0.5 * away)
    return float(portable.arctan(0.5 * np.pi * fall.max() * ratio / (1.0 - stoss)))


@inner
def _profile(part, stoss, sharpness):  # type: ignore[no-untyped-def]
    """Height about its mean: half a cosine, mixed with a cusp of 1 - sine."""
    away = (stoss - part) / stoss if part < stoss else (part - stoss) / (1.0 - stoss)
    smooth, cusp = 0.5 * np.cos(np.pi * away), 2.0 / np.pi - np.sin(0.5 * np.pi * away)
    return smooth + sharpness * (cusp - smooth)


@inner
def _noise(key, x, y):  # type: ignore[no-untyped-def]
    """Two octaves; their lattices are turned and shifted against each other."""
    x, y = x + 512.0 * uniform(mix(key, 1)), y + 512.0 * uniform(mix(key, 2))
    u, v = 2.0 * (_TURN_COS * x - _TURN_SIN * y), 2.0 * (_TURN_SIN * x + _TURN_COS * y)
    return gradient_noise(key, x, y) + 0.5 * gradient_noise(mix(key, 3), u, v)


@kernel
def _vary(first, last, key, wind, wavelength, vary, corner, step, slow):  # type: ignore[no-untyped-def]
    """Both parts of E and the push of the crests [wavelengths] at samples."""
    sinuosity, defects = vary
    keys = mix(key, 10), mix(key, 11), mix(key, 12)
    for row in range(first, last):
        north = (corner[1] + row) * step / wavelength
        for column in range(slow.shape[1]):
            east = (corner[0] + column) * step / wavelength
            x = (wind[0] * east + wind[1] * north) / _ALONG_WIND
            y = (wind[0] * north - wind[1] * east) / _ALONG_CREST
            slow[row, column, 0] = 1.0 - defects + defects * _UNIT * _noise(keys[0], x, y)
            slow[row, column, 1] = defects * _UNIT * _noise(keys[1], x, y)
            # Bends are longer than the spaces between defects.
            slow[row, column, 2] = sinuosity * _WANDER * _noise(keys[2], 0.6 * x, 0.8 * y)


@inner
def _between(slow, i, j, u, v, channel):  # type: ignore[no-untyped-def]
    south = slow[j, i, channel] + u * (slow[j, i + 1, channel] - slow[j, i, channel])
    north = slow[j + 1, i, channel] + u * (slow[j + 1, i + 1, channel] - slow[j + 1, i, channel])
    return south + v * (north - south)


@kernel
def _raise(  # type: ignore[no-untyped-def]
    first, last, key, wind, wavelength, shape, slow, corner, step, east, north, height, heights
):
    stoss, sharpness = shape
    shift = uniform(mix(key, 13))
    for row in range(first, last):
        below = np.floor(north[row] / step)
        j, v = np.int64(below) - corner[1], north[row] / step - below
        for column in range(len(east)):
            if height[row, column] <= 0.0:
                continue
            left = np.floor(east[column] / step)
            i, u = np.int64(left) - corner[0], east[column] / step - left
            real, imaginary = _between(slow, i, j, u, v, 0), _between(slow, i, j, u, v, 1)
            along = (wind[0] * east[column] + wind[1] * north[row]) / wavelength
            phase = shift + along + _between(slow, i, j, u, v, 2)
            phase += np.arctan2(imaginary, real) / (2.0 * np.pi)
            sure = min(np.sqrt(real * real + imaginary * imaginary) / _FADE, 1.0)
            sure *= sure * (3.0 - 2.0 * sure)
            form = _profile(phase - np.floor(phase), stoss, sharpness)
            heights[row, column] = height[row, column] * sure * form
