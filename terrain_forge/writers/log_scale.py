"""Logarithmic axes for figures, drawn to the same pixels on every processor."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.scale import InvertedLogTransform, LogScale, LogTransform

from terrain_forge.base import Array, portable

_BELOW = -1000.0
"""Where numbers that have no logarithm are drawn: far below any axis."""


def log_axes(axes: Axes) -> None:
    """Make both axes logarithmic."""
    axes.set_xscale(_PortableLog(axes.xaxis))
    axes.set_yscale(_PortableLog(axes.yaxis))


class _PortableLog(LogScale):  # type: ignore[misc]
    def get_transform(self) -> Any:
        return _Forward(10)


class _Forward(LogTransform):  # type: ignore[misc]
    def transform_non_affine(self, values: Any) -> Array:
        numbers = np.asarray(values, np.float64)
        return np.where(
            numbers > 0.0, portable.log10(np.where(numbers > 0.0, numbers, 1.0)), _BELOW
        )

    def inverted(self) -> Any:
        return _Backward(10)


class _Backward(InvertedLogTransform):  # type: ignore[misc]
    def transform_non_affine(self, values: Any) -> Array:
        return portable.power(10.0, values)

    def inverted(self) -> Any:
        return _Forward(10)
