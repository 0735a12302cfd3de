"""A film of a recorded camera: its pictures, true depth and labels below them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import srgb_from_linear, worker_threads
from terrain_forge.datasets import RecordedCamera, Recording
from terrain_forge.report.blocks import LARGEST_ANIMATION, Key

FRAMES = 60
"""Pictures that a film has at most."""
_WIDTH, _TALLEST = 720, 480
"""Of the camera's own picture in the film [px]."""
_FRAME_MS = 120
_QUALITY = 65
NEAREST, FARTHEST = 0.5, 50.0
"""Depths that the colours begin and end at [m]."""
_NOTHING = (24, 22, 20)
_LABELS = {
    "ground": (150, 112, 80),
    "crater": (90, 130, 190),
    "rock": (240, 196, 60),
    "ripple": (206, 160, 120),
    "track": (200, 90, 160),
    "rover": (225, 70, 60),
    "sky": (70, 76, 86),
    "beyond": (104, 120, 104),
}
Pixels = NDArray[np.uint8]


@dataclass(frozen=True)
class Film:
    """An animated picture."""

    content: bytes
    """The WebP."""
    still: Pixels
    """One of its pictures, sRGB, shape [height, width, 3]."""
    frames: int
    """How many it has."""
    speed: float
    """How much faster than the recording it runs."""
    parts: tuple[str, ...]
    """What is below the camera's picture: `depth`, `class`."""
    keys: tuple[Key, ...]
    """The labels that are to be seen in it."""


def main_camera(recording: Recording) -> RecordedCamera | None:
    """The camera that the page shows: the left one of the first pair, or else the first."""
    if recording.pairs:
        return recording.pairs[0].left
    return next(iter(recording.cameras), None)


def some_of(count: int, most: int) -> list[int]:
    """At most so many numbers below `count`, evenly spread, the first and the last among them."""
    numbers = np.linspace(0, count - 1, min(count, most)).round()
    return [int(number) for number in np.unique(numbers)]


def make_film(recording: Recording, camera: RecordedCamera) -> Film:
    """The film of a camera, of as many pictures as the page takes in."""
    names = {int(number): str(name) for number, name in recording.about["classes"].items()}
    parts = tuple(name for name in ("depth", "class") if name in camera.channels)
    numbers = some_of(len(camera.stamps), FRAMES)
    with worker_threads(2) as pool:
        made = list(pool.map(partial(_frame, recording, camera, parts, names), numbers))
    while len(content := _webp([frame for frame, _ in made])) > LARGEST_ANIMATION:
        made = made[::2]
    first, last = camera.span
    seconds = 1e-9 * (last - first)
    seen = {label for _, labels in made for label in labels}
    return Film(
        content=content,
        still=made[len(made) // 2][0],
        frames=len(made),
        speed=seconds / (1e-3 * _FRAME_MS * max(len(made) - 1, 1)),
        parts=parts,
        keys=tuple(
            Key(name, "#{:02x}{:02x}{:02x}".format(*_LABELS.get(name, _NOTHING)))
            for number, name in names.items()
            if number in seen
        ),
    )


def told_of(recording: Recording, camera: RecordedCamera) -> Mapping[str, Any]:
    """What the recipe says of a camera, or of the stereo pair that it is an eye of."""
    pair = camera.name.removesuffix("_left").removesuffix("_right")
    told: list[Mapping[str, Any]] = recording.about.get("sensors", [])
    return next((one for one in told if one.get("name") in (camera.name, pair)), {})


def intensities(recording: Recording, camera: RecordedCamera, number: int) -> NDArray[np.float64]:
    """A picture's linear values, at most 1, shape [height, width] or [height, width, 3]."""
    pixels, linear = _linear(recording, camera, number)
    return linear[pixels]


def _linear(
    recording: Recording, camera: RecordedCamera, number: int
) -> tuple[NDArray[np.uint16], NDArray[np.float64]]:
    """A picture's pixels, and the linear value of each that one can have."""
    pixels = camera.image(number)
    held = 8 if pixels.dtype == np.uint8 else 16
    bits = 8 if held == 8 else int(camera.channels["data"].get("bits", 16))
    gamma = float(told_of(recording, camera).get("gamma", 1.0))
    return pixels.astype(np.uint16), (np.arange(2.0**held) / (2.0**bits - 1.0)) ** gamma


def displayed(recording: Recording, camera: RecordedCamera, number: int) -> Pixels:
    """A picture as an eye would see it, sRGB, shape [height, width, 3]."""
    values, linear = _linear(recording, camera, number)
    shown = (255 * srgb_from_linear(linear)).round()
    pixels = shown.clip(0, 255).astype(np.uint8)[values]
    return np.stack([pixels] * 3, axis=-1) if pixels.ndim == 2 else pixels[..., :3]


def _frame(
    recording: Recording,
    camera: RecordedCamera,
    parts: tuple[str, ...],
    names: dict[int, str],
    number: int,
) -> tuple[Pixels, set[int]]:
    """A picture of the film, and the numbers of the labels in it."""
    from PIL import Image

    across, down = camera.size
    scale = min(_WIDTH / across, _TALLEST / down)
    width, height = round(across * scale) // 2 * 2, round(down * scale)
    own = Image.fromarray(displayed(recording, camera, number)).resize((width, height))
    tiles, labels = [], set[int]()
    if parts:
        wide = width // len(parts)
        rows = _nearest(down, round(height / len(parts)))
        columns = _nearest(across, wide)
        for part in parts:
            if part == "depth":
                tiles.append(_depth_colours(camera.depth(number)[np.ix_(rows, columns)]))
            else:
                found = camera.image(number, part)[np.ix_(rows, columns)]
                labels |= set(np.unique(found).tolist())
                tiles.append(_label_colours(found, names))
        return np.vstack([np.asarray(own), np.hstack(tiles)]), labels
    return np.asarray(own), labels


def _nearest(count: int, wanted: int) -> NDArray[np.intp]:
    """Which of `count` pixels a smaller picture of `wanted` shows."""
    return ((np.arange(wanted) + 0.5) * (count / wanted)).astype(np.intp)


def _depth_colours(depth: NDArray[np.float64]) -> Pixels:
    from matplotlib import colormaps

    table = (colormaps["viridis_r"](np.linspace(0.0, 1.0, 256))[:, :3] * 255).astype(np.uint8)
    there = depth > 0.0
    share = np.log(np.where(there, depth, 1.0) / NEAREST) / np.log(FARTHEST / NEAREST)
    found = table[np.clip(255 * share, 0, 255).astype(np.uint8)]
    found[~there] = _NOTHING
    return np.asarray(found)


def _label_colours(labels: NDArray[np.integer], names: dict[int, str]) -> Pixels:
    table = np.full((256, 3), _NOTHING, np.uint8)
    for number, name in names.items():
        table[number] = _LABELS.get(name, _NOTHING)
    return np.asarray(table[np.minimum(labels, 255)])


def _webp(frames: list[Pixels]) -> bytes:
    from PIL import Image

    first, *others = map(Image.fromarray, frames)
    buffer = BytesIO()
    first.save(
        buffer, "WEBP", save_all=True, append_images=others, duration=_FRAME_MS, loop=0,
        quality=_QUALITY, method=3,
    )  # fmt: skip
    return buffer.getvalue()
