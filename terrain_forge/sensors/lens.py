"""Which ray belongs to which pixel, and back: pinholes and their distortion as OpenCV has them.

The optical frame is x right, y down, z forward; the first pixel's centre is at column 0, row 0.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, Mask, inner, kernel
from terrain_forge.model import CameraSensor, Equidistant

OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Rotation from the optical frame to the camera's own, x forward, y left, z up."""
OPTICAL.setflags(write=False)

FISHEYE = 2
"""The kind of a lens with `equidistant` distortion."""
_PLAIN, _RADTAN = 0, 1
_TURNS = 60
_TINY = 1e-15


class Lens(NamedTuple):
    """A camera's calibration, as kernels take it."""

    width: int
    """Columns of pixels."""
    height: int
    """Rows of pixels."""
    focal: tuple[float, float]
    """Focal lengths across and down [pixels]."""
    centre: tuple[float, float]
    """Principal point, column and row [pixels]."""
    kind: int
    """0 for a pinhole, 1 for `radtan`, 2 for `equidistant`."""
    k: tuple[float, float, float, float, float]
    """Coefficients, as OpenCV orders them."""
    fold: float
    """Largest tan θ (of a fisheye: θ) that has a pixel."""


def lens_of(sensor: CameraSensor, *, rectified: bool) -> Lens:
    """The lens of a camera's raw or rectified pictures."""
    bent = None if rectified else sensor.distortion
    kind = _PLAIN
    if bent is not None:
        kind = FISHEYE if isinstance(bent, Equidistant) else _RADTAN
    a, b, c, d, e = map(float, (*(bent.k if bent else ()), *(0.0,) * 5)[:5])
    return Lens(
        width=sensor.width_px,
        height=sensor.height_px,
        focal=sensor.focal,
        centre=sensor.centre,
        kind=kind,
        k=(a, b, c, d, e),
        fold=bent.fold if bent else 1e9,
    )


@lru_cache(maxsize=8)
def rays_of(lens: Lens) -> NDArray[np.float32]:
    """Unit rays through the pixels' centres in the optical frame, shape [height, width, 3]."""
    rays = np.empty((lens.height, lens.width, 3), dtype=np.float32)
    _fill_rays(lens, rays)
    rays.setflags(write=False)
    return rays


def unproject(lens: Lens, pixels: Array) -> Array:
    """Unit rays through places in the picture, columns and rows, shape [places, 3].

    NaN for a place that the lens does not reach.
    """
    rays = np.empty((len(pixels), 3))
    _unproject(lens, np.ascontiguousarray(pixels, np.float64), rays)
    return rays


def project(lens: Lens, points: Array) -> tuple[Array, Mask]:
    """Where points show, in the optical frame, or directions, shape [points, 3].

    Returns:
        Columns and rows, shape [points, 2], and which points the lens shows at all, within the
        picture or beside it.
    """
    pixels = np.empty((len(points), 2))
    seen = np.empty(len(points), dtype=np.bool_)
    _project(lens, np.ascontiguousarray(points, np.float64), pixels, seen)
    return pixels, seen


def calibration_of(sensor: CameraSensor, *, rectified: bool) -> dict[str, Any]:
    """What EuRoC's sensor.yaml says of a lens."""
    bent = None if rectified else sensor.distortion
    (fu, fv), (cu, cv) = sensor.focal, sensor.centre
    return {
        "resolution": [sensor.width_px, sensor.height_px],
        "camera_model": "pinhole",
        "intrinsics": [fu, fv, cu, cv],
        "distortion_model": bent.MODEL if bent else "none",
        "distortion_coefficients": list(bent.k) if bent else [0.0] * 4,
    }


@inner
def _bend(lens, x, y):  # type: ignore[no-untyped-def]
    """Brown's distortion of a place on the plane at unit distance."""
    k1, k2, p1, p2, k3 = lens.k
    s = x * x + y * y
    radial = 1.0 + s * (k1 + s * (k2 + s * k3))
    return (
        x * radial + 2.0 * p1 * x * y + p2 * (s + 2.0 * x * x),
        y * radial + p1 * (s + 2.0 * y * y) + 2.0 * p2 * x * y,
    )


@inner
def _radius(lens, r):  # type: ignore[no-untyped-def]
    """Distance from the principal point of what is at r, and its derivative."""
    k1, k2, k3, k4, k5 = lens.k
    if lens.kind == _RADTAN:
        k3, k4 = k5, 0.0
    s = r * r
    return (
        r * (1.0 + s * (k1 + s * (k2 + s * (k3 + s * k4)))),
        1.0 + s * (3.0 * k1 + s * (5.0 * k2 + s * (7.0 * k3 + s * 9.0 * k4))),
    )


@inner
def _straighten(lens, wanted):  # type: ignore[no-untyped-def]
    """The r that shows at a distance from the principal point: Newton's, kept between bounds."""
    low, high = 0.0, lens.fold
    if not wanted < _radius(lens, high)[0]:
        return np.nan
    r = min(wanted, 0.5 * high)
    for _ in range(_TURNS):
        found, growth = _radius(lens, r)
        if found > wanted:
            high = r
        else:
            low = r
        step = (wanted - found) / growth if growth > 0.0 else np.inf
        if abs(step) < _TINY * (1.0 + r):
            break
        r += step
        if not low < r < high:
            r = 0.5 * (low + high)
    return r


@inner
def _unbend(lens, u, v):  # type: ignore[no-untyped-def]
    """The place on the plane at unit distance that Brown's distortion moves to (u, v)."""
    wanted = np.sqrt(u * u + v * v)
    if wanted == 0.0 and lens.k[2] == 0.0 and lens.k[3] == 0.0:
        return 0.0, 0.0
    k1, k2, p1, p2, k3 = lens.k
    r = _straighten(lens, wanted)
    scale = r / wanted if wanted > 0.0 else 1.0
    x, y = scale * u, scale * v
    if p1 == 0.0 and p2 == 0.0:
        return x, y
    for _ in range(_TURNS):
        s = x * x + y * y
        radial = 1.0 + s * (k1 + s * (k2 + s * k3))
        slope = 2.0 * (k1 + s * (2.0 * k2 + 3.0 * s * k3))
        xx = radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x
        xy = slope * x * y + 2.0 * p1 * x + 2.0 * p2 * y
        yy = radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x
        bent_x, bent_y = _bend(lens, x, y)
        a, b = u - bent_x, v - bent_y
        size = xx * yy - xy * xy
        if not size > 0.0:
            return np.nan, np.nan
        dx, dy = (yy * a - xy * b) / size, (xx * b - xy * a) / size
        x, y = x + dx, y + dy
        if abs(dx) + abs(dy) < 4.0 * _TINY * (1.0 + abs(x) + abs(y)):
            break
    return x, y


@inner
def _ray(lens, column, row):  # type: ignore[no-untyped-def]
    u, v = (column - lens.centre[0]) / lens.focal[0], (row - lens.centre[1]) / lens.focal[1]
    if lens.kind == FISHEYE:
        wanted = np.sqrt(u * u + v * v)
        if wanted == 0.0:
            return 0.0, 0.0, 1.0
        angle = _straighten(lens, wanted)
        across = np.sin(angle) / wanted
        return across * u, across * v, np.cos(angle)
    if lens.kind == _RADTAN:
        u, v = _unbend(lens, u, v)
    length = np.sqrt(1.0 + u * u + v * v)
    return u / length, v / length, 1.0 / length


@kernel
def _fill_rays(lens, rays):  # type: ignore[no-untyped-def]
    for row in range(lens.height):
        for column in range(lens.width):
            x, y, z = _ray(lens, np.float64(column), np.float64(row))
            rays[row, column, 0], rays[row, column, 1], rays[row, column, 2] = x, y, z


@kernel
def _unproject(lens, pixels, rays):  # type: ignore[no-untyped-def]
    for n in range(len(pixels)):
        rays[n, 0], rays[n, 1], rays[n, 2] = _ray(lens, pixels[n, 0], pixels[n, 1])


@inner
def shown(lens, x, y, z):  # type: ignore[no-untyped-def]
    """Column and row of a point in the optical frame, and whether the lens shows it."""
    across = np.sqrt(x * x + y * y)
    if lens.kind == FISHEYE:
        angle = np.arctan2(across, z)
        scale = _radius(lens, angle)[0] / across if across > 0.0 else 0.0
        u, v, seen = scale * x, scale * y, angle <= lens.fold
    else:
        seen = z > 0.0 and across <= lens.fold * z
        depth = z if z > 0.0 else np.nan
        u, v = x / depth, y / depth
        if lens.kind == _RADTAN:
            u, v = _bend(lens, u, v)
    return lens.focal[0] * u + lens.centre[0], lens.focal[1] * v + lens.centre[1], seen


@kernel
def _project(lens, points, pixels, seen):  # type: ignore[no-untyped-def]
    for n in range(len(points)):
        pixels[n, 0], pixels[n, 1], seen[n] = shown(lens, points[n, 0], points[n, 1], points[n, 2])
