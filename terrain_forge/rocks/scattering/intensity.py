"""Where rocks may lie: the weight of a place, 0 to 1 or above, that multiplies a population's law.

A population's weight is the product of its density image, its slope limit and, where it lies around
craters, the sum of their weights. Rocks are drawn as densely as the weight is anywhere in a cell
and kept with the weight's share of that (thinning: Lewis & Shedler 1979,
doi:10.1002/nav.3800260304), which is exact: what is kept is a Poisson process of the law times the
weight.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, DataError, RecipeError, inner, kernel, portable
from terrain_forge.model import Heightfield, Site, Window
from terrain_forge.rocks.around_craters import (
    FARTHEST,
    INTERIOR,
    Throwers,
    density_around,
    profile,
    throwers,
)
from terrain_forge.rocks.arrangement import AroundCraters
from terrain_forge.rocks.scattering.cells import Rectangle
from terrain_forge.rocks.scattering.corridor import (
    corridors,
    is_kept_free,
    largest_area,
    search_radius,
)
from terrain_forge.terrain import shape_ground

if TYPE_CHECKING:
    from terrain_forge.rocks.populations import PopulationSpec

_SURELY_LEFT = 0.5
"""Part of a site that corridors may cover without it being looked for what they leave."""


class Intensity(NamedTuple):
    """What the weights of all populations are computed from."""

    bounds: Array
    """West, south, east, north edge of the site [m], shape [4]."""
    image: Array
    """Pixels of all density images, one after the other, rows run north."""
    image_first: NDArray[np.int64]
    """Where a population's image begins, shape [populations]."""
    image_shape: NDArray[np.int64]
    """Rows and columns of a population's image, 0 for none, shape [populations, 2]."""
    around: NDArray[np.bool_]
    """Which populations lie around craters, shape [populations]."""
    thrown: Throwers
    """The craters that they lie around."""
    steepest: Array
    """Largest rise per metre for a population, infinite for no limit, shape [populations]."""
    steepness: Array
    """Rise per metre of the triangles of the cells of `steepness_window`, first that to the
    south-east, then that to the north-west of each cell's diagonal, shape [rows, columns, 2]."""
    steepness_window: NDArray[np.int64]
    """First column and row of those cells on the site's lattice, shape [2]."""
    spacing: float
    """Distance of the nodes [m]."""

    @property
    def limits_slope(self) -> bool:
        """Whether any population has a slope limit."""
        return bool(np.isfinite(self.steepest).any())

    def largest_rock(self, population: int) -> float:
        """Diameter [m] that no rock of a population exceeds by its craters' sizes."""
        if not self.around[population]:
            return np.inf
        own = slice(*self.thrown.first[population : population + 2])
        return float(self.thrown.crater[own, 4].max(initial=0.0))

    def thins(self, population: int) -> bool:
        """Whether a population's weight is not 1 everywhere."""
        shaped = self.image_shape[population, 0] > 0 or self.around[population]
        return bool(shaped or np.isfinite(self.steepest[population]))


def make_intensity(populations: tuple[PopulationSpec, ...], site: Site) -> Intensity:
    """The weights of all populations; slopes are not known yet (`with_slopes`).

    Raises:
        RecipeError: if a population's craters are those of a layer, which `plan` finds.
        DataError: if an image has a value that is no density, or none that is above 0.
    """
    for number, population in enumerate(populations):
        if isinstance(population.arrangement, AroundCraters) and population.arrangement.layer:
            raise RecipeError(
                f"the craters of layer {population.arrangement.layer!r} are not known yet: take "
                "the populations of a planned site, site.recipe.rocks.populations",
                key=("rocks", "populations", number, "arrangement"),
            )
    images = [_image(population, n, site) for n, population in enumerate(populations)]
    around = [isinstance(p.arrangement, AroundCraters) for p in populations]
    tables = [getattr(p.arrangement, "table", np.zeros((0, 5))) for p in populations]
    bounds = np.array(site.bounds)
    limits = [np.inf if p.max_slope_deg is None else p.max_slope_deg for p in populations]
    return Intensity(
        bounds=bounds,
        image=np.concatenate([np.zeros(0), *(image.ravel() for image in images)]),
        image_first=np.cumsum([0, *(image.size for image in images)])[:-1],
        image_shape=np.array([image.shape for image in images], np.int64).reshape(-1, 2),
        around=np.array(around, np.bool_),
        thrown=throwers(tables, bounds),
        steepest=np.array([portable.tan(np.radians(a)) if a < 90.0 else np.inf for a in limits]),
        steepness=np.zeros((0, 0, 2)),
        steepness_window=np.zeros(2, np.int64),
        spacing=site.spacing,
    )


def with_slopes(
    intensity: Intensity, *, site: Site, area: Rectangle, ground: Heightfield | None
) -> Intensity:
    """The same with the ground's slope over an area [m].

    What counts is the strictest measure: the rise per metre of a triangle of the surface is its
    own, or that of its cell's steepest node by central differences (over two cells; one-sided at
    the site's border) where that is more. Ground that is known is used where it holds the area and
    a node around; else the site's layers shape it.
    """
    if not intensity.limits_slope:
        return intensity
    inside = _window(site, area)
    around = site.padded(inside, site.spacing)
    land = _cut(ground, site, around) or shape_ground(
        site=site, window=around, layers=site.recipe.terrain.layers
    )
    elevation = land.elevation.astype(np.float64)
    north, east = (np.gradient(elevation, site.spacing, axis=axis) for axis in (0, 1))
    nodes = inside.nodes_in(around)
    steepest = np.hypot(east[nodes], north[nodes])
    for _ in range(2):  # of each cell's four nodes
        steepest = np.maximum(steepest[1:], steepest[:-1]).T
    east, north = (np.diff(elevation[nodes], axis=axis) / site.spacing for axis in (1, 0))
    southern, northern = np.hypot(east[:-1], north[:, 1:]), np.hypot(east[1:], north[:, :-1])
    of_triangles = np.stack([southern, northern], axis=-1)
    return intensity._replace(
        steepness=np.maximum(of_triangles, steepest[:, :, None]),
        steepness_window=np.array([inside.column, inside.row]),
    )


def flat_area(intensity: Intensity, population: int, window: Window) -> float:
    """Area [m²] of a window's ground that is not too steep for a population, by its triangles."""
    column, row = np.array([window.column, window.row]) - intensity.steepness_window
    cells = intensity.steepness[row : row + window.rows, column : column + window.columns]
    flat = np.count_nonzero(cells <= intensity.steepest[population])
    return 0.5 * intensity.spacing**2 * float(flat)


def _window(site: Site, area: Rectangle) -> Window:
    """The smallest window that holds an area, as far as the site goes."""
    whole = site.window
    west, south, east, north = np.subtract(area, (site.west, site.south) * 2) / site.spacing
    first = np.floor([west, south]).astype(int)
    last = np.ceil([east, north]).astype(int)
    column, row = np.clip(first, 0, (whole.columns - 1, whole.rows - 1)).tolist()
    right, top = np.clip(last, (column + 1, row + 1), (whole.columns, whole.rows)).tolist()
    return Window(column=column, row=row, columns=right - column, rows=top - row)


def _cut(ground: Heightfield | None, site: Site, window: Window) -> Heightfield | None:
    """A window's part of the ground, where it holds the window."""
    if ground is None:
        return None
    column = window.column - round((ground.origin[0] - site.west) / site.spacing)
    row = window.row - round((ground.origin[1] - site.south) / site.spacing)
    rows, columns = ground.shape
    if min(column, row) < 0 or column + window.columns >= columns or row + window.rows >= rows:
        return None
    return ground.cut(column=column, row=row, columns=window.columns, rows=window.rows)


def _image(population: PopulationSpec, index: int, site: Site) -> Array:
    if population.density_image is None:
        return np.zeros((0, 0))
    name, values = population.density_image, site.image(population.density_image)
    key, least, most = ("rocks", "populations", index, "density_image"), values.min(), values.max()
    if least < 0.0 or most > 1.0:
        raise DataError(
            f"{name} holds values from {least:g} to {most:g}, allowed: 0 (no rocks) to 1", key=key
        )
    if most == 0.0:
        raise DataError(f"{name} is black all over: it leaves no place for rocks", key=key)
    return values


def require_place(
    populations: tuple[PopulationSpec, ...], site: Site, intensity: Intensity | None = None
) -> None:
    """Refuse populations whose rocks cannot lie anywhere on a site.

    Args:
        populations: The rocks.
        site: The site.
        intensity: Their weights with slopes, where the whole site's are known.

    Raises:
        RecipeError: if slope limit, image, craters, corridors and exclusion zones together leave
            nothing.
    """
    known = intensity or make_intensity(populations, site)._replace(
        steepest=np.full(len(populations), np.inf)
    )
    strips = corridors(site)
    narrow = largest_area(strips) > _SURELY_LEFT * site.size[0] * site.size[1]
    for number, population in enumerate(populations):
        if (narrow or known.thins(number)) and not _has_place(
            known, number, strips, population.diameters[0]
        ):
            reasons = {
                "its slope limit": np.isfinite(known.steepest[number]),
                "its density image": population.density_image is not None,
                "its craters": known.around[number],
                "corridors and circles": len(strips.half_width) > 0,
            }
            found = ", ".join(name for name, there in reasons.items() if there)
            raise RecipeError(
                f"no place is left for {population.name!r} on the site: {found}",
                key=("rocks", "populations", number),
            )


@kernel
def _has_place(intensity, population, strips, diameter):  # type: ignore[no-untyped-def]
    """Whether rocks of a diameter [m] can lie in the middle of any triangle of the surface."""
    west, south, east, north = intensity.bounds
    limit = search_radius(strips, 0.0)
    for j in range(round((north - south) / intensity.spacing)):
        for i in range(round((east - west) / intensity.spacing)):
            for part in range(2):
                x = west + (i + (2 - part) / 3) * intensity.spacing
                y = south + (j + (1 + part) / 3) * intensity.spacing
                if weight(intensity, population, x, y, diameter) > 0.0:
                    if not is_kept_free(strips, x, y, limit, 0.0):
                        return True
    return False


@kernel
def weights(intensity, population, xy, diameter):  # type: ignore[no-untyped-def]
    """Weight of places for rocks of one population.

    Args:
        intensity: What it is computed from.
        population: Index of the population.
        xy: East and north on the site [m], shape [places, 2].
        diameter: Diameter of the rock at each place [m], shape [places].

    Returns:
        Weights, shape [places].
    """
    found = np.empty(len(xy))
    for n in range(len(xy)):
        found[n] = weight(intensity, population, xy[n, 0], xy[n, 1], diameter[n])
    return found


@kernel
def crater_bounds(intensity, population, smallest, columns, rows):  # type: ignore[no-untyped-def]
    """Upper bound of the craters' weight in cells that divide the site, shape [rows, columns].

    Craters without rocks of the `smallest` diameter [m] do not count.
    """
    found = np.zeros((rows, columns))
    west, south, east, north = intensity.bounds
    width, depth = (east - west) / columns, (north - south) / rows
    thrown = intensity.thrown
    for c in range(thrown.first[population], thrown.first[population + 1]):
        x, y, radius, strength, limit = thrown.crater[c]
        if limit <= smallest:
            continue
        reach = FARTHEST * radius
        i0 = min(max(int(np.floor((x - reach - west) / width)), 0), columns)
        i1 = min(max(int(np.floor((x + reach - west) / width)) + 1, 0), columns)
        j0 = min(max(int(np.floor((y - reach - south) / depth)), 0), rows)
        j1 = min(max(int(np.floor((y + reach - south) / depth)) + 1, 0), rows)
        for j in range(j0, j1):
            for i in range(i0, i1):
                dx0, dx1 = _span(x - west - i * width, width)
                dy0, dy1 = _span(y - south - j * depth, depth)
                # A billionth closer and farther, for places that rounding puts beyond the cell.
                near = np.sqrt(dx0 * dx0 + dy0 * dy0) / radius * (1.0 - 1e-9)
                far = np.sqrt(dx1 * dx1 + dy1 * dy1) / radius * (1.0 + 1e-9)
                if near > 1.0:
                    found[j, i] += strength * profile(near)
                else:
                    found[j, i] += strength * (1.0 if far > 1.0 else INTERIOR)
    return found


@inner
def _span(place, side):  # type: ignore[no-untyped-def]
    """Least and largest distance of a place from those of an interval from 0 to `side`."""
    return max(max(-place, place - side), 0.0), max(abs(place), abs(place - side))


@inner
def weight(intensity, population, x, y, diameter):  # type: ignore[no-untyped-def]
    """Weight of one place for a rock of one population."""
    found = 1.0
    if intensity.around[population]:
        found = density_around(intensity.thrown, population, x, y, diameter)
    if found > 0.0 and intensity.image_shape[population, 0] > 0:
        found *= _pixel(intensity, population, x, y)
    if found > 0.0 and intensity.steepest[population] < np.inf:
        found *= _rise(intensity, x, y) <= intensity.steepest[population]
    return found


@inner
def _pixel(intensity, population, x, y):  # type: ignore[no-untyped-def]
    """The density image, bilinear between the centres of its pixels and level beyond them."""
    west, south, east, north = intensity.bounds
    rows, columns = intensity.image_shape[population]
    i, u = _between((x - west) / (east - west) * columns - 0.5, columns)
    j, v = _between((y - south) / (north - south) * rows - 0.5, rows)
    low = intensity.image_first[population] + j * columns + i
    high = low + (columns if rows > 1 else 0)
    right = 1 if columns > 1 else 0
    below = (1.0 - u) * intensity.image[low] + u * intensity.image[low + right]
    above = (1.0 - u) * intensity.image[high] + u * intensity.image[high + right]
    return (1.0 - v) * below + v * above


@inner
def _rise(intensity, x, y):  # type: ignore[no-untyped-def]
    """Rise per metre of the ground at a place: that of its triangle."""
    rows, columns, _ = intensity.steepness.shape
    u = (x - intensity.bounds[0]) / intensity.spacing
    v = (y - intensity.bounds[1]) / intensity.spacing
    column, row = int(np.floor(u)), int(np.floor(v))
    i = min(max(column - intensity.steepness_window[0], 0), columns - 1)
    j = min(max(row - intensity.steepness_window[1], 0), rows - 1)
    return intensity.steepness[j, i, 0 if u - column >= v - row else 1]


@inner
def _between(place, count):  # type: ignore[no-untyped-def]
    """The sample before a place among `count`, and the part of the way to the next, held within."""
    n = min(max(int(np.floor(place)), 0), max(count - 2, 0))
    return n, min(max(place - n, 0.0), 1.0)
