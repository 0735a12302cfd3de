"""Detail that continues a DTM below its posting and leaves the mean of every pixel as it is.

The noise n follows the spectrum that continues the DTM's own. Its means over the DTM's pixels, B n,
are taken away through the interpolation I that the DTM itself goes through: n − I B n. So what the
DTM tells is told by the DTM alone, the images that its interpolation leaves above half a cycle per
posting are complemented rather than added to, and averages over pixels return the DTM.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, kernel, over_chunks
from terrain_forge.dtm import (
    NEAR,
    STENCIL,
    Nodes,
    PixelFrame,
    Pixels,
    Posts,
    add_cell_means,
    node_places,
    pixel_of,
)
from terrain_forge.model import Site, Window
from terrain_forge.terrain.noise import octaves

_SAMPLES = 16  # at least so many nodes across a pixel take part in its mean


@dataclass(frozen=True, kw_only=True, eq=False)
class Grain:
    """Noise that is drawn out along one direction, where the ground is."""

    key: np.uint64
    """What the noise is, from `seeds.stage_key`."""
    turn: Array
    """Matrix from east and north to coordinates in which the noise is alike in all directions."""
    factor: float
    """On its octaves, so that it is as high as noise alike in all directions."""
    share: Array
    """What it is multiplied by around each post of the DTM that is asked of, shape [rows, columns].
    """


@dataclass(frozen=True, kw_only=True, eq=False)
class Octaves:
    """Noise that continues the ground: octaves with their factors."""

    key: np.uint64
    """What the noise is, from `seeds.stage_key`."""
    wavelengths: Array
    """Lattice distance of each octave [m], descending."""
    factors: Array
    """Height of each octave [m]."""
    variation: Array | None = None
    """Factor on the heights around each post of the DTM that is asked of, shape [rows, columns]."""
    grains: tuple[Grain, ...] = ()
    """Noise with directions that takes the place of a part of it; the first has none."""


Noise = Callable[[Posts | None], Octaves]
"""The noise as it is around some posts of the DTM; what it is everywhere, around none."""


def continue_dtm(*, site: Site, window: Window, noise: Noise) -> Array:
    """The noise at the window's nodes without its means over the DTM's pixels [m].

    A node has the same bits in every window.
    """
    assert site.dtm is not None
    wanted = Nodes.of(window)
    stride = max(int(site.dtm.posting / (_SAMPLES * site.spacing)), 1)
    pixels = Pixels.under(site, wanted, NEAR + STENCIL)
    around = pixels.nodes(site, stride)
    # Samples of every stride-th node do not show shorter waves, whose means are next to nothing.
    long = (noise(None).wavelengths >= 2.0 * stride * site.spacing * (1.0 - 1e-9)) | (stride == 1)
    samples = noise_at(site, around, noise, long)
    means = pixels.means(site, around, samples)
    if stride == 1:
        detail = around.cut(samples, wanted)
    else:
        detail = noise_at(site, wanted, noise)
    add_cell_means(
        detail,
        means,
        places=node_places(site, wanted),
        cell=PixelFrame.of(site).extent(site.spacing),
        reach=NEAR,
        origin=(pixels.column, pixels.row),
        factor=-1.0,
    )
    return detail


def noise_at(
    site: Site, nodes: Nodes, noise: Noise, chosen: NDArray[np.bool_] | slice = slice(None)
) -> Array:
    """The chosen octaves at nodes, higher where the ground around is rougher [m]."""
    east, north = nodes.axes(site)
    places = posts = None
    if site.dtm is not None:
        places = node_places(site, nodes)
        # Around the nodes alone: a DTM may be far larger than the window.
        posts = places.posts(site.dtm.heights.shape)
    found = noise(posts)

    def drawn(key: np.uint64, turn: Array | None, factor: float, share: Array | None) -> Array:
        part = octaves(
            key,
            east=east,
            north=north,
            wavelengths=found.wavelengths[chosen],
            amplitudes=factor * found.factors[chosen],
            turn=turn,
        )
        if share is not None:
            assert posts is not None
            assert site.dtm is not None
            first, shape = (posts.rows.start, posts.columns.start), site.dtm.heights.shape
            local = np.ascontiguousarray(share, np.float64)
            over_chunks(_scale, len(part), local, first, shape, places, part)
        return part

    if not found.grains:
        return drawn(found.key, None, 1.0, found.variation)
    total = np.zeros((len(north), len(east)))
    for grain in found.grains:
        share = grain.share if found.variation is None else grain.share * found.variation
        total += drawn(grain.key, grain.turn, grain.factor, share)
    return total


@kernel
def _scale(first, last, local, corner, shape, places, total):  # type: ignore[no-untyped-def]
    """Multiply nodes by what the posts around them say, bilinear; these begin at a corner."""
    rows, columns = shape
    for j in range(first, last):
        for i in range(total.shape[1]):
            column, row = pixel_of(places, j, i)
            column = min(max(column, 0.0), columns - 1.000001)
            row = min(max(row, 0.0), rows - 1.000001)
            m, n = np.int64(column), np.int64(row)
            x, y = column - m, row - n
            m, n = m - corner[1], n - corner[0]
            south = local[n, m] + x * (local[n, m + 1] - local[n, m])
            north = local[n + 1, m] + x * (local[n + 1, m + 1] - local[n + 1, m])
            total[j, i] *= south + y * (north - south)
