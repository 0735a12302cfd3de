"""What is wrong with a DTM, and its repair: filled facets, seams, stripes, holes, stairs."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, Mask, portable
from terrain_forge.dtm.squares import in_squares

FILL_METHOD = "inverse-distance interpolation from the rim (GDAL FillNodata)"

_WIDTHS = (24.0, 12.0, 6.0, 3.0, 1.5)  # of the Gaussians that find the way, coarse to fine [posts]
_ROUNDS = 8
_POLISH = 300
_SEAM_CONTRAST = 8.0  # times the usual mean step
_SEAM_COHERENCE = 0.75  # of the steps along a seam go the same way
_LARGEST = 32.0  # of the usual step, that one step counts
_STRIPED = 0.4  # rank correlation of the steps in parts of a DTM that do not touch
_SMOOTH = 0.5  # correlation of the steps before neighbouring columns
_FEWEST_LINES, _FEWEST_LONG = 48, 64
_STRIP = 256  # rows that are looked at between samples at once


@dataclass(frozen=True, kw_only=True)
class Quality:
    """Defects of a piece of a DTM."""

    planar_fraction: float
    """Part of the posts that lie in exact planes, as triangles that fill gaps do, 0 to 1."""
    seams: tuple[tuple[str, int, float], ...]
    """Lines across which the ground breaks: row or column, its number, the mean step [m]."""
    stripes: tuple[tuple[str, float], ...]
    """Whether columns or rows differ in height all along: which, and their steps' RMS [m]."""
    difference: float
    """RMS difference of neighbouring posts [m] before heights were rounded; 0 where there is none.
    It is that of normal ones with the same mean size, which rounding leaves as it is."""
    spike: tuple[float, int, int]
    """How far a single post stands above all its neighbours, or below them, at most [m], and the
    row and column of it."""


def assess(heights: Array, valid: Mask, *, quantum: float | None) -> Quality:
    """Look for planar fill, for seams and for stripes.

    Args:
        heights: a piece of a DTM [m], at least 8 × 8 posts.
        valid: its samples that are no holes.
        quantum: height step of an integer DTM [m]; its stairs are no facets.
    """
    planar = np.zeros(heights.shape, bool) if quantum else planar_posts(heights) & valid
    seams, stripes = [], []
    for name, z, known in (("column", heights, valid), ("row", heights.T, valid.T)):
        excess, whole = _excess_steps(z, known)
        seams += _seams(excess, whole, name)
        if (step := _stripes(excess, whole)) > 0.0:
            stripes.append((name, step))
    return Quality(
        planar_fraction=float(planar.sum() / max(valid.sum(), 1)),
        seams=tuple(seams),
        stripes=tuple(stripes),
        difference=_difference(heights, valid),
        spike=_spike(heights, valid),
    )


def _difference(heights: Array, valid: Mask) -> float:
    sizes = np.concatenate(
        [
            np.abs(np.diff(heights, axis=0))[valid[1:] & valid[:-1]],
            np.abs(np.diff(heights, axis=1))[valid[:, 1:] & valid[:, :-1]],
        ]
    )
    return math.sqrt(0.5 * math.pi) * float(sizes.mean()) if sizes.size else 0.0


def _spike(heights: Array, valid: Mask) -> tuple[float, int, int]:
    from scipy.ndimage import maximum_filter, minimum_filter

    around = np.ones((3, 3), np.bool_)
    around[1, 1] = False
    known = minimum_filter(valid, size=3, mode="constant")
    z = np.where(valid, heights, 0.0)
    above = z - maximum_filter(z, footprint=around)
    below = minimum_filter(z, footprint=around) - z
    away = np.where(known, np.maximum(above, below), 0.0)
    row, column = np.unravel_index(int(np.argmax(away)), away.shape)
    return float(max(away[row, column], 0.0)), int(row), int(column)


def planar_posts(heights: Array) -> Mask:
    """Posts in the middle of 5 × 5 posts that lie in one plane, as exactly as float32 can tell."""
    tolerance = 4.0 * float(np.spacing(np.float32(np.abs(heights).max())))
    return in_squares(partial(_planar, tolerance=tolerance), heights, margin=2)


def _planar(heights: Array, *, tolerance: float) -> Mask:
    flat = np.zeros(heights.shape, bool)
    if min(heights.shape) < 3:
        return flat
    z = heights
    east = np.abs(z[1:-1, 2:] - 2 * z[1:-1, 1:-1] + z[1:-1, :-2])
    north = np.abs(z[2:, 1:-1] - 2 * z[1:-1, 1:-1] + z[:-2, 1:-1])
    twist = np.abs(z[2:, 2:] - z[2:, :-2] - z[:-2, 2:] + z[:-2, :-2])
    flat[1:-1, 1:-1] = np.maximum(np.maximum(east, north), twist) <= tolerance
    whole = flat[:-2] & flat[1:-1] & flat[2:]
    middle = np.zeros_like(flat)
    middle[1:-1, 1:-1] = whole[:, :-2] & whole[:, 1:-1] & whole[:, 2:]
    return middle


def _excess_steps(heights: Array, valid: Mask) -> tuple[Array, Mask]:
    """Steps between columns [m] that the slopes on either side do not explain; where all is valid.

    Their sign is kept, so that rough ground averages out.
    """
    step = heights[:, 1:] - heights[:, :-1]
    known = valid[:, 3:] & valid[:, 2:-1] & valid[:, 1:-2] & valid[:, :-3]
    return np.where(known, step[:, 1:-1] - 0.5 * (step[:, :-2] + step[:, 2:]), 0.0), known


def _seams(excess: Array, known: Mask, name: str) -> list[tuple[str, int, float]]:
    """Columns before which the heights step, on the whole, far more than before others.

    No single step counts more than `_LARGEST` usual ones: a spike is no seam.
    """
    count = np.maximum(known.sum(axis=0), 1)
    size = excess.sum(axis=0) / count
    most = _LARGEST * float(np.median(np.abs(excess[known]))) if known.any() else 0.0
    if most > 0.0:
        excess = np.clip(excess, -most, most)
    mean, spread = excess.sum(axis=0) / count, np.abs(excess).sum(axis=0) / count
    usual = float(np.median(np.abs(mean)) / 0.6745)
    enough = (known.sum(axis=0) > 0.5 * len(excess)) & (np.abs(mean) > _SEAM_COHERENCE * spread)
    peak = np.abs(mean) >= np.maximum(np.abs(np.roll(mean, 1)), np.abs(np.roll(mean, -1)))
    found = np.flatnonzero(enough & peak & (np.abs(mean) > _SEAM_CONTRAST * usual) & (usual > 0))
    return [(name, int(n) + 2, float(size[n])) for n in found]


def _stripes(excess: Array, known: Mask) -> float:
    """RMS of the steps between columns [m] that all of a DTM's length has; 0 where it has none.

    Means over its four quarters are compared: those of ground do not agree where the quarters do
    not touch, by 0.15 at most in the DTMs that this was tried on. Ranks, since a seam is no stripe.
    """
    quarters = np.array_split(np.arange(len(excess)), 4)
    if min(map(len, quarters)) < _FEWEST_LONG // 4:
        return 0.0
    count = np.stack([known[rows].sum(axis=0) for rows in quarters])
    enough = (count > 0.5 * min(map(len, quarters))).all(axis=0)
    mean = np.stack([excess[rows].sum(axis=0) for rows in quarters])[:, enough] / count[:, enough]
    if enough.sum() < _FEWEST_LINES or not np.ptp(mean, axis=1).all():
        return 0.0
    ranks = mean.argsort(axis=1).argsort(axis=1) / enough.sum()
    alike = np.corrcoef(ranks)
    whole = mean.mean(axis=0)
    smooth = np.corrcoef(whole[1:], whole[:-1])[0, 1] > _SMOOTH  # a ridge, a valley
    if smooth or min(alike[0, 2], alike[1, 3], alike[0, 3]) < _STRIPED:
        return 0.0
    return float(np.sqrt(max((mean[0] * mean[2]).mean(), 0.0)))


def farthest_filled(valid: Mask, inside: tuple[NDArray[np.intp], ...]) -> tuple[int, float, float]:
    """Width [samples] of the widest hole of a site, and row and column of its middle.

    It is the number of samples across the largest circle that holds no valid one and whose middle,
    a sample or half way between two, lies on the site.

    Args:
        valid: samples that are no holes, of the site and around it.
        inside: index of the site's samples.
    """
    from scipy.ndimage import distance_transform_edt

    away = distance_transform_edt(~valid)
    reach, (rows, columns) = math.ceil(away[inside].max()) + 1, (axis.ravel() for axis in inside)
    found, first, last = (0.0, 0.0, 0.0), int(rows.min()), int(rows.max())
    for row in range(first, last + 1, _STRIP):
        end = min(row + _STRIP, last + 1)
        if away[row:end, columns].max() <= reach - 3.0:
            continue
        low = max(row - reach, 0)
        part = valid[low : end + reach]
        known = np.zeros((2 * part.shape[0] - 1, 2 * part.shape[1] - 1), np.bool_)
        known[::2, ::2] = part  # and what lies half way between
        halves = distance_transform_edt(~known)
        halves = halves[2 * (row - low) : 2 * (min(end, last) - low) + 1]
        halves = halves[:, 2 * columns.min() : 2 * columns.max() + 1]
        n, m = np.unravel_index(int(np.argmax(halves)), halves.shape)
        place = row + 0.5 * float(n), float(columns.min()) + 0.5 * float(m)
        found = max(found, (float(halves[n, m]), *place), key=lambda one: one[0])
    return math.floor(found[0] - 1.0), found[1], found[2]


def fill_holes(heights: Array, valid: Mask) -> Array:
    """Heights whose holes are filled by `FILL_METHOD`; valid ones keep their bits."""
    if valid.all():
        return heights
    from rasterio.fill import fillnodata

    middle = np.median(heights[valid])  # keeps float32 precise inside GDAL
    relative = np.where(valid, heights - middle, 0.0).astype(np.float32)
    filled = fillnodata(relative, mask=valid, max_search_distance=float(max(heights.shape)))
    return np.where(valid, heights, filled + middle)


def destair(heights: Array, quantum: float) -> Array:
    """The smoothest ground whose heights all round to the given integer ones.

    Each height stays within half a quantum. Gaussians from wide to narrow find the way across the
    treads, then steps down the bending energy ½·Σ(∇²z)² polish it; after each step the heights are
    put back between their bounds, so that the result is always feasible.

    Args:
        heights: multiples of the quantum, shifted [m].
        quantum: height step of one unit [m].
    """
    from scipy.ndimage import laplace

    low, high = heights - 0.5 * quantum, heights + 0.5 * quantum
    smooth = heights
    for width in _WIDTHS:
        for _ in range(_ROUNDS):
            smooth = np.clip(portable.smoothed(smooth, width, mode="nearest"), low, high)
    for _ in range(_POLISH):
        bending = laplace(laplace(smooth, mode="nearest"), mode="nearest")
        smooth = np.clip(smooth - bending / 64.0, low, high)
    return np.asarray(smooth)
