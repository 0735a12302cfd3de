"""How many rocks of a population are to be expected on a part of a site, and how sure that is.

Where a population's rocks lie is its law times a weight that depends on the place: 1 everywhere for
plain Poisson populations, less where an image or a slope limit thins them out or far from craters,
random for clustered ones. Expected numbers and cover are those of the law on the *effective area*,
the integral of the weight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from terrain_forge.base import Array, rectangle_distance
from terrain_forge.model import Heightfield, Site, Window
from terrain_forge.rocks.around_craters import FARTHEST, throwers
from terrain_forge.rocks.arrangement import AroundCraters, Clustered
from terrain_forge.rocks.scattering.cells import Rectangle
from terrain_forge.rocks.scattering.corridor import corridor_area, in_corridor
from terrain_forge.rocks.scattering.intensity import (
    Intensity,
    flat_area,
    make_intensity,
    weights,
    with_slopes,
)

if TYPE_CHECKING:
    from terrain_forge.rocks.populations import PopulationSpec


_POINTS = 1000
_CLUSTER_POINTS = 300
_CRATER_POINTS, _FEWEST, _ALL = 300, 24, 1e6
"""Points away from a crater and around it, fewer where all of them would have more than `_ALL`."""


@dataclass(frozen=True, kw_only=True)
class Expectation:
    """What a correct sampler puts onto a part of a site; the law is n(D) dD rocks per m².

    The number of rocks above D is expected to be N = Σ area · (N(D) - N(largest)) over the `parts`.
    Its variance is N + v (N / A)², with A the sum of the parts' areas and v `area_variance`; that
    of their summed plan area is A ∫ (π D²/4)² n dD + v (∫ (π D²/4) n dD)².
    """

    parts: tuple[tuple[float, float], ...]
    """Effective area [m²] and largest diameter [m] of each part: one part, or one per crater."""
    area_variance: float
    """Variance of the effective area [m⁴], since clusters lie at random; 0 for all other
    arrangements."""

    @property
    def area(self) -> float:
        """Effective area of all parts [m²]."""
        return sum(area for area, _ in self.parts)


def expected(
    population: PopulationSpec,
    *,
    site: Site,
    window: Window,
    ground: Heightfield | None = None,
) -> Expectation:
    """Effective area of a window, without corridors and exclusion zones, for a population.

    Exact for plain Poisson populations and slope limits; by the midpoint rule where something else
    shapes the weight, on 1000 points each way, or on 300 away from each crater and around it,
    fewer of many craters.
    Clusters' tails beyond 4 standard deviations, which the rocks do not have, make a difference of
    at most 1 in 3000.

    Args:
        population: Whose rocks.
        site: The site.
        window: Part of it.
        ground: Bare ground of the window, for a slope limit; shaped again where it is not given.
    """
    east, north = site.axes(window)
    area = float(east[0]), float(north[0]), float(east[-1]), float(north[-1])
    _, largest = population.diameters
    intensity = make_intensity((population,), site)
    intensity = with_slopes(intensity, site=site, area=area, ground=ground)
    if isinstance(population.arrangement, AroundCraters):
        table = population.arrangement.table
        table = table[rectangle_distance(table[:, :2], area) < FARTHEST * table[:, 2]]
        points = int(np.clip((_ALL / max(len(table), 1)) ** 0.5, _FEWEST, _CRATER_POINTS))
        areas = [_around(crater, intensity, site, area, points) for crater in table]
        limits = np.minimum(table[:, 4], largest).tolist()
        parts = tuple(part for part in zip(areas, limits, strict=True) if part[0] > 0.0)
        return Expectation(parts=parts, area_variance=0.0)
    covered = corridor_area(site, window)
    held = window.columns * window.rows * site.spacing**2 - covered
    if intensity.limits_slope and covered == 0.0 and population.density_image is None:
        held = flat_area(intensity, 0, window)
    elif intensity.thins(0):
        held = _grid(area, intensity, site, _POINTS)[2]
    variance = 0.0
    if isinstance(population.arrangement, Clustered):
        level = covered == 0.0 and not intensity.thins(0)
        weight, step, coarse = _grid(area, intensity, site, 1 if level else _CLUSTER_POINTS)
        finer = held / coarse if coarse > 0.0 else 0.0
        variance = _cluster_variance(population.arrangement, weight, step) * finer**2
    return Expectation(parts=((held, largest),), area_variance=variance)


def expected_cover(populations: tuple[PopulationSpec, ...], site: Site, window: Window) -> Array:
    """Part of the ground that rocks of some populations cover on average, shape [rows, columns].

    Limits by slope do not count, since the ground is not known yet.
    """
    east, north = site.axes(window)
    places = np.stack(np.meshgrid(east, north), axis=-1).reshape(-1, 2)
    cover = np.zeros(len(places))
    populations = tuple(replace(p, max_slope_deg=None) for p in populations)
    intensity = make_intensity(populations, site)
    for number, population in enumerate(populations):
        share: Array | float = 1.0
        if intensity.thins(number):
            smallest = np.full(len(places), population.diameters[0])
            share = weights(intensity, number, places, smallest)
        cover += population.cover * share
    return cover.reshape(len(north), len(east))


def _grid(
    area: Rectangle, intensity: Intensity, site: Site, points: int
) -> tuple[Array, tuple[float, float], float]:
    """Weights at the middles of the cells of a grid over an area [m], the cells' sides, integral.

    They are 0 in corridors and exclusion zones, shape [points, points].
    """
    step = (area[2] - area[0]) / points, (area[3] - area[1]) / points
    middles = np.arange(points) + 0.5
    east, north = np.meshgrid(area[0] + middles * step[0], area[1] + middles * step[1])
    xy = np.column_stack([east.ravel(), north.ravel()])
    weight = _weights_of(xy, intensity, site).reshape(points, points)
    return weight, step, float(weight.sum()) * (step[0] * step[1])


def _weights_of(xy: Array, intensity: Intensity, site: Site) -> Array:
    """Weights at places [m], 0 in corridors and exclusion zones, shape [places]."""
    weight = weights(intensity, 0, xy, np.zeros(len(xy)))
    return np.where(in_corridor(site, xy), 0.0, weight)


def _around(crater: Array, intensity: Intensity, site: Site, area: Rectangle, points: int) -> float:
    """Integral of the weight of one crater, a row of `Throwers.crater`, over an area [m²]."""
    alone = intensity._replace(thrown=throwers([crater[None]], intensity.bounds))
    (x, y), reach = crater[:2].tolist(), FARTHEST * float(crater[2])
    whole = x - reach, y - reach, x + reach, y + reach
    inner = *np.maximum(whole[:2], area[:2]).tolist(), *np.minimum(whole[2:], area[2:]).tolist()
    if inner != whole:
        return _grid(inner, alone, site, points)[2]
    # On rings, one of which ends at the rim, where the density jumps: few cells of a square grid
    # would be wrong by the same 2 % at each crater.
    width, turn = float(crater[2]) / round(points / FARTHEST), 2.0 * np.pi / points
    away = np.arange(0.5 * width, reach, width)
    angle = np.arange(points) * turn
    east, north = np.outer(away, np.cos(angle)), np.outer(away, np.sin(angle))
    xy = np.column_stack([x + east.ravel(), y + north.ravel()])
    weight = _weights_of(xy, alone, site).reshape(east.shape)
    return float((weight.sum(axis=1) * away).sum() * (width * turn))


def _cluster_variance(clusters: Clustered, weight: Array, step: tuple[float, float]) -> float:
    """Variance of the effective area [m⁴]: ∫ g² dp / κ with κ clusters on a square metre.

    g(p) is the part of a cluster around p whose rocks lie in the window, weighted (Campbell's
    theorem). So it is the integral of w(x) w(y) k(x - y) / κ over both places of two rocks of one
    cluster, whose distance has the normal density k of the variance 2 radius². Exact for a weight
    that is level in each cell.
    """
    from scipy.ndimage import correlate1d

    shared = weight
    for axis, side in ((0, step[1]), (1, step[0])):
        # ∫∫ of k along the axis, over two cells that lie 0, 1, 2 … cells apart [m]: by differences
        # of its second integral.
        places = [0.5 * (n - 1) * side / clusters.radius_m for n in range(weight.shape[axis] + 2)]
        second = [t * math.erf(t) + math.exp(-t * t) / math.sqrt(math.pi) for t in places]
        pairs = clusters.radius_m * np.diff(second, 2)
        both_ways = np.concatenate([pairs[:0:-1], pairs])
        shared = correlate1d(shared, both_ways, axis=axis, mode="constant")
    return float((shared * weight).sum()) / clusters.clusters_per_m2
