"""Rectangles of the DTM's pixels under a site: where they lie, and means over them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from terrain_forge.base import Array, kernel, over_chunks, portable
from terrain_forge.dtm.lattice import (
    Nodes,
    PixelFrame,
    anchors,
    bilinear,
    node_places,
    patch_points,
)
from terrain_forge.model import Site

_ANCHOR_PIXELS = 8


@dataclass(frozen=True, kw_only=True)
class Pixels:
    """A rectangle of the DTM's pixels, which may reach beyond the patch."""

    column: int
    """First column, counted as in the patch."""
    row: int
    """First row, counted as in the patch."""
    columns: int
    """Columns of pixels."""
    rows: int
    """Rows of pixels."""

    @classmethod
    def under(cls, site: Site, nodes: Nodes, margin: int) -> Pixels:
        """All pixels that hold nodes, and some around them."""
        exact = node_places(site, nodes).anchors
        low = np.floor(exact.min(axis=(1, 2))).astype(int) - margin
        high = np.ceil(exact.max(axis=(1, 2))).astype(int) + margin
        return cls(
            column=int(low[0]),
            row=int(low[1]),
            columns=int(high[0] - low[0]) + 1,
            rows=int(high[1] - low[1]) + 1,
        )

    def centres(self, site: Site) -> Array:
        """East and north of the pixels' centres [m], shape [2, rows, columns].

        Exact at every eighth pixel, linear between.
        """
        assert site.dtm is not None
        columns, across = anchors(self.column, self.columns, _ANCHOR_PIXELS)
        rows, down = anchors(self.row, self.rows, _ANCHOR_PIXELS)
        exact = patch_points(site.dtm, site.crs, *np.meshgrid(columns, rows))
        return np.stack([bilinear(values, across, down) for values in exact])

    def nodes(self, site: Site, stride: int) -> Nodes:
        """The nodes over all these pixels."""
        assert site.dtm is not None
        east, north = self.centres(site)
        reach = site.dtm.posting + stride * site.spacing
        step = stride * site.spacing
        column = int(np.floor((east.min() - reach - site.west) / step))
        row = int(np.floor((north.min() - reach - site.south) / step))
        columns = int(np.ceil((east.max() + reach - site.west) / step)) - column + 1
        rows = int(np.ceil((north.max() + reach - site.south) / step)) - row + 1
        return Nodes(column=column, row=row, columns=columns, rows=rows, stride=stride)

    def means(self, site: Site, nodes: Nodes, samples: Array) -> Array:
        """Mean of the samples over each pixel, by the parts of their cells that lie in it.

        NaN where there are none.
        """
        frame, step = PixelFrame.of(site), nodes.stride * site.spacing
        east, north = self.centres(site)
        lattice = np.stack(
            [(east - site.west) / step - nodes.column, (north - site.south) / step - nodes.row]
        )
        means = np.empty((self.rows, self.columns))
        per_step = np.array(frame.per_metre) * step
        over_chunks(
            _average, len(means), samples, lattice, per_step, portable.inverse(per_step),
            np.array(frame.extent(step)), means,
        )  # fmt: skip
        return means


@kernel
def _average(first, last, samples, lattice, per_step, inverse, cell, means):  # type: ignore[no-untyped-def]
    """Means over pixels; a node counts by the part of its cell within the pixel."""
    rows, columns = samples.shape
    reach_column = 0.5 * (1.0 + cell[0])
    reach_row = 0.5 * (1.0 + cell[1])
    wide = abs(inverse[0, 0]) * reach_column + abs(inverse[0, 1]) * reach_row
    high = abs(inverse[1, 0]) * reach_column + abs(inverse[1, 1]) * reach_row
    for j in range(first, last):
        for i in range(means.shape[1]):
            x, y = lattice[0, j, i], lattice[1, j, i]
            total, weight = 0.0, 0.0
            west, south = np.int64(np.ceil(x - wide)), np.int64(np.ceil(y - high))
            east, north = np.int64(np.floor(x + wide)), np.int64(np.floor(y + high))
            for n in range(max(south, 0), min(north + 1, rows)):  # type: ignore[call-overload]
                for m in range(max(west, 0), min(east + 1, columns)):  # type: ignore[call-overload]
                    column = abs(per_step[0, 0] * (m - x) + per_step[0, 1] * (n - y))
                    row = abs(per_step[1, 0] * (m - x) + per_step[1, 1] * (n - y))
                    part = min(1.0, max(0.0, (reach_column - column) / cell[0]))
                    part *= min(1.0, max(0.0, (reach_row - row) / cell[1]))
                    total += part * samples[n, m]
                    weight += part
            means[j, i] = total / weight
