"""Sites and layers of craters that tests share."""

from __future__ import annotations

import numpy as np

from terrain_forge.model import MOON, Table
from terrain_forge.terrain import (
    BodyProduction,
    CraterLayer,
    make_craters,
)
from terrain_forge.terrain.cratering import degradation
from tests.helpers import worlds
from tests.helpers.recipes import flat

ALPHA = 0.001
KM2 = 1e-6


def moon(size=(200.0, 160.0), *, spacing=0.5, seed=1, **changes):
    """A flat site on the Moon."""
    return worlds.site().replace(size=size, spacing=spacing, seed=seed, body=MOON, **changes)


def layer(**changes):
    """Craters of an old mare from 2 to 60 m."""
    return CraterLayer(
        **{
            "production": BodyProduction(kind="neukum", age_ga=3.5),
            "diameter_m": (2.0, 60.0),
            **changes,
        }
    )


def listed(rows, columns=("x_m", "y_m", "diameter_m", "age_ga"), **changes):
    """A site with a list of craters, and their layer."""
    table = Table(path="craters.csv", columns=columns, values=np.array(rows, float))
    return moon(tables=(table,)), CraterLayer(file="craters.csv", **changes)


MOON_AGES = MOON.craters.chronology
AS_JSON = (
    '{"name":"m","body":"moon","dtm":{"kind":"flat","size_m":[100,80]},"terrain":{"spacing_m":'
    '0.5,"layers":[{"kind":"craters","production":{%s}}]}}'
)
"""A recipe with a production function to be filled in."""


def fresh_profile(x, *, depth, rim, ejecta):
    """Height [m] of a fresh crater above the ground around at distances in radii."""
    weights = np.array([depth, rim - ejecta, ejecta])
    return np.tensordot(weights, degradation.shapes(x), axes=1)


def everywhere(spec, place):
    return make_craters(spec, site=place, area=place.bounds)


def recipe(*layers, **changes):
    """A flat Moon of 100 × 80 m."""
    more = {"body": "moon", "exports": (), **changes}
    terrain = {"layers": layers}
    return flat((100.0, 80.0), 0.5, shapes=2, lonlat=(-23.4, -3.0), terrain=terrain, **more)


def near(x, y, radius):
    """Nodes of `heights` within a circle."""
    east, north = moon().axes(moon().window)
    return np.hypot(east[None, :] - x, north[:, None] - y) <= radius
