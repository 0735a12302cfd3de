"""What is true of each pixel's centre: depth, disparity, normals, ids, classes, shadow, flow."""

from __future__ import annotations

from collections.abc import Mapping
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, Mask, kernel, over_chunks, portable
from terrain_forge.scene import BODY, MISSED
from terrain_forge.sensors.labels import CLASSES, Labels
from terrain_forge.sensors.lens import Lens, project, rays_of, shown
from terrain_forge.sensors.picture import Exposure
from terrain_forge.sensors.scenery import Scenery
from terrain_forge.writers import encode_png

_MOST = 65535
DISPARITY_FACTOR = 256.0
"""Values of a disparity image for a pixel, as in KITTI."""
FLOW_FACTOR, FLOW_ZERO = 64.0, 32768.0
"""Values of a flow image for a pixel, and for no motion, as in KITTI."""
_TURNS = 60
"""How often the row is looked for, at most, that is exposed when it sees a place."""
_SETTLED = 1e-4
"""By what the row changes at the end [pixels]."""
_LIFT, _NEAR = 2e-4, 1e-3
"""What an occluder must be nearer than the point by: of the distance, and at least [m]."""


def float_file(values: NDArray[Any]) -> bytes:
    """An array as a .npy file."""
    file = BytesIO()
    np.save(file, values, allow_pickle=False)
    return file.getvalue()


def depth_file(depth: NDArray[np.float32], factor: float | None) -> bytes:
    """Depths [m] times a factor in 16 bits, or as floats.

    Of the 16 bits 0 is for none, for what is too far, and for what a fisheye sees behind its plane.
    """
    if factor is None:
        return float_file(np.asarray(depth, np.float32))
    values = np.where(np.isfinite(depth), np.asarray(depth, np.float64) * factor + 0.5, 0.0)
    held = (values >= 0.0) & (values < _MOST + 1)
    return encode_png(np.where(held, values, 0.0).astype(np.uint16))


def points_of(exposure: Exposure, lens: Lens, position: Array, rotation: Array) -> Array:
    """Where a picture's rays met something [m], shape [height, width, 3]; NaN for the sky.

    Args:
        exposure: The picture.
        lens: The camera's.
        position: Its place at each row [m], shape [height, 3].
        rotation: From the optical frame to the world, shape [height, 3, 3].
    """
    points = np.empty((*exposure.distance.shape, 3))
    poses = np.array(position, order="C"), np.array(rotation, order="C")
    over_chunks(_reach, len(points), exposure.distance, rays_of(lens), *poses, points)
    return points


def normals_file(exposure: Exposure, rotation: Array) -> bytes:
    """Normals in the optical frame, -1 to 1 as 1 to 65535; 0 where there is none.

    Args:
        exposure: The picture.
        rotation: From the optical frame to the world of each row, shape [height, 3, 3].
    """
    values = np.empty(exposure.normal.shape, dtype=np.uint16)
    turns = np.array(rotation, order="C")
    over_chunks(_code_normals, len(values), exposure.normal, turns, values)
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
    scenery: Scenery, exposure: Exposure, points: Array, other: Array, lens: Lens, turns: Array,
    times: Array, near: float,
) -> bytes:  # fmt: skip
    """255 where the other eye does not see a pixel's place: hidden, or beside its picture.

    Args:
        scenery: What may hide it.
        exposure: This eye's picture.
        points: Where its rays met something [m], shape [height, width, 3].
        other: The other eye's place at each row, which it sees at the same time [m], shape
            [height, 3].
        lens: Its lens.
        turns: From its optical frame to the world then, shape [height, 3, 3].
        times: When [s], shape [height].
        near: What of the rover is nearer to it hides nothing [m].
    """
    values = np.zeros(exposure.depth.shape, dtype=np.uint8)
    met = np.isfinite(exposure.depth)
    if not met.any():
        return encode_png(values)
    row = np.nonzero(met)[0]
    if times[0] == times[-1]:  # one pose serves all rows
        row, other, turns, times = np.zeros_like(row), other[:1], turns[:1], times[:1]
    towards = points[met] - other[row]
    distance = portable.norm(towards)
    rays = towards / distance[:, None]
    moments = times[row] if len(times) > 1 else times
    hits = scenery.cast(other[row], rays, moments, near=near)
    hidden = hits.distance < distance * (1.0 - _LIFT) - _NEAR
    ends = np.searchsorted(row, np.arange(1, len(turns)))
    parts = zip(np.split(rays, ends), turns, strict=True)
    own = np.concatenate([portable.product(part, turn) for part, turn in parts])
    values[met] = np.where(hidden | ~within(lens, own), 255, 0)
    return encode_png(values)


def within(lens: Lens, points: Array) -> Mask:
    """Which points, in the optical frame, lie in the picture."""
    pixels, seen = project(lens, points)
    columns, rows = pixels.T
    across = (columns > -0.5) & (columns < lens.width - 0.5)
    return np.asarray(seen & across & (rows > -0.5) & (rows < lens.height - 0.5))


def flow_file(
    exposure: Exposure, points: Array, lens: Lens, position: Array, rotation: Array, here: Array
) -> bytes:
    """Where each pixel's place is in the next picture, less where it is now, as KITTI writes it.

    The time is continuous in the row: between rows the pose is that between theirs.

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
    values = np.zeros((*exposure.depth.shape, 3), dtype=np.uint16)
    poses = (np.array(part, order="C") for part in (position, rotation, here))
    rolls = np.ptp(position, axis=0).any() or np.ptp(rotation, axis=0).any()
    turns = _TURNS if rolls else 1
    over_chunks(
        _follow, len(values), exposure.instance, points, rays_of(lens), lens, *poses, turns, values
    )
    return encode_png(values)


def no_flow_file(lens: Lens) -> bytes:
    """Flow of the last picture, after which there is none."""
    return encode_png(np.zeros((lens.height, lens.width, 3), dtype=np.uint16))


def stream_figures(channel: str, *, factor: float | None, wide: bool) -> Mapping[str, Any]:
    """What a reader must know of a channel's files."""
    if channel == "depth" and factor is None:
        return {
            "unit": "m",
            "type": "float32",
            "none": "inf",
            "measures": "Z, along the optical axis",
        }
    every: dict[str, dict[str, Any]] = {
        "depth": {
            "values_per_metre": factor,
            "farthest_m": _MOST / (factor or 1.0),
            "none": 0,
            "measures": "Z, along the optical axis",
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


@kernel
def _reach(first, last, distance, rays, position, rotation, points):  # type: ignore[no-untyped-def]
    for j in range(first, last):
        turn = rotation[j]
        for i in range(points.shape[1]):
            far = distance[j, i] if np.isfinite(distance[j, i]) else np.nan
            x, y, z = far * rays[j, i, 0], far * rays[j, i, 1], far * rays[j, i, 2]
            for k in range(3):
                points[j, i, k] = position[j, k] + turn[k, 0] * x + turn[k, 1] * y + turn[k, 2] * z


@kernel
def _code_normals(first, last, normals, rotation, values):  # type: ignore[no-untyped-def]
    for j in range(first, last):
        turn = rotation[j]
        for i in range(values.shape[1]):
            x, y, z = normals[j, i, 0], normals[j, i, 1], normals[j, i, 2]
            there = x != 0.0 or y != 0.0 or z != 0.0
            for k in range(3):
                own = turn[0, k] * x + turn[1, k] * y + turn[2, k] * z
                coded = min(max(own * 32767.0 + 32768.5, 1.0), 65535.0)
                values[j, i, k] = np.uint16(coded) if there else np.uint16(0)


@kernel
def _follow(  # type: ignore[no-untyped-def]
    first, last, instance, points, rays, lens, position, rotation, here, turns, values
):
    height = len(rotation)
    for j in range(first, last):
        for i in range(values.shape[1]):
            if instance[j, i] == BODY:
                continue
            row, u, v, seen = float(j), 0.0, 0.0, False
            ray = rays[j, i]
            for _ in range(turns):
                first_row = max(min(int(row), height - 2), 0)
                last_row, part = min(first_row + 1, height - 1), row - first_row
                x = y = z = 0.0
                for k in range(3):
                    if instance[j, i] == MISSED:
                        way = (
                            here[j, k, 0] * ray[0] + here[j, k, 1] * ray[1] + here[j, k, 2] * ray[2]
                        )
                    else:
                        place = position[first_row, k]
                        way = points[j, i, k] - place - part * (position[last_row, k] - place)
                    one, other = rotation[first_row, k], rotation[last_row, k]
                    x += way * (one[0] + part * (other[0] - one[0]))
                    y += way * (one[1] + part * (other[1] - one[1]))
                    z += way * (one[2] + part * (other[2] - one[2]))
                u, v, seen = shown(lens, x, y, z)
                before, row = row, min(max(v, 0.0), height - 1.0)
                if not seen or abs(row - before) < _SETTLED:
                    break
            across, down = (u - i) * FLOW_FACTOR + FLOW_ZERO, (v - j) * FLOW_FACTOR + FLOW_ZERO
            if seen and 0.5 <= across < 65535.0 and 0.5 <= down < 65535.0:
                values[j, i, 0], values[j, i, 1] = np.uint16(across + 0.5), np.uint16(down + 0.5)
                values[j, i, 2] = 1
