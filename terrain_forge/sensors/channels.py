"""What is true of each pixel's centre: depth, disparity, normals, ids, classes, shadow, flow."""

from __future__ import annotations

from collections.abc import Mapping
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, Mask
from terrain_forge.scene import BODY, MISSED
from terrain_forge.sensors.labels import CLASSES, Labels
from terrain_forge.sensors.lens import Lens, project, rays_of
from terrain_forge.sensors.picture import Exposure
from terrain_forge.sensors.scenery import Scenery
from terrain_forge.writers import encode_png

_MOST = 65535
DISPARITY_FACTOR = 256.0
"""Values of a disparity image for a pixel, as in KITTI."""
FLOW_FACTOR, FLOW_ZERO = 64.0, 32768.0
"""Values of a flow image for a pixel, and for no motion, as in KITTI."""
_LIFT, _NEAR = 2e-4, 1e-3
"""What an occluder must be nearer than the point by: of the distance, and at least [m]."""


def float_file(values: NDArray[Any]) -> bytes:
    """An array as a .npy file."""
    file = BytesIO()
    np.save(file, values, allow_pickle=False)
    return file.getvalue()


def depth_file(depth: NDArray[np.float32], factor: float | None) -> bytes:
    """Depths [m] times a factor in 16 bits, 0 for none and for what is too far; or as floats."""
    if factor is None:
        return float_file(np.asarray(depth, np.float32))
    values = np.where(np.isfinite(depth), np.asarray(depth, np.float64) * factor + 0.5, 0.0)
    return encode_png(np.where(values < _MOST + 1, values, 0.0).astype(np.uint16))


def normals_file(exposure: Exposure, rotation: Array) -> bytes:
    """Normals in the optical frame, -1 to 1 as 1 to 65535; 0 where there is none.

    Args:
        exposure: The picture.
        rotation: From the optical frame to the world of each row, shape [height, 3, 3].
    """
    own = np.einsum("hwi,hij->hwj", exposure.normal.astype(np.float64), rotation)
    values = np.clip(own * 32767.0 + 32768.5, 1.0, _MOST).astype(np.uint16)
    values[exposure.instance == MISSED] = 0
    return encode_png(values)


def id_file(exposure: Exposure, labels: Labels) -> bytes:
    """Ids of rocks plus 1, 0 for all else: in 16 bits if all ids fit, else in four bytes."""
    rock = exposure.instance >= 0
    values = np.zeros(exposure.instance.shape, dtype=np.uint32)
    values[rock] = labels.ids[exposure.instance[rock]].astype(np.uint32) + 1
    if wide_ids(labels):
        return encode_png(values.astype("<u4").view(np.uint8).reshape(*values.shape, 4))
    return encode_png(values.astype(np.uint16))


def wide_ids(labels: Labels) -> bool:
    """Whether ids need more than 16 bits."""
    return bool(len(labels.ids)) and int(labels.ids.max()) + 1 > _MOST


def class_file(exposure: Exposure, points: Array, labels: Labels, behind: float) -> bytes:
    """Numbers of `CLASSES`."""
    shape = exposure.instance.shape
    seen = np.ascontiguousarray(exposure.instance, np.int32).reshape(-1)
    return encode_png(labels.of(points.reshape(-1, 3), seen, behind).reshape(shape))


def shadow_file(exposure: Exposure) -> bytes:
    """255 where a surface gets no light from the Sun, else 0."""
    dark = ~exposure.sunlit & (exposure.instance != MISSED)
    return encode_png(np.where(dark, 255, 0).astype(np.uint8))


def disparity_file(depth: NDArray[np.float32], focal: float, baseline: float) -> bytes:
    """Disparities f B / Z in 1/256 px, of what the other eye does not see too.

    0 stands for what is too near, and for the sky, which has none.
    """
    values = focal * baseline / np.asarray(depth, np.float64) * DISPARITY_FACTOR + 0.5
    return encode_png(np.where(values < _MOST + 1, values, 0.0).astype(np.uint16))


def occlusion_file(
    scenery: Scenery, exposure: Exposure, points: Array, other: Array, lens: Lens, turn: Array,
    time: float,
) -> bytes:  # fmt: skip
    """255 where the other eye does not see a pixel's place: hidden, or beside its picture.

    Args:
        scenery: What may hide it.
        exposure: This eye's picture.
        points: Where its rays met something [m], shape [height, width, 3].
        other: The other eye's place [m], shape [3].
        lens: Its lens.
        turn: From its optical frame to the world, shape [3, 3].
        time: When [s].
    """
    met = np.isfinite(exposure.depth)
    towards = points[met] - other
    distance = np.sqrt((towards**2).sum(axis=1))
    rays = towards / distance[:, None]
    hits = scenery.cast(np.broadcast_to(other, rays.shape).copy(), rays, time)
    hidden = hits.distance < distance * (1.0 - _LIFT) - _NEAR
    outside = ~within(lens, *project(lens, rays @ turn))
    values = np.zeros(exposure.depth.shape, dtype=np.uint8)
    values[met] = np.where(hidden | outside, 255, 0)
    return encode_png(values)


def within(lens: Lens, pixels: Array, seen: Mask) -> Mask:
    """Which places lie in the picture."""
    inside = (pixels > -0.5).all(axis=1)
    inside &= (pixels[:, 0] < lens.width - 0.5) & (pixels[:, 1] < lens.height - 0.5)
    return np.asarray(seen & inside)


def flow_file(
    exposure: Exposure, points: Array, lens: Lens, position: Array, rotation: Array, here: Array
) -> bytes:
    """Where each pixel's place is in the next picture, less where it is now, as KITTI writes it.

    Red is the columns' part and green the rows', 1/64 px a value, 32768 for none; blue is 1 where
    it is known: not on the rover itself, whose wheels turn.

    Args:
        exposure: The picture.
        points: Where its rays met something [m], shape [height, width, 3].
        lens: The camera's.
        position: Its place at each row of the next picture [m], shape [height, 3].
        rotation: From the optical frame to the world then, shape [height, 3, 3].
        here: From the optical frame to the world at each row now, shape [height, 3, 3].
    """
    height, width = exposure.depth.shape
    sky = ~np.isfinite(exposure.depth).reshape(-1)
    far = np.einsum("hij,hwj->hwi", here, rays_of(lens).astype(np.float64)).reshape(-1, 3)
    flat = points.reshape(-1, 3)
    row = np.full(height * width, height // 2)
    pixels, seen = np.zeros((0, 2)), np.zeros(0, np.bool_)
    for _ in range(4 if np.ptp(position, axis=0).any() else 1):  # each row is exposed when it is
        towards = np.where(sky[:, None], far, flat - position[row])
        own = np.einsum("ni,nij->nj", towards, rotation[row])
        pixels, seen = project(lens, own)
        down = np.where(np.isfinite(pixels[:, 1]), pixels[:, 1], 0.0)
        row = np.clip(np.rint(down), 0, height - 1).astype(np.int64)
    now = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).reshape(-1, 2)
    values = (pixels - now) * FLOW_FACTOR + FLOW_ZERO + 0.5
    known = seen & (exposure.instance.reshape(-1) != BODY)
    known &= (values >= 1.0).all(axis=1) & (values < _MOST + 1).all(axis=1)
    image = np.zeros((height * width, 3), dtype=np.uint16)
    image[known, :2] = values[known]
    image[known, 2] = 1
    return encode_png(image.reshape(height, width, 3))


def no_flow_file(lens: Lens) -> bytes:
    """Flow of the last picture, after which there is none."""
    return encode_png(np.zeros((lens.height, lens.width, 3), dtype=np.uint16))


def stream_figures(channel: str, *, factor: float | None, wide: bool) -> Mapping[str, Any]:
    """What a reader must know of a channel's files."""
    if channel == "depth" and factor is None:
        return {"unit": "m", "type": "float32", "none": "inf", "of": "Z, along the optical axis"}
    every: dict[str, dict[str, Any]] = {
        "depth": {
            "values_per_metre": factor,
            "farthest_m": _MOST / (factor or 1.0),
            "none": 0,
            "of": "Z, along the optical axis",
        },
        "disparity": {"values_per_pixel": DISPARITY_FACTOR, "none": 0},
        "occlusion": {"hidden": 255},
        "normals": {"value": "32768 + 32767 n", "none": 0, "frame": "optical"},
        "instance": {
            "value": "id + 1",
            "none": 0,
            "packing": "id + 1 = R + 256 G + 65536 B + 16777216 A" if wide else "16 bit",
        },
        "class": {"classes": dict(enumerate(CLASSES))},
        "shadow": {"shadow": 255},
        "flow": {
            "values_per_pixel": FLOW_FACTOR,
            "zero": FLOW_ZERO,
            "known": "blue is 1",
            "to": "the next picture",
        },
    }
    return every[channel]
