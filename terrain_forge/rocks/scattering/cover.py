"""How much of the ground rocks are expected to cover, place by place."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from terrain_forge.base import Array
from terrain_forge.model import Site, Window
from terrain_forge.rocks.scattering.intensity import make_intensity, weights

if TYPE_CHECKING:
    from terrain_forge.rocks.populations import PopulationSpec


def expected_cover(populations: tuple[PopulationSpec, ...], site: Site, window: Window) -> Array:
    """Part of the ground that rocks of some populations cover on average, shape [rows, columns].

    Limits by slope do not count, since the ground is not known yet.
    """
    east, north = site.axes(window)
    cover = np.zeros(len(north) * len(east))
    populations = tuple(replace(p, max_slope_deg=None) for p in populations)
    if not populations:
        return cover.reshape(len(north), len(east))
    intensity = make_intensity(populations, site)
    places = np.stack(np.meshgrid(east, north), axis=-1).reshape(-1, 2)
    for number, population in enumerate(populations):
        law = population.size_frequency
        smallest, largest = population.diameter_range(site.size[0] * site.size[1])
        share = float(law.cumulative_area(smallest) - law.cumulative_area(largest))
        if intensity.thins(number):
            sizes = np.full(len(places), smallest)
            cover += share * weights(intensity, number, places, sizes)
        else:
            cover += share
    return cover.reshape(len(north), len(east))
