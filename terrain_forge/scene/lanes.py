"""What the eight rays of a packet see where they land, and the light that comes back from there.

Numbers of the lanes lie side by side in one workspace, so that the compiler makes vector
instructions of the loops over them.
"""

from __future__ import annotations

import numpy as np

from terrain_forge.base import merged
from terrain_forge.scene.packets import (
    COPY,
    FAR,
    LANES,
    NORMAL_X,
    NORMAL_Y,
    NORMAL_Z,
    TRIANGLE,
    U,
    V,
)
from terrain_forge.scene.relief import (
    FOOTPRINT,
    PEBBLY,
    RELIEF_ROWS,
    ROUGH,
    SLABBY,
)
from terrain_forge.scene.stage import (
    CENTRE,
    GRAIN,
    GROUND_RGB,
    HEIGHT,
    ROCK_RGB,
    SIZE,
    SKY,
    SLOPE_X,
    SLOPE_Y,
    TURN,
)

(
    OWNER, AIM_X, AIM_Y, AIM_Z, RANGE, STEP, HIT_X, HIT_Y, HIT_Z, FLAT_X, FLAT_Y, FLAT_Z, SMOOTH_X,
    SMOOTH_Y, SMOOTH_Z, BENT_X, BENT_Y, BENT_Z, LIFT, OPEN, ABOVE, WIDE, CLEAR, BACK, DARK,
    OWN_X, OWN_Y, OWN_Z, SOIL_RGB, _, _, RGB, _, _, DIRECT, _, _, REST, _, _,
) = (LANES * (RELIEF_ROWS + row) for row in range(40))  # fmt: skip
"""Rows of the workspace behind those of the relief: what a lane sees (a rock's row, -1 the ground,
-2 nothing, -3 the land beyond, -4 the rover), its unit direction, the distance [m], the angle of a
pixel [rad], the place in the scene's frame [m], the normals of triangle, smooth surface and grain,
the height of the smooth surface over the triangle, the open share of the sky, height above the
ground, a rock's size, clearness of the air, part of the sunlight that comes back, and
that small stones keep off, the place in a
rock's own frame; albedo of the ground there and of the surface; radiance by the Sun and without."""
WORKSPACE = LANES * (RELIEF_ROWS + 40)

_0, _HALF, _1, _EPS = (np.float32(n) for n in (0.0, 0.5, 1.0, 1e-12))
_GRAZING, _TINY = np.float32(0.04), np.float32(1e-6)


@merged
def _ground_below(space, lane, stage):  # type: ignore[no-untyped-def]
    """Find the ground under a lane's place: colour, height, sky; returns its slope and lift."""
    nodes = stage.nodes
    column = (space[HIT_X + lane] - stage.corner_x) / stage.spacing
    row = (space[HIT_Y + lane] - stage.corner_y) / stage.spacing
    i = min(max(np.int64(np.floor(column)), 0), nodes.shape[1] - 2)
    j = min(max(np.int64(np.floor(row)), 0), nodes.shape[0] - 2)
    u = min(max(column - np.float32(i), _0), _1)
    v = min(max(row - np.float32(j), _0), _1)
    slope_x, slope_y, lift, height, sky = _0, _0, _0, _0, _0
    pebbly, rough, slabby = _0, _0, _0
    channels = nodes.shape[2] - GROUND_RGB
    for channel in range(channels):
        space[SOIL_RGB + LANES * channel + lane] = _0
    for corner in range(4):
        a, b = corner & 1, corner >> 1
        off_u, off_v = u - np.float32(a), v - np.float32(b)
        weight = (_1 - abs(off_u)) * (_1 - abs(off_v))
        node = nodes[j + b, i + a]
        z, along_x, along_y = node[HEIGHT], node[SLOPE_X], node[SLOPE_Y]
        plane = z + (along_x * off_u + along_y * off_v) * stage.spacing
        lift += weight * max(_0, plane - space[HIT_Z + lane])
        slope_x, slope_y = slope_x + weight * along_x, slope_y + weight * along_y
        height, sky = height + weight * z, sky + weight * node[SKY]
        pebbly, rough = pebbly + weight * node[GRAIN], rough + weight * node[GRAIN + 1]
        slabby += weight * node[GRAIN + 2]
        for channel in range(channels):
            space[SOIL_RGB + LANES * channel + lane] += weight * node[GROUND_RGB + channel]
    space[ABOVE + lane], space[OPEN + lane] = space[HIT_Z + lane] - height, sky
    space[PEBBLY + lane], space[ROUGH + lane], space[SLABBY + lane] = pebbly, rough, slabby
    return slope_x, slope_y, lift


@merged
def set_unit(space, first, lane, x, y, z):  # type: ignore[no-untyped-def]
    """Set three rows of a lane to a vector made as long as 1."""
    scale = _1 / np.sqrt(x * x + y * y + z * z + _EPS)
    space[first + lane] = x * scale
    space[first + LANES + lane] = y * scale
    space[first + 2 * LANES + lane] = z * scale


@merged
def _meet_ground(space, lane, stage):  # type: ignore[no-untyped-def]
    slope_x, slope_y, lift = _ground_below(space, lane, stage)
    set_unit(space, SMOOTH_X, lane, -slope_x, -slope_y, _1)
    space[LIFT + lane] = lift
    for channel in range(stage.nodes.shape[2] - GROUND_RGB):
        space[RGB + LANES * channel + lane] = space[SOIL_RGB + LANES * channel + lane]


@merged
def _meet_land(space, lane, ray, word, stage):  # type: ignore[no-untyped-def]
    a, b, c = _corners(word, lane, stage, stage.land_face)
    u, v = ray[U, lane], ray[V, lane]
    _smooth(space, lane, stage, a, b, c, u, v)
    space[OPEN + lane] = _1 if stage.haze < np.inf else _0
    space[PEBBLY + lane], space[ROUGH + lane] = stage.usual[0], stage.usual[1]
    space[SLABBY + lane] = stage.usual[2]
    first, land = stage.land_corner, stage.land
    space[WIDE + lane] = _1
    if np.int64(word[TRIANGLE, lane]) < stage.land_rock:
        space[WIDE + lane] = _0
        space[LIFT + lane] = (
            (_1 - u - v) * _over(space, lane, stage, a)
            + u * _over(space, lane, stage, b)
            + v * _over(space, lane, stage, c)
        )
    for channel in range(land.shape[1]):
        space[RGB + LANES * channel + lane] = (
            (_1 - u - v) * land[a - first, channel]
            + u * land[b - first, channel]
            + v * land[c - first, channel]
        )


@merged
def _over(space, lane, stage, corner):  # type: ignore[no-untyped-def]
    """How far the plane of a corner's normal lies over a lane's place on the land beyond [m]."""
    point, normal = stage.land_points[corner - stage.land_corner], stage.normals[corner]
    x, y = space[HIT_X + lane] - point[0], space[HIT_Y + lane] - point[1]
    fall = (normal[0] * x + normal[1] * y) / max(normal[2], _TINY)
    return max(_0, point[2] - fall - space[HIT_Z + lane])


@merged
def _corners(word, lane, stage, first):  # type: ignore[no-untyped-def]
    """Corners of the triangle that a lane hit, whose shape begins at a face."""
    corners = stage.faces[first + np.int64(word[TRIANGLE, lane])]
    return corners[0], corners[1], corners[2]


@merged
def _smooth(space, lane, stage, a, b, c, u, v):  # type: ignore[no-untyped-def]
    """Set the normal between those at a triangle's corners, in the shape's own frame."""
    for axis in range(3):
        space[SMOOTH_X + LANES * axis + lane] = (
            (_1 - u - v) * stage.normals[a, axis]
            + u * stage.normals[b, axis]
            + v * stage.normals[c, axis]
        )
    x, y, z = space[SMOOTH_X + lane], space[SMOOTH_Y + lane], space[SMOOTH_Z + lane]
    set_unit(space, SMOOTH_X, lane, x, y, z)


@merged
def _meet_rock(space, lane, ray, word, stage, rock):  # type: ignore[no-untyped-def]
    record = stage.rocks[rock]
    x, y, z = ray[NORMAL_X, lane], ray[NORMAL_Y, lane], ray[NORMAL_Z, lane]
    set_unit(
        space, FLAT_X, lane,
        record[TURN] * x + record[TURN + 1] * y + record[TURN + 2] * z,
        record[TURN + 3] * x + record[TURN + 4] * y + record[TURN + 5] * z,
        record[TURN + 6] * x + record[TURN + 7] * y + record[TURN + 8] * z,
    )  # fmt: skip
    x = space[HIT_X + lane] - record[CENTRE]
    y = space[HIT_Y + lane] - record[CENTRE + 1]
    z = space[HIT_Z + lane] - record[CENTRE + 2]
    for axis in range(3):
        space[OWN_X + LANES * axis + lane] = (
            record[TURN + axis] * x + record[TURN + 3 + axis] * y + record[TURN + 6 + axis] * z
        )
    _ground_below(space, lane, stage)
    a, b, c = _corners(word, lane, stage, stage.first_face[rock])
    _smooth(space, lane, stage, a, b, c, ray[U, lane], ray[V, lane])
    space[WIDE + lane] = record[SIZE]
    for channel in range(len(record) - ROCK_RGB):
        space[RGB + LANES * channel + lane] = record[ROCK_RGB + channel]
    _turn_smooth(space, lane, record)


@merged
def _turn_smooth(space, lane, record):  # type: ignore[no-untyped-def]
    x, y, z = space[SMOOTH_X + lane], space[SMOOTH_Y + lane], space[SMOOTH_Z + lane]
    set_unit(
        space, SMOOTH_X, lane,
        record[TURN] * x + record[TURN + 1] * y + record[TURN + 2] * z,
        record[TURN + 3] * x + record[TURN + 4] * y + record[TURN + 5] * z,
        record[TURN + 6] * x + record[TURN + 7] * y + record[TURN + 8] * z,
    )  # fmt: skip
    # The sky over a rock: what its ground sees, more the higher it is.
    high = min(_1, max(_0, space[ABOVE + lane] / max(space[WIDE + lane], _TINY)))
    share = space[OPEN + lane]
    if share > _0:  # there is none on a body without air
        share += high * (_1 - share)
    space[OPEN + lane] = share * _HALF * (_1 + space[SMOOTH_Z + lane])


@merged
def _meet_body(space, lane, word, stage, parts):  # type: ignore[no-untyped-def]
    for axis in range(3):
        space[SMOOTH_X + LANES * axis + lane] = space[FLAT_X + LANES * axis + lane]
    share = _HALF * (_1 + space[SMOOTH_Z + lane])
    space[OPEN + lane] = share if stage.haze < np.inf else _0
    for channel in range(parts.shape[1]):
        space[RGB + LANES * channel + lane] = parts[np.int64(word[COPY, lane]), channel]


@merged
def meet(space, lane, ray, word, owner, origin, stage, parts):  # type: ignore[no-untyped-def]
    """Fill in what a lane sees: its place, normals, colours; its direction and angle are set."""
    space[OWNER + lane], space[LIFT + lane] = np.float32(owner), _0
    space[DARK + lane] = _0
    if owner == -2:
        space[RANGE + lane], space[FOOTPRINT + lane] = _0, np.float32(np.inf)
        return
    far = ray[FAR, lane]
    space[RANGE + lane] = far
    space[HIT_X + lane] = origin[0] + far * space[AIM_X + lane]
    space[HIT_Y + lane] = origin[1] + far * space[AIM_Y + lane]
    space[HIT_Z + lane] = origin[2] + far * space[AIM_Z + lane]
    if owner >= 0:
        _meet_rock(space, lane, ray, word, stage, owner)
    else:
        x, y, z = ray[NORMAL_X, lane], ray[NORMAL_Y, lane], ray[NORMAL_Z, lane]
        if z < _0 and owner == -1:
            x, y, z = -x, -y, -z
        set_unit(space, FLAT_X, lane, x, y, z)
        if owner == -1:
            _meet_ground(space, lane, stage)
        elif owner == -3:
            _meet_land(space, lane, ray, word, stage)
        else:
            _meet_body(space, lane, word, stage, parts)
    facing = -(
        space[FLAT_X + lane] * space[AIM_X + lane]
        + space[FLAT_Y + lane] * space[AIM_Y + lane]
        + space[FLAT_Z + lane] * space[AIM_Z + lane]
    )
    space[FOOTPRINT + lane] = space[STEP + lane] * far / np.sqrt(max(facing, _GRAZING))
    for axis in range(3):
        space[BENT_X + LANES * axis + lane] = space[SMOOTH_X + LANES * axis + lane]
