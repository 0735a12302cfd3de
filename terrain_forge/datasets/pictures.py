"""Pictures as formats want them: grey of 8 bits, without distortion, depth in other units."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, ExportError
from terrain_forge.datasets.reader import Recording, StereoPair
from terrain_forge.datasets.streams import RecordedCamera
from terrain_forge.writers import write_png

RECTIFIED = "rectified"
"""The stream of pictures without distortion, beside raw ones."""
_FARTHEST = 2**16 - 1


def truth_stream(camera: RecordedCamera) -> str:
    """The stream of the pictures whose pixels the truth is of."""
    return RECTIFIED if RECTIFIED in camera.channels else "data"


def straight_stream(camera: RecordedCamera) -> str:
    """The stream of a camera's pictures without distortion; empty if there is none."""
    if RECTIFIED in camera.channels:
        return RECTIFIED
    return "data" if camera.straight else ""


def pair_of(recording: Recording, name: str = "") -> StereoPair | None:
    """The stereo pair that all formats, calibration files and systems take, if there is one.

    The first with pictures without distortion, or else the first; of those whose left camera has
    the name or the folder, where one is given.
    """
    pairs = [p for p in recording.pairs if name in ("", p.left.key, p.left.name)]
    return next((pair for pair in pairs if _is_straight(pair)), pairs[0] if pairs else None)


def _is_straight(pair: StereoPair) -> bool:
    """Whether there are pictures of both cameras as of one pinhole, moved along its rows."""
    return pair.alike and bool(straight_stream(pair.left) and straight_stream(pair.right))


def rectified_pair(recording: Recording, name: str, kind: str) -> StereoPair:
    """The pair of `pair_of`, which must have pictures without distortion.

    Raises:
        ExportError: if there is none; says why.
    """
    pair = pair_of(recording, name)
    if pair is None:
        which = f"whose left camera is {name!r}" if name else "of cameras"
        raise ExportError(f"{kind} needs a stereo pair {which}, and the recording has none")
    left, right = pair.left, pair.right
    if not pair.alike:
        raise ExportError(
            f"{kind} needs two cameras of the same focal lengths and principal point, and those of "
            f"{left.name} and {right.name} differ"
        )
    if not _is_straight(pair):
        bent = next(camera for camera in (left, right) if not straight_stream(camera))
        raise ExportError(
            f"{kind} needs pictures without distortion, and those of {bent.name} have "
            f"{bent.distortion[0]}: record with images: [rectified], or [raw, rectified]"
        )
    return pair


def deep_cameras(recording: Recording) -> tuple[RecordedCamera, ...]:
    """The cameras with true depth: the TUM layout is of one of them (`one_of`)."""
    return tuple(one for one in recording.cameras if "depth" in one.channels)


def eight_bits(picture: NDArray[Any], bits: int) -> NDArray[np.uint8]:
    """A picture whose values have more bits, as one of 8."""
    if picture.dtype == np.uint8:
        return picture
    return np.asarray(np.minimum(picture >> max(bits - 8, 0), 255), np.uint8)


def grey(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Brightness of colours (ITU-R BT.601, in 14 bits as OpenCV computes it)."""
    if picture.ndim == 2:
        return picture
    red, green, blue = (picture[..., channel].astype(np.int64) for channel in range(3))
    return np.asarray((4899 * red + 9617 * green + 1868 * blue + 8192) >> 14, np.uint8)


def bits_of(camera: RecordedCamera, stream: str = "data") -> int:
    """Bits of a picture's values, as its stream tells; 8 or, of wider ones, 16 by default."""
    return int(camera.channels[stream].get("bits", 16))


def picture_losses(cameras: Iterable[RecordedCamera]) -> list[str]:
    """What is lost of pictures: how they were exposed, and of more than 8 bits the lower ones."""
    found = list(cameras)
    wide = [one.name for one in found if int(one.channels["data"].get("bits", 8)) > 8]
    told = ["Exposure times and gains of pictures are lost."] * bool(found)
    bits = f"Of the pictures of {', '.join(wide)} only the 8 upper bits are written."
    rolls = [one.name for one in found if _rolls(one)]
    rows = f"That rows of {', '.join(rolls)} are exposed one after the other is told nowhere."
    return told + [bits] * bool(wide) + [rows] * bool(rolls)


def _rolls(camera: RecordedCamera) -> bool:
    """Whether a camera exposes one row after the other."""
    told = camera.about.get("electronics")
    return isinstance(told, Mapping) and bool(told.get("rolling_shutter_s"))


def picture_of(camera: RecordedCamera, number: int, stream: str) -> NDArray[np.uint8]:
    """A picture of 8 bits."""
    return eight_bits(camera.image(number, stream), bits_of(camera, stream))


def write_picture(
    path: Path, camera: RecordedCamera, number: int, stream: str, *, to_grey: bool
) -> bool:
    """Write a picture of 8 bits; the very file where it is one. Returns whether it has colours."""
    raw = camera.image(number, stream)
    coloured = raw.ndim == 3
    if raw.dtype == np.uint8 and not (to_grey and coloured):
        shutil.copyfile(camera.file(number, stream), path)
    else:
        picture = eight_bits(raw, bits_of(camera, stream))
        write_png(path, grey(picture) if to_grey else picture)
    return coloured


def write_depth(path: Path, depth: Array, factor: float) -> int:
    """Write depth [m] as 16 bits, 0 where nothing is; returns how many pixels were too far."""
    units = np.rint(depth * factor)
    far = units > _FARTHEST
    write_png(path, np.where(far, 0, units).astype(np.uint16))
    return int(far.sum())
