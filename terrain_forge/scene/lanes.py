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
    COARSEST,
    FOOTPRINT,
    PLACE_X,
    PLACE_Y,
    PLACE_Z,
    RELIEF_ROWS,
    RISE_X,
    RISE_Y,
    RISE_Z,
    SHADOWED,
    STONE,
    VALUE,
    clast_lanes,
    face_lanes,
    soil_lanes,
)
from terrain_forge.scene.stage import (
    AMBIENT,
    BOUNCE,
    CENTRE,
    GROUND_RGB,
    HEIGHT,
    HORIZON,
    ROCK_RGB,
    SIZE,
    SKY,
    SLOPE_X,
    SLOPE_Y,
    SUN,
    TURN,
    ZENITH,
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

_0, _HALF, _1, _2, _EPS = (np.float32(n) for n in (0.0, 0.5, 1.0, 2.0, 1e-12))
_GRAZING, _TALL = np.float32(0.04), np.float32(0.35)
_ROUGH, _LEAST_MU, _SURGE, _SURGE_WIDTH, _TINY = (
    np.float32(n) for n in (0.05 * 0.05, 0.1, 0.5, 0.08, 1e-6)
)
_SHADE = np.float32(0.7)
_TREAD, _TREAD_PHASE, _FULL_TURN = np.float32(0.09), np.float32(0.25), np.float32(2.0 * np.pi)


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
        for channel in range(channels):
            space[SOIL_RGB + LANES * channel + lane] += weight * node[GROUND_RGB + channel]
    space[ABOVE + lane], space[OPEN + lane] = space[HIT_Z + lane] - height, sky
    return slope_x, slope_y, lift


@merged
def _set_unit(space, first, lane, x, y, z):  # type: ignore[no-untyped-def]
    scale = _1 / np.sqrt(x * x + y * y + z * z + _EPS)
    space[first + lane] = x * scale
    space[first + LANES + lane] = y * scale
    space[first + 2 * LANES + lane] = z * scale


@merged
def _meet_ground(space, lane, stage):  # type: ignore[no-untyped-def]
    slope_x, slope_y, lift = _ground_below(space, lane, stage)
    _set_unit(space, SMOOTH_X, lane, -slope_x, -slope_y, _1)
    space[LIFT + lane] = lift
    for channel in range(stage.nodes.shape[2] - GROUND_RGB):
        space[RGB + LANES * channel + lane] = space[SOIL_RGB + LANES * channel + lane]


@merged
def _meet_land(space, lane, ray, word, stage):  # type: ignore[no-untyped-def]
    a, b, c = _corners(word, lane, stage, stage.land_face)
    u, v = ray[U, lane], ray[V, lane]
    _smooth(space, lane, stage, a, b, c, u, v)
    space[OPEN + lane] = _1 if stage.haze < np.inf else _0
    first, land = stage.land_corner, stage.land
    for channel in range(land.shape[1]):
        space[RGB + LANES * channel + lane] = (
            (_1 - u - v) * land[a - first, channel]
            + u * land[b - first, channel]
            + v * land[c - first, channel]
        )


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
    _set_unit(space, SMOOTH_X, lane, x, y, z)


@merged
def _meet_rock(space, lane, ray, word, stage, rock):  # type: ignore[no-untyped-def]
    record = stage.rocks[rock]
    x, y, z = ray[NORMAL_X, lane], ray[NORMAL_Y, lane], ray[NORMAL_Z, lane]
    _set_unit(
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
    space[WIDE + lane], space[COARSEST + lane] = record[SIZE], _TALL * record[SIZE]
    space[STONE + lane] = np.float32((rock * 7919 + 101) & 0xFFFFFF)
    for channel in range(len(record) - ROCK_RGB):
        space[RGB + LANES * channel + lane] = record[ROCK_RGB + channel]
    _turn_smooth(space, lane, record)


@merged
def _turn_smooth(space, lane, record):  # type: ignore[no-untyped-def]
    x, y, z = space[SMOOTH_X + lane], space[SMOOTH_Y + lane], space[SMOOTH_Z + lane]
    _set_unit(
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
    space[OWNER + lane], space[COARSEST + lane], space[LIFT + lane] = np.float32(owner), _0, _0
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
        if z < _0 and owner != -4:
            x, y, z = -x, -y, -z
        _set_unit(space, FLAT_X, lane, x, y, z)
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


@merged
def _imprint(space, lane, stage, wheels, behind):  # type: ignore[no-untyped-def]
    """Depth (0 to 1) and rise per metre along x and y of the wheel tracks under a lane."""
    x, y = space[HIT_X + lane], space[HIT_Y + lane]
    rows, columns = stage.nodes.shape[:2]
    i = np.int64(np.floor((x - stage.corner_x) / stage.spacing + _HALF))
    j = np.int64(np.floor((y - stage.corner_y) / stage.spacing + _HALF))
    i, j = min(max(i, np.int64(0)), columns - 1), min(max(j, np.int64(0)), rows - 1)
    for one in (1, 0):
        at = wheels.nearest[j, i, one]
        if at < 0:
            return _0, _0, _0
        point = wheels.points[at]
        cos, sin, off_x, off_y = point[2], point[3], x - point[0], y - point[1]
        along = point[4] + off_x * cos + off_y * sin
        if along <= behind:
            sideways = off_y * cos - off_x * sin
            return _pressed(space, lane, wheels, sideways, along, cos, sin)
    return _0, _0, _0


_FRAY, _SHALLOW, _USUAL, _GAPS, _SOFT = (np.float32(n) for n in (0.8, 0.3, 0.75, 2.5, 0.3))
_RIM_IN, _RIM, _RIM_OUT, _RIM_FALL = (np.float32(n) for n in (0.8, 1.1, 1.35, -0.8))
_TRACK_FADE = np.float32(0.03)


@merged
def _pressed(space, lane, wheels, sideways, along, cos, sin):  # type: ignore[no-untyped-def]
    ragged, footprint = space[VALUE + lane] - _1, space[FOOTPRINT + lane]
    inner_ = (abs(sideways) - wheels.half_gauge) / (_HALF * wheels.width) + _FRAY * ragged
    soft = max(_SOFT, _2 * footprint / wheels.width)
    depth = min(_1, max(_0, (_1 + soft - abs(inner_)) / soft))
    depth *= min(_1, max(_SHALLOW, _USUAL + _GAPS * ragged))
    shown = max(_0, _1 - footprint / _TRACK_FADE)
    phase = _FULL_TURN * (along / _TREAD + _TREAD_PHASE * abs(inner_))
    tread = _HALF * depth * shown * np.cos(phase)
    edge = _0
    if _RIM_IN < abs(inner_) < _RIM_OUT:
        edge = _HALF * shown * (_1 if abs(inner_) < _RIM else _RIM_FALL)
        if (inner_ < _0) != (sideways < _0):
            edge = -edge
    return depth, tread * cos - edge * sin, tread * sin + edge * cos


_GROUND, _LAND = np.float32(-1.0), np.float32(-3.0)
_KEPT, _DARKER = np.float32(0.45), np.float32(0.3)


@merged
def _grow_ground(space, stage, relief, octaves, keys, owner, wheels, behind, anchor):  # type: ignore[no-untyped-def]
    """Soil, small stones and tracks of the lanes that see the ground or the land beyond."""
    for lane in range(LANES):
        space[PLACE_X + lane] = space[HIT_X + lane] - anchor[0]
        space[PLACE_Y + lane] = space[HIT_Y + lane] - anchor[1]
    soil_lanes(space, octaves, keys)
    clast_lanes(space, relief)
    for lane in range(LANES):
        if space[OWNER + lane] != owner:
            continue
        depth, track_x, track_y = _0, _0, _0
        if owner == _GROUND:
            depth, track_x, track_y = _imprint(space, lane, stage, wheels, behind)
        kept, steep = _1 - _KEPT * depth, _1 / max(space[SMOOTH_Z + lane], _TINY)
        rise_x = space[RISE_X + lane] * kept + track_x
        rise_y = space[RISE_Y + lane] * kept + track_y
        x, y = space[SMOOTH_X + lane] * steep, space[SMOOTH_Y + lane] * steep
        _set_unit(space, BENT_X, lane, x - rise_x, y - rise_y, _1)
        space[DARK + lane] = space[SHADOWED + lane] * (_1 - depth)
        for channel in range(stage.nodes.shape[2] - GROUND_RGB):
            space[RGB + LANES * channel + lane] *= space[VALUE + lane] * (_1 - _DARKER * depth)


_LOW_0, _LOW_1, _UP, _UP_VALUE, _LOW_DUST, _SPOTS, _SOILED = (
    np.float32(n) for n in (0.04, 0.12, 0.35, 0.5, 0.6, 0.45, 0.2)
)


@merged
def _grow_faces(space, stage, relief):  # type: ignore[no-untyped-def]
    """Rough faces and dust of the lanes that see rocks."""
    for lane in range(LANES):
        space[PLACE_X + lane], space[PLACE_Y + lane] = space[OWN_X + lane], space[OWN_Y + lane]
        space[PLACE_Z + lane] = space[OWN_Z + lane]
    face_lanes(space, relief.faces)
    channels = stage.nodes.shape[2] - GROUND_RGB
    for lane in range(LANES):
        if space[OWNER + lane] < _0:
            continue
        record = stage.rocks[np.int64(space[OWNER + lane])]
        x, y, z = space[RISE_X + lane], space[RISE_Y + lane], space[RISE_Z + lane]
        _set_unit(
            space, BENT_X, lane,
            space[SMOOTH_X + lane]
            - (record[TURN] * x + record[TURN + 1] * y + record[TURN + 2] * z),
            space[SMOOTH_Y + lane]
            - (record[TURN + 3] * x + record[TURN + 4] * y + record[TURN + 5] * z),
            space[SMOOTH_Z + lane]
            - (record[TURN + 6] * x + record[TURN + 7] * y + record[TURN + 8] * z),
        )  # fmt: skip
        value = space[VALUE + lane]
        low = max(_0, _1 - space[ABOVE + lane] / (_LOW_0 + _LOW_1 * space[WIDE + lane]))
        up = (space[BENT_Z + lane] - _UP + _UP_VALUE * value) / _HALF
        dust = min(_1, stage.dust * min(_1, max(_0, up)) + _LOW_DUST * low * low)
        for channel in range(channels):
            bare = space[RGB + LANES * channel + lane] * (_1 + _SPOTS * value)
            soiled = space[SOIL_RGB + LANES * channel + lane] * (_1 + _SOILED * value)
            space[RGB + LANES * channel + lane] = bare + dust * (soiled - bare)


@merged
def shine(space, stage, relief, wheels, behind, anchor):  # type: ignore[no-untyped-def]
    """The lanes' radiance: by the Sun, if nothing stands before it, and without."""
    ground, land, rocks = False, False, False
    for lane in range(LANES):
        owner = space[OWNER + lane]
        ground, land, rocks = (
            ground or owner == _GROUND, land or owner == _LAND, rocks or owner >= _0
        )  # fmt: skip
    if rocks:  # first, since what follows uses the same rows
        _grow_faces(space, stage, relief)
    if land:
        _grow_ground(
            space, stage, relief, relief.far, relief.far_keys, _LAND, wheels, behind, anchor
        )
    if ground:
        _grow_ground(
            space, stage, relief, relief.soil, relief.soil_keys, _GROUND, wheels, behind, anchor
        )
    _reflect(space, stage)
    for lane in range(LANES):
        space[CLEAR + lane] = np.exp(-space[RANGE + lane] / stage.haze)
    for channel in range(stage.nodes.shape[2] - GROUND_RGB):
        sun, sky, bounce = (
            stage.colours[SUN, channel], stage.colours[AMBIENT, channel],
            stage.colours[BOUNCE, channel],
        )  # fmt: skip
        horizon, zenith = stage.colours[HORIZON, channel], stage.colours[ZENITH, channel]
        row = LANES * channel
        for lane in range(LANES):
            albedo, clear = space[RGB + row + lane], space[CLEAR + lane]
            share = space[OPEN + lane]
            space[DIRECT + row + lane] = albedo * sun * space[BACK + lane] * clear
            shone = albedo * (sky * share + bounce * (_1 - share))
            space[REST + row + lane] = shone * clear + horizon * (_1 - clear)
        for lane in range(LANES):
            if space[OWNER + lane] == -_2:
                down = _1 - max(space[AIM_Z + lane], _0)
                blend = _1 - down * down * down * down
                space[DIRECT + row + lane] = _0
                space[REST + row + lane] = horizon + blend * (zenith - horizon)


@merged
def _reflect(space, stage):  # type: ignore[no-untyped-def]
    """Lunar-Lambert reflectance over albedo times the cosine of incidence (light.py)."""
    sun_x, sun_y, sun_z, lunar = stage.sun[0], stage.sun[1], stage.sun[2], stage.lunar
    for lane in range(LANES):
        x, y, z = space[BENT_X + lane], space[BENT_Y + lane], space[BENT_Z + lane]
        a, b, c = space[AIM_X + lane], space[AIM_Y + lane], space[AIM_Z + lane]
        mu0 = x * sun_x + y * sun_y + z * sun_z
        mu0 = _HALF * (mu0 + np.sqrt(mu0 * mu0 + _ROUGH))
        mu = max(-(x * a + y * b + z * c), _LEAST_MU)
        phase = -(sun_x * a + sun_y * b + sun_z * c)
        half = np.sqrt(max(_0, _1 - phase) / (_1 + phase + _TINY))
        surge = _1 + _SURGE / (_1 + half / _SURGE_WIDTH)
        back = surge * (lunar * _2 * mu0 / (mu0 + mu) + (_1 - lunar) * mu0)
        space[BACK + lane] = back * (_1 - _SHADE * space[DARK + lane])
        # Ground that grain tilts sees less of the sky.
        space[OPEN + lane] *= min(_1, (_1 + z) / (_1 + space[SMOOTH_Z + lane]))
