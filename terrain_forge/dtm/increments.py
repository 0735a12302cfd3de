"""Second increments: how rough a DTM is at each baseline, whatever its slope.

The second increment of the heights over a lag L, z(x + L) − 2 z(x) + z(x − L), does not see planes.
For self-affine ground of the RMS deviation ν(L) = ν₁·L^H its mean square is ν₁²·(4 − 2^2H)·L^2H; it
looks at wavelengths around 2 L. An exponent estimated from it (Istas & Lang 1997,
doi:10.1016/S0246-0203(97)80099-4) scatters far less than one from the spectrum of a small DTM, into
which large walls leak. Posts that are means of their pixels have smaller increments, which is
allowed for.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from terrain_forge.base import Array, Mask, kernel, portable
from terrain_forge.dtm.squares import in_squares, samples

_QUADRATURE = 24
_PRIOR = 0.02  # weight of the mean of wider surroundings, beside up to two increments at each post
_CUT = 3.0  # standard deviations after which a window ends
_WIDER, _LAST = 8.0, 4e-4  # how much wider those are, and weight of the mean of all beside them


def mean_square_increment(heights: Array, lag: int, trusted: Mask) -> float:
    """Mean square of the second increments over a lag [posts], both directions.

    NaN where no three trusted posts lie in a row.
    """
    sums = [_sums(heights[part], lag, trusted[part]) for part in samples(heights.shape)]
    total, count = (sum(float(one[n].sum()) for one in sums) for n in range(2))
    return total / count if count else float("nan")


@cache
def expected_increment(hurst: float, lag: int) -> float:
    """Mean square of second increments of pixel means, of ground with ν = 1 at one posting."""
    return (
        8.0 * _variogram_of_means(hurst, lag)
        - 2.0 * _variogram_of_means(hurst, 2 * lag)
        - 6.0 * _variogram_of_means(hurst, 0)
    )


def mixed_share(heights: Array, lag: int, trusted: Mask) -> float:
    """Mean square of the mixed fourth differences over a lag, over that of second increments.

    NaN where no three by three trusted posts lie together, or all lie in planes.
    """
    found = [_mixed(heights[part], lag, trusted[part]) for part in samples(heights.shape)]
    total, count = (sum(column) for column in zip(*found, strict=True))
    second = mean_square_increment(heights, lag, trusted)
    return float(total / count / second) if count and second else float("nan")


def local_square_increments(heights: Array, lag: int, trusted: Mask, width: float) -> Array:
    """Mean squares of second increments around each post, shape as the heights.

    Far from trusted posts they tend to the mean of wider surroundings, and at last of all.

    Args:
        heights: the DTM [m].
        lag: posts.
        trusted: posts that are measured, not filled in.
        width: standard deviation of the Gaussian window [posts].
    """
    usual = mean_square_increment(heights, lag, trusted)

    def near(heights: Array, trusted: Mask) -> Array:
        return local_mean(*_sums(heights, lag, trusted), width, usual)

    return in_squares(near, heights, trusted, **reach_of(width))


def reach_of(width: float) -> dict[str, int]:
    """How `in_squares` has to take the pieces of which `local_mean` makes means."""
    step = _block(_WIDER * width)
    return {"margin": math.ceil(_CUT * _WIDER * width) + 2 * step, "step": step}


def local_mean(total: Array, count: Array, width: float, usual: float | None = None) -> Array:
    """Means around each post of what was summed at each, in a Gaussian window of a width [posts].

    Where there is little in it they tend to the mean of a wider window, and at last to what is
    usual, by default the mean of all.
    """
    usual = total.sum() / max(count.sum(), 1.0) if usual is None else usual
    mean = np.full(total.shape, usual)
    for wide, prior in ((_WIDER * width, _LAST), (width, _PRIOR)):
        # What counts for a fiftieth is taken of blocks, since a window of 300 posts is dear.
        step = _block(wide) if wide > width else 1
        near, weight = (_smoothed(values, wide, step) for values in (total, count))
        mean = (near + prior * mean) / (weight + prior)
    return mean


def _block(width: float) -> int:
    """Posts a side of the blocks that are taken for a wide window [posts]."""
    return max(int(0.25 * width), 1)


def _smoothed(values: Array, width: float, step: int) -> Array:
    """Gaussian means of a width [posts], of blocks of some posts a side and linear between them.

    0 lies beyond the values.
    """
    blocks = _blocks(_blocks(values, step).T, step).T
    means = portable.smoothed(blocks, width / step, mode="constant", truncate=_CUT)
    rows, columns = values.shape
    return np.ascontiguousarray(_stretched(_stretched(means, step, rows).T, step, columns).T)


def _blocks(values: Array, step: int) -> Array:
    """Means of so many rows together."""
    padded = np.zeros((-(-len(values) // step) * step, values.shape[1]))
    padded[: len(values)] = values
    return np.asarray(sum(padded[k::step] for k in range(step)) / step)


def _stretched(values: Array, step: int, rows: int) -> Array:
    """The rows that `_blocks` had, linear between the middles of blocks."""
    if step == 1:
        return values
    place = np.clip((np.arange(rows) + 0.5) / step - 0.5, 0.0, len(values) - 1.0)
    first = place.astype(np.int64)
    after = values[np.minimum(first + 1, len(values) - 1)]
    return np.asarray(values[first] + (place - first)[:, None] * (after - values[first]))


def _sums(heights: Array, lag: int, trusted: Mask) -> tuple[Array, Array]:
    """Squared increments around each post summed over both directions, and how many there are."""
    total, count = np.zeros(heights.shape), np.zeros(heights.shape)
    for z, known, squares, numbers in (
        (heights, trusted, total, count),
        (heights.T, trusted.T, total.T, count.T),
    ):
        all_known = _all_known(known, lag)
        squares[:, lag:-lag] += np.where(all_known, _differences(z, lag) ** 2, 0.0)
        numbers[:, lag:-lag] += all_known
    return total, count


def _mixed(heights: Array, lag: int, trusted: Mask) -> tuple[float, int]:
    """Sum of squares of the mixed fourth differences over a lag, and how many there are."""
    across, known = _differences(heights, lag), _all_known(trusted, lag)
    mixed, known = _differences(across.T, lag), _all_known(known.T, lag)
    return float(np.sum(mixed[known] ** 2)), int(known.sum())


def _differences(heights: Array, lag: int) -> Array:
    """Second increments along rows."""
    return np.asarray(heights[:, 2 * lag :] - 2.0 * heights[:, lag:-lag] + heights[:, : -2 * lag])


def _all_known(trusted: Mask, lag: int) -> Mask:
    """Where all three posts of them are trusted."""
    return trusted[:, 2 * lag :] & trusted[:, lag:-lag] & trusted[:, : -2 * lag]


@cache
def _variogram_of_means(hurst: float, lag: int) -> float:
    """Mean of ½·r^2H over all pairs of points of two unit pixels, `lag` apart along one axis."""
    distance, weights = _pairs(lag)
    return 0.5 * float(portable.product(_weighed_powers(distance, weights, 2.0 * hurst), weights))


@cache
def _pairs(lag: int) -> tuple[Array, Array]:
    """Distances of points of two unit pixels, and weights along an axis."""
    steps = (np.arange(_QUADRATURE) + 0.5) / _QUADRATURE * 2.0 - 1.0
    weights = (1.0 - np.abs(steps)) * 2.0 / _QUADRATURE
    return np.hypot(lag + steps[None, :], steps[:, None]), weights


@kernel
def _weighed_powers(distance, weights, exponent):  # type: ignore[no-untyped-def]
    """Sums of the columns' powers, in a fixed order, shape [columns]."""
    total = np.zeros(distance.shape[1])
    for column in range(distance.shape[1]):
        for row in range(distance.shape[0]):
            total[column] += weights[row] * math.pow(distance[row, column], exponent)
    return total
