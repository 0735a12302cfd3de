"""Figures of a picture that tell renders from photographs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, Record, portable

_BAND = 0.02, 0.1, 0.35
"""Where slopes of a spectrum begin, are parted and end [cycles per pixel]."""
_CIRCLE = np.array(
    [(0, -3), (1, -3), (2, -2), (3, -1), (3, 0), (3, 1), (2, 2), (1, 3),
     (0, 3), (-1, 3), (-2, 2), (-3, 1), (-3, 0), (-3, -1), (-2, -2), (-1, -3)]
)  # fmt: skip
"""Pixels around a corner, column and row, in their order (Rosten & Drummond 2006)."""
_ARC = 9
_CORNER = 20


@dataclass(frozen=True, kw_only=True, eq=False)
class ImageStatistics(Record):
    """What renders and photographs of ground differ in."""

    slope: float
    """Exponent of the radial power spectrum, 0.02 to 0.35 cycles per pixel; of photographs about
    -2 (Field 1987, doi:10.1364/JOSAA.4.002379)."""
    slope_low: float
    """The same, below 0.1 cycles per pixel."""
    slope_high: float
    """The same, above it."""
    kurtosis: float
    """Of the horizontal differences of the logarithm; 3 for a Gaussian (Huang & Mumford 1999,
    doi:10.1109/CVPR.1999.786990)."""
    corners: float
    """FAST-9 corners of threshold 20 after a stretch to 8 bits, per 1000 pixels (Rosten & Drummond
    2006, doi:10.1007/11744023_34)."""
    dark: float
    """Share of pixels below a quarter of the median: shadows, where the Sun stands low."""


def image_statistics(picture: NDArray[Any]) -> ImageStatistics:
    """The figures of a picture of ground, without sky and rover.

    Args:
        picture: Linear intensities, any factor, shape [rows, columns] or [rows, columns, 3].

    Raises:
        ValueError: for less than 32 rows or columns.
    """
    grey = np.asarray(picture, np.float64)
    grey = grey if grey.ndim == 2 else grey.mean(axis=2)
    if min(grey.shape) < 32:
        raise ValueError(f"a picture of {grey.shape[1]} × {grey.shape[0]} pixels, at least 32 × 32")
    frequency, power = radial_spectrum(grey)
    low, middle, high = _BAND

    def slope(first: float, last: float) -> float:
        within = (frequency >= first) & (frequency <= last) & (power > 0.0)
        if within.sum() < 3:
            return float("nan")
        line = portable.fit_line(portable.log(frequency[within]), portable.log(power[within]))
        return line[0]

    floor = max(1e-3 * float(np.median(grey)), 1e-12)
    steps = np.diff(portable.log(np.maximum(grey, floor)), axis=1).ravel()
    steps = steps - steps.mean()
    spread = float((steps**2).mean())
    kurtosis = float((steps**4).mean()) / spread**2 if spread > 0.0 else float("nan")
    return ImageStatistics(
        slope=slope(low, high),
        slope_low=slope(low, middle),
        slope_high=slope(middle, high),
        kurtosis=kurtosis,
        corners=1000.0 * len(fast_corners(stretched(grey))) / grey.size,
        dark=float((grey < 0.25 * np.median(grey)).mean()),
    )


def stretched(grey: Array) -> NDArray[np.uint8]:
    """Bytes of intensities, from the half to the 99.5th percentile."""
    low, high = np.percentile(grey, (0.5, 99.5))
    scaled = (grey - low) * (255.0 / max(float(high - low), 1e-12))
    return np.asarray(np.clip(np.round(scaled), 0, 255), np.uint8)


def radial_spectrum(grey: Array) -> tuple[Array, Array]:
    """Frequencies [cycles per pixel] and power, averaged over rings of a Hann-windowed picture."""
    rows, columns = grey.shape
    window = np.hanning(rows)[:, None] * np.hanning(columns)[None, :]
    power = np.abs(np.fft.rfft2((grey - grey.mean()) * window)) ** 2
    radius = np.hypot(np.fft.fftfreq(rows)[:, None], np.fft.rfftfreq(columns)[None, :])
    edges = portable.geomspace(0.01, 0.5, 40)
    ring = np.digitize(radius.ravel(), edges)
    count = np.bincount(ring, minlength=len(edges) + 1)[1:-1]
    total = np.bincount(ring, power.ravel(), minlength=len(edges) + 1)[1:-1]
    some = count > 0
    middles = np.sqrt(edges[:-1] * edges[1:])
    return middles[some], total[some] / count[some]


def fast_corners(picture: NDArray[np.uint8], *, threshold: int = _CORNER) -> NDArray[np.intp]:
    """Row and column of the FAST-9 corners that are the strongest of their eight neighbours."""
    values = picture.astype(np.int16)
    inner = values[3:-3, 3:-3]
    rows, columns = values.shape
    around = np.stack(
        [values[3 + y : rows - 3 + y, 3 + x : columns - 3 + x] - inner for x, y in _CIRCLE]
    )
    score = np.maximum(_strength(around), _strength(-around))
    corner = score > threshold
    padded = np.pad(score, 1)
    height, width = score.shape
    for y in range(3):
        for x in range(3):
            if (y, x) != (1, 1):
                corner &= score > padded[y : y + height, x : x + width]
    return np.argwhere(corner) + 3


def _strength(around: NDArray[np.int16]) -> NDArray[np.int16]:
    """The largest difference that nine neighbours in a row of the circle reach."""
    best = np.full(around.shape[1:], -1, np.int16)
    twice = np.concatenate([around, around[: _ARC - 1]])
    for first in range(len(_CIRCLE)):
        np.maximum(best, twice[first : first + _ARC].min(axis=0), out=best)
    return best
