"""The Sun in a lens: its disc, the veil and the star around it, and ghosts across the picture.

Light that lens surfaces scatter falls with the square of the angle; what they reflect twice lies on
the line through the Sun and the principal point. All of it is radiance before the chip counts it.
"""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np

from terrain_forge.base import Array, Mask, kernel, over_chunks, portable
from terrain_forge.model import LensFlare, mix, uniform
from terrain_forge.sensors.exposure import Picture
from terrain_forge.sensors.lens import Lens, project, rays_of
from terrain_forge.sensors.scenery import Scenery

_LOOKS = 32
_GOLDEN = math.pi * (3.0 - math.sqrt(5.0))
_CORE = 0.02
"""Angle around the Sun within which the veil is even [rad]."""
_RAY_WIDTH, _RAY_LENGTH = 0.002, 0.12
"""Of the star's rays [rad]."""
_NEAREST, _FARTHEST = 0.6, -1.3
"""Where ghosts lie: the Sun's place from the principal point times this."""
_GHOST_SIZES = 0.015, 0.12
"""Their radii, as parts of the picture's height."""


class SunSeen(NamedTuple):
    """The Sun as one camera sees it at one moment."""

    towards: Array
    """Unit vector to its middle in the optical frame, shape [3]."""
    radius: float
    """Of its disc [rad]."""
    irradiance: float
    """Of a surface that faces it [W/m²]."""
    part: float
    """Part of the disc that nothing hides, 0 to 1."""


def visible_part(
    scenery: Scenery, position: Array, towards: Array, *, radius: float, time: float
) -> float:
    """Part of the Sun's disc [rad] that a place sees, by rays to evenly spread points of it."""
    aside = np.cross(towards, (0.0, 0.0, 1.0) if abs(towards[2]) < 0.9 else (1.0, 0.0, 0.0))
    aside /= np.linalg.norm(aside)
    n = np.arange(_LOOKS) + 0.5
    away, turn = radius * np.sqrt(n / _LOOKS), _GOLDEN * n
    across = np.stack([np.cos(turn), np.sin(turn)], axis=-1) * away[:, None]
    spots = towards + across[:, :1] * aside + across[:, 1:] * np.cross(towards, aside)
    spots /= portable.norm(spots)[:, None]
    hits = scenery.cast(np.tile(position, (_LOOKS, 1)), spots, time)
    return float(np.isinf(hits.distance).mean())


def add_sun(
    radiance: Picture, sky: Mask, lens: Lens, sun: SunSeen, flare: LensFlare | None, key: np.uint64
) -> None:
    """Add the Sun's disc where there is sky, and what goes astray of its light, to a picture.

    Args:
        radiance: The picture [W/(m² sr)], which is changed, shape [height, width, channels].
        sky: Which pixels see the sky, shape [height, width].
        lens: The camera's.
        sun: The Sun.
        flare: What the lens does; None for the disc alone.
        key: What the shapes of this camera's ghosts hang on.
    """
    axial = float(sun.towards[2])
    if sun.part <= 0.0 or axial <= 0.0:
        return
    pixels, seen = project(lens, sun.towards[None])
    disc = sun.irradiance / (math.pi * sun.radius**2)
    spots, astray = np.zeros((0, 6)), np.zeros(2)
    place = pixels[0] if seen[0] else np.full(2, np.inf)
    if flare is not None:
        light = sun.irradiance * sun.part * axial
        astray = light * np.array([flare.veil / _spread(), flare.star])
        if seen[0]:
            spots = _ghosts(lens, flare, place, key)
            spots[:, 3:6] *= light * _within(lens, place)
    rays = flare.blades * (1 + flare.blades % 2) if flare else 1
    turn = float(uniform(mix(key, 0)))
    over_chunks(
        _shine,
        len(radiance),
        radiance,
        sky,
        rays_of(lens),
        (lens.focal[0], float(place[0]), float(place[1])),
        (float(sun.towards[0]), float(sun.towards[1]), float(sun.towards[2])),
        (disc, sun.radius, 1.0 / lens.focal[0]),
        (float(astray[0]), float(astray[1])),
        (rays, flare.blades if flare else 3, turn),
        spots,
    )


@cache
def _spread() -> float:
    """Integral of 1 / (θ² + core²) over the hemisphere around the Sun [sr/rad²]."""
    steps = (np.arange(20_000) + 0.5) * (0.5 * math.pi / 20_000)
    rings = 2.0 * math.pi * np.sin(steps) / (steps**2 + _CORE**2)
    return math.fsum(rings) * 0.5 * math.pi / 20_000


def _within(lens: Lens, place: Array) -> float:
    """1 where the Sun is in the picture, falling to 0 at a third of its diagonal beside it."""
    size = np.array([lens.width, lens.height])
    beside = np.maximum(np.abs(place - 0.5 * size) - 0.5 * size, 0.0)
    return max(0.0, 1.0 - 3.0 * math.hypot(*beside) / math.hypot(*size))


def _ghosts(lens: Lens, flare: LensFlare, place: Array, key: np.uint64) -> Array:
    """Column, row, radius [pixels], radiance of three colours per irradiance, shape [ghosts, 6]."""
    spots = np.zeros((flare.ghosts, 6))
    drawn = uniform(mix(mix(key, np.arange(1, 1 + flare.ghosts)[:, None]), np.arange(6)))
    for spot, (at, size, strength, *tints) in zip(spots, drawn, strict=True):
        along = _FARTHEST + at * (_NEAREST - _FARTHEST)
        low, high = _GHOST_SIZES
        radius = lens.height * (low + (high - low) * size * size)
        solid = math.pi * radius**2 / (lens.focal[0] * lens.focal[1])
        spot[:2] = np.array(lens.centre) + along * (place - lens.centre)
        spot[2] = radius
        spot[3:6] = flare.ghost_strength * (0.3 + 1.4 * strength) / solid
        spot[3:6] *= 0.6 + 0.4 * np.array(tints)
    return spots


@kernel
def _shine(  # type: ignore[no-untyped-def]
    first, last, radiance, sky, rays, frame, towards, disc, astray, corners, spots
):
    """Add the Sun's light to rows of a picture."""
    focal, column, row = frame
    glow, radius, pixel = disc
    veil, star = astray
    points, blades, twist = corners
    channels = radiance.shape[2]
    for j in range(first, last):
        for i in range(radiance.shape[1]):
            x = rays[j, i, 0] - towards[0]
            y = rays[j, i, 1] - towards[1]
            z = rays[j, i, 2] - towards[2]
            chord = 0.5 * np.sqrt(x * x + y * y + z * z)
            angle = 2.0 * np.arcsin(min(chord, 1.0))
            light = veil / (angle * angle + _CORE * _CORE)
            if sky[j, i]:
                light += glow * min(max((radius - angle) / pixel + 0.5, 0.0), 1.0)
            x, y = (i - column) / focal, (j - row) / focal
            away = np.sqrt(x * x + y * y)
            if star > 0.0 and 0.0 < away < 8.0 * _RAY_LENGTH:
                step = 2.0 * np.pi / points
                turn = np.arctan2(y, x) / step + twist
                aside = step * (turn - np.floor(turn + 0.5))
                across = away * np.sin(aside) / _RAY_WIDTH
                if np.abs(across) < 6.0:
                    shape = np.exp(-0.5 * across * across - away * np.cos(aside) / _RAY_LENGTH)
                    light += star * shape / (2.5066 * _RAY_WIDTH * _RAY_LENGTH * points)
            for c in range(channels):
                radiance[j, i, c] += light
    for n in range(len(spots)):
        size = spots[n, 2]
        top = max(first, int(np.floor(spots[n, 1] - 1.5 * size)))
        bottom = min(last - 1, int(np.ceil(spots[n, 1] + 1.5 * size)))
        left = max(0, int(np.floor(spots[n, 0] - 1.5 * size)))
        right = min(radiance.shape[1] - 1, int(np.ceil(spots[n, 0] + 1.5 * size)))
        step = 2.0 * np.pi / blades
        for j in range(top, bottom + 1):
            for i in range(left, right + 1):
                x, y = i - spots[n, 0], j - spots[n, 1]
                turn = np.arctan2(y, x) / step + twist
                side = np.cos(step * (turn - np.floor(turn + 0.5)))
                out = np.sqrt(x * x + y * y) * side
                cover = min(max((size - out) / (0.06 * size + 1.0) + 0.5, 0.0), 1.0)
                if cover > 0.0:
                    cover *= 0.7 + 0.6 * (out / size) ** 4
                    mean = (spots[n, 3] + spots[n, 4] + spots[n, 5]) / 3.0
                    for c in range(channels):
                        radiance[j, i, c] += cover * (spots[n, 3 + c] if channels == 3 else mean)
