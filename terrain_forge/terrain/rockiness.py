"""How much of the ground the recipe's rocks are expected to cover, place by place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from terrain_forge.rocks.scattering.intensity import make_intensity, weights
from terrain_forge.site import Site, Window

Array = NDArray[np.float64]


def rock_cover(site: Site, window: Window) -> Array:
    """Part of the ground that scattered rocks cover on average, shape [rows, columns].

    Density images and craters count; limits by slope do not, since the ground is not known yet,
    and rocks that are listed one by one do not.
    """
    east, north = site.axes(window)
    cover = np.zeros(len(north) * len(east))
    populations = tuple(replace(p, max_slope_deg=None) for p in site.recipe.rocks.populations)
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
