"""Light that comes back from what the eight rays of a packet see: texture, tracks, reflectance.

Ground and rocks send it back by the law of `photometry.py`, a rover by Lambert's.
"""

from __future__ import annotations

import numpy as np

from terrain_forge.base import merged
from terrain_forge.scene.lanes import (
    ABOVE,
    AIM_X,
    AIM_Y,
    AIM_Z,
    BACK,
    BENT_X,
    BENT_Y,
    BENT_Z,
    CLEAR,
    DARK,
    DIRECT,
    FLAT_X,
    FLAT_Y,
    FLAT_Z,
    HIT_X,
    HIT_Y,
    HIT_Z,
    OPEN,
    OWN_X,
    OWN_Y,
    OWN_Z,
    OWNER,
    RANGE,
    REST,
    RGB,
    SMOOTH_X,
    SMOOTH_Y,
    SMOOTH_Z,
    SOIL_RGB,
    STEP,
    WIDE,
    set_unit,
)
from terrain_forge.scene.packets import LANES
from terrain_forge.scene.pebbles import clast_lanes
from terrain_forge.scene.relief import (
    FOOTPRINT,
    PLACE_X,
    PLACE_Y,
    PLACE_Z,
    RISE_X,
    RISE_Y,
    SHADOWED,
    VALUE,
    soil_lanes,
)
from terrain_forge.scene.rock_tile import tile_at
from terrain_forge.scene.stage import (
    AMBIENT,
    BOUNCE,
    EVEN,
    GROUND_RGB,
    SCALE,
    SIZE,
    SUN,
    TURN,
)
from terrain_forge.scene.tints import DUST_FROM, DUST_OVER, DUST_VALUE, SOILED

_0, _HALF, _1, _2, _TINY = (np.float32(n) for n in (0.0, 0.5, 1.0, 2.0, 1e-6))
_ROUGH, _LEAST_MU, _ROVER = (np.float32(n) for n in (0.05**2, 0.1, -4.0))
_SHADE, _LEAST_RISE = np.float32(0.7), np.float32(-0.8)
_BRIGHTER, _DIMMER = np.float32(0.35), np.float32(1.4)
"""How the light of a sky that leans to the Sun falls short, on steep faces, of what the slope of
gentle ones says. At a τ of 0.3 to 1.5 it is within 0.1 of what level ground gets of a sum over the
sky on faces away from the Sun, 0.2 on those towards it, 0.4 at a τ of 0.3 and a Sun of 20°."""
_TREAD, _TREAD_PHASE, _FULL_TURN = np.float32(0.09), np.float32(0.25), np.float32(2.0 * np.pi)


@merged
def _imprint(space, lane, stage, wheels, behind):  # type: ignore[no-untyped-def]
    """Depth (0 to 1) and rise per metre along x and y of the wheel tracks under a lane.

    Of several passes the one that pressed deepest shows, of equal ones the last.
    """
    x, y = space[HIT_X + lane], space[HIT_Y + lane]
    rows, columns = stage.nodes.shape[:2]
    i = np.int64(np.floor((x - stage.corner_x) / stage.spacing + _HALF))
    j = np.int64(np.floor((y - stage.corner_y) / stage.spacing + _HALF))
    i, j = min(max(i, np.int64(0)), columns - 1), min(max(j, np.int64(0)), rows - 1)
    depth, rise_x, rise_y, one = _0, _0, _0, wheels.newest[j, i]
    while one >= 0:
        point, one = wheels.points[wheels.passes[one, 0]], wheels.passes[one, 1]
        cos, sin, off_x, off_y = point[2], point[3], x - point[0], y - point[1]
        along = point[4] + off_x * cos + off_y * sin
        if _0 < along <= behind:  # behind its begin the wheels have not been
            sideways = off_y * cos - off_x * sin
            found = _pressed(space, lane, wheels, sideways, along, cos, sin)
            if found[0] > depth or (depth == _0 and rise_x == _0 and rise_y == _0):
                depth, rise_x, rise_y = found
    return depth, rise_x, rise_y


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


_GROUND, _LAND, _FAR_SCALE = (np.float32(n) for n in (-1.0, -3.0, 1.0))
_KEPT, _DARKER = np.float32(0.45), np.float32(0.3)


@merged
def _grow_far_face(space, lane, stage):  # type: ignore[no-untyped-def]
    """The rough face of a rock beyond the edge, whose own frame nobody knows any more."""
    own = space[HIT_X + lane], space[HIT_Y + lane], space[HIT_Z + lane]
    facing = space[FLAT_X + lane], space[FLAT_Y + lane], space[FLAT_Z + lane]
    found = tile_at(stage.tile, own, facing, _FAR_SCALE, space[FOOTPRINT + lane])
    set_unit(
        space, BENT_X, lane,
        space[SMOOTH_X + lane] - np.float32(found[1]),
        space[SMOOTH_Y + lane] - np.float32(found[2]),
        space[SMOOTH_Z + lane] - np.float32(found[3]),
    )  # fmt: skip
    for channel in range(stage.nodes.shape[2] - GROUND_RGB):
        space[RGB + LANES * channel + lane] *= _1 + _SPOTS * np.float32(found[0])


@merged
def _grow_ground(space, stage, relief, octaves, keys, owner, wheels, behind, anchor):  # type: ignore[no-untyped-def]
    """Soil, small stones and tracks of the lanes that see the ground or the land beyond."""
    for lane in range(LANES):
        space[PLACE_X + lane] = space[HIT_X + lane] - anchor[0]
        space[PLACE_Y + lane] = space[HIT_Y + lane] - anchor[1]
    soil_lanes(space, relief, octaves, keys)
    clast_lanes(space, relief)
    for lane in range(LANES):
        if space[OWNER + lane] != owner:
            continue
        if owner == _LAND and space[WIDE + lane] > _0:
            _grow_far_face(space, lane, stage)
            continue
        depth, track_x, track_y = _0, _0, _0
        if owner == _GROUND:
            depth, track_x, track_y = _imprint(space, lane, stage, wheels, behind)
        kept, steep = _1 - _KEPT * depth, _1 / max(space[SMOOTH_Z + lane], _TINY)
        rise_x = space[RISE_X + lane] * kept + track_x
        rise_y = space[RISE_Y + lane] * kept + track_y
        x, y = space[SMOOTH_X + lane] * steep, space[SMOOTH_Y + lane] * steep
        set_unit(space, BENT_X, lane, x - rise_x, y - rise_y, _1)
        space[DARK + lane] = space[SHADOWED + lane] * (_1 - depth)
        for channel in range(stage.nodes.shape[2] - GROUND_RGB):
            space[RGB + LANES * channel + lane] *= space[VALUE + lane] * (_1 - _DARKER * depth)


_LOW_0, _LOW_1, _UP, _OVER, _UP_VALUE, _LOW_DUST, _SPOTS, _SOILED = (
    np.float32(n) for n in (0.04, 0.12, DUST_FROM, DUST_OVER, DUST_VALUE, 0.6, 1.0, SOILED)
)
_SMOOTH = np.float32(1e-3)  # things that are made for a size below this have no relief [m]


@merged
def _grow_faces(space, stage):  # type: ignore[no-untyped-def]
    """Rough faces and dust of the lanes that see rocks."""
    channels = stage.nodes.shape[2] - GROUND_RGB
    for lane in range(LANES):
        if space[OWNER + lane] < _0:
            continue
        record = stage.rocks[np.int64(space[OWNER + lane])]
        x, y, z = space[FLAT_X + lane], space[FLAT_Y + lane], space[FLAT_Z + lane]
        facing = (
            record[TURN] * x + record[TURN + 3] * y + record[TURN + 6] * z,
            record[TURN + 1] * x + record[TURN + 4] * y + record[TURN + 7] * z,
            record[TURN + 2] * x + record[TURN + 5] * y + record[TURN + 8] * z,
        )
        own = space[OWN_X + lane], space[OWN_Y + lane], space[OWN_Z + lane]
        value, x, y, z = _0, _0, _0, _0
        if record[SIZE] > _SMOOTH:
            found = tile_at(stage.tile, own, facing, record[SCALE], space[FOOTPRINT + lane])
            value, x, y, z = (
                np.float32(found[0]), np.float32(found[1]), np.float32(found[2]),
                np.float32(found[3]),
            )  # fmt: skip
        set_unit(
            space, BENT_X, lane,
            space[SMOOTH_X + lane]
            - (record[TURN] * x + record[TURN + 1] * y + record[TURN + 2] * z),
            space[SMOOTH_Y + lane]
            - (record[TURN + 3] * x + record[TURN + 4] * y + record[TURN + 5] * z),
            space[SMOOTH_Z + lane]
            - (record[TURN + 6] * x + record[TURN + 7] * y + record[TURN + 8] * z),
        )  # fmt: skip
        low = max(_0, _1 - space[ABOVE + lane] / (_LOW_0 + _LOW_1 * space[WIDE + lane]))
        up = (space[BENT_Z + lane] - _UP + _UP_VALUE * value) / _OVER
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
        _grow_faces(space, stage)
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
    _find_sky(space, stage)
    for channel in range(stage.nodes.shape[2] - GROUND_RGB):
        sun, sky, bounce = (
            stage.colours[SUN, channel], stage.colours[AMBIENT, channel],
            stage.colours[BOUNCE, channel],
        )  # fmt: skip
        _shine_sky(space, stage, channel)
        row = LANES * channel
        for lane in range(LANES):
            albedo, clear = space[RGB + row + lane], space[CLEAR + lane]
            share = space[OPEN + lane]
            space[DIRECT + row + lane] = albedo * sun * space[BACK + lane] * clear
            shone = albedo * (sky * share + bounce * max(_0, _1 - share))
            space[REST + row + lane] = shone * clear + space[PLACE_Z + lane] * (_1 - clear)
        for lane in range(LANES):
            if space[OWNER + lane] == -_2:
                space[DIRECT + row + lane] = _0
                space[REST + row + lane] = space[PLACE_Z + lane]


@merged
def _find_sky(space, stage):  # type: ignore[no-untyped-def]
    """Places of the lanes' directions in the sky's tables, in rows that surfaces had before."""
    last = np.float32(stage.dome.shape[1] - 1)
    for lane in range(LANES):
        x = space[AIM_X + lane] - stage.sun[0]
        y = space[AIM_Y + lane] - stage.sun[1]
        z = space[AIM_Z + lane] - stage.sun[2]
        up = min(max(space[AIM_Z + lane], _0), _1)
        space[PLACE_X + lane] = last * np.sqrt(up)
        off = min(_HALF * np.sqrt(x * x + y * y + z * z), _1)
        space[PLACE_Y + lane] = last * np.sqrt(off)


@merged
def _shine_sky(space, stage, channel):  # type: ignore[no-untyped-def]
    """The sky's radiance in the lanes' directions."""
    last = stage.dome.shape[1] - 2
    for lane in range(LANES):
        # A lane that nothing was aimed with may hold anything.
        i = min(max(np.int64(space[PLACE_X + lane]), np.int64(0)), last)
        j = min(max(np.int64(space[PLACE_Y + lane]), np.int64(0)), last)
        u, v = space[PLACE_X + lane] - np.float32(i), space[PLACE_Y + lane] - np.float32(j)
        low, high = stage.dome[0, i, channel], stage.dome[0, i + 1, channel]
        near, far = stage.dome[1, j, channel], stage.dome[1, j + 1, channel]
        across, around = low + u * (high - low), near + v * (far - near)
        space[PLACE_Z + lane] = across * around + stage.colours[EVEN, channel]
    if len(stage.disc) > 0:
        _shine_disc(space, stage, channel)


_COLOUR = 7


@merged
def _shine_disc(space, stage, channel):  # type: ignore[no-untyped-def]
    """Add the Earth's radiance, as `Disc.radiance` has it, to that of the sky."""
    disc = stage.disc[0]
    radius = disc[3]
    for lane in range(LANES):
        x = (space[AIM_X + lane] - disc[0]) / radius
        y = (space[AIM_Y + lane] - disc[1]) / radius
        z = (space[AIM_Z + lane] - disc[2]) / radius
        away = np.sqrt(x * x + y * y + z * z)
        covered = min(_1, max(_0, _HALF + (_1 - away) * radius / space[STEP + lane]))
        if space[AIM_Z + lane] < stage.lowest:
            covered = _0
        inside = _1 / max(away, _1)
        x, y, z = x * inside, y * inside, z * inside
        nearer = np.sqrt(max(_0, _1 - x * x - y * y - z * z))
        lit = (
            (x - nearer * disc[0]) * disc[4]
            + (y - nearer * disc[1]) * disc[5]
            + (z - nearer * disc[2]) * disc[6]
        )
        space[PLACE_Z + lane] += covered * max(_0, lit) * disc[_COLOUR + channel]


@merged
def _reflect(space, stage):  # type: ignore[no-untyped-def]
    """Light that comes back over that of a surface as light as the albedo that faces the Sun."""
    sun_x, sun_y, sun_z, law = stage.sun[0], stage.sun[1], stage.sun[2], stage.law
    last = law.shape[1] - 2
    for lane in range(LANES):
        x, y, z = space[BENT_X + lane], space[BENT_Y + lane], space[BENT_Z + lane]
        a, b, c = space[AIM_X + lane], space[AIM_Y + lane], space[AIM_Z + lane]
        mu0 = x * sun_x + y * sun_y + z * sun_z
        mu0 = _HALF * (mu0 + np.sqrt(mu0 * mu0 + _ROUGH))
        mu = max(-(x * a + y * b + z * c), _LEAST_MU)
        x, y, w = sun_x + a, sun_y + b, sun_z + c  # between eye and Sun
        half = _HALF * np.sqrt(x * x + y * y + w * w)
        place = min(np.sqrt(half), _1) * np.float32(last + 1)
        i = min(max(np.int64(place), np.int64(0)), last)  # an unaimed lane may hold anything
        t = place - np.float32(i)
        lommel = law[0, i] + t * (law[0, i + 1] - law[0, i])
        lambert = law[1, i] + t * (law[1, i + 1] - law[1, i])
        if space[OWNER + lane] == _ROVER:
            lommel, lambert = _0, _1
        back = mu0 * (lommel / (mu0 + mu) + lambert)
        space[BACK + lane] = back * (_1 - _SHADE * space[DARK + lane])
        # What grain tilts sees less of the sky, but more of its light where it faces the Sun.
        open_ = min(_1, (_1 + z) / (_1 + space[SMOOTH_Z + lane]))
        tilt = space[BENT_X + lane] * stage.lean[0] + space[BENT_Y + lane] * stage.lean[1]
        tilt /= _HALF * (_1 + max(z, _LEAST_RISE))
        tilt /= _1 + (_BRIGHTER if tilt > _0 else _DIMMER) * abs(tilt)
        space[OPEN + lane] *= open_ * (_1 + tilt)
