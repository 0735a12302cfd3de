"""What a ray sees where it lands: normal and albedo of the ground and of rocks, for the renderer.

Positions are in the scene's frame (`RayScene.origin`); textures are addressed in the world's.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import inner
from terrain_forge.scene.grain import SOIL_COARSEST, cell_hash, ground_grain, part
from terrain_forge.scene.rock_tile import tile_at

(
    X, Y, Z, FLAT_X, FLAT_Y, FLAT_Z, BENT_X, BENT_Y, BENT_Z, RED, GREEN, BLUE, RANGE, SHADE, LIFT,
    OWNER,
) = range(16)  # fmt: skip
"""Columns of a surface point: its place, the triangle's normal, the shading normal, albedo,
distance from the camera, the part of sunlight that small stones keep off, the height of the smooth
surface over the triangle, and what it belongs to: a rock's row, -1 for the ground."""
COLUMNS = 16
_SMOOTH = 1e-3  # things that are made for a size below this have no relief [m]
NOBODY = -9.0
"""Owner of a point that is not yet shaded."""


class Land(NamedTuple):
    """The ground as the renderer needs it."""

    elevation: NDArray[np.float32]
    """Heights in the scene's frame [m], shape [rows, columns]."""
    rgb: NDArray[np.uint8]
    """sRGB colour of the nodes, shape [rows, columns, 3]."""
    linear: NDArray[np.float64]
    """Linear value of each sRGB byte, shape [256]."""
    corner: tuple[float, float]
    """East and north of node [0, 0] in the scene's frame [m]."""
    shift: tuple[float, float]
    """East and north of the scene's frame in the world [m]."""
    spacing: float
    """Distance of the nodes [m]."""
    edge: float
    """Mean height along the border, in the scene's frame [m]; the plain beyond lies there."""
    key: Any
    """Key of the fine texture, uint64."""
    grain: NDArray[np.uint8]
    """Pebbles, roughness and slabs of the nodes, 100 for 1, shape [rows, columns, 3]."""
    usual: tuple[float, float, float]
    """As `grain`, 1 for 1, of the land beyond the ground's edge."""
    shadow: tuple[float, float]
    """From the end of the shadow of a thing of unit height to its foot, east and north."""
    apron_faces: NDArray[np.int64]
    """Corners of the triangles beyond the edge, rows of the arrays below, shape [faces, 3]."""
    apron_normals: NDArray[np.float64]
    """Unit normals at their corners, shape [vertices, 3]."""
    apron_rgb: NDArray[np.float64]
    """Linear albedo at their corners, shape [vertices, 3]."""


class Tracks(NamedTuple):
    """Wheel tracks on the ground."""

    nearest: NDArray[np.int32]
    """Nearest point of a path to each node, -1 where none is near, shape [rows, columns]."""
    points: NDArray[np.float64]
    """East, north (scene's frame), cosine, sine of the heading, distance, shape [points, 5]."""
    half_gauge: float
    """Sideways distance of a wheel from the path [m]."""
    width: float
    """Width of a wheel [m]."""


class Stones(NamedTuple):
    """The rocks as the renderer needs them."""

    centre: NDArray[np.float64]
    """In the scene's frame [m], shape [rocks, 3]."""
    rotation: NDArray[np.float64]
    """Shape [rocks, 3, 3]."""
    size: NDArray[np.float64]
    """Exposed diameter [m], shape [rocks]."""
    scale: NDArray[np.float64]
    """Size in units of the shape [m], shape [rocks]."""
    tile: NDArray[np.float32]
    """Relief of their faces, as `rock_tile` makes it."""
    rgb: NDArray[np.float64]
    """Linear albedo, shape [rocks, 3]."""
    first_face: NDArray[np.int64]
    """Where each rock's shape begins in `faces`, shape [rocks]."""
    faces: NDArray[np.int64]
    """Corners of all shapes, rows of `normals`, shape [faces, 3]."""
    normals: NDArray[np.float64]
    """Unit normals at all shapes' vertices, shape [vertices, 3]."""
    dust: float
    """How much of the ground's colour lies on faces that look up, 0 to 1."""


@inner
def _cell(land, x, y):  # type: ignore[no-untyped-def]
    """Column and row of the cell under a place and the place in the cell, 0 to 1."""
    rows, columns = land.elevation.shape
    column = (x - land.corner[0]) / land.spacing
    row = (y - land.corner[1]) / land.spacing
    i = min(max(np.int64(np.floor(column)), 0), columns - 2)
    j = min(max(np.int64(np.floor(row)), 0), rows - 2)
    return i, j, min(max(column - i, 0.0), 1.0), min(max(row - j, 0.0), 1.0)


@inner
def _blend(sw, se, nw, ne, u, v):  # type: ignore[no-untyped-def]
    south, north = sw + u * (se - sw), nw + u * (ne - nw)
    return south + v * (north - south)


@inner
def _node_slope(land, i, j):  # type: ignore[no-untyped-def]
    rows, columns = land.elevation.shape
    west, east = max(i - 1, 0), min(i + 1, columns - 1)
    south, north = max(j - 1, 0), min(j + 1, rows - 1)
    z = land.elevation
    along_x = (z[j, east] - z[j, west]) / ((east - west) * land.spacing)
    return along_x, (z[north, i] - z[south, i]) / ((north - south) * land.spacing)


@inner
def _colour(land, i, j, u, v, channel):  # type: ignore[no-untyped-def]
    rgb, linear = land.rgb, land.linear
    sw, se = linear[rgb[j, i, channel]], linear[rgb[j, i + 1, channel]]
    nw, ne = linear[rgb[j + 1, i, channel]], linear[rgb[j + 1, i + 1, channel]]
    return _blend(sw, se, nw, ne, u, v)


@inner
def _grain(land, i, j, u, v, part):  # type: ignore[no-untyped-def]
    grain = land.grain
    return 0.01 * _blend(
        np.float64(grain[j, i, part]), np.float64(grain[j, i + 1, part]),
        np.float64(grain[j + 1, i, part]), np.float64(grain[j + 1, i + 1, part]), u, v,
    )  # fmt: skip


@inner
def _set_normal(point, x, y, z):  # type: ignore[no-untyped-def]
    length = np.sqrt(x * x + y * y + z * z)
    point[BENT_X], point[BENT_Y], point[BENT_Z] = x / length, y / length, z / length


@inner
def _track(tracks, land, x, y, ragged, footprint):  # type: ignore[no-untyped-def]
    """Imprint (0 to 1) and rise per metre along x and y of the wheel tracks at a place.

    `ragged` is noise about 0 that frays the edges and leaves gaps.
    """
    i, j, u, v = _cell(land, x, y)
    at = tracks.nearest[j + (v > 0.5), i + (u > 0.5)]
    if at < 0:
        return 0.0, 0.0, 0.0
    from_x, from_y, cos, sin, distance = tracks.points[at]
    sideways = (y - from_y) * cos - (x - from_x) * sin
    along = distance + (x - from_x) * cos + (y - from_y) * sin
    inner = (abs(sideways) - tracks.half_gauge) / (0.5 * tracks.width) + 0.8 * ragged
    soft = max(0.3, 2.0 * footprint / tracks.width)
    depth = min(1.0, max(0.0, (1.0 + soft - abs(inner)) / soft))
    depth *= min(1.0, max(0.3, 0.75 + 2.5 * ragged))
    shown = max(0.0, 1.0 - footprint / 0.03)
    phase = 2.0 * np.pi * (along / 0.09 + 0.25 * abs(inner))
    tread = 0.5 * depth * shown * np.cos(phase)
    edge = 0.0
    if 0.8 < abs(inner) < 1.35 and shown > 0.0:
        edge = 0.5 * shown * (1.0 if abs(inner) < 1.1 else -0.8)
        edge *= np.sign(inner) * np.sign(sideways)
    return depth, tread * cos - edge * sin, tread * sin + edge * cos


@inner
def see_ground(point, land, tracks, footprint):  # type: ignore[no-untyped-def]
    """Fill in normal, albedo and lift of a point on the ground; its place is set already."""
    x, y = point[X], point[Y]
    i, j, u, v = _cell(land, x, y)
    slope_x, slope_y = _round_off(point, land, i, j, u, v)
    east, north = x + land.shift[0], y + land.shift[1]
    grain = (_grain(land, i, j, u, v, 0), _grain(land, i, j, u, v, 1), _grain(land, i, j, u, v, 2))
    bright, shade, rise_x, rise_y = ground_grain(
        land.key, grain, *land.shadow, east, north, land.spacing, footprint
    )
    depth, track_x, track_y = _track(tracks, land, x, y, bright - 1.0, footprint)
    kept = 1.0 - 0.45 * depth
    rise_x, rise_y = rise_x * kept + track_x, rise_y * kept + track_y
    _set_normal(point, -(slope_x + rise_x), -(slope_y + rise_y), 1.0)
    point[SHADE] = shade * (1.0 - depth)
    bright *= 1.0 - 0.3 * depth
    for channel in range(3):
        point[RED + channel] = _colour(land, i, j, u, v, channel) * bright


@inner
def see_apron(point, land, triangle, u, v, footprint):  # type: ignore[no-untyped-def]
    """Fill in normal and albedo of a point beyond the ground's edge; its place is set already."""
    corners = land.apron_faces[triangle]
    east, north = point[X] + land.shift[0], point[Y] + land.shift[1]
    bright, shade, rise_x, rise_y = ground_grain(
        land.key, land.usual, *land.shadow, east, north, SOIL_COARSEST, footprint
    )  # with the waves too that the ground's grid holds within the edge
    x, y, z, parts = 0.0, 0.0, 0.0, (1.0 - u - v, u, v)
    for channel in range(3):
        point[RED + channel] = 0.0
    for k in range(3):
        normal, rgb = land.apron_normals[corners[k]], land.apron_rgb[corners[k]]
        x, y, z = x + parts[k] * normal[0], y + parts[k] * normal[1], z + parts[k] * normal[2]
        for channel in range(3):
            point[RED + channel] += parts[k] * rgb[channel] * bright
    _set_normal(point, x / z - rise_x, y / z - rise_y, 1.0)
    point[SHADE], point[LIFT] = shade, 0.0


@inner
def _round_off(point, land, i, j, u, v):  # type: ignore[no-untyped-def]
    """The interpolated slope, and the lift to the smooth surface that it pretends.

    Without the lift every facet shades itself under a low Sun. It blends the nodes' tangent planes
    over the point (Hanika 2021, Ray Tracing Gems II, chapter 4).
    """
    lift, along_x, along_y = 0.0, 0.0, 0.0
    for corner in range(4):
        a, b = corner & 1, corner >> 1
        slope_x, slope_y = _node_slope(land, i + a, j + b)
        off_x, off_y = (u - a) * land.spacing, (v - b) * land.spacing
        plane = land.elevation[j + b, i + a] + slope_x * off_x + slope_y * off_y
        weight = (u if a else 1.0 - u) * (v if b else 1.0 - v)
        lift += weight * max(0.0, plane - point[Z])
        along_x += weight * slope_x
        along_y += weight * slope_y
    point[LIFT] = lift
    return along_x, along_y


@inner
def _smooth_normal(stones, rock, triangle, u, v):  # type: ignore[no-untyped-def]
    """The interpolated vertex normal of a rock in its own frame."""
    corners = stones.faces[stones.first_face[rock] + triangle]
    a, b, c = stones.normals[corners[0]], stones.normals[corners[1]], stones.normals[corners[2]]
    rest = 1.0 - u - v
    return (
        rest * a[0] + u * b[0] + v * c[0],
        rest * a[1] + u * b[1] + v * c[1],
        rest * a[2] + u * b[2] + v * c[2],
    )


@inner
def see_rock(point, land, stones, rock, triangle, u, v, footprint):  # type: ignore[no-untyped-def]
    """Fill in the normal and the albedo of a point on a rock; its place and flat normal are set."""
    turn, centre = stones.rotation[rock], stones.centre[rock]
    x, y, z = point[X] - centre[0], point[Y] - centre[1], point[Z] - centre[2]
    own_x = turn[0, 0] * x + turn[1, 0] * y + turn[2, 0] * z
    own_y = turn[0, 1] * x + turn[1, 1] * y + turn[2, 1] * z
    own_z = turn[0, 2] * x + turn[1, 2] * y + turn[2, 2] * z
    size = stones.size[rock]
    x, y, z = point[FLAT_X], point[FLAT_Y], point[FLAT_Z]
    facing = (
        turn[0, 0] * x + turn[1, 0] * y + turn[2, 0] * z,
        turn[0, 1] * x + turn[1, 1] * y + turn[2, 1] * z,
        turn[0, 2] * x + turn[1, 2] * y + turn[2, 2] * z,
    )
    own = own_x, own_y, own_z
    value, rise_x, rise_y, rise_z = 0.0, 0.0, 0.0, 0.0
    if size > _SMOOTH:
        value, rise_x, rise_y, rise_z = tile_at(
            stones.tile, own, facing, stones.scale[rock], footprint
        )
    a, b, c = _smooth_normal(stones, rock, triangle, u, v)
    a, b, c = a - rise_x, b - rise_y, c - rise_z
    _set_normal(
        point,
        turn[0, 0] * a + turn[0, 1] * b + turn[0, 2] * c,
        turn[1, 0] * a + turn[1, 1] * b + turn[1, 2] * c,
        turn[2, 0] * a + turn[2, 1] * b + turn[2, 2] * c,
    )
    point[SHADE], point[LIFT] = 0.0, 0.0
    i, j, s, t = _cell(land, point[X], point[Y])
    ground = _height(land, i, j, s, t)
    low = max(0.0, 1.0 - (point[Z] - ground) / (0.04 + 0.12 * size))
    up = min(1.0, max(0.0, (point[BENT_Z] - 0.35 + value) / 0.5))
    dust = min(1.0, stones.dust * up + 0.6 * low * low)
    for channel in range(3):
        bare = stones.rgb[rock, channel] * (1.0 + value)
        soiled = _colour(land, i, j, s, t, channel) * (1.0 + 0.4 * value)
        point[RED + channel] = bare + dust * (soiled - bare)


@inner
def _height(land, i, j, u, v):  # type: ignore[no-untyped-def]
    z = land.elevation
    return _blend(z[j, i], z[j, i + 1], z[j + 1, i], z[j + 1, i + 1], u, v)


@inner
def disc_place(key, column, row, sample, what):  # type: ignore[no-untyped-def]
    """A place on the unit disc for a pixel; `sample` 0 to 3 stratifies by angle and radius."""
    draw = cell_hash(key, column, row, what)
    azimuth = 0.5 * np.pi * (sample + 0.5 + 0.5 * part(draw, np.uint64(0)))
    ring = (2 * sample + (sample >> 1)) & 3
    share = (ring + 0.5 + 0.5 * part(draw, np.uint64(16 + 8 * (sample & 1)))) / 4.0
    radius = np.sqrt(min(max(share, 0.0), 1.0))
    return radius * np.cos(azimuth), radius * np.sin(azimuth)


@inner
def hemisphere(point, key, column, row, sample):  # type: ignore[no-untyped-def]
    """A direction about the shading normal, density by the cosine; `sample` 0 to 3 stratifies."""
    a, b = disc_place(key, column, row, sample, np.int64(7))
    c = np.sqrt(max(0.0, 1.0 - a * a - b * b))
    x, y, z = point[BENT_X], point[BENT_Y], point[BENT_Z]
    # Duff et al. 2017 (JCGT 6(1)): an orthonormal basis without a branch.
    sign = 1.0 if z >= 0.0 else -1.0
    p = -1.0 / (sign + z)
    q = x * y * p
    return (
        a * (1.0 + sign * x * x * p) + b * q + c * x,
        a * sign * q + b * (sign + y * y * p) + c * y,
        -a * sign * x - b * y + c * z,
    )
