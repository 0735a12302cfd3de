"""Where a lidar is as its columns fire, and where its beams point: compiled code."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from terrain_forge.base import Array, inner, kernel
from terrain_forge.sensors.beams import (
    COS_AZIMUTH,
    COS_ELEVATION,
    COS_TURN,
    ELEVATION,
    OFFSET,
    SIN_AZIMUTH,
    SIN_ELEVATION,
    SIN_TURN,
)


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
def aim_of(turn, beam, prisms):  # type: ignore[no-untyped-def]
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
def beside(direction, sideways, upwards):  # type: ignore[no-untyped-def]
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
def turned(place, speed, late, direction):  # type: ignore[no-untyped-def]
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
