"""Ripples and transverse ridges of the wind."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from annotated_types import Interval

from terrain_forge.base import Array, FileName, Fraction, Positive, RecipeError, stage_key
from terrain_forge.model import Site, Window
from terrain_forge.terrain.aeolian import Bedforms, bedform_heights, steepest_lee
from terrain_forge.terrain.layer import Layer
from terrain_forge.terrain.masks import fade, steepness, stencil_cells

REPOSE_DEG = 34.0
"""Slope at which loose sand begins to slide [degrees]."""
INDEX = 15.0
"""Wavelength over height where no height is given; ripples have 10 to 20."""
FEWEST_NODES = 4.0
"""Spacings that a wavelength must be long."""


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
    wavelength_m: Positive
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
            most = self.height * np.tan(np.radians(REPOSE_DEG)) / np.tan(lee)
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
        towards = np.radians(self.wind_from_deg + 180.0)
        forms = Bedforms(
            key=stage_key(site.seed, f"terrain/{self.name}"),
            wind=(float(np.sin(towards)), float(np.cos(towards))),
            wavelength=self.wavelength_m,
            stoss=self.stoss,
            sharpness=self.sharpness,
            sinuosity=self.sinuosity,
            defects=self.defects,
        )
        east, north = site.axes(window)
        height = self.height * self._sandiness(site, window, elevation)
        return bedform_heights(forms, east=east, north=north, spacing=site.spacing, height=height)

    def _sandiness(self, site: Site, window: Window, elevation: Array) -> Array:
        """Factor on the height, 0 to 1: less on steep and on rocky ground."""
        rise = steepness(elevation, stencil_cells(self.wavelength_m, site.spacing), site.spacing)
        full, none = (float(np.tan(np.radians(angle))) for angle in self.slope_deg)
        factor = fade(rise, full, none)
        if self.rock_cover is not None:
            cover = site.recipe.rocks.expected_cover(site, window)
            factor = factor * fade(cover, *self.rock_cover)
        return factor
