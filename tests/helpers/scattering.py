"""Sites and populations whose rocks can be counted."""

from __future__ import annotations

import numpy as np

from terrain_forge.model import Image, Table
from terrain_forge.rocks import Clustered, PopulationSpec, PowerLaw, scatter
from tests.helpers import worlds

LIBRARY = worlds.library()
CLUSTERED = Clustered(clusters_per_m2=0.03, radius_m=1.5)


def site(size=(60.0, 50.0), *, seed=1, spacing=0.25, **changes):
    """A flat site of 60 × 50 m."""
    return worlds.site().replace(size=size, spacing=spacing, seed=seed, **changes)


def sand(number=1.0, *, sizes=(0.02, 0.03), name="sand", **more):
    """A known number of small rocks, 1/m², of which hardly one has to move."""
    law = PowerLaw(number_per_m2=1.0, exponent=2.0)
    density = float(law.cumulative_number(sizes[0]) - law.cumulative_number(sizes[1]))
    law = PowerLaw(number_per_m2=number / density, exponent=2.0)
    return PopulationSpec(name=name, size_frequency=law, diameter_m=sizes, **more)


def run(place, *populations, window=None, library=LIBRARY, **more):
    """Scatter populations on a place."""
    return scatter(
        site=place,
        populations=tuple(one.with_diameters(place.size[0] * place.size[1]) for one in populations),
        library=library,
        window=window or place.window,
        **more,
    )


def image(values, path="map.png"):
    """An image that was read."""
    return Image(path=path, values=np.asarray(values, float))


def rough(place):
    """Ground with slopes of 0 to 45° and more [m]."""
    return worlds.shaped(place, lambda x, y: np.sin(x / 3) + np.cos(y / 2.5))


def listed(values, columns=("x_m", "y_m", "diameter_m")):
    """A list of rocks that was read."""
    return Table(path="rocks.csv", columns=columns, values=np.array(values, float))
