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

from terrain_forge.base import Array, inner, kernel, stage_key
from terrain_forge.model import Heightfield, Site, Window
from terrain_forge.rocks.arrangement import FARTHEST, AroundCraters, Clustered, Crater
from terrain_forge.rocks.scattering.cells import Rectangle
from terrain_forge.rocks.scattering.clusters import TRUNCATION, parents
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
_CRATER_POINTS = 300


@dataclass(frozen=True, kw_only=True)
class Expectation:
    """What a right sampler puts onto a part of a site; the law is n(D) dD rocks per m².

    The number of rocks above D is expected to be N = Σ area · (N(D) - N(largest)) over the `parts`.
    Its variance is N + v (N / A)², with A the sum of the parts' areas and v `area_variance`; that
    of their summed plan area is A ∫ (π D²/4)² n dD + v (∫ (π D²/4) n dD)².
    """

    parts: tuple[tuple[float, float], ...]
    """Effective area [m²] and largest diameter [m] of each part: one part, or one per crater."""
    area_variance: float
    """Variance of the effective area [m⁴], since clusters lie at random; 0 where they are given and
    for all other arrangements."""

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
    given_clusters: bool = False,
) -> Expectation:
    """Effective area of a window, without corridors and exclusion zones, for a population.

    Exact for plain Poisson populations and slope limits; by the midpoint rule where something else
    shapes the weight, on 1000 points each way, or on 300 around each crater. Clusters' tails beyond
    4 standard deviations, which the rocks do not have, make a difference of at most 1 in 3000.

    Args:
        population: Whose rocks.
        site: The site.
        window: Part of it.
        ground: Bare ground of the window, for a slope limit; shaped again where it is not given.
        given_clusters: Take the clusters' parents as they were drawn for the site, instead of at
            random: then the rocks are a Poisson process, and the count has no further variance.
    """
    east, north = site.axes(window)
    area = float(east[0]), float(north[0]), float(east[-1]), float(north[-1])
    _, largest = population.diameters
    intensity = make_intensity((population,), site)
    intensity = with_slopes(intensity, site=site, area=area, ground=ground)
    if isinstance(population.arrangement, AroundCraters):
        parts = [
            (_around(crater, population, intensity, site, area), crater.largest_rock_m)
            for crater in population.arrangement.craters
        ]
        limited = tuple((held, min(limit, largest)) for held, limit in parts if held > 0.0)
        return Expectation(parts=limited, area_variance=0.0)
    cells = window.columns * window.rows
    covered = corridor_area(site, window)
    held = cells * site.spacing**2 - covered
    if intensity.limits_slope and covered == 0.0 and population.density_image is None:
        held = flat_area(intensity, 0, window)
    elif intensity.thins(0):
        held = _grid(area, intensity, site).integral
    variance = 0.0
    if isinstance(population.arrangement, Clustered):
        level = covered == 0.0 and not intensity.thins(0)
        grid = _grid(area, intensity, site, points=1 if level else _CLUSTER_POINTS)
        held, variance = _in_clusters(population, grid, held, site, given=given_clusters)
    return Expectation(parts=((held, largest),), area_variance=variance)


@dataclass(frozen=True, kw_only=True)
class _Grid:
    """Weights at the middles of the cells of a grid."""

    weight: Array
    """Weights, 0 in corridors and exclusion zones, shape [rows, columns]."""
    corner: Array
    """South-western corner [m], shape [2]."""
    step: Array
    """Size of a cell [m], east and north, shape [2]."""

    @property
    def integral(self) -> float:
        """Integral of the weight [m²]."""
        return float(self.weight.sum() * self.step.prod())


def _grid(
    area: Rectangle, intensity: Intensity, site: Site, *, points: int = _POINTS, diameter: float = 0
) -> _Grid:
    """Weights over an area [m], for rocks of a diameter [m]."""
    corner, far = np.array(area[:2]), np.array(area[2:])
    step = (far - corner) / points
    middles = np.arange(points) + 0.5
    east, north = np.meshgrid(corner[0] + middles * step[0], corner[1] + middles * step[1])
    xy = np.column_stack([east.ravel(), north.ravel()])
    weight = weights(intensity, 0, xy, np.full(len(xy), float(diameter)))
    weight[in_corridor(site, xy)] = 0.0
    return _Grid(weight=weight.reshape(points, points), corner=corner, step=step)


def _around(
    crater: Crater,
    population: PopulationSpec,
    intensity: Intensity,
    site: Site,
    area: Rectangle,
) -> float:
    """Integral of one crater's weight over an area [m²]."""
    reach = 0.5 * FARTHEST * crater.diameter_m
    x, y = crater.centre_m
    west, south = max(area[0], x - reach), max(area[1], y - reach)
    east, north = min(area[2], x + reach), min(area[3], y + reach)
    if west >= east or south >= north:
        return 0.0
    alone = replace(population, arrangement=AroundCraters(craters=(crater,)))
    own = make_intensity((alone,), site)._replace(
        steepness=intensity.steepness, steepness_window=intensity.steepness_window
    )
    return _grid((west, south, east, north), own, site, points=_CRATER_POINTS).integral


def _in_clusters(
    population: PopulationSpec, grid: _Grid, held: float, site: Site, *, given: bool
) -> tuple[float, float]:
    """Effective area [m²] of a clustered population, and its variance [m⁴].

    `held` is the integral of the weight, which the grid has less exactly.

    With g(p) the part of the rocks of a parent at p that lie in the window, weighted, and κ parents
    on a square metre: the area is Σ g(p) / κ over given parents, otherwise the integral of the
    weight, and its variance ∫ g² dp / κ (Campbell's theorem). Exact for a weight that is level in
    each cell.
    """
    assert isinstance(population.arrangement, Clustered)
    density, radius = population.arrangement.clusters_per_m2, population.arrangement.radius_m
    if grid.integral == 0.0:
        return 0.0, 0.0
    finer = held / grid.integral
    if not given:
        return held, float(_shared(grid.weight, grid.step, radius) / density) * finer**2
    key = stage_key(site.seed, f"rocks/{population.name}")
    points = parents(population.arrangement, site=site, key=key).xy - grid.corner
    return float(_held(grid.weight, grid.step, radius, points) / density) * finer, 0.0


@kernel
def _shared(weight, step, radius):  # type: ignore[no-untyped-def]
    """∫ g² dp [m⁴]: over pairs of cells, the chance density that a parent's rocks lie in both."""
    rows, columns = weight.shape
    across, along = _pairs(columns, step[0], radius), _pairs(rows, step[1], radius)
    total = 0.0
    for i in range(rows):
        for j in range(columns):
            one = other = 0.0
            for k in range(rows):
                one += along[abs(i - k)] * weight[k, j]
            for k in range(columns):
                other += across[abs(j - k)] * weight[i, k]
            total += one * other
    return total


@inner
def _pairs(count, side, radius):  # type: ignore[no-untyped-def]
    """∫∫ of the density of two rocks' distance, over two cells that lie 0, 1, 2 … cells apart [m].

    That density is normal with the variance 2 radius²; its second integral is differenced.
    """
    found = np.empty(count)
    for n in range(count):
        found[n] = 0.0
        for shift, factor in ((-1, 1.0), (0, -2.0), (1, 1.0)):
            t = 0.5 * (n + shift) * side / radius
            second = t * math.erf(t) + np.exp(-t * t) / np.sqrt(np.pi)
            found[n] += factor * radius * second
    return found


@kernel
def _held(weight, step, radius, points):  # type: ignore[no-untyped-def]
    """Σ g(p) over parents [m], relative to the grid's corner."""
    rows, columns = weight.shape
    total = 0.0
    for p in range(len(points)):
        i0, i1, across = _shares(points[p, 0], step[0], columns, radius)
        j0, j1, along = _shares(points[p, 1], step[1], rows, radius)
        for j in range(j0, j1):
            for i in range(i0, i1):
                total += along[j - j0] * across[i - i0] * weight[j, i]
    return total


@inner
def _shares(place, side, count, radius):  # type: ignore[no-untyped-def]
    """First cell near a parent's coordinate, one past the last, and each one's share of rocks."""
    reach = TRUNCATION * radius
    first = min(max(int(np.floor((place - reach) / side)), 0), count)
    last = min(max(int(np.floor((place + reach) / side)) + 1, 0), count)
    found = np.empty(max(last - first, 0))
    for n in range(len(found)):
        low = ((first + n) * side - place) / (np.sqrt(2.0) * radius)
        found[n] = 0.5 * (math.erf(low + side / (np.sqrt(2.0) * radius)) - math.erf(low))
    return first, last, found
