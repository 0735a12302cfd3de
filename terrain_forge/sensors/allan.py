"""The Allan deviation, which tells the noise of a sensor by how long its samples are averaged."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from terrain_forge.base import Array, DataError, given_numbers

_PER_DECADE = 10
_LEAST = 9
"""Times of averaging that a record holds at least, for a deviation to say something."""


def allan_deviation(
    samples: ArrayLike, rate: float, times: ArrayLike | None = None
) -> tuple[Array, Array]:
    """The overlapping Allan deviation of samples (IEEE Std 952-1997, annex C).

    White noise of a density N falls by N / √τ, a walk K rises by K √(τ / 3).

    Args:
        samples: Of a resting sensor, shape [n] or [n, axes].
        rate: Samples per second [Hz].
        times: Times τ of averaging [s]; by default ten a decade, up to a ninth of the record.

    Returns:
        The times, as whole numbers of samples give them [s], shape [times], and the deviation in
        the samples' unit, shape [times] or [times, axes].

    Raises:
        DataError: for samples or a rate that no sensor has.
    """
    values, hertz = given_numbers(samples, "samples"), given_numbers(rate, "the rate")
    if values.ndim not in (1, 2):
        raise DataError(f"samples of shape {values.shape}: must be (n,) or (n, axes)")
    if hertz.ndim or hertz <= 0.0:
        raise DataError(f"rate {rate} Hz: must be one number above 0")
    count = len(values)
    if times is None:
        decades = np.log10(max(count / _LEAST, 1.0))
        wanted = 10.0 ** np.arange(0.0, decades + 1e-9, 1.0 / _PER_DECADE)
    else:
        wanted = rate * given_numbers(times, "times of averaging")
    lengths = np.unique(np.rint(wanted).astype(np.int64))
    lengths = lengths[(lengths >= 1) & (2 * lengths < count)]
    # Sums about the mean: those of a bias would cost digits.
    sums = np.cumsum(values - values.mean(axis=0), axis=0)
    sums = np.concatenate([np.zeros_like(sums[:1]), sums])
    found = []
    for m in lengths.tolist():
        change = (sums[2 * m :] - 2.0 * sums[m:-m] + sums[: -2 * m]) / m
        found.append(np.sqrt(0.5 * np.mean(change**2, axis=0)))
    shape = (len(lengths), *values.shape[1:])
    return lengths / rate, np.asarray(found).reshape(shape)
