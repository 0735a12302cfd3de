"""The Sun in a lens: its disc, the veil and the star around it, and ghosts across the picture.

Light that lens surfaces scatter falls with the square of the distance; what they reflect twice lies
on the line through the Sun and the principal point. All of it is radiance before the chip counts.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from terrain_forge.base import Array, Mask, kernel, over_chunks, portable
from terrain_forge.model import LensFlare, mix, uniform
from terrain_forge.sensors.exposure import Picture
from terrain_forge.sensors.lens import FISHEYE, Lens, project, rays_of
from terrain_forge.sensors.scenery import Scenery

_LOOKS = 32
_GOLDEN = math.pi * (3.0 - math.sqrt(5.0))
_CORE = 0.02
"""Angle around the Sun within which the veil is even [rad]."""
_SPREAD = math.pi * math.log1p(2.0 / _CORE**2)
"""Integral of 1 / (c² + core²) over the hemisphere around the Sun, c the chord to it [sr]."""
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
    scenery: Scenery, position: Array, towards: Array, *, radius: float, time: float, near: float
) -> float:
    """Part of the Sun's disc [rad] that a place sees, by rays to evenly spread points of it.

    What of the rover is nearer than `near` [m] hides nothing.
    """
    aside = np.cross(towards, (0.0, 0.0, 1.0) if abs(towards[2]) < 0.9 else (1.0, 0.0, 0.0))
    aside /= np.linalg.norm(aside)
    n = np.arange(_LOOKS) + 0.5
    away, turn = radius * np.sqrt(n / _LOOKS), _GOLDEN * n
    across = np.stack([np.cos(turn), np.sin(turn)], axis=-1) * away[:, None]
    spots = towards + across[:, :1] * aside + across[:, 1:] * np.cross(towards, aside)
    spots /= portable.norm(spots)[:, None]
    hits = scenery.cast(np.tile(position, (_LOOKS, 1)), spots, time, near=near)
    return float(np.isinf(hits.distance).mean())


def add_sun(
    radiance: Picture,
    sky: Mask,
    lens: Lens,
    sun: SunSeen,
    flare: LensFlare | None,
    key: np.uint64,
    *,
    glass: Lens | None = None,
) -> None:
    """Add the Sun's disc where there is sky, and what goes astray of its light, to a picture.

    Args:
        radiance: The picture [W/(m² sr)], which is changed, shape [height, width, channels].
        sky: Which pixels see the sky, shape [height, width].
        lens: The camera's.
        sun: The Sun.
        flare: What the lens does; None for the disc alone.
        key: What the shapes of this camera's ghosts hang on.
        glass: What the light comes through, of a rectified picture the raw one's lens; by default
            the camera's.
    """
    open_ = aperture_seen(glass or lens, sun.towards)
    if sun.part <= 0.0 or open_ <= 0.0:
        return
    pixels, seen = project(lens, sun.towards[None])
    near = _within(lens, pixels[0]) if seen[0] else 0.0
    towards = float(sun.towards[0]), float(sun.towards[1]), float(sun.towards[2])
    light, star, spikes = sun.irradiance * sun.part * open_, 0.0, np.zeros((0, 2))
    twist = 2.0 * math.pi * float(uniform(mix(key, 0)))
    if flare is not None:
        veil = light * flare.veil / _SPREAD
        over_chunks(_veil, len(radiance), radiance, rays_of(lens), towards, veil)
        star, rays = light * flare.star / math.sqrt(2.0 * math.pi), flare.blades
        angles = twist + 2.0 * math.pi / rays * np.arange(rays)
        spikes = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        if rays % 2:  # each edge of the aperture throws light to both sides
            spikes = np.concatenate([spikes, -spikes])
    if near <= 0.0:
        return
    over_chunks(
        _shine,
        len(radiance),
        radiance,
        sky,
        rays_of(lens),
        (lens.focal[0], float(pixels[0, 0]), float(pixels[0, 1])),
        towards,
        (sun.irradiance / (math.pi * sun.radius**2), sun.radius, 1.0 / lens.focal[0]),
        star,
        spikes,
    )
    if flare is not None:
        spots = _ghosts(lens, flare, pixels[0], key)
        spots[:, 3:6] *= light * near
        _reflect(radiance, spots, flare.blades, twist)


def aperture_seen(lens: Lens, towards: Array) -> float:
    """Part of a lens's front that a direction sees: of a plane, or of a fisheye's half sphere."""
    axial = float(towards[2])
    return 0.5 * (1.0 + axial) if lens.kind == FISHEYE else max(axial, 0.0)


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
def _veil(first, last, radiance, rays, towards, veil):  # type: ignore[no-untyped-def]
    """Add the scattered light of the Sun to rows of a picture."""
    core, channels = np.float32(_CORE * _CORE), radiance.shape[2]
    east, down, ahead = np.float32(towards[0]), np.float32(towards[1]), np.float32(towards[2])
    for j in range(first, last):
        for i in range(radiance.shape[1]):
            x, y, z = rays[j, i, 0] - east, rays[j, i, 1] - down, rays[j, i, 2] - ahead
            light = np.float32(veil) / (x * x + y * y + z * z + core)
            for c in range(channels):
                radiance[j, i, c] += light


@kernel
def _shine(  # type: ignore[no-untyped-def]
    first, last, radiance, sky, rays, frame, towards, disc, star, spikes
):
    """Add the Sun's disc and its star to rows of a picture."""
    focal, column, row = frame
    glow, radius, pixel = disc
    near, scale = (2.0 * radius + 2.0 * pixel) ** 2, star / (len(spikes) * _RAY_WIDTH * _RAY_LENGTH)
    for j in range(first, last):
        for i in range(radiance.shape[1]):
            light = 0.0
            x, y, z = (
                rays[j, i, 0] - towards[0],
                rays[j, i, 1] - towards[1],
                rays[j, i, 2] - towards[2],
            )
            chord = x * x + y * y + z * z
            if chord < near and sky[j, i]:
                light = glow * min(max((radius - np.sqrt(chord)) / pixel + 0.5, 0.0), 1.0)
            x, y = (i - column) / focal, (j - row) / focal
            for n in range(len(spikes)):
                along = x * spikes[n, 0] + y * spikes[n, 1]
                aside = abs(x * spikes[n, 1] - y * spikes[n, 0])
                if aside < 5.0 * _RAY_WIDTH and 0.0 < along < 8.0 * _RAY_LENGTH:
                    across = aside / _RAY_WIDTH
                    light += scale * np.exp(-0.5 * across * across - along / _RAY_LENGTH)
            if light > 0.0:
                for c in range(radiance.shape[2]):
                    radiance[j, i, c] += light


@kernel
def _reflect(radiance, spots, blades, twist):  # type: ignore[no-untyped-def]
    """Add ghosts: polygons that are brighter towards their edge."""
    rows, columns, channels = radiance.shape
    step = 2.0 * np.pi / blades
    for n in range(len(spots)):
        size = spots[n, 2]
        mean = (spots[n, 3] + spots[n, 4] + spots[n, 5]) / 3.0
        top = max(0, int(np.floor(spots[n, 1] - 1.5 * size)))
        bottom = min(rows - 1, int(np.ceil(spots[n, 1] + 1.5 * size)))
        left = max(0, int(np.floor(spots[n, 0] - 1.5 * size)))
        right = min(columns - 1, int(np.ceil(spots[n, 0] + 1.5 * size)))
        for j in range(top, bottom + 1):
            for i in range(left, right + 1):
                x, y = i - spots[n, 0], j - spots[n, 1]
                turn = (np.arctan2(y, x) - twist) / step
                side = np.cos(step * (turn - np.floor(turn + 0.5)))
                out = np.sqrt(x * x + y * y) * side
                cover = min(max((size - out) / (0.06 * size + 1.0) + 0.5, 0.0), 1.0)
                if cover > 0.0:
                    cover *= 0.7 + 0.6 * (out / size) ** 4
                    for c in range(channels):
                        radiance[j, i, c] += cover * (spots[n, 3 + c] if channels == 3 else mean)
