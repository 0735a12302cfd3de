"""Images whose bytes depend on the pixels alone: no time stamp, no software tag."""

from __future__ import annotations

import struct
import zlib
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

_COLOUR_TYPE = {1: 0, 3: 2, 4: 6}
_SUB = 1
# Level 1 is six times faster than zlib's default and a filtered photograph hardly gets larger.
_LEVEL = 1
_QUALITY = 90
_MOST_TEXTURES = 16
_textures: dict[bytes, bytes] = {}
"""Files of the last textures, by what they show."""


def write_png(path: Path, image: NDArray[Any]) -> None:
    """Write a grey, RGB or RGBA image of 8 or 16 bits as PNG.

    Args:
        path: The file.
        image: Pixels, uint8 or uint16, shape [rows, columns] or [rows, columns, 1 | 3 | 4]; the
            first row is the top one (`frames.image_rows` turns a grid over).

    Raises:
        ValueError: if the array is not such an image.
    """
    Path(path).write_bytes(encode_png(image))


def encode_png(image: NDArray[Any], *, noisy: bool = False) -> bytes:
    """The PNG file of an image; see `write_png`.

    Of a noisy one, as cameras take, only runs are looked for: that is twice as fast, and no larger.
    """
    pixels = image[:, :, None] if image.ndim == 2 else image
    known = pixels.ndim == 3 and pixels.shape[2] in _COLOUR_TYPE and pixels.size > 0
    if not known or pixels.dtype not in (np.uint8, np.uint16):
        raise ValueError(f"no PNG holds an image of shape {image.shape} and type {image.dtype}")
    rows, columns, channels = pixels.shape
    depth = 8 * pixels.dtype.itemsize
    header = struct.pack(">IIBBBBB", columns, rows, depth, _COLOUR_TYPE[channels], 0, 0, 0)
    strategy = zlib.Z_RLE if noisy else zlib.Z_DEFAULT_STRATEGY
    packer = zlib.compressobj(_LEVEL, strategy=strategy)
    body = packer.compress(_filtered(pixels)) + packer.flush()
    chunks = _chunk(b"IHDR", header), _chunk(b"IDAT", body), _chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


def encode_texture(image: NDArray[Any]) -> bytes:
    """The PNG file of an image that several exports, or many worlds, have alike: made once."""
    kind = f"{image.shape} {image.dtype.str}".encode()
    key = sha256(kind + np.ascontiguousarray(image).tobytes()).digest()
    found = _textures.get(key)
    if found is None:
        if len(_textures) >= _MOST_TEXTURES:
            _textures.clear()
        found = _textures[key] = encode_png(image)
    return found


def write_texture(path: Path, image: NDArray[Any]) -> None:
    """Write a texture as PNG; see `encode_texture`."""
    Path(path).write_bytes(encode_texture(image))


def encode_jpeg(image: NDArray[np.uint8]) -> bytes:
    """The JPEG file of a noisy RGB image, a fifth of its PNG; shape [rows, columns, 3]."""
    from PIL import Image

    target = BytesIO()
    Image.fromarray(image).save(target, "JPEG", quality=_QUALITY, subsampling=0)
    return target.getvalue()


def _filtered(pixels: NDArray[Any]) -> bytes:
    """Scan lines, each byte less the one a pixel to its left (PNG filter 1), to compress better."""
    rows = pixels.shape[0]
    step = pixels.shape[2] * pixels.dtype.itemsize
    plain = np.ascontiguousarray(pixels.astype(pixels.dtype.newbyteorder(">"), copy=False))
    lines = plain.view(np.uint8).reshape(rows, -1)
    filtered = np.empty((rows, lines.shape[1] + 1), dtype=np.uint8)
    filtered[:, 0] = _SUB
    filtered[:, 1 : step + 1] = lines[:, :step]
    np.subtract(lines[:, step:], lines[:, :-step], out=filtered[:, step + 1 :])
    return filtered.tobytes()


def _chunk(kind: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
