"""Cubic splines through points of a route, to the bit those of SciPy, whose import takes longer.

`scipy.interpolate.CubicSpline` of `bc_type` "periodic" or "natural", for points in the plane.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from terrain_forge.base import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Cubic:
    """A piecewise polynomial."""

    knots: Array
    """Where its pieces begin and end, shape [pieces + 1]."""
    coefficients: Array
    """Of each power of the way from a piece's beginning, the highest first, shape [powers, pieces,
    2]."""
    closed: bool
    """Whether it goes on from the end as from the beginning."""

    def __call__(self, parameter: Array) -> Array:
        """Points at values of the parameter between the ends, shape [points, 2]."""
        if self.closed:
            first, last = self.knots[0], self.knots[-1]
            parameter = first + (parameter - first) % (last - first)
        piece = np.searchsorted(self.knots, parameter, side="right") - 1
        piece = np.clip(piece, 0, len(self.knots) - 2)
        step = (parameter - self.knots[piece])[:, None]
        total, power = np.zeros((len(parameter), 2)), np.ones_like(step)
        for factors in self.coefficients[::-1]:
            total = total + factors[piece] * power
            power = power * step
        return total

    def derivative(self) -> Cubic:
        """That by the parameter."""
        orders = np.arange(len(self.coefficients) - 1, 0, -1.0)[:, None, None]
        return replace(self, coefficients=self.coefficients[:-1] * orders)


def cubic_spline(knots: Array, points: Array, *, closed: bool) -> Cubic:
    """The C² curve through points, shape [points, 2], at values of its parameter.

    A closed one ends as it begins, in the first point; another has no curvature at its ends.
    """
    width = np.diff(knots)[:, None]
    slope = np.diff(points, axis=0) / width
    rise = _closed_slopes(width, slope) if closed else _open_slopes(width, slope, points)
    bend = (rise[:-1] + rise[1:] - 2 * slope) / width
    powers = bend / width, (slope - rise[:-1]) / width - bend, rise[:-1], points[:-1]
    return Cubic(knots=knots, coefficients=np.stack(powers), closed=closed)


def _open_slopes(width: Array, slope: Array, points: Array) -> Array:
    """The curve's derivative at its points."""
    wanted, d = np.empty_like(points), width[:, 0]
    wanted[1:-1] = 3 * (width[1:] * slope[:-1] + width[:-1] * slope[1:])
    wanted[0], wanted[-1] = 3 * (points[1] - points[0]), 3 * (points[-1] - points[-2])
    diagonal = np.concatenate([2 * d[:1], 2 * (d[:-1] + d[1:]), 2 * d[-1:]])
    return _solve(np.append(d[1:], d[-1]), diagonal, np.append(d[0], d[:-1]), wanted)


def _closed_slopes(width: Array, slope: Array) -> Array:
    """The curve's derivative at its points, the last of which is the first."""
    d = width[:, 0]
    if len(d) == 2:
        mean = (slope / width).sum(0) / (1.0 / width).sum(0)
        return np.broadcast_to(mean, (3, 2))
    wanted = np.empty_like(slope)
    wanted[1:] = 3 * (width[1:] * slope[:-1] + width[:-1] * slope[1:])
    wanted[0] = 3 * (width[0] * slope[-1] + width[-1] * slope[0])
    wanted[-1] = 3 * (width[-1] * slope[-2] + width[-2] * slope[-1])
    # Without the last unknown the equations have three diagonals; then it is added.
    diagonal = np.concatenate([2 * (d[-1:] + d[:1]), 2 * (d[:-2] + d[1:-1])])
    below, above = d[1:-1], np.append(d[-1], d[: len(d) - 3])
    unit = np.zeros_like(wanted[:-1])
    unit[0], unit[-1] = -d[0], -d[-3]
    one, other = (_solve(below, diagonal, above, right) for right in (wanted[:-1], unit))
    last = (wanted[-1] - d[-2] * one[0] - d[-1] * one[-1]) / (
        2 * (d[-1] + d[-2]) + d[-2] * other[0] + d[-1] * other[-1]
    )
    most = one + last * other
    return np.concatenate([most, last[None], most[:1]])


def _solve(below: Array, diagonal: Array, above: Array, wanted: Array) -> Array:
    """Solve equations of three diagonals by elimination with pivots, as LAPACK's `dgtsv` does."""
    low, middle, high = below.tolist(), diagonal.tolist(), above.tolist()
    second, columns = [0.0] * len(middle), wanted.T.tolist()
    for k in range(len(middle) - 1):
        if abs(middle[k]) >= abs(low[k]):
            part = low[k] / middle[k]
            middle[k + 1] -= part * high[k]
            for rows in columns:
                rows[k + 1] -= part * rows[k]
            continue
        part = middle[k] / low[k]
        middle[k], following = low[k], middle[k + 1]
        middle[k + 1] = high[k] - part * following
        if k < len(middle) - 2:
            second[k], high[k + 1] = high[k + 1], -part * high[k + 1]
        high[k] = following
        for rows in columns:
            rows[k], rows[k + 1] = rows[k + 1], rows[k] - part * rows[k + 1]
    for rows in columns:
        for k in range(len(middle) - 1, -1, -1):
            if k + 1 < len(middle):
                rows[k] -= high[k] * rows[k + 1]
            if k + 2 < len(middle):
                rows[k] -= second[k] * rows[k + 2]
            rows[k] /= middle[k]
    return np.array(columns).T
