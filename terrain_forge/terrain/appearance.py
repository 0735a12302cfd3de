"""The colour of the ground: the body's regolith, mottled by noise and by the relief itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrain_forge.kernels import kernel, over_chunks
from terrain_forge.seeds import stage_key
from terrain_forge.site import Site, Window
from terrain_forge.specs import Fraction, Spec
from terrain_forge.terrain.noise import fbm
from terrain_forge.world import Heightfield

_STENCIL_M = 0.5
_MOTTLE_M, _MOTTLE_OCTAVES, _MOTTLE_GAIN = 23.0, 7, 0.68


@dataclass(frozen=True, kw_only=True)
class AppearanceSpec(Spec):
    """What the ground looks like."""

    ground_rgb: tuple[Fraction, Fraction, Fraction] | None = None
    """sRGB colour of level ground, 0 to 1 each; without it the body's regolith."""
    variation: Fraction = 0.5
    """How much colour and brightness vary over the ground: 0 not at all, 1 strongly."""


def stencil_reach(site: Site) -> float:
    """How far around a node its colour looks at the ground [m]: the margin that a window needs."""
    return _cells(site.spacing) * site.spacing


def colour_ground(
    *, site: Site, window: Window, ground: Heightfield, spec: AppearanceSpec
) -> NDArray[np.uint8]:
    """The sRGB colour of the window's nodes, rows run north, shape [rows, columns, 3].

    Steep ground shows less of the bright dust, hollows hold darker sand, and noise that is
    addressed by position mottles all of it, so that nothing repeats.

    Args:
        site: the place.
        window: what is coloured.
        ground: heights of at least the window. A node has the same colour in every window if this
            reaches `stencil_reach` beyond the window, or to the site's edge.
        spec: the recipe's wishes.
    """
    east, north = site.axes(window)
    mottle = fbm(
        stage_key(site.seed, "appearance"), east, north, _MOTTLE_M, _MOTTLE_OCTAVES, _MOTTLE_GAIN
    )
    colour = np.array(spec.ground_rgb or site.body.ground_rgb)
    rgb = np.empty((*mottle.shape, 3), dtype=np.uint8)
    over_chunks(
        _paint,
        len(mottle),
        ground.elevation,
        round((float(east[0]) - ground.origin[0]) / ground.spacing),
        round((float(north[0]) - ground.origin[1]) / ground.spacing),
        _cells(site.spacing),
        site.spacing,
        mottle,
        colour,
        spec.variation,
        rgb,
    )
    return rgb


def _cells(spacing: float) -> int:
    return max(1, round(_STENCIL_M / spacing))


@kernel
def _paint(  # type: ignore[no-untyped-def]
    first, last, elevation, column, row, cells, spacing, mottle, colour, variation, rgb
):
    """Colour each node; `elevation[row, column]` lies under the first node of `mottle`."""
    columns = mottle.shape[1]
    last_row, last_column = elevation.shape[0] - 1, elevation.shape[1] - 1
    grey = (colour[0] + colour[1] + colour[2]) / 3.0
    for j in range(first, last):
        south, north = max(row + j - cells, 0), min(row + j + cells, last_row)
        for i in range(columns):
            west, east = max(column + i - cells, 0), min(column + i + cells, last_column)
            here = np.float64(elevation[row + j, column + i])
            w, e = np.float64(elevation[row + j, west]), np.float64(elevation[row + j, east])
            s, n = (
                np.float64(elevation[south, column + i]),
                np.float64(elevation[north, column + i]),
            )
            slope_x = (e - w) / ((east - west) * spacing)
            slope_y = (n - s) / ((north - south) * spacing)
            hollow = (0.25 * (w + e + s + n) - here) / (cells * spacing)
            steep = min(1.0, slope_x * slope_x + slope_y * slope_y)
            dust = 0.8 * mottle[j, i] - 0.8 * steep - min(max(3.0 * hollow, -0.5), 0.5)
            bright = 1.0 + 0.30 * variation * dust
            vivid = 1.0 + 0.2 * variation * dust
            for channel in range(3):
                value = bright * (grey + vivid * (colour[channel] - grey))
                rgb[j, i, channel] = np.uint8(255.0 * min(max(value, 0.0), 1.0) + 0.5)
