"""How bright a surface is under the angles of light and look: Hapke's law, and a table for it.

As McEwen 1991 (doi:10.1016/0019-1035(91)90053-V) did for maps: at each phase angle g the lunar-
Lambert law A(g) · 2 μ₀ / (μ₀ + μ) + B(g) · μ₀ that is nearest to Hapke's over the half of a sphere
that is seen and lit, with cosines μ₀ of incidence and μ of emission. Its mean error is 3 to 5 %.
The opposition surge is all in A and B. Divided by μ₀ it is reciprocal, whatever the figures.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrain_forge.base import Array, portable
from terrain_forge.model import Photometry

STEPS = 64
"""Entries of the table."""
STANDARD = 1.0, float(np.sqrt(0.75))
"""Cosines of emission and incidence of laboratories' spectra: there a surface of a colour is as
bright as one of Lambert's of that colour."""
_LOOKS = 10
"""Latitudes and longitudes of the sphere that the table is fitted to."""
_HIGHEST = np.radians(80.0)
_GRAZING = np.radians(88.0)


def photometric_law(photometry: Photometry | None) -> NDArray[np.float64]:
    """2 A and B by the square root of the sine of half the phase angle, shape [2, STEPS].

    Entries are even steps of it from 0 to 1. Without figures it is Lambert's law.
    """
    if photometry is None:
        return np.stack([np.zeros(STEPS), np.ones(STEPS)])
    figures = (
        photometry.albedo, photometry.lobe, photometry.back, photometry.surge,
        photometry.surge_width, photometry.roughness,
    )  # fmt: skip
    return _law(*figures)


def reflected(law: NDArray[np.float64], mu0: float, mu: float, cos_phase: float) -> float:
    """Light that comes back over that of a white Lambert surface that faces the Sun."""
    place = np.sqrt(np.sqrt(max(0.0, 0.5 * (1.0 - cos_phase))))
    lommel, lambert = (float(np.interp(place, np.linspace(0.0, 1.0, STEPS), row)) for row in law)
    return mu0 * (lommel / (mu0 + mu) + lambert)


def hapke(photometry: Photometry, mu0: ArrayLike, mu: ArrayLike, cos_phase: ArrayLike) -> Array:
    """Radiance factor of Hapke's law: light that comes back over that of white facing the Sun.

    Args:
        photometry: The surface's figures.
        mu0: Cosines of the angle of incidence.
        mu: Cosines of the angle of emission.
        cos_phase: Cosines of the angle between the Sun and the eye, as they are seen from there.
    """
    mu0, mu, phase = (np.asarray(x, np.float64) for x in np.broadcast_arrays(mu0, mu, cos_phase))
    lit, seen, shadowing = _rough(photometry.roughness, mu0, mu, phase)
    b, c = photometry.lobe, photometry.back
    lobes = [(1.0 - b * b) / portable.power(1.0 + b * b - s * phase, 1.5) for s in (2 * b, -2 * b)]
    particle = 0.5 * (1.0 + c) * lobes[0] + 0.5 * (1.0 - c) * lobes[1]
    half = np.sqrt((1.0 - phase) / np.maximum(1.0 + phase, 1e-12))  # tangent of half the angle
    surge = 1.0 + photometry.surge / (1.0 + half / photometry.surge_width)
    gamma = np.sqrt(1.0 - photometry.albedo)
    several = [(1.0 + 2.0 * x) / (1.0 + 2.0 * gamma * x) for x in (lit, seen)]
    scattered = particle * surge + several[0] * several[1] - 1.0
    return np.asarray(0.25 * photometry.albedo * lit / (lit + seen) * scattered * shadowing)


def _rough(slope: float, mu0: Array, mu: Array, phase: Array) -> tuple[Array, Array, Array]:
    """Effective cosines of incidence and emission, and what shadows leave (Hapke 1984)."""
    if slope == 0.0:
        return mu0, mu, np.ones_like(mu0)
    tangent = float(np.tan(slope))
    chi = 1.0 / np.sqrt(1.0 + np.pi * tangent**2)
    sin0, sin = np.sqrt(1.0 - mu0 * mu0), np.sqrt(1.0 - mu * mu)
    turn = np.clip((phase - mu0 * mu) / np.maximum(sin0 * sin, 1e-12), -1.0, 1.0)
    angle = portable.arctan2(np.sqrt(1.0 - turn * turn), turn)
    beside = 0.5 * (1.0 - turn)  # squared sine of half the angle
    visible = portable.exp(-2.0 * np.sqrt(beside / np.maximum(1.0 - beside, 1e-12)))

    def parts(cosine: Array, sine: Array) -> tuple[Array, Array, Array]:
        steep = cosine / np.maximum(sine, 1e-9) / tangent
        first, second = (portable.exp(-x) for x in (2.0 / np.pi * steep, steep * steep / np.pi))
        return first, second, chi * (cosine + sine * tangent * second / (2.0 - first))

    (one0, two0, even0), (one, two, even) = parts(mu0, sin0), parts(mu, sin)
    lower = mu0 < mu  # the Sun is nearer to the horizon than the eye
    low1, low2 = np.where(lower, one0, one), np.where(lower, two0, two)
    high1, high2 = np.where(lower, one, one0), np.where(lower, two, two0)
    below = 2.0 - low1 - angle / np.pi * high1
    near = chi * tangent * (low2 - beside * high2) / below
    far = chi * tangent * (turn * low2 + beside * high2) / below
    lit = chi * mu0 + sin0 * np.where(lower, near, far)
    seen = chi * mu + sin * np.where(lower, far, near)
    share = np.where(lower, mu / even, mu0 / even0)
    shadowing = seen / even * (mu0 / even0) * chi / (1.0 - visible + visible * chi * share)
    return lit, seen, shadowing


@cache
def _law(*figures: float) -> NDArray[np.float64]:
    names = "albedo", "lobe", "back", "surge", "surge_width", "roughness"
    photometry = Photometry(**dict(zip(names, figures, strict=True)), source="")
    half = (np.arange(STEPS) / (STEPS - 1.0)) ** 2
    # The last entries' spheres are seen from behind: a thin crescent is left of 2.5 degrees.
    phase = 2.0 * portable.arcsin(np.minimum(half, np.sin(0.5 * (2.0 * _GRAZING - 0.04))))
    law = np.stack([_nearest(photometry, float(angle)) for angle in phase], axis=-1)
    mu, mu0 = STANDARD
    law *= mu0 / hapke(photometry, mu0, mu, mu0)
    law.setflags(write=False)
    return law


def _nearest(photometry: Photometry, phase: float) -> tuple[float, float]:
    """2 A and B at a phase angle [rad]."""
    middles = (np.arange(_LOOKS) + 0.5) / _LOOKS
    latitude = _HIGHEST * middles
    longitude = phase - _GRAZING + (2.0 * _GRAZING - phase) * middles
    flat = np.cos(latitude)[:, None]
    mu, mu0 = (flat * np.cos(longitude - turn) for turn in (0.0, phase))
    wanted = hapke(photometry, mu0, mu, np.cos(phase)).ravel()
    terms = np.stack([(mu0 / (mu0 + mu)).ravel(), mu0.ravel()], axis=1) / wanted[:, None]
    lommel, lambert = portable.solve(portable.product(terms.T, terms), terms.sum(axis=0)).tolist()
    if lommel < 0.0:  # beyond some 110 degrees
        return 0.0, float(terms[:, 1].sum() / (terms[:, 1] ** 2).sum())
    return lommel, lambert
