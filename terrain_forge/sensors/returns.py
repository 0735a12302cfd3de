"""What comes back to a lidar: rays of all beams in one pass, echoes, noise, lost returns.

Rays are traced ring by ring, eight columns at a time, since neighbours of a ring run side by side;
each has the pose of its own firing.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, inlined, inner, kernel, mix, uniform
from terrain_forge.scene import (
    ACTIVE,
    COPY,
    FAR,
    LANES,
    hit_normal,
    hit_rock,
    meet8,
    set_ray,
)
from terrain_forge.sensors.beams import (
    COS_AZIMUTH,
    COS_ELEVATION,
    COS_TURN,
    DELAY,
    ELEVATION,
    OFFSET,
    SIN_AZIMUTH,
    SIN_ELEVATION,
    SIN_TURN,
)

_NEAREST = 0.01
"""Range below which the power of a return grows no more [m]."""
_DARKEST = 1e-9
"""Reflectance times cosine of what reflects nothing: where no return is too weak, it comes back."""
_SPREAD = 0.2
"""How far the limit of detection varies to both sides, as a part of it."""
_NOISE, _LOST, _WEAK = range(3)
FIRST, STRONGEST, LAST = range(3)


class Course(NamedTuple):
    """Where the lidar and the rover are when its columns fire."""

    turns: Array
    """Cosine and sine of how far the lidar has turned, or each prism has, shape [columns, 4]."""
    place: Array
    """Place in the scene's frame [m] and rotation to it at each column, shape [columns, 12]."""
    speed: Array
    """Their derivatives [1/s], shape [columns, 12]."""
    base: Array
    """base_link in the scene's frame, [turn | place], shape [columns, 3, 4]."""


class Surfaces(NamedTuple):
    """What the things that rays meet reflect."""

    elevation: NDArray[np.float32]
    """Heights of the ground's nodes [m], shape [rows, columns]."""
    reflectance: NDArray[np.float32]
    """Of the ground's nodes, shape [rows, columns]."""
    corner: tuple[float, float]
    """East and north of node [0, 0] in the scene's frame [m]."""
    spacing: float
    """Distance of the nodes [m]."""
    beyond: float
    """Reflectance of what lies beyond the ground's edge."""
    rocks: Array
    """Of the rocks, shape [rocks]."""
    ids: NDArray[np.int32]
    """What the rocks are called, shape [rocks]."""
    turns: Array
    """From the rocks' frames to the scene's, shape [rocks, 3, 3]."""
    rover: Array
    """Of the rover's parts, shape [parts]."""


class Rules(NamedTuple):
    """How a lidar measures."""

    near: float
    """Nearest range [m]."""
    far: float
    """Farthest range [m]."""
    origin: float
    """Distance of the beams' begin from the axis [m]."""
    prisms: tuple[float, float]
    """What the prisms bend the beams by [rad]; both negative for a lidar that turns."""
    limit: float
    """Power of the weakest return: reflectance · cosine / range² [1/m²]."""
    lost: float
    """Share of returns that are lost by chance."""
    sun: tuple[float, float, float]
    """Towards the Sun."""
    blinding: float
    """Cosine of the angle about the Sun that blinds; above 1 for none."""
    noise: float
    """Standard deviation of a range [m]."""
    quantum: float
    """Step of a range [m]; 0 for none."""
    separation: float
    """Echoes nearer to each other are one [m]."""
    echo: int
    """Which echo is returned: FIRST, STRONGEST, LAST."""
    levelled: bool
    """Whether intensities make up for the range."""
    sees_rover: bool
    """Whether points on the rover are kept."""


class Points(NamedTuple):
    """What a sweep's rays write: column by column, beams of a column by time."""

    xyz: NDArray[np.float32]
    """In the lidar's frame [m], shape [points, 3]."""
    distance: NDArray[np.float32]
    """Range [m], 0 where nothing came back, shape [points]."""
    intensity: NDArray[np.float32]
    """Shape [points]."""
    instance: NDArray[np.int32]
    """Id of a rock, or -1 ground, -3 beyond it, -4 rover, shape [points]."""


@kernel
def follow(columns, nodes, slopes, step, turns, place, speed, base):  # type: ignore[no-untyped-def]
    """Fill in a course from states at equal steps, by cubic Hermite polynomials.

    Rows of `columns` are those of `sweep_columns`; rows of `nodes` hold 12 numbers of the lidar,
    [place, rotation], and 12 of base_link, `slopes` their derivatives.
    """
    for n in range(len(columns)):
        for i in range(2):
            angle = 2.0 * np.pi * columns[n, 1 + i]
            turns[n, 2 * i], turns[n, 2 * i + 1] = np.cos(angle), np.sin(angle)
        at = columns[n, 0] / step
        k = np.int64(min(max(at, 0.0), len(nodes) - 2.0))
        t = at - k
        s = 1.0 - t
        p, q = s * s * (1.0 + 2.0 * t), t * t * (1.0 + 2.0 * s)
        a, b = s * s * t * step, -t * t * s * step
        dp, da, db = -6.0 * s * t / step, s * (s - 2.0 * t), t * (t - 2.0 * s)
        for i in range(24):
            y, z, u, v = nodes[k, i], nodes[k + 1, i], slopes[k, i], slopes[k + 1, i]
            value = p * y + q * z + a * u + b * v
            if i < 12:
                place[n, i] = value
                speed[n, i] = dp * (y - z) + da * u + db * v
            elif i < 15:
                base[n, i - 12, 3] = value
            else:
                base[n, (i - 15) // 3, (i - 15) % 3] = value


@inner
def _normal_quantile(p):  # type: ignore[no-untyped-def]
    """The standard normal's value below which a part p of it lies.

    Wichura 1988, algorithm AS 241, PPND7 (doi:10.2307/2347330): right to 7 digits.
    """
    q = p - 0.5
    if abs(q) <= 0.425:
        r = 0.180625 - q * q
        above = ((59.109374720 * r + 159.29113202) * r + 50.434271938) * r + 3.3871327179
        below = ((67.187563600 * r + 78.757757664) * r + 17.895169469) * r + 1.0
        return q * above / below
    r = np.sqrt(-np.log(p if q < 0.0 else 1.0 - p))
    if r <= 5.0:
        r -= 1.6
        above = ((0.17023821103 * r + 1.3067284816) * r + 2.7568153900) * r + 1.4234372777
        below = (0.12021132975 * r + 0.73700164250) * r + 1.0
    else:
        r -= 5.0
        above = ((0.017337203997 * r + 0.42868294337) * r + 3.0812263860) * r + 6.6579051150
        below = (0.012258202635 * r + 0.24197894225) * r + 1.0
    return -above / below if q < 0.0 else above / below


@inner
def _aim(turn, beam, prisms):  # type: ignore[no-untyped-def]
    """Where a beam points in the lidar's frame, and where its column does."""
    if prisms[0] < 0.0:
        # Behind, then clockwise: the azimuth is π less the angle turned by.
        cos, sin = -turn[0], turn[1]
        ahead = cos * beam[COS_AZIMUTH] + sin * beam[SIN_AZIMUTH]
        left = sin * beam[COS_AZIMUTH] - cos * beam[SIN_AZIMUTH]
        flat = beam[COS_ELEVATION]
        column = cos * beam[COS_TURN] + sin * beam[SIN_TURN]
        aside = sin * beam[COS_TURN] - cos * beam[SIN_TURN]
        return (flat * ahead, flat * left, beam[SIN_ELEVATION]), (column, aside)
    left = prisms[0] * turn[1] + prisms[1] * turn[3] - beam[OFFSET]
    up = prisms[0] * turn[0] + prisms[1] * turn[2] + beam[ELEVATION]
    angle = np.sqrt(left * left + up * up)
    part = np.sin(angle) / angle if angle > 1e-12 else 1.0
    return (np.cos(angle), part * left, part * up), (1.0, 0.0)


@inner
def _beside(direction, sideways, upwards):  # type: ignore[no-untyped-def]
    """A direction beside another one, by small angles."""
    x, y, z = direction
    flat = np.sqrt(x * x + y * y)
    a, b = (-y / flat, x / flat) if flat > 1e-9 else (0.0, 1.0)
    x, y, z = (
        x + sideways * a - upwards * b * z,
        y + sideways * b + upwards * a * z,
        z + upwards * (b * x - a * y),
    )
    length = np.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


@inner
def _turned(place, speed, late, direction):  # type: ignore[no-untyped-def]
    """A direction of the lidar's frame in the scene's, some time after a column."""
    x, y, z = direction
    return (
        (place[3] + late * speed[3]) * x
        + (place[4] + late * speed[4]) * y
        + (place[5] + late * speed[5]) * z,
        (place[6] + late * speed[6]) * x
        + (place[7] + late * speed[7]) * y
        + (place[8] + late * speed[8]) * z,
        (place[9] + late * speed[9]) * x
        + (place[10] + late * speed[10]) * y
        + (place[11] + late * speed[11]) * z,
    )


@inner
def _dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inner
def _ground(surfaces, x, y):  # type: ignore[no-untyped-def]
    """Reflectance and upward normal of the ground.

    The normal is smooth, since the ground's triangles are larger than the spot of a beam.
    """
    z, shade, spacing = surfaces.elevation, surfaces.reflectance, surfaces.spacing
    rows, columns = z.shape
    column, row = (x - surfaces.corner[0]) / spacing, (y - surfaces.corner[1]) / spacing
    i = min(max(np.int64(np.floor(column)), 0), columns - 2)
    j = min(max(np.int64(np.floor(row)), 0), rows - 2)
    u, v = min(max(column - i, 0.0), 1.0), min(max(row - j, 0.0), 1.0)
    along_x, along_y, reflectance = 0.0, 0.0, 0.0
    for corner in range(4):
        a, b = corner & 1, corner >> 1
        weight = (u if a else 1.0 - u) * (v if b else 1.0 - v)
        west, east = max(i + a - 1, 0), min(i + a + 1, columns - 1)
        south, north = max(j + b - 1, 0), min(j + b + 1, rows - 1)
        along_x += weight * (z[j + b, east] - z[j + b, west]) / (east - west)
        along_y += weight * (z[north, i + a] - z[south, i + a]) / (north - south)
        reflectance += weight * shade[j + b, i + a]
    along_x, along_y = along_x / spacing, along_y / spacing
    length = np.sqrt(1.0 + along_x * along_x + along_y * along_y)
    return reflectance, (-along_x / length, -along_y / length, 1.0 / length)


@inner
def _reflected(ray, word, lane, hit, x, y, towards, surfaces):  # type: ignore[no-untyped-def]
    """Reflectance times the cosine of incidence where a lane's ray landed."""
    if hit == -1:
        reflectance, normal = _ground(surfaces, x, y)
    else:
        normal = hit_normal(ray, lane, hit, surfaces.turns)
        if hit >= 0:
            reflectance = surfaces.rocks[hit]
        elif hit == -4:
            reflectance = surfaces.rover[word[COPY, lane]]
        else:
            reflectance = surfaces.beyond
    return max(-reflectance * _dot(normal, towards), _DARKEST)


@inlined
def _returned(found, power, hits, rays, lane, rules):  # type: ignore[no-untyped-def]
    """Range, power and owner of the echo that a beam returns; the power is 0 where there is none.

    Echoes are groups of rays whose ranges follow each other closely: a pulse is that long.
    """
    best, best_power, best_owner, after = 0.0, 0.0, -2, -np.inf
    for _ in range(len(rays)):
        start = np.inf  # of the next echo
        for k in range(len(rays)):
            if found[k, lane] > after and power[k, lane] > 0.0:
                start = min(start, found[k, lane])
        if start == np.inf:
            break
        end, more = start, True
        while more:
            more = False
            for k in range(len(rays)):
                if end < found[k, lane] <= end + rules.separation and power[k, lane] > 0.0:
                    end, more = found[k, lane], True
        total, middle, owner, most = 0.0, 0.0, -2, 0.0
        for k in range(len(rays)):
            if start <= found[k, lane] <= end:
                total += power[k, lane]
                middle += power[k, lane] * found[k, lane]
                if power[k, lane] > most:
                    most, owner = power[k, lane], hits[k, lane]
        after = end
        if rules.echo == LAST or total > best_power:
            if total >= rules.limit or rules.echo == STRONGEST:
                best, best_power, best_owner = middle / total, total, owner
        if rules.echo == FIRST and best_power > 0.0:
            break
    return best, best_power, best_owner


@inner
def _measured(exact, power, key, rules):  # type: ignore[no-untyped-def]
    """The range that a lidar tells of an exact one; 0 where it tells none."""
    if power <= 0.0:
        return 0.0
    if rules.limit > 0.0:
        chance = 1.0 - _SPREAD + 2.0 * _SPREAD * uniform(mix(key, _WEAK))
        if power * chance < rules.limit:
            return 0.0
    if rules.lost > 0.0 and uniform(mix(key, _LOST)) < rules.lost:
        return 0.0
    if rules.noise > 0.0:
        exact += rules.noise * _normal_quantile(uniform(mix(key, _NOISE)))
    if rules.quantum > 0.0:
        exact = rules.quantum * np.floor(exact / rules.quantum + 0.5)
    return exact if rules.near <= exact <= rules.far else 0.0


@kernel
def scan(  # type: ignore[no-untyped-def]
    begin, end, scene, query, bodies, course, beams, surfaces, rules, key, room, points
):
    """Measure some rings of a sweep; all of its points are written, each by its ring alone."""
    rays, count = beams.rays, len(beams.table)
    found, power = np.empty((len(rays), LANES)), np.empty((len(rays), LANES))
    hits = np.empty((len(rays), LANES), np.int64)
    aims, roots, starts, directions = (
        np.empty((LANES, 3)),
        np.zeros((LANES, 3)),
        np.empty((LANES, 3)),
        np.empty((LANES, 3)),
    )
    reach = rules.far + 10.0 * rules.noise + rules.quantum - rules.origin
    for ring in range(begin, end):
        ray, own = room[2 * ring], room[2 * ring + 1]
        word, beam = ray.view(np.uint32), beams.table[ring]
        late = beam[DELAY]
        for first in range(0, len(course.turns), LANES):
            filled = min(LANES, len(course.turns) - first)
            for lane in range(filled):
                place, speed = course.place[first + lane], course.speed[first + lane]
                aim, root = _aim(course.turns[first + lane], beam, rules.prisms)
                aims[lane, 0], aims[lane, 1], aims[lane, 2] = aim
                roots[lane, 0], roots[lane, 1] = rules.origin * root[0], rules.origin * root[1]
                moved = _turned(place, speed, late, (roots[lane, 0], roots[lane, 1], 0.0))
                for axis in range(3):
                    starts[lane, axis] = place[axis] + late * speed[axis] + moved[axis]
            for k in range(len(rays)):
                for lane in range(LANES):
                    word[ACTIVE, lane] = 0
                for lane in range(filled):
                    place, speed = course.place[first + lane], course.speed[first + lane]
                    aim = (aims[lane, 0], aims[lane, 1], aims[lane, 2])
                    if k > 0:
                        aim = _beside(aim, rays[k, 0], rays[k, 1])
                    towards = _turned(place, speed, late, aim)
                    start = (starts[lane, 0], starts[lane, 1], starts[lane, 2])
                    directions[lane, 0], directions[lane, 1], directions[lane, 2] = towards
                    set_ray(ray, word, lane, start, towards, 0.0, reach)
                meet8(scene, bodies, course.base[first : first + LANES], query, ray, own)
                for lane in range(filled):
                    hit = hit_rock(word, lane)
                    found[k, lane], power[k, lane], hits[k, lane] = np.inf, 0.0, hit
                    if hit == -2:
                        continue
                    towards = (directions[lane, 0], directions[lane, 1], directions[lane, 2])
                    if _dot(towards, rules.sun) >= rules.blinding:
                        continue
                    distance = np.float64(ray[FAR, lane])
                    x = starts[lane, 0] + distance * towards[0]
                    y = starts[lane, 1] + distance * towards[1]
                    share = _reflected(ray, word, lane, hit, x, y, towards, surfaces)
                    away = max(distance + rules.origin, _NEAREST)
                    found[k, lane] = distance
                    power[k, lane] = rays[k, 2] * share / (away * away)
            for lane in range(filled):
                n = first + lane
                row = n * count + beams.rank[ring]
                exact, strength, owner = _returned(found, power, hits, rays, lane, rules)
                told = 0.0
                if owner != -4 or rules.sees_rover:
                    told = _measured(
                        exact + rules.origin, strength, mix(key, n * count + ring), rules
                    )
                length = told - rules.origin
                points.distance[row] = told
                points.xyz[row, 0] = roots[lane, 0] + length * aims[lane, 0]
                points.xyz[row, 1] = roots[lane, 1] + length * aims[lane, 1]
                points.xyz[row, 2] = length * aims[lane, 2]
                level = exact + rules.origin if rules.levelled else 10.0
                points.intensity[row] = 100.0 * strength * level * level
                points.instance[row] = surfaces.ids[owner] if owner >= 0 else owner
