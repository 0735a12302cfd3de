"""Colour between sRGB, as images and recipes hold it, and linear light."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from terrain_forge.base import Array, portable


def linear_from_srgb(colour: ArrayLike) -> Array:
    """Linear light of sRGB values, both 0 to 1 (IEC 61966-2-1)."""
    values = np.asarray(colour, dtype=np.float64)
    result: Array = np.where(
        values <= 0.04045, values / 12.92, portable.power((values + 0.055) / 1.055, 2.4)
    )
    return result


def srgb_from_linear(light: ArrayLike) -> Array:
    """SRGB values of linear light, both 0 to 1; the inverse of `linear_from_srgb`."""
    values = np.asarray(light, dtype=np.float64)
    result: Array = np.where(
        values <= 0.0031308,
        12.92 * values,
        1.055 * portable.power(np.maximum(values, 0.0), 1 / 2.4) - 0.055,
    )
    return result
