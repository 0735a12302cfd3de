"""Where the nodes of rings lie: on the crests of hills that the ring would pass by."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from terrain_forge.base import Array
from terrain_forge.terrain.horizon.rings import Lattice, Ring, ring_points

_SHIFTS = (-0.4, -0.2, 0.2, 0.4)
"""Where crests are looked for, as parts of the way to the last ring and to the next: nodes of
neighbouring rings keep their order."""
_COARSE = 1.5
"""Cells that rings lie apart at least where crests are looked for between them."""
_LEAST = 5e-4
"""Height over the straight line between rings that makes a crest, over its distance."""
_KNOWN = 0.99
"""How far heights must be known there and on the rings beside it, 0 to 1."""


def places_of(
    rings: list[Ring], ground: Lattice, known_at: Callable[[Array], tuple[Array, Array]]
) -> list[Array]:
    """East and north of the nodes of each ring [m], shape [nodes, 2].

    A node moves straight away from the ground, or towards it, to where what stands over the line
    between rings is seen highest from the ground's middle; else hills on the skyline would be cut
    off between rings. Where nothing is known it stays.

    Args:
        rings: The rings.
        ground: What they lie around.
        known_at: Heights over an eye in the ground's middle at places [m], and how far they are
            known.
    """
    places = [ring.points for ring in rings]
    for number, ring in enumerate(rings[1:-1], 1):
        inward, outward = ring.away - rings[number - 1].away, rings[number + 1].away - ring.away
        if inward > _COARSE * ring.cell:
            places[number] = _on_crests(ring, ground, known_at, inward, outward)
    return places


def _on_crests(
    ring: Ring,
    ground: Lattice,
    known_at: Callable[[Array], tuple[Array, Array]],
    inward: float,
    outward: float,
) -> Array:
    parts = np.array([-1.0, 0.0, 1.0, *_SHIFTS])
    aways = ring.away + parts * np.where(parts < 0.0, inward, outward)
    points = np.stack([ring_points(ground, ring.parts, away) for away in aways])
    known, weight = (values.reshape(points.shape[:2]) for values in known_at(points.reshape(-1, 2)))
    last, here, following = known[:3]
    ends = np.where(parts[:, None] < 0.0, last, following)
    line = here + np.abs(parts)[:, None] * (ends - here)
    west, south, east, north = ground.bounds
    off = points - (0.5 * (west + east), 0.5 * (south + north))
    far = np.sqrt((off * off).sum(axis=2))
    rise = known / far
    crest = (known - line > _LEAST * far) & (rise > rise[1]) & (weight.min(axis=0) > _KNOWN)
    crest[:3] = [[False], [True], [False]]
    chosen = np.where(crest, rise, -np.inf).argmax(axis=0)
    return np.asarray(points[chosen, np.arange(points.shape[1])])
