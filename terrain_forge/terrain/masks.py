"""Where a layer applies: the weight of a place, 0 to 1, that multiplies the layer's relief.

A mask is made of conditions on slope, height, relief, an image and the distance to a route; the
weights of those that are given are multiplied. Between 0 and 1 a weight follows 3t² - 2t³, so that
a layer ends without an edge.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Interval, MinLen
from numpy.typing import NDArray

from terrain_forge.base import (
    Array,
    Coordinate,
    DataError,
    InputFile,
    Key,
    NotNegative,
    Positive,
    RecipeError,
    Spec,
    portable,
)
from terrain_forge.dtm import bilinear
from terrain_forge.model import Site, Window
from terrain_forge.terrain.route_distance import route_distance

Angle = Annotated[float, Interval(ge=0, lt=90)]


@dataclass(frozen=True, kw_only=True)
class HeightBand(Spec):
    """Ground between two heights."""

    above_m: Coordinate | None = None
    """World z [m] from which the layer applies; without it there is no lower bound."""
    below_m: Coordinate | None = None
    """World z [m] up to which the layer applies; without it there is no upper bound."""
    fade_m: NotNegative = 0.0
    """Height beyond a bound within which the layer fades out [m]."""

    def __post_init__(self) -> None:
        _require_band(self.above_m, self.below_m, ("above_m", "below_m"))


@dataclass(frozen=True, kw_only=True)
class SlopeBand(Spec):
    """Ground between two slopes."""

    above_deg: Angle | None = None
    """Slope from which the layer applies [degrees]; without it there is no lower bound."""
    below_deg: Angle | None = None
    """Slope up to which the layer applies [degrees]; without it there is no upper bound."""
    fade_deg: Angle = 0.0
    """Angle beyond a bound within which the layer fades out [degrees]."""
    baseline_m: Positive = 1.0
    """Length over which the slope is measured [m], rounded to whole cells, two at least; at most
    the site's longer side."""

    def __post_init__(self) -> None:
        _require_band(self.above_deg, self.below_deg, ("above_deg", "below_deg"))


@dataclass(frozen=True, kw_only=True)
class ReliefBand(Spec):
    """Ground between two measures of its relief over a baseline."""

    above_m: Coordinate | None = None
    """Measure [m] from which the layer applies; without it there is no lower bound."""
    below_m: Coordinate | None = None
    """Measure [m] up to which the layer applies; without it there is no upper bound."""
    fade_m: NotNegative = 0.0
    """What beyond a bound the layer fades out within [m]."""
    baseline_m: Positive = 2.0
    """Length over which it is measured [m], rounded to whole cells, two at least; at most the
    site's longer side."""

    def __post_init__(self) -> None:
        _require_band(self.above_m, self.below_m, ("above_m", "below_m"))


@dataclass(frozen=True, kw_only=True)
class RouteBand(Spec):
    """Ground between two distances to a route."""

    path: Annotated[str, MinLen(1)] | None = None
    """Name of the path; without it the nearest of all paths counts."""
    beyond_m: NotNegative | None = None
    """Distance from which the layer applies [m]; without it there is no lower bound."""
    within_m: NotNegative | None = None
    """Distance up to which the layer applies [m]; without it there is no upper bound."""
    fade_m: NotNegative = 0.0
    """Distance beyond a bound within which the layer fades out [m]."""

    def __post_init__(self) -> None:
        _require_band(self.beyond_m, self.within_m, ("beyond_m", "within_m"))


@dataclass(frozen=True, kw_only=True)
class Mask(Spec):
    """Where a layer applies; its relief is multiplied by all conditions that are given."""

    slope: SlopeBand | None = None
    """By the slope of the ground before this layer."""
    height: HeightBand | None = None
    """By the height of the ground before this layer."""
    hollow: ReliefBand | None = None
    """By how far the ground lies below the mean of its surroundings, half a baseline away [m]:
    above 0 in lows, below 0 on crests. It is the curvature times an eighth of the squared baseline.
    """
    roughness: ReliefBand | None = None
    """By the RMS of that in four directions [m]: how rough the ground is, whatever its slope."""
    image: Annotated[str, MinLen(1), InputFile(kind="image")] | None = None
    """By an image over the whole site, north up: 0 (black) to 1 (white). The outer pixels' centres
    lie on the site's edges."""
    route: RouteBand | None = None
    """By the distance to a path."""
    invert: bool = False
    """Apply the layer where it would not, and not where it would."""

    def __post_init__(self) -> None:
        conditions = (
            *(self.slope, self.height, self.hollow, self.roughness),
            *(self.image, self.route),
        )
        if all(part is None for part in conditions):
            raise ValueError("a mask needs a slope, height, hollow, roughness, image or route")

    def reach(self, site: Site) -> float:
        """How far around a node the mask looks at the ground [m]."""
        bands = (self.slope, self.hollow, self.roughness)
        spans = [stencil_cells(band.baseline_m, site.spacing) for band in bands if band is not None]
        return max(spans, default=0) * site.spacing

    def check(self, *, site: Site, key: Key) -> None:
        """Refuse a mask that a site cannot have; `key` is its place in the recipe.

        Raises:
            RecipeError: for a path that does not exist, or a baseline longer than the site.
            DataError: for an image whose shape is not the site's, or that is no weight.
        """
        for name in ("slope", "hollow", "roughness"):
            band = getattr(self, name)
            if band is not None and band.baseline_m > max(site.size):
                raise RecipeError(
                    f"{band.baseline_m:g} m: at most {max(site.size):g} m, the longer side of the "
                    "site",
                    key=(*key, name, "baseline_m"),
                )
        if self.image is not None:
            _check_image(site.image(self.image), self.image, site, (*key, "image"))
        if self.route is not None:
            names, path = [route.name for route in site.routes], self.route.path
            if path is not None and path not in names:
                raise RecipeError(
                    f"no path is called {path!r}, there are: {', '.join(names) or 'none'}",
                    key=(*key, "route", "path"),
                )
            if not names:
                raise RecipeError(
                    "the recipe has no path to keep a distance to", key=(*key, "route")
                )


def mask_weight(mask: Mask, *, site: Site, window: Window, elevation: Array) -> Array:
    """Weight of the window's nodes, 0 to 1, by their heights [m], shape [rows, columns].

    A node's weight is the same in every window if the heights reach `Mask.reach` around it, or to
    the site's edge.
    """
    weight = np.ones_like(elevation)
    east, north = site.axes(window)
    if mask.height is not None:
        band = mask.height
        weight *= _within(elevation, band.above_m, band.below_m, band.fade_m)
    if mask.slope is not None:
        cells = stencil_cells(mask.slope.baseline_m, site.spacing)
        weight *= _within_slopes(mask.slope, steepness(elevation, cells, site.spacing))
    if mask.hollow is not None:
        weight *= _relief_weight(mask.hollow, elevation, site.spacing, _AXES, np.mean)
    if mask.roughness is not None:
        weight *= _relief_weight(mask.roughness, elevation, site.spacing, _ALL_WAYS, _rms)
    weight = weight_by_place(mask, weight, site=site, east=east, north=north)
    return 1.0 - weight if mask.invert else weight


def weight_by_place(mask: Mask, weight: Array, *, site: Site, east: Array, north: Array) -> Array:
    """A weight times those of the mask's image and route, before `invert`, shape [north, east].

    Beyond the site an image goes on as at its edge.

    Args:
        mask: The mask.
        weight: Of a grid's nodes, 0 to 1, shape [north, east].
        site: The site.
        east: Of the columns [m].
        north: Of the rows [m].
    """
    if mask.image is not None:
        values = site.image(mask.image)
        rows, columns = values.shape
        across = _between((east - site.west) / site.size[0] * (columns - 1), columns)
        down = _between((north - site.south) / site.size[1] * (rows - 1), rows)
        weight = weight * bilinear(values, across, down)
    if mask.route is not None:
        near = mask.route
        lines = [route.position for route in site.routes if near.path in (None, route.name)]
        farthest = max(near.beyond_m or 0.0, (near.within_m or 0.0) + near.fade_m) + site.spacing
        away = route_distance(lines, east=east, north=north, farthest=farthest)
        weight = weight * _within(away, near.beyond_m, near.within_m, near.fade_m)
    return weight


def mask_weight_at(
    mask: Mask,
    *,
    placed: Array,
    east: Array,
    north: Array,
    cell: float,
    height_at: Callable[[Array, Array], Array],
) -> Array:
    """Weight of single points, 0 to 1, shape [points].

    As `mask_weight` on a grid of `cell` [m] through each point.

    Args:
        mask: The mask.
        placed: Their `weight_by_place`, shape [points].
        east: Of the points [m], shape [points].
        north: Of the points [m], shape [points].
        cell: How closely the ground is known there [m].
        height_at: Heights [m] at places east and north [m], of any shape.
    """

    def around(baseline: float) -> tuple[Array, float]:
        away = stencil_cells(baseline, cell) * cell
        steps = np.array([-away, 0.0, away])
        return height_at(east + steps[None, :, None], north + steps[:, None, None]), away

    weight = placed.copy()
    if mask.height is not None:
        band = mask.height
        weight *= _within(height_at(east, north), band.above_m, band.below_m, band.fade_m)
    if mask.slope is not None:
        z, away = around(mask.slope.baseline_m)
        x, y = (z[1, 2] - z[1, 0]) / (2.0 * away), (z[2, 1] - z[0, 1]) / (2.0 * away)
        weight *= _within_slopes(mask.slope, np.sqrt(x * x + y * y))
    measures = (mask.hollow, _AXES, np.mean), (mask.roughness, _ALL_WAYS, _rms)
    for relief, ways, measure in measures:
        if relief is not None:
            z, _ = around(relief.baseline_m)
            sags = [0.5 * (z[1 + j, 1 + i] + z[1 - j, 1 - i]) - z[1, 1] for j, i in ways]
            weight *= _within(
                measure(np.stack(sags), axis=0), relief.above_m, relief.below_m, relief.fade_m
            )
    return 1.0 - weight if mask.invert else weight


def fade(value: Array, start: float, end: float) -> Array:
    """From 1 at `start` smoothly to 0 at `end`, which is not lower; a step after it if equal."""
    if start == end:
        return np.asarray(value <= start, np.float64)
    part = np.clip((end - value) / (end - start), 0.0, 1.0)
    return np.asarray(part * part * (3.0 - 2.0 * part))


def stencil_cells(baseline: float, spacing: float) -> int:
    """Cells from a node to each end of a baseline [m] that is centred on it, at least 1."""
    return max(1, round(0.5 * baseline / spacing))


def steepness(elevation: Array, cells: int, spacing: float) -> Array:
    """Rise per metre of the steepest way up at each node, from heights [m], shape [rows, columns].

    From differences over so many cells to either side, fewer at the border.
    """
    east = _differences(elevation, cells, spacing)
    north = _differences(elevation.T, cells, spacing).T
    return np.asarray(np.sqrt(east * east + north * north))


def _differences(elevation: Array, cells: int, spacing: float) -> Array:
    """Rise per metre along the columns."""
    index = np.arange(elevation.shape[1])
    low, high = np.maximum(index - cells, 0), np.minimum(index + cells, len(index) - 1)
    return np.asarray((elevation[:, high] - elevation[:, low]) / ((high - low) * spacing))


_AXES = ((0, 1), (1, 0))
_ALL_WAYS = (*_AXES, (1, 1), (1, -1))
"""Directions along which relief is measured, rows and columns."""


def _rms(parts: Array, axis: int) -> Array:
    return np.asarray(np.sqrt(np.mean(parts * parts, axis=axis)))


def _relief_weight(
    band: ReliefBand,
    elevation: Array,
    spacing: float,
    ways: tuple[tuple[int, int], ...],
    measure: Callable[..., Array],
) -> Array:
    """As `_within`, of how far the ground lies below the means of both ends of a baseline."""
    cells = stencil_cells(band.baseline_m, spacing)
    parts = np.stack([_sag(elevation, cells * j, cells * i) for j, i in ways])
    return _within(measure(parts, axis=0), band.above_m, band.below_m, band.fade_m)


def _sag(elevation: Array, rows: int, columns: int) -> Array:
    """Mean of the heights so far to both sides, less the node's own; nearer at the border."""
    j, i = (np.arange(count) for count in elevation.shape)
    rise = np.sign(columns) * _room(i, abs(columns))[None, :]
    climb = _room(j, abs(rows))[:, None]
    if rows and columns:  # as far along one axis as along the other
        near = np.minimum(np.abs(rise), climb)
        rise, climb = np.sign(columns) * near, near
    ends = (elevation[j[:, None] + side * climb, i[None, :] + side * rise] for side in (1, -1))
    return np.asarray(0.5 * sum(ends) - elevation)


def _room(index: NDArray[np.int64], wanted: int) -> NDArray[np.int64]:
    """How far nodes can look to both sides."""
    return np.asarray(np.minimum(wanted, np.minimum(index, index[-1] - index)))


def _within(value: Array, low: float | None, high: float | None, width: float) -> Array:
    """1 between two bounds, falling to 0 over a width beyond them."""
    weight = np.ones_like(value)
    if low is not None:
        weight *= fade(-value, -low, width - low)
    if high is not None:
        weight *= fade(value, high, high + width)
    return weight


def _within_slopes(band: SlopeBand, rise: Array) -> Array:
    """As `_within`, in angles; the fade ends at level ground or the vertical."""
    weight = np.ones_like(rise)
    above, below, width = band.above_deg, band.below_deg, band.fade_deg
    if above is not None:
        none, full = portable.tan(np.radians([max(above - width, 0.0), above]))
        weight *= fade(-rise, -full, -none)
    if below is not None:
        weight *= fade(rise, *portable.tan(np.radians([below, min(below + width, 89.9)])))
    return weight


def _between(place: Array, count: int) -> tuple[NDArray[np.int64], Array]:
    """The sample before each place and the part of the way to the next one."""
    before = np.clip(np.floor(place), 0, max(count - 2, 0)).astype(np.int64)
    return before, np.clip(place - before, 0.0, 1.0)


def _require_band(low: float | None, high: float | None, names: tuple[str, str]) -> None:
    if low is None and high is None:
        raise ValueError(f"{names[0]} or {names[1]} is needed")
    if low is not None and high is not None and low > high:
        raise ValueError(f"{names[0]} {low:g} lies over {names[1]} {high:g}")


def require_shape(rows: int, columns: int, name: str, site: Site, key: Key) -> None:
    """Refuse a picture that covers the site, if its shape is another.

    Raises:
        DataError: for one that is off by more than a pixel.
    """
    east, north = site.size
    # Whether pixels end or have their centres on the edges is within a pixel of tolerance.
    if abs(columns * north - rows * east) > max(east, north):
        fitting = max(round(columns * north / east), 1)
        raise DataError(
            f"{name} has {columns} × {rows} pixels for a site of {east:g} × {north:g} m, whose "
            f"shape would be {columns} × {fitting}",
            key=key,
        )


def _check_image(values: Array, name: str, site: Site, key: Key) -> None:
    rows, columns = values.shape
    require_shape(rows, columns, name, site, key)
    least, most = float(values.min()), float(values.max())
    if least < 0.0 or most > 1.0:
        raise DataError(
            f"{name} holds values from {least:g} to {most:g}, allowed: 0 (without the layer) to 1",
            key=key,
        )
