"""Where the nodes of the site's lattice lie among the pixels of its DTM, and the reverse."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, DataError, inner, portable
from terrain_forge.dtm.projection import pole_distance, transform
from terrain_forge.model import DtmPatch

if TYPE_CHECKING:
    from terrain_forge.model import Site, Window


ANCHOR_CELLS = 32
"""Nodes between the anchors at which the projection is computed exactly. Between them it is
linear: at 0.25 m, off by less than (8 m)²/(8 R), a hundred-thousandth of a millimetre of ground; R
is the body's radius, or in a map of longitudes the distance to the pole."""

_OFF = 0.1
"""Part of a posting that nodes may lie off between anchors."""


class Georeferenced(Protocol):
    """A raster whose place is known; the fields are those of `DtmPatch`."""

    @property
    def to_pixel(self) -> tuple[float, ...]:
        """Affine from source coordinates to sample indices."""

    @property
    def crs(self) -> str:
        """WKT of the source's CRS; empty where its coordinates are the site's own metres."""

    @property
    def wrap(self) -> tuple[float, float]:
        """Period of x where a meridian has several x, and the x around which they are."""


@dataclass(frozen=True, kw_only=True)
class Nodes:
    """A rectangle of the site's lattice, or of each n-th node of it, also beyond the site."""

    column: int
    """First column, in strides from the site's western edge."""
    row: int
    """First row, in strides from the site's southern edge."""
    columns: int
    """Columns of nodes."""
    rows: int
    """Rows of nodes."""
    stride: int = 1
    """Lattice cells between the nodes."""

    @classmethod
    def of(cls, window: Window) -> Nodes:
        """The nodes of a window."""
        columns, rows = window.columns + 1, window.rows + 1
        return cls(column=window.column, row=window.row, columns=columns, rows=rows)

    def cut(self, values: Array, part: Nodes) -> Array:
        """A copy of the values of those of these nodes that are in `part`, of the same stride."""
        south, west = part.row - self.row, part.column - self.column
        return values[south : south + part.rows, west : west + part.columns].copy()

    def axes(self, site: Site) -> tuple[Array, Array]:
        """East coordinates of the columns and north ones of the rows [m]; bits as `Site.axes`."""
        columns = (self.column + np.arange(self.columns, dtype=np.float64)) * self.stride
        rows = (self.row + np.arange(self.rows, dtype=np.float64)) * self.stride
        return site.west + columns * site.spacing, site.south + rows * site.spacing


class Posts(NamedTuple):
    """A rectangle of a DTM's posts."""

    rows: slice
    columns: slice


class Places(NamedTuple):
    """Fractional pixel columns and rows of nodes: exact at anchors, linear between them."""

    anchors: Array
    """Column and row of the anchors, shape [2, rows, columns]."""
    column_index: NDArray[np.int64]
    """Western anchor of each column of nodes."""
    column_part: Array
    """How far each column of nodes lies from its western anchor to the next, 0 to 1."""
    row_index: NDArray[np.int64]
    """Southern anchor of each row of nodes."""
    row_part: Array
    """How far each row of nodes lies from its southern anchor to the next, 0 to 1."""

    def grid(self) -> tuple[Array, Array]:
        """Pixel column and row of each node, shape [rows, columns]."""
        columns, rows = (self.column_index, self.column_part), (self.row_index, self.row_part)
        column, row = (bilinear(values, columns, rows) for values in self.anchors)
        return column, row

    def posts(self, shape: tuple[int, ...]) -> Posts:
        """The posts of a patch of that shape that the nodes lie between, two at least each way."""
        columns, rows = (
            slice(
                min(max(int(np.floor(index.min())) - 1, 0), most - 2),
                max(min(int(np.ceil(index.max())) + 2, most), 2),
            )
            for index, most in zip(self.anchors, shape[::-1], strict=True)
        )
        return Posts(rows, columns)


@inner
def pixel_of(places, j, i):  # type: ignore[no-untyped-def]
    """Fractional pixel column and row of the node in row j and column i, for kernels."""
    c, u, r, v = (
        places.column_index[i],
        places.column_part[i],
        places.row_index[j],
        places.row_part[j],
    )
    w00, w01, w10, w11 = (1 - v) * (1 - u), (1 - v) * u, v * (1 - u), v * u
    column = w00 * places.anchors[0, r, c] + w01 * places.anchors[0, r, c + 1]
    column += w10 * places.anchors[0, r + 1, c] + w11 * places.anchors[0, r + 1, c + 1]
    row = w00 * places.anchors[1, r, c] + w01 * places.anchors[1, r, c + 1]
    row += w10 * places.anchors[1, r + 1, c] + w11 * places.anchors[1, r + 1, c + 1]
    return column, row


Steps = tuple[NDArray[np.int64], Array]
"""The sample before each of some places along an axis, and the part of the way to the next one."""


def bilinear(values: Array, columns: Steps, rows: Steps) -> Array:
    """Values between the samples of a grid, shape [rows, columns]; its edge goes on beyond it."""
    (i, u), (j, v) = columns, rows
    right, above = (
        np.minimum(n + 1, size - 1) for n, size in ((i, values.shape[1]), (j, len(values)))
    )
    line = values[:, i] * (1.0 - u) + values[:, right] * u
    result: Array = line[j] * (1.0 - v)[:, None] + line[above] * v[:, None]
    return result


def node_places(site: Site, nodes: Nodes, raster: Georeferenced | None = None) -> Places:
    """Where nodes lie in a raster, by default the site's DTM.

    A node has the same bits in every rectangle.
    """
    raster = raster or site.dtm
    assert raster is not None
    columns, across = anchors(nodes.column, nodes.columns, ANCHOR_CELLS)
    rows, down = anchors(nodes.row, nodes.rows, ANCHOR_CELLS)
    east = site.west + columns * nodes.stride * site.spacing
    north = site.south + rows * nodes.stride * site.spacing
    exact = patch_pixels(raster, site.crs, *np.meshgrid(east, north))
    return Places(np.stack(exact), *across, *down)


def require_straight(site: Site) -> None:
    """Refuse a site so near to a pole that its DTM's meridians bend between anchors.

    Raises:
        DataError: tells the distance that is needed.
    """
    if site.dtm is None or not site.dtm.wrap[0]:
        return
    away = pole_distance(site.crs, site.size)
    needed = (ANCHOR_CELLS * site.spacing) ** 2 / (8.0 * _OFF * site.dtm.posting)
    if away < needed:
        raise DataError(
            f"the site lies {away:.3g} m from a pole, and a DTM that is a map of longitudes is "
            f"bent there: at this spacing it needs {needed:.3g} m; take a polar product",
            key=("dtm", "centre"),
        )


def anchors(first: int, count: int, every: int) -> tuple[Array, Steps]:
    """Every so manieth number around some along an axis, and how those lie between them."""
    numbers = first + np.arange(count, dtype=np.int64)
    start, stop = first // every, (first + count - 1) // every + 2
    found = np.arange(start, stop, dtype=np.float64) * every
    return found, (numbers // every - start, (numbers % every) / every)


def patch_pixels(
    patch: Georeferenced, local_crs: str, east: Array, north: Array
) -> tuple[Array, Array]:
    """Fractional column and row of the patch under points of the site [m]."""
    a, b, c, d, e, f = patch.to_pixel
    if patch.crs:
        x, y = transform(local_crs, patch.crs, east, north)
    else:
        x, y = east, north
    period, middle = patch.wrap
    if period:
        x = x + period * np.round((middle - x) / period)
    return a * x + b * y + c, d * x + e * y + f


def patch_points(patch: DtmPatch, local_crs: str, column: Array, row: Array) -> tuple[Array, Array]:
    """Points of the site [m] at fractional columns and rows of the patch."""
    a, b, c, d, e, f = patch.to_pixel
    (p, q), (r, s) = portable.inverse([[a, b], [d, e]])
    x, y = p * (column - c) + q * (row - f), r * (column - c) + s * (row - f)
    return transform(patch.crs, local_crs, x, y) if patch.crs else (x, y)


@dataclass(frozen=True, kw_only=True)
class PixelFrame:
    """How the lattice lies in the DTM at the site's centre; it hardly turns over a site."""

    per_metre: tuple[tuple[float, float], tuple[float, float]]
    """Pixel columns, then rows, for each metre east and north."""

    @classmethod
    def of(cls, site: Site) -> PixelFrame:
        """The frame of a site that has a DTM."""
        assert site.dtm is not None
        return cls.at(site.dtm, site.crs, 0.5 * site.dtm.posting)

    @classmethod
    def at(cls, raster: Georeferenced, crs: str, step: float) -> PixelFrame:
        """The frame of a raster, by points so far from the centre of a site's local CRS [m]."""
        east, north = np.array([-step, step, 0.0, 0.0]), np.array([0.0, 0.0, -step, step])
        column, row = patch_pixels(raster, crs, east, north)
        across, down = (
            (float(n[1] - n[0]) / (2 * step), float(n[3] - n[2]) / (2 * step))
            for n in (column, row)
        )
        return cls(per_metre=(across, down))

    def extent(self, length: float) -> tuple[float, float]:
        """Extent along columns and rows of a square of that side [pixels]."""
        across, down = self.per_metre
        return float(np.hypot(*across)) * length, float(np.hypot(*down)) * length
