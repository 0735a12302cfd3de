"""Daylight under dust: what arrives from the Sun, what from the sky, and how bright the sky is.

What is scattered once has the whole phase function, in a layer without its forward peak (the TMS
method of Nakajima & Tanaka 1988, doi:10.1016/0022-4073(88)90031-3). The rest of the diffuse light
that a delta-Eddington two-stream lets through (Joseph, Wiscombe & Weinman 1976 and Meador & Weaver
1980, Journal of the Atmospheric Sciences 33, 2452 and 37, 630) comes evenly from all of the sky.
Towards the horizon the layer is as thick as a curved one, about as Chapman 1931 has it. Nothing is
known of twilight: the Sun counts as at least a degree high.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from terrain_forge.base import Array, portable
from terrain_forge.model import Dust, Lighting

SKY_STEPS = 512
"""Entries of the tables."""
_LEAST = 0.0175
"""Least sine of the Sun's elevation."""
_LOOKS = 96
_AUREOLE = 0.966  # cosine of 15°


class Daylight(NamedTuple):
    """Light at the ground over what would arrive on level ground without any dust."""

    direct: Array
    """From the Sun, linear red, green, blue."""
    diffuse: Array
    """From the sky."""
    aureole: Array
    """What of `diffuse` comes from within 15° of the Sun: a thing that hides the Sun hides it too.
    """
    lean: Array
    """Horizontal flux towards the Sun of the rest of `diffuse`, over its flux on level ground: so
    much more of it, for each unit of the sine of its slope, has ground that faces the Sun."""
    across: Array
    """How much dust shines towards the ground by the sine of the elevation, (k / (SKY_STEPS - 1))²,
    shape [SKY_STEPS, 3]."""
    around: Array
    """How it scatters by the chord to the Sun, 2 (k / (SKY_STEPS - 1))², shape [SKY_STEPS, 3];
    the sky's radiance over that of white level ground is `across` · `around` + `rest`."""
    rest: Array
    """What was scattered several times, evenly over the sky."""

    def radiance(self, towards: Array, sun: Array) -> Array:
        """Radiance of the sky over that of white level ground without dust, shape [..., 3].

        Args:
            towards: Unit vectors (east, north, up), shape [..., 3].
            sun: Unit vector to the Sun.
        """
        chord = portable.norm(towards - sun)
        up = np.sqrt(np.clip(towards[..., 2], 0.0, 1.0))
        marks = np.linspace(0.0, 1.0, SKY_STEPS)
        found = [
            np.interp(up, marks, self.across[:, c])
            * np.interp(np.sqrt(0.5 * chord), marks, self.around[:, c])
            + self.rest[c]
            for c in range(3)
        ]
        return np.stack(found, axis=-1)


def daylight(dust: Dust, sine: float, ground: Array) -> Daylight:
    """Daylight with the Sun at the sine of an elevation over ground of an albedo, shape [3]."""
    level, tau = max(sine, _LEAST), dust.tau
    sun = float(_thick(level, dust))
    albedo, forward, wide, share = (
        np.array(values) for values in (dust.albedo, dust.forward, dust.wide, dust.share)
    )
    beam = float(portable.exp(-tau / sun))
    peak = share * forward**2
    mean = (share * forward + (1.0 - share) * wide - peak) / (1.0 - peak)
    depth, left = (1.0 - albedo * peak) * tau, (1.0 - peak) * albedo / (1.0 - albedo * peak)
    total = _two_stream(depth, left, mean, sun) / (1.0 - ground * _reflected(depth, left, mean))
    diffuse = np.maximum(total - beam, 0.0) * sun / level

    steps = (np.arange(SKY_STEPS) / (SKY_STEPS - 1.0)) ** 2
    paths = [_path(_thick(steps, dust), sun, float(one)) for one in depth]
    across = 0.25 * albedo * np.stack(paths, axis=-1) * tau / np.maximum(depth, 1e-12) * sun / level
    cosine = 1.0 - 0.5 * (2.0 * steps) ** 2
    around = share * _lobe(forward, cosine) + (1.0 - share) * _lobe(wide, cosine)
    single, _ = _fluxes(across, around, level)
    # What scatters once cannot be more than all; where the two-stream is below, it is scaled.
    around = around * np.minimum(1.0, diffuse / np.maximum(single, 1e-12))
    near = (cosine > _AUREOLE)[:, None]
    aureole, _ = _fluxes(across, around * near, level)
    _, sideways = _fluxes(across, around * ~near, level)
    return Daylight(
        direct=np.full(3, beam),
        diffuse=diffuse,
        aureole=aureole,
        lean=sideways / np.maximum(diffuse - aureole, 1e-12),
        across=across,
        around=around,
        rest=np.maximum(diffuse - single, 0.0),
    )


def beam(lighting: Lighting) -> float:
    """Part of the Sun's own light that gets through the air along its way."""
    if lighting.dust is None:
        return 1.0
    sine = max(float(lighting.towards_sun[2]), _LEAST)
    return float(portable.exp(-lighting.dust.tau / _thick(sine, lighting.dust)))


def _thick(sine: Array | float, dust: Dust) -> Array:
    """Sine of the elevation at which a flat layer is as thick as the curved one is at another."""
    return np.asarray(np.sqrt(np.asarray(sine) ** 2 + dust.air_masses**-2))


def _path(up: Array, sun: float, tau: float) -> Array:
    """(exp(-τ/μ₀) - exp(-τ/μ)) / (μ₀ - μ) of the sky at the sine μ of an elevation."""
    beam = portable.exp(-tau / sun)
    along = portable.exp(-tau / np.maximum(up, 1e-6))
    apart = sun - up
    near = np.abs(apart) < 1e-4
    limit = tau / (sun * sun) * beam
    return np.asarray(np.where(near, limit, (beam - along) / np.where(near, 1.0, apart)))


def _lobe(asymmetry: Array, cosine: Array) -> Array:
    """Henyey-Greenstein phase functions, mean 1 over the sphere, shape [cosines, 3]."""
    below = 1.0 + asymmetry**2 - 2.0 * asymmetry * cosine[:, None]
    return np.asarray((1.0 - asymmetry**2) / portable.power(below, 1.5))


def _fluxes(across: Array, around: Array, sun: float) -> tuple[Array, Array]:
    """Flux of what is scattered once, over that of the Sun without dust: level and towards the Sun.

    The one is on level ground, the other through an upright plane that faces the Sun.
    """
    up = (np.arange(_LOOKS) + 0.5) / _LOOKS
    turn = np.pi * ((np.arange(4 * _LOOKS) + 0.5) / (4 * _LOOKS)) ** 2  # fine about the Sun
    width = 2.0 * np.pi * (np.arange(4 * _LOOKS) + 0.5) / (4 * _LOOKS) ** 2
    flat, low = np.sqrt(1.0 - up * up)[:, None], np.sqrt(1.0 - sun * sun)
    ahead = flat * np.cos(turn)
    chord = np.sqrt(np.maximum(2.0 - 2.0 * (up[:, None] * sun + low * ahead), 0.0))
    marks = np.linspace(0.0, 1.0, SKY_STEPS)
    level, sideways = [], []
    for c in range(3):
        scatter = np.interp(np.sqrt(0.5 * chord), marks, around[:, c])
        shines = np.interp(np.sqrt(up), marks, across[:, c])[:, None] * scatter * width
        level.append((shines * up[:, None]).sum() * 2.0 / (np.pi * _LOOKS))
        sideways.append((shines * ahead).sum() * 2.0 / (np.pi * _LOOKS))
    return np.array(level), np.array(sideways)


def _gammas(albedo: Array, mean: Array, sun: float) -> tuple[Array, Array, Array, Array]:
    third = 0.25 * (2.0 - 3.0 * mean * sun)
    first = 0.25 * (7.0 - albedo * (4.0 + 3.0 * mean))
    second = -0.25 * (1.0 - albedo * (4.0 - 3.0 * mean))
    return first, second, third, 1.0 - third


def _two_stream(depth: Array, albedo: Array, mean: Array, sun: float) -> Array:
    """Part of the Sun's light on a layer that goes through it, directly or scattered."""
    first, second, third, fourth = _gammas(albedo, mean, sun)
    k = np.sqrt(first * first - second * second)
    a1 = first * fourth + second * third
    grow, fade = portable.exp(k * depth), portable.exp(-k * depth)
    beam = portable.exp(-depth / sun)
    below = (1.0 - (k * sun) ** 2) * ((k + first) * grow + (k - first) * fade)
    lost = (1.0 + k * sun) * (a1 + k * fourth) * grow
    lost = lost - (1.0 - k * sun) * (a1 - k * fourth) * fade
    lost = lost - 2.0 * k * (fourth + a1 * sun) / beam
    return np.asarray(np.clip(beam * (1.0 - albedo / below * lost), 0.0, 1.0))


def _reflected(depth: Array, albedo: Array, mean: Array) -> Array:
    """Part of diffuse light on a layer that it sends back, as of light from 30° high."""
    sun = 0.5
    first, second, third, fourth = _gammas(albedo, mean, sun)
    k = np.sqrt(first * first - second * second)
    a2 = first * third + second * fourth
    grow, fade = portable.exp(k * depth), portable.exp(-k * depth)
    beam = portable.exp(-depth / sun)
    below = (1.0 - (k * sun) ** 2) * ((k + first) * grow + (k - first) * fade)
    back = (1.0 - k * sun) * (a2 + k * third) * grow
    back = back - (1.0 + k * sun) * (a2 - k * third) * fade
    back = back - 2.0 * k * (third - a2 * sun) * beam
    return np.asarray(np.clip(albedo / below * back, 0.0, 1.0))
