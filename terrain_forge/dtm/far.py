"""Heights far around a site: the raster read in windows that double, each coarser than the last."""

from __future__ import annotations

from math import ceil, floor
from pathlib import PurePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, DataError, Mask, portable
from terrain_forge.dtm.lattice import Georeferenced, patch_pixels
from terrain_forge.dtm.quality import fill_holes
from terrain_forge.dtm.raster import Raster
from terrain_forge.dtm.reading import placed
from terrain_forge.model import FarHeights, Site

_POSTS = 128
"""Samples along the longer side of a window."""
_FEWEST = 8
"""Samples that a window has at least, each way."""
_FADE = 12
"""Samples over which heights fade out at a window's border, and beyond what is measured; a quarter
of a smaller window."""
_AVERAGED = 2**20
"""Samples of a window up to which all are read and averaged; of more, each so manieth is read."""
_MOST = 2**24
"""Samples that may have to be decoded for a window."""
_EDGE = 8.0
"""Samples over which a window fades into the next one."""
_DISTANCES, _HALVINGS = 33, 6
"""Distances from a border at which it is looked whether heights go on, and how often the step in
which they end is halved."""
_SIDE = np.linspace(-1.0, 1.0, 65)
_AROUND = np.stack(
    [np.concatenate([_SIDE, _SIDE, 0.0 * _SIDE - 1.0, 0.0 * _SIDE + 1.0]),
     np.concatenate([0.0 * _SIDE - 1.0, 0.0 * _SIDE + 1.0, _SIDE, _SIDE])]
)  # fmt: skip
"""East and north of points around a square of side 2."""
_EYE = 50.0
"""Height above the site's middle from which the horizon is looked for [m]."""


def read_surroundings(
    raster: Raster,
    *,
    source: str,
    crs: str,
    to_pixel: tuple[float, ...],
    size: tuple[float, float],
    reach: float | None,
    followed: bool = False,
) -> tuple[FarHeights, ...]:
    """The heights around a site, out to where nothing can be seen any more or the raster ends.

    Args:
        raster: The open raster.
        source: Its name.
        crs: The site's local CRS.
        to_pixel: From the raster's coordinates to its samples, for this site.
        size: The site's, east and north [m].
        reach: How far is asked for from the site's border [m]; None for the horizon.
        followed: Whether another terrain model goes on where this one ends, so that its own heights
            fade out before its end and not beyond it.
    """
    levels: list[FarHeights] = []
    half, radius = _first(raster, crs, to_pixel, max(size)), raster.body.mean_radius
    while True:
        found = _level(raster, source, crs, to_pixel, half, followed=followed)
        if found is None:
            break
        level, whole = found
        levels.append(level)
        middle = float(levels[0].heights[tuple(n // 2 for n in levels[0].heights.shape)])
        rise = max(float(some.heights.max()) for some in levels) - middle
        above = _EYE + max(middle - level.mean, 0.0)
        seen = np.sqrt(2.0 * radius) * (np.sqrt(above) + np.sqrt(max(rise, 0.0)))
        if whole or half >= (seen if reach is None else reach + 0.5 * max(size)):
            break
        half *= 2.0
    return tuple(levels)


def _first(raster: Raster, crs: str, to_pixel: tuple[float, ...], half: float) -> float:
    """Half the side [m] of the smallest window that has samples enough, from a half side on."""
    whole = placed(raster, crs, to_pixel)

    def samples(half: float) -> float:
        return max(float(np.ptp(index)) for index in _pixels(whole, crs, half))

    have = max(samples(half), 1e-9)
    if not np.isfinite(have):
        return half
    wanted = min(_POSTS, min(raster.shape) // 2)
    found = half * 2.0 ** max(ceil(float(portable.log2(wanted / have))), 0)
    # Where meridians converge a wider window has more than that: then none of its samples is left.
    while found > half and not samples(found) < 2.0 * _POSTS:
        found *= 0.5
    return found


def _pixels(whole: Georeferenced, crs: str, half: float) -> tuple[Array, Array]:
    """Columns and rows of points all over a window of half a side [m]; not finite at a pole."""
    steps = np.linspace(-half, half, 9)
    return patch_pixels(whole, crs, *np.meshgrid(steps, steps))


def _level(
    raster: Raster,
    source: str,
    crs: str,
    to_pixel: tuple[float, ...],
    half: float,
    *,
    followed: bool,
) -> tuple[FarHeights, bool] | None:
    """A window of that half side, and whether the raster ends in it; None where nothing is had.

    Where the raster ends, its border's heights go on for the samples in which they fade out, unless
    it is followed by another.
    """
    whole = placed(raster, crs, to_pixel)
    column, row = _pixels(whole, crs, half)
    if not (np.isfinite(column).all() and np.isfinite(row).all()):
        return None
    wide, high = np.ptp(column), np.ptp(row)
    if raster.goes_round and wide > 0.5 * raster.shape[1]:
        return None  # a pole lies within: there are no samples across it
    # Each axis by itself: a window near a pole has many columns and few rows.
    steps = tall, broad = max(int(high / _POSTS), 1), max(int(wide / _POSTS), 1)
    top, down, *above = _span(row, raster.shape[0], tall)
    left, across, *beside = _span(column, raster.shape[1], broad, goes_round=raster.goes_round)
    if min(down, across) < _FEWEST:
        return None
    read = _read(raster, slice(top, top + down * tall), slice(left, left + across * broad), steps)
    if read is None:
        return None
    heights, known = read
    if known.mean() < 0.1:
        return None
    most = 0 if followed else _FADE
    more = [min(n, most) for n in above], [min(n, most) for n in beside]
    valid = np.pad(known, more)
    heights = np.pad(fill_holes(heights, known), more, mode="edge")
    a, b, c, d, e, f = to_pixel
    part = max(tall / float(high), broad / float(wide))  # of the window from sample to sample
    level = FarHeights(
        heights=heights.astype(np.float32),
        weight=_weight(valid, followed=followed).astype(np.float32),
        to_pixel=(
            a / broad, b / broad, (c - left - 0.5 * (broad - 1)) / broad + more[1][0],
            d / tall, e / tall, (f - top - 0.5 * (tall - 1)) / tall + more[0][0],
        ),
        crs=raster.crs,
        wrap=whole.wrap,
        reach=half,
        posting=2.0 * half * part,
        source=PurePath(source).name,
    )  # fmt: skip
    faded = 2.0 * min(_FADE * part, 0.25)
    column, row = patch_pixels(whole, crs, *((1.0 - faded) * half * _AROUND))
    rows, columns = raster.shape
    on = (row >= 0.0) & (row <= rows - 1) & (column >= 0.0) & (column <= columns - 1)
    return level, not (raster.goes_round or on.any())


def _span(
    places: Array, length: int, step: int, *, goes_round: bool = False
) -> tuple[int, int, int, int]:
    """First sample and number of steps that lie within the raster, or once around the body.

    Then how many steps the window goes on before and after them.
    """
    first, last = floor(float(places.min())), ceil(float(places.max())) + 1
    if goes_round:
        return first, (min(last, first + length) - first) // step, 0, 0
    begin, end = max(first, 0), min(last, length)
    count = max((end - begin) // step, 0)
    return begin, count, (begin - first) // step, max(last - begin - count * step, 0) // step


def _read(
    raster: Raster, rows: slice, columns: slice, steps: tuple[int, int]
) -> tuple[Array, Mask] | None:
    """Heights [m] of blocks of so many samples down and across, and which are measured."""
    from rasterio.windows import Window

    tall, broad = steps
    shape = (rows.stop - rows.start) // tall, (columns.stop - columns.start) // broad
    dataset, band, pieces = raster.dataset, raster.band, raster.pieces(columns)
    needed = shape[0] * shape[1] * tall * broad
    if needed <= _AVERAGED or (len(pieces) > 1 and needed <= _MOST):
        windows = [Window.from_slices(rows, piece) for piece in pieces]
        read = [dataset.read(band, window=window) for window in windows]
        masks = [dataset.read_masks(band, window=window) for window in windows]
        values = np.concatenate(read, axis=1).astype(np.float64)
        valid = raster.valid(values, np.concatenate(masks, axis=1))
        blocks = (shape[0], tall, shape[1], broad)
        count = valid.reshape(blocks).sum(axis=(1, 3))
        total = np.where(valid, values, 0.0).reshape(blocks).sum(axis=(1, 3))
        known = 2 * count > tall * broad
        values = np.where(known, total / np.maximum(count, 1), 0.0)
    else:
        if len(pieces) > 1 or _decoded(dataset, band, rows, columns, steps) > _MOST:
            return None
        window = Window.from_slices(rows, columns)
        values = dataset.read(band, window=window, out_shape=shape).astype(np.float64)
        known = raster.valid(values, dataset.read_masks(band, window=window, out_shape=shape))
    rise = _datum_rise(raster, rows.start, columns.start, shape, steps)
    return np.where(known, raster.heights(values) - rise, 0.0), known


def _decoded(dataset: Any, band: int, rows: slice, columns: slice, steps: tuple[int, int]) -> float:
    """Samples that are decoded to read every so manieth one; overviews are read if there are."""
    tall, broad = steps
    overviews = [factor for factor in dataset.overviews(band) if factor <= min(steps)]
    finer = max(overviews, default=1)
    down, across = dataset.block_shapes[band - 1]
    high, wide = (rows.stop - rows.start) / finer, (columns.stop - columns.start) / finer
    down_left, across_left = max(tall // finer, 1), max(broad // finer, 1)
    blocks = ceil(high / max(down, down_left)) * ceil(wide / max(across, across_left))
    return float(blocks * down * across)


def _datum_rise(
    raster: Raster, top: int, left: int, shape: tuple[int, int], steps: tuple[int, int]
) -> Array | float:
    """Radius of the ellipsoid at each sample above that at the raster's middle [m], for radii."""
    if raster.is_round:
        return 0.0
    rows, columns = (
        np.arange(n) * step + 0.5 * (step - 1) for n, step in zip(shape, steps, strict=True)
    )
    return raster.datum_rise_at(columns + left, rows + top)


def _weight(valid: Mask, *, followed: bool) -> Array:
    """1 where heights are measured, fading to 0 beyond that and towards the window's border.

    Where another terrain model follows, they fade before what is not measured around the raster.
    """
    from scipy.ndimage import binary_fill_holes, distance_transform_edt

    across = min(_FADE, 0.25 * min(valid.shape))
    row, column = (np.minimum(np.arange(n), np.arange(n)[::-1]) for n in valid.shape)
    inside = np.minimum(row[:, None], column[None, :])
    if followed and not valid.all():
        inside = np.minimum(inside, distance_transform_edt(binary_fill_holes(valid)))
    beyond = distance_transform_edt(~valid)
    part = np.clip(np.minimum(inside, across - beyond) / across, 0.0, 1.0)
    return np.asarray(part * part * (3.0 - 2.0 * part))


def heights_at(level: FarHeights, crs: str, east: Array, north: Array) -> Array:
    """Heights above the datum [m] at points of the site [m]."""
    return _between(level.heights, *patch_pixels(level, crs, east, north))


def weights_at(level: FarHeights, crs: str, east: Array, north: Array) -> Array:
    """How far those heights are to be followed, 0 to 1."""
    return _between(level.weight, *patch_pixels(level, crs, east, north))


def far_heights(site: Site, east: Array, north: Array) -> tuple[Array, Array]:
    """Heights above the datum [m] at points beyond a site, and how far they are to be followed.

    The finest heights that there are count; each fades into the next coarser ones.

    Args:
        site: The site.
        east: Of the points [m], shape [points].
        north: Of the points [m], shape [points].
    """
    height, weight = np.zeros(len(east)), np.zeros(len(east))
    off = np.maximum(np.abs(east), np.abs(north))

    def follow(
        raster: Georeferenced, values: NDArray[Any], shares: NDArray[Any] | None, reach: float
    ) -> None:
        chosen = np.flatnonzero((weight < 1.0) & (off <= reach))
        if not len(chosen):
            return
        column, row = patch_pixels(raster, site.crs, east[chosen], north[chosen])
        if shares is None:
            rows, columns = values.shape
            inside = np.minimum(
                np.minimum(column, columns - 1 - column), np.minimum(row, rows - 1 - row)
            )
            part = np.clip(inside / _EDGE, 0.0, 1.0)
        else:
            part = _between(shares, column, row)
        part *= 1.0 - weight[chosen]
        height[chosen] += part * _between(values, column, row)
        weight[chosen] += part

    if site.dtm is not None:
        patch = site.dtm
        follow(patch, patch.heights, None, 0.75 * max(patch.heights.shape) * patch.posting)
    for level in site.surroundings:
        follow(level, level.heights, level.weight, level.reach)
    return height / np.where(weight > 0.0, weight, 1.0), weight


def followed_to(site: Site) -> float:
    """How far from a site's border heights are told for the most part of the way round [m].

    No farther than the recipe's horizon is to reach.
    """
    reach = max((level.reach for level in site.surroundings), default=0.0)
    reach = min(reach, site.recipe.horizon.reach_m or reach)
    east, north = 0.5 * site.size[0], 0.5 * site.size[1]

    def is_told(away: float) -> bool:
        around = ((east + away) * _AROUND[0], (north + away) * _AROUND[1])
        return bool(np.mean(far_heights(site, *around)[1] > 0.99) > 0.5)

    if not reach:
        return 0.0
    distances = portable.geomspace(min(1.0, reach), reach, _DISTANCES).tolist()
    told = max(filter(is_told, distances), default=0.0)
    beyond = min((away for away in distances if away > told), default=told)
    for _ in range(_HALVINGS):
        middle = 0.5 * (told + beyond)
        told, beyond = (middle, beyond) if is_told(middle) else (told, middle)
    return told


def _between(values: NDArray[Any], column: Array, row: Array) -> Array:
    """Bilinear values of a grid; its edge goes on beyond it."""
    rows, columns = values.shape
    column, row = np.clip(column, 0.0, columns - 1.0), np.clip(row, 0.0, rows - 1.0)
    i = np.minimum(column.astype(np.int64), columns - 2)
    j = np.minimum(row.astype(np.int64), rows - 2)
    u, v = column - i, row - j
    south = values[j, i] * (1.0 - u) + values[j, i + 1] * u
    north = values[j + 1, i] * (1.0 - u) + values[j + 1, i + 1] * u
    return np.asarray(south * (1.0 - v) + north * v, np.float64)


def require_coarser(raster: Raster, name: str) -> None:
    """Refuse a second terrain model that cannot say where it lies or what its numbers are.

    Raises:
        DataError: what is missing.
    """
    if not raster.crs or not raster.vertical.known:
        missing = "georeference" if not raster.crs else "vertical scale"
        raise DataError(
            f"{name} has no {missing}: a terrain model for the horizon needs a georeference and a "
            "vertical scale",
            key=("horizon", "dtm"),
        )
