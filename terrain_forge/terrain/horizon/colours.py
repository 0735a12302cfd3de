"""The colour of the ground beyond a world where the recipe has materials.

They go on by the rule that they have on the site: the same patches, and masks by the ground's
slope, height and relief there. Where nodes lie too far apart for that, a material has the share
that it has on the site. With distance all of it fades to the regolith, so that no material tints
the land out to the horizon. An image goes on as at its edge, a route's distance is known anywhere,
but what is masked by them ends within some patches of the border.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np

from terrain_forge.base import Array, linear_from_srgb
from terrain_forge.model import Appearance, Site
from terrain_forge.terrain.horizon.border import Border
from terrain_forge.terrain.horizon.rings import Ring
from terrain_forge.terrain.masks import Mask, fade, mask_weight_at, weight_by_place
from terrain_forge.terrain.materials import MaterialSpec, patch_ranks

_LEAST = 0.01
"""Part of the site that is regolith, from which on its colour is looked up there."""
_DARKEST = 1e-3
"""Linear colour that a tint is told over, at least."""
_ENDED = 2.0
"""Patches beyond the border over which a mask by an image or a route ends."""
_SWAPPED = np.array([[0.0, 1.0], [1.0, 0.0]])
_LINEAR = linear_from_srgb(np.arange(256) / 255.0)


def regolith_colour(*parts: Appearance) -> Array:
    """Mean linear colour of the regolith on parts of a site, drifts and all, shape [3]."""
    rgb = [looks.ground_rgb.reshape(-1, 3) for looks in parts]
    if parts[0].material is not None:
        bare = [looks.material.ravel() == 0 for looks in parts if looks.material is not None]
        found = sum(int(np.count_nonzero(one)) for one in bare)
        if found < _LEAST * sum(one.size for one in bare):
            return np.asarray(linear_from_srgb(parts[0].materials[0].rgb))
        rgb = [colours[one] for colours, one in zip(rgb, bare, strict=True)]
    counts = [
        sum(np.bincount(colours[:, band], minlength=256) for colours in rgb) for band in range(3)
    ]
    total = sum(len(colours) for colours in rgb)
    return np.array([math.fsum(count * _LINEAR) for count in counts]) / total


def tinted(site: Site, border: Border) -> Border:
    """Looks without materials where they have no colour: an orthoimage of three bands has."""
    picture = site.orthoimage
    if picture is None or picture.albedo.shape[2] == 1:
        return border
    plain = {id(looks): looks.replace(material=None) for looks in border.different_looks}
    south, east, north, west = (plain[id(looks)] for looks in border.looks)
    return replace(border, looks=(south, east, north, west))


def material_tints(appearance: Appearance) -> Array:
    """Linear colour of each material over that of the regolith, shape [materials, 3]."""
    colours = np.maximum(linear_from_srgb([one.rgb for one in appearance.materials]), _DARKEST)
    return np.asarray(colours / colours[0])


def tints_beyond(
    rings: list[Ring],
    *,
    site: Site,
    border: Border,
    side: float,
    height_at: Callable[[Array, Array], Array],
) -> Array:
    """Linear colour of the rings' nodes over that of regolith, shape [nodes, 3].

    Args:
        rings: The rings, the first on the border.
        site: The site.
        border: Its border.
        side: The shorter side of the world [m]; over about so much the materials fade.
        height_at: Heights [m] at places east and north [m], within the world and beyond.
    """
    tints, shares = material_tints(border.looks[0]), _shares(border.different_looks)
    found = []
    for last, ring in pairwise([rings[0], *rings]):
        tint = np.ones((len(ring.points), 3))
        cell = max(ring.cell, ring.away - last.away, site.spacing)
        for number, spec in enumerate(site.recipe.terrain.materials, 1):
            share = _share(spec, ring, cell, site, shares[number], height_at)[:, None]
            tint += share * (tints[number] - tint)
        found.append(1.0 + (tint - 1.0) * side / (side + ring.away))
    return np.concatenate(found)


def _shares(parts: tuple[Appearance, ...]) -> list[float]:
    """Part of the site that each material covers where none of the later ones lies."""
    kinds, counts = len(parts[0].materials), np.zeros(len(parts[0].materials), np.int64)
    for looks in parts:
        if looks.material is not None:
            counts += np.bincount(looks.material.ravel(), minlength=kinds)
    if not counts.any():
        return [1.0] + [0.0] * (kinds - 1)
    below = np.cumsum(counts)
    return [int(n) / max(int(m), 1) for n, m in zip(counts, below, strict=True)]


def _share(
    spec: MaterialSpec,
    ring: Ring,
    cell: float,
    site: Site,
    usual: float,
    height_at: Callable[[Array, Array], Array],
) -> Array:
    """How much of a ring's nodes a material covers, shape [nodes].

    Where neighbouring nodes and rings are `cell` [m] apart it lies on some, and on others not;
    where that is wider than its patches, on each to the part that is usual, or that an image or a
    route says.
    """
    mask, count = spec.mask, len(ring.points)
    placed = mask is not None and (mask.image is not None or mask.route is not None)
    ended = float(fade(np.array(ring.away), 0.0, _ENDED * spec.patch_m)) if placed else 1.0
    bands = () if mask is None else (mask.slope, mask.hollow, mask.roughness)
    scale = min([spec.patch_m, *(band.baseline_m for band in bands if band is not None)])
    known = float(fade(np.array(cell), 0.25 * scale, scale))
    if ended == 0.0 or not (placed or known):
        return np.full(count, ended * usual)
    weight = np.full(count, spec.cover)
    if mask is not None:
        east, north = ring.points.T
        weight *= mask_weight_at(
            mask, placed=_by_place(mask, ring, site), east=east, north=north, cell=cell,
            height_at=height_at,
        )  # fmt: skip
    there = known * (_ranks(spec, ring, cell, site) < weight)
    return np.asarray(ended * (there + (1.0 - known) * (weight if placed else usual)))


def _by_place(mask: Mask, ring: Ring, site: Site) -> Array:
    """What a mask's image and route make of a ring's nodes, shape [nodes]."""
    weights, first = [], 0
    for number, part in enumerate(ring.parts):
        points = ring.points[first : first + len(part) - 1]
        lines = [points[:, 0], points[:, 1]]
        lines[1 - number % 2] = lines[1 - number % 2][:1]  # one row or column of nodes
        (east, north), shape = lines, (len(lines[1]), len(lines[0]))
        weight = weight_by_place(mask, np.ones(shape), site=site, east=east, north=north)
        weights.append(weight.ravel())
        first += len(points)
    return np.concatenate(weights)


def _ranks(spec: MaterialSpec, ring: Ring, cell: float, site: Site) -> Array:
    """The ranks of a ring's nodes in a material's patches, shape [nodes]."""
    ranks, first = [], 0
    for number, part in enumerate(ring.parts):
        points = ring.points[first : first + len(part) - 1]
        along, across = points[:, number % 2], points[:1, 1 - number % 2]
        turn = _SWAPPED if number % 2 else None  # one row of nodes in any case
        ranks.append(
            patch_ranks(spec, site=site, east=along, north=across, cell=cell, turn=turn).ravel()
        )
        first += len(points)
    return np.concatenate(ranks)
