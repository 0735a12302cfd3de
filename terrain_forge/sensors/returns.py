"""What comes back to a lidar: rays of all beams in one pass, echoes, noise, lost returns.

Rays are traced ring by ring, eight columns at a time, since neighbours of a ring run side by side;
each has the pose of its own firing.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, inlined, inner, kernel, mix, normal, uniform
from terrain_forge.scene import (
    ACTIVE,
    COPY,
    FAR,
    LANES,
    borrow,
    hit_normal,
    hit_rock,
    meet8,
    set_ray,
)
from terrain_forge.sensors.beams import DELAY
from terrain_forge.sensors.course import aim_of, beside, turned

_NEAREST = 0.01
"""Range below which the power of a return grows no more [m]."""
_DARKEST = 1e-9
"""Reflectance times cosine of what reflects nothing: where no return is too weak, it comes back."""
_SPREAD = 0.2
"""How far the limit of detection varies to both sides, as a part of it."""
_NOISE, _LOST, _WEAK = range(3)
_FULL = 10.0
"""Range at which the power of a white surface that faces the lidar is 100 [m]."""
FIRST, STRONGEST, LAST = range(3)
AIM, ROOT, START, TOWARDS, FOUND = 0, 3, 5, 8, 11
POWER, OWNER = FOUND + 1, FOUND + 2
"""Rows of a packet's numbers: a beam's direction in the lidar's frame, where it begins there and in
the scene's frame, a ray's direction in the scene's frame; then of each ray the distance (infinite
where it met nothing), the power and what it met."""


class Surfaces(NamedTuple):
    """What the things that rays meet reflect."""

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


@inner
def _dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inner
def _ground(surfaces, x, y):  # type: ignore[no-untyped-def]
    """Reflectance of the ground at a place."""
    shade = surfaces.reflectance
    rows, columns = shade.shape
    column = (x - surfaces.corner[0]) / surfaces.spacing
    row = (y - surfaces.corner[1]) / surfaces.spacing
    i = min(max(np.int64(np.floor(column)), 0), columns - 2)
    j = min(max(np.int64(np.floor(row)), 0), rows - 2)
    u, v = min(max(column - i, 0.0), 1.0), min(max(row - j, 0.0), 1.0)
    south = shade[j, i] + u * (shade[j, i + 1] - shade[j, i])
    north = shade[j + 1, i] + u * (shade[j + 1, i + 1] - shade[j + 1, i])
    return south + v * (north - south)


@inner
def _reflected(ray, word, lane, hit, x, y, towards, surfaces):  # type: ignore[no-untyped-def]
    """Reflectance times the cosine of incidence where a lane's ray landed."""
    if hit == -1:
        reflectance = _ground(surfaces, x, y)
    elif hit >= 0:
        reflectance = surfaces.rocks[hit]
    elif hit == -4:
        reflectance = surfaces.rover[word[COPY, lane]]
    else:
        reflectance = surfaces.beyond
    upright = hit_normal(ray, lane, hit, surfaces.turns)
    return max(-reflectance * _dot(upright, towards), _DARKEST)


@inlined
def _returned(lanes, lane, rays, rules):  # type: ignore[no-untyped-def]
    """Range, power and owner of the echo that a beam returns; the power is 0 where there is none.

    Echoes are groups of rays whose ranges follow each other closely: a pulse is that long.
    """
    best, best_power, best_owner, after = 0.0, 0.0, np.int64(-2), -np.inf
    for _ in range(len(rays)):
        start = np.inf  # of the next echo
        for k in range(len(rays)):
            if lanes[FOUND + 3 * k, lane] > after:
                start = min(start, lanes[FOUND + 3 * k, lane])
        if start == np.inf:
            break
        end, more = start, len(rays) > 1
        while more:
            more = False
            for k in range(len(rays)):
                if end < lanes[FOUND + 3 * k, lane] <= end + rules.separation:
                    end, more = lanes[FOUND + 3 * k, lane], True
        total, middle, owner, most = 0.0, 0.0, -2.0, 0.0
        for k in range(len(rays)):
            distance, power = lanes[FOUND + 3 * k, lane], lanes[POWER + 3 * k, lane]
            if start <= distance <= end:
                total += power
                middle += power * distance
                if power > most:
                    most, owner = power, lanes[OWNER + 3 * k, lane]
        after = end
        strong = rules.echo == STRONGEST or total >= rules.limit
        if strong and (rules.echo == LAST or total > best_power):
            best, best_power, best_owner = middle / total, total, np.int64(owner)
            if rules.echo == FIRST:
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
        exact += rules.noise * normal(mix(key, _NOISE))
    if rules.quantum > 0.0:
        exact = rules.quantum * np.floor(exact / rules.quantum + 0.5)
    return exact if rules.near <= exact <= rules.far else 0.0


@inner
def _vector(lanes, row, lane):  # type: ignore[no-untyped-def]
    return lanes[row, lane], lanes[row + 1, lane], lanes[row + 2, lane]


@inlined
def _prepare(course, beam, first, filled, rules, lanes):  # type: ignore[no-untyped-def]
    """Fill in where a beam points and begins at the firings of a packet."""
    late = beam[DELAY]
    for lane in range(filled):
        place, speed = course.place[first + lane], course.speed[first + lane]
        aim, root = aim_of(course.turns[first + lane], beam, rules.prisms)
        x, y = rules.origin * root[0], rules.origin * root[1]
        lanes[AIM, lane], lanes[AIM + 1, lane], lanes[AIM + 2, lane] = aim
        lanes[ROOT, lane], lanes[ROOT + 1, lane] = x, y
        moved = turned(place, speed, late, (x, y, 0.0))
        for axis in range(3):
            lanes[START + axis, lane] = place[axis] + late * speed[axis] + moved[axis]


@inlined
def _trace(  # type: ignore[no-untyped-def]
    scene, query, bodies, course, late, first, filled, spread, k, surfaces, rules, ray, own, lanes
):
    """Cast one of the rays of each beam of a packet, and note what it meets."""
    word = ray.view(np.uint32)
    reach = rules.far + 10.0 * rules.noise + rules.quantum - rules.origin
    for lane in range(LANES):
        word[ACTIVE, lane] = 0
    for lane in range(filled):
        aim = _vector(lanes, AIM, lane)
        if k > 0:
            aim = beside(aim, spread[0], spread[1])
        towards = turned(course.place[first + lane], course.speed[first + lane], late, aim)
        lanes[TOWARDS, lane], lanes[TOWARDS + 1, lane], lanes[TOWARDS + 2, lane] = towards
        set_ray(ray, word, lane, _vector(lanes, START, lane), towards, 0.0, reach)
    meet8(scene, bodies, course.base[first : first + LANES], query, ray, own)
    for lane in range(filled):
        hit, towards = hit_rock(word, lane), _vector(lanes, TOWARDS, lane)
        lanes[FOUND + 3 * k, lane] = np.inf
        if hit == -2 or _dot(towards, rules.sun) >= rules.blinding:
            continue
        distance = np.float64(ray[FAR, lane])
        x = lanes[START, lane] + distance * towards[0]
        y = lanes[START + 1, lane] + distance * towards[1]
        share = spread[2] * _reflected(ray, word, lane, hit, x, y, towards, surfaces)
        away = max(distance + rules.origin, _NEAREST)
        lanes[FOUND + 3 * k, lane], lanes[OWNER + 3 * k, lane] = distance, hit
        lanes[POWER + 3 * k, lane] = share / (away * away)


@inlined
def _tell(ring, first, filled, beams, surfaces, rules, key, lanes, points):  # type: ignore[no-untyped-def]
    """Write the points of a packet."""
    count = len(beams.table)
    for lane in range(filled):
        row, number = (first + lane) * count + beams.rank[ring], (first + lane) * count + ring
        exact, power, owner = _returned(lanes, lane, beams.rays, rules)
        exact += rules.origin
        told = 0.0
        if owner != -4 or rules.sees_rover:
            told = _measured(exact, power, mix(key, number), rules)
        length = told - rules.origin
        x, y, z = _vector(lanes, AIM, lane)
        points.xyz[row, 0] = lanes[ROOT, lane] + length * x
        points.xyz[row, 1] = lanes[ROOT + 1, lane] + length * y
        points.xyz[row, 2] = length * z
        level = exact if rules.levelled else _FULL
        points.distance[row], points.intensity[row] = told, 100.0 * power * level * level
        points.instance[row] = surfaces.ids[owner] if owner >= 0 else owner


@kernel
def scan(  # type: ignore[no-untyped-def]
    begin, end, scene, query, bodies, course, beams, surfaces, rules, key, room, lanes, points
):
    """Measure some rings of a sweep; each writes points of its own.

    `room` has two packets for each ring, `lanes` the rows that are named above, shape [rings, FOUND
    + 3 · rays, LANES].
    """
    bodies, course, beams = borrow(bodies), borrow(course), borrow(beams)
    surfaces, points = borrow(surfaces), borrow(points)
    room, lanes = borrow((room, lanes))
    for ring in range(begin, end):
        ray, own = room[2 * ring], room[2 * ring + 1]
        beam, mine = beams.table[ring], lanes[ring]
        for first in range(0, len(course.turns), LANES):
            filled = min(LANES, len(course.turns) - first)
            _prepare(course, beam, first, filled, rules, mine)
            for k in range(len(beams.rays)):
                _trace(
                    scene, query, bodies, course, beam[DELAY], first, filled, beams.rays[k], k,
                    surfaces, rules, ray, own, mine,
                )  # fmt: skip
            _tell(ring, first, filled, beams, surfaces, rules, key, mine, points)


@kernel
def gather(points, rings, ring, column):  # type: ignore[no-untyped-def]
    """Move the points that came back to the front; returns how many there are.

    `rings` names the beams of a column by time; `ring` and `column` are filled in.
    """
    count, kept = len(rings), 0
    for row in range(len(points.distance)):
        if points.distance[row] == 0.0:
            continue
        for axis in range(3):
            points.xyz[kept, axis] = points.xyz[row, axis]
        points.distance[kept] = points.distance[row]
        points.intensity[kept] = points.intensity[row]
        points.instance[kept] = points.instance[row]
        ring[kept], column[kept] = rings[row % count], row // count
        kept += 1
    return kept
