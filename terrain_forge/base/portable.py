"""Arithmetic that gives the same bits on every x86-64 processor with FMA (2013 and later).

NumPy computes `exp`, `log`, `power` and their like by other instructions where the processor has
AVX-512, and the BLAS behind `@` and `numpy.linalg` adds up in an order that the processor decides:
both differ in the last bit. What enters a world, an export or a truth file is computed here
instead: elementary functions of the C library, element by element, sums in a fixed order. It costs
about 0.1 µs an element. Compiled kernels need none of it: they call the C library too.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from terrain_forge.base.arrays import Array

_AT_ONCE = 1 << 16
"""Elements that become Python's numbers at a time."""
_SWEEPS = 12
"""Jacobi sweeps over a 3 × 3 matrix; six are enough for double precision."""
_NEGLIGIBLE = 1e-18
"""An element off the diagonal that is smaller than this part of those on it counts as 0."""


def _each(
    function: Callable[..., float],
    *arrays: ArrayLike,
    otherwise: Callable[..., float] | None = None,
) -> Array:
    """A function of each element; where it raises, all of them by the slower one that does not."""
    even = [np.asarray(array, np.float64) for array in arrays]
    if len(even) > 1:
        even = [*np.broadcast_arrays(*even)]
    columns = [array.ravel() for array in even]
    found = np.empty(even[0].size)
    try:
        for begin in range(0, found.size, _AT_ONCE):
            part = slice(begin, begin + _AT_ONCE)
            numbers = map(function, *(column[part].tolist() for column in columns))
            found[part] = np.fromiter(numbers, np.float64)
    except (OverflowError, ValueError):
        if otherwise is None:
            raise
        return _each(otherwise, *arrays)
    return found.reshape(even[0].shape)[()]


def _safe(function: Callable[..., float], at_zero: float) -> Callable[..., float]:
    """A function that is infinite where it overflows, and NaN where it has no value but at 0."""

    def safe(x: float, *more: float) -> float:
        try:
            return function(x, *more)
        except OverflowError:
            return math.inf
        except ValueError:
            return at_zero if x == 0.0 else math.nan

    return safe


exp = partial(_each, math.exp, otherwise=_safe(math.exp, 1.0))
"""E to the power of x; infinite where that is too large."""
expm1 = partial(_each, math.expm1)
"""E to the power of x, minus 1, exact near 0."""
log = partial(_each, math.log, otherwise=_safe(math.log, -math.inf))
"""Natural logarithm; minus infinity at 0, NaN below."""
log1p = partial(_each, math.log1p)
"""Natural logarithm of 1 + x, exact near 0."""
log2 = partial(_each, math.log2)
"""Logarithm to the base of 2, of numbers above 0."""
log10 = partial(_each, math.log10)
"""Logarithm to the base of 10, of numbers above 0."""
power = partial(_each, math.pow, otherwise=_safe(math.pow, math.inf))
"""X to a power, for x of at least 0; infinite at 0 with an exponent below 0."""
cbrt = partial(_each, math.cbrt)
"""Cube root."""
tan = partial(_each, math.tan)
"""Tangent of angles [rad]."""
arctan = partial(_each, math.atan)
"""Angle of a tangent [rad], -π/2 to π/2."""
arctan2 = partial(_each, math.atan2)
"""Angle of the vector (x, y) [rad], -π to π, of y and x."""
arcsin = partial(_each, math.asin)
"""Angle of a sine from -1 to 1 [rad]."""
arccos = partial(_each, math.acos)
"""Angle of a cosine from -1 to 1 [rad]."""


def geomspace(first: float, last: float, count: int) -> Array:
    """Numbers at equal ratios from the first to the last, both included."""
    steps = np.linspace(math.log(first), math.log(last), count)
    numbers = exp(steps)
    numbers[0], numbers[-1] = first, last
    return numbers


def product(a: ArrayLike, b: ArrayLike) -> Array:
    """What `a @ b` is, for any shapes that it takes, summed in a fixed order."""
    a, b = np.asarray(a, np.float64), np.asarray(b, np.float64)
    if a.ndim == 1:
        return np.asarray(product(a[None], b)[..., 0, :]) if b.ndim > 1 else _sum_last(a * b)
    if b.ndim == 1:
        return np.asarray(product(a, b[:, None])[..., 0])
    total: Array = a[..., :, :1] * b[..., :1, :]
    for k in range(1, a.shape[-1]):
        total = total + a[..., :, k : k + 1] * b[..., k : k + 1, :]
    return total


def norm(x: ArrayLike, axis: int = -1) -> Array:
    """Length of the vectors along an axis."""
    x = np.asarray(x, np.float64)
    length: Array = np.sqrt(_sum_last(np.moveaxis(x * x, axis, -1)))
    return length


def solve(a: ArrayLike, b: ArrayLike) -> Array:
    """The x of a x = b for a small matrix, shape [n, n], by elimination with pivots.

    Raises:
        ValueError: if the matrix is singular.
    """
    a, x = np.array(a, np.float64), np.array(b, np.float64)
    size = len(a)
    for k in range(size):
        pivot = k + int(np.argmax(np.abs(a[k:, k])))
        if a[pivot, k] == 0.0:
            raise ValueError("singular matrix")
        a[[k, pivot]], x[[k, pivot]] = a[[pivot, k]], x[[pivot, k]]
        for row in range(size):
            if row != k:
                factor = a[row, k] / a[k, k]
                a[row] -= factor * a[k]
                x[row] -= factor * x[k]
    return np.asarray((x.T / np.diagonal(a)).T)


def inverse(a: ArrayLike) -> Array:
    """Inverse of a small matrix, shape [n, n]; raises a ValueError if it is singular."""
    return solve(a, np.eye(len(np.asarray(a))))


def eigh(matrix: ArrayLike) -> tuple[Array, Array]:
    """Eigenvalues of symmetric matrices, ascending, and unit eigenvectors as columns.

    Of shape [..., 3, 3], by Jacobi's rotations (Golub & Van Loan, Matrix Computations, 8.5). Of
    each eigenvector the component of the largest magnitude is positive.
    """
    a = np.array(matrix, np.float64)
    shape = a.shape
    a = a.reshape(-1, 3, 3)
    vectors = np.tile(np.eye(3), (len(a), 1, 1))
    for _ in range(_SWEEPS):
        if not a[:, (0, 0, 1), (1, 2, 2)].any():
            break
        for p, q in ((0, 1), (0, 2), (1, 2)):
            _rotate(a, vectors, p, q)
    values = np.diagonal(a, axis1=1, axis2=2)
    order = np.argsort(values, axis=1, kind="stable")
    values = np.take_along_axis(values, order, axis=1)
    vectors = np.take_along_axis(vectors, order[:, None, :], axis=2)
    largest = np.argmax(np.abs(vectors), axis=1)[:, None, :]
    signs = np.where(np.take_along_axis(vectors, largest, axis=1) < 0.0, -1.0, 1.0)
    return values.reshape(shape[:-1]), (vectors * signs).reshape(shape)


def fit_line(x: ArrayLike, y: ArrayLike) -> tuple[float, float]:
    """Slope and intercept of the least-squares line through points."""
    x, y = np.asarray(x, np.float64), np.asarray(y, np.float64)
    middle, height = math.fsum(x) / len(x), math.fsum(y) / len(y)
    slope = math.fsum((x - middle) * (y - height)) / math.fsum((x - middle) ** 2)
    return slope, height - slope * middle


def smoothed(values: Array, width: float, *, mode: str, truncate: float = 4.0) -> Array:
    """`scipy.ndimage.gaussian_filter` of that width, whose weights are not NumPy's exponentials."""
    from scipy.ndimage import correlate1d

    steps = np.arange(-int(truncate * width + 0.5), int(truncate * width + 0.5) + 1)
    weights = exp(-0.5 / width**2 * steps.astype(np.float64) ** 2)
    weights /= math.fsum(weights)
    for axis in range(values.ndim):
        values = correlate1d(values, weights, axis, mode=mode)
    return values


def _sum_last(terms: Array) -> Array:
    """Sums along the last axis, from its first to its last."""
    if terms.shape[-1] == 0:
        return np.zeros(terms.shape[:-1])
    if terms.ndim == 1:
        return np.float64(math.fsum(terms))  # type: ignore[return-value]
    total = terms[..., 0]
    for k in range(1, terms.shape[-1]):
        total = total + terms[..., k]
    return np.asarray(total)


def _rotate(a: Array, vectors: Array, p: int, q: int) -> None:
    """One Jacobi rotation of each matrix, which makes its elements (p, q) vanish."""
    off = a[:, p, q]
    there = np.abs(off) > _NEGLIGIBLE * (np.abs(a[:, p, p]) + np.abs(a[:, q, q]))
    twice = np.where(there, 2.0 * off, 1.0)
    theta = (a[:, q, q] - a[:, p, p]) / twice
    t = np.where(theta >= 0.0, 1.0, -1.0) / (np.abs(theta) + np.sqrt(theta * theta + 1.0))
    t = np.where(there, t, 0.0)
    c = 1.0 / np.sqrt(t * t + 1.0)
    s = t * c
    for matrix in (a, vectors):
        left, right = matrix[:, :, p].copy(), matrix[:, :, q].copy()
        matrix[:, :, p] = c[:, None] * left - s[:, None] * right
        matrix[:, :, q] = s[:, None] * left + c[:, None] * right
    above, below = a[:, p, :].copy(), a[:, q, :].copy()
    a[:, p, :] = c[:, None] * above - s[:, None] * below
    a[:, q, :] = s[:, None] * above + c[:, None] * below
    a[:, p, q] = a[:, q, p] = 0.0
