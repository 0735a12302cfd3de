"""Radiance HDR images (.hdr): linear light of any brightness in four bytes a pixel."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array


def encode_hdr(image: Array) -> bytes:
    """The file of a linear RGB image, shape [rows, columns, 3], the first row on top.

    Ward 1991, Real Pixels, Graphics Gems II; without run lengths. Exact to 1/256 of the pixel's
    brightest channel.
    """
    rows, columns, _ = image.shape
    most = np.maximum(np.asarray(image, np.float64).max(axis=-1), 1e-32)
    _, exponent = np.frexp(most)
    scale = np.ldexp(256.0, -exponent)[..., None]
    pixels: NDArray[np.uint8] = np.empty((rows, columns, 4), np.uint8)
    pixels[..., :3] = np.clip(image * scale, 0.0, 255.0)
    pixels[..., 3] = np.where(most > 1e-31, exponent + 128, 0)
    header = f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {rows} +X {columns}\n"
    return header.encode() + pixels.tobytes()
