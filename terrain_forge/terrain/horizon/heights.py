"""How high the ground beyond a world is, and its colour.

It is what was read of it, where anything was: the DTM's patch, then ever coarser heights around.
Where they end it becomes level, as high as the farthest are. Layers go on in it as far as they can
say how (`Layer.beyond`). What the ground at the border is besides all this runs out, and so does
what is known where that ends: it is smoothed along the ring, and falls to nothing over about the
length of the site's side. Farther out the body curves away.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np

from terrain_forge.base import Array, length_text, linear_from_srgb, portable, srgb_from_linear
from terrain_forge.dtm import far_heights
from terrain_forge.model import Horizon, Mesh, Site
from terrain_forge.terrain.horizon.border import Border
from terrain_forge.terrain.horizon.colours import (
    material_tints,
    regolith_colour,
    tinted,
    tints_beyond,
)
from terrain_forge.terrain.horizon.crests import places_of
from terrain_forge.terrain.horizon.places import heights_on
from terrain_forge.terrain.horizon.rings import (
    Ring,
    ring_faces,
    ring_points,
    rings_around,
)
from terrain_forge.terrain.layer import Beyond, Layer
from terrain_forge.writers import vertex_normals

_EYE = 5.0
"""Height over the site's relief from which the horizon is looked at [m]."""
_INWARD = 2
"""Cells over which the ground's slope across its border is taken."""
_RUNOUT = 0.1
"""How far that slope goes on, as a part of the site's shorter side."""


def shape_horizon(
    *,
    site: Site,
    border: Border,
    layers: tuple[Layer, ...],
    reach: float | None,
) -> Horizon:
    """The ground beyond a world's edge, without rocks.

    Args:
        site: The world's site.
        border: The world's ground along its border, and its looks.
        layers: The recipe's layers.
        reach: How far it goes on [m]; None for the true horizon.
    """
    border = tinted(site, border)
    rings = rings_around(border, _reach(site, border) if reach is None else reach)
    places = places_of(rings, border, partial(_over_middle, site, border))
    heights, linear, weight = _values(site, border, layers, rings, places)
    vertices = np.column_stack([np.concatenate(places), heights])
    if border.material() is not None:
        linear *= tints_beyond(
            rings,
            site=site,
            border=border,
            side=min(_sides(border)),
            height_at=partial(_height_anywhere, border, rings, vertices),
        )
    faces = ring_faces(rings)
    normals = vertex_normals(vertices, faces)
    count = len(rings[0].points)
    normals[:count] = border.normals()
    rgb = np.round(255.0 * np.clip(srgb_from_linear(linear), 0.0, 1.0)).astype(np.uint8)
    rgb[:count] = border.colours()
    starts = np.cumsum([0, *(len(ring.points) for ring in rings)])
    known = [
        ring.away
        for ring, a, b in zip(rings, starts[:-1], starts[1:], strict=True)
        if (weight[a:b] > 0.99).mean() > 0.5
    ]
    followed = max(known, default=0.0)
    return Horizon(
        mesh=Mesh(vertices=vertices, faces=faces),
        normals=normals.astype(np.float32),
        rgb=rgb,
        ground_vertices=len(vertices),
        ground_faces=len(faces),
        rocks=0,
        reach=rings[-1].away,
        followed=followed,
        told=_told(site, rings[-1].away, followed),
    )


def _told(site: Site, reach: float, followed: float) -> str:
    sources = dict.fromkeys(level.source for level in site.surroundings)
    if not followed:
        return f"level ground out to {length_text(reach)}: no heights were read beyond the site"
    told = f"heights of {', '.join(sources) or 'the DTM around the site'} out to"
    told += f" {length_text(followed)}"
    return told if followed >= 0.9 * reach else f"{told}, then level out to {length_text(reach)}"


def _reach(site: Site, border: Border) -> float:
    """How far can be seen from 5 m above the site's relief [m], and hills beyond that.

    Where the land around lies lower than the site, it is seen from higher up, and farther.
    """
    low, high = min([border.lowest, *_around(site)]), border.highest
    level = np.sqrt(2.0 * site.body.mean_radius * (_EYE + high - low))
    tops = [(float(f.heights.max()) - site.datum_height, f.reach) for f in site.surroundings]
    hills = np.sqrt(2.0 * site.body.mean_radius * max([0.0, *(top - low for top, _ in tops)]))
    known = max([0.0, *(far for _, far in tops)])
    return float(max(level, min(level + hills, known)))


def _values(
    site: Site,
    border: Border,
    layers: tuple[Layer, ...],
    rings: list[Ring],
    places: list[Array],
) -> tuple[Array, Array, Array]:
    """Height [m], linear colour of all nodes, and how far heights are followed there.

    The colour is that of regolith, whatever materials lie there.
    """
    first, sides = len(rings[0].points), _sides(border)
    inward = min(_INWARD, 0.5 * (min(border.shape) - 1)) * border.spacing
    inner = ring_points(border, rings[0].parts, -inward)
    points = np.concatenate([inner, *places])
    known, weight = _known(site, points)
    height = border.heights().astype(np.float64)
    level = float(height.mean()) if site.dtm is None else _level(site, known, weight)
    going_on = [f for layer in layers if layer.mask is None and (f := layer.beyond(site))]
    relief = np.concatenate([_relief(going_on, ring) for ring in rings])
    within = _relief(going_on, replace(rings[0], points=inner))
    inside = border.height_at(*inner.T) - within - weight[:first] * known[:first]
    known, weight, points = known[first:], weight[first:], points[first:]
    bare = height - relief[:first]
    slope = (bare - weight[:first] * known[:first] - inside) / inward
    linear = linear_from_srgb(np.arange(256) / 255.0)
    colour, mean = linear[border.colours()], regolith_colour(*border.different_looks)
    if (material := border.material()) is not None:
        colour = colour / material_tints(border.looks[0])[material]
    states, start = [np.column_stack([bare, slope, colour])], 0
    for last, ring in pairwise(rings):
        step, count = ring.away - last.away, len(last.points)
        here = slice(start, start + count)
        start += count
        there = slice(start, start + len(ring.points))
        # Apart from what is known, where anything is.
        apart = np.where(weight[here] > 0.0, states[-1][:, 0] - known[here], 0.0)
        state = _smoothed(_smoothed(np.column_stack([states[-1], apart])))[ring.kept]
        slope = state[:, 1] / (1.0 + step / (_RUNOUT * min(sides)))
        fade = 1.0 / (1.0 + min(sides) / step)
        share = np.minimum(weight[there], weight[here][ring.kept])
        on_known = known[there] + (1.0 - fade) * (state[:, 5] + slope * step)
        alone = state[:, 0] + slope * step
        found = share * on_known + (1.0 - share) * (alone + fade * (level - alone))
        colour = state[:, 2:5] + fade * (mean - state[:, 2:5])
        states.append(np.column_stack([found, slope, colour]))
    whole = np.concatenate(states)
    heights = whole[:, 0] + relief - _drop(site, border, points)
    heights[:first] = height
    return heights, whole[:, 2:], weight


def _known(site: Site, points: Array) -> tuple[Array, Array]:
    """Heights that were read [m] in the site's frame, not yet bent down, and how far they are."""
    known, weight = far_heights(site, *points.T)
    known -= site.datum_height + _plane(site, points)
    return known, weight


def _over_middle(site: Site, border: Border, points: Array) -> tuple[Array, Array]:
    """Heights that were read over an eye on the site [m], bent down, and how far they are."""
    known, weight = _known(site, points)
    eye = 0.5 * (border.lowest + border.highest) + _EYE
    return known - _drop(site, border, points) - eye, weight


def _drop(site: Site, border: Border, points: Array) -> Array:
    """How far the body has curved away at points [m]."""
    west, south, east, north = border.bounds
    off = points - np.clip(points, (west, south), (east, north))
    return np.asarray((off * off).sum(axis=1) / (2.0 * site.body.mean_radius))


def _height_anywhere(
    border: Border, rings: list[Ring], vertices: Array, east: Array, north: Array
) -> Array:
    """Heights of the ground [m] at places within a world and beyond, at most at the last ring."""
    west, south, far_east, far_north = border.bounds
    reach = rings[-1].away
    x, y = np.broadcast_arrays(
        np.clip(east, west - reach, far_east + reach),
        np.clip(north, south - reach, far_north + reach),
    )
    inside = border.covers(x, y)
    heights = np.empty(x.shape)
    heights[inside] = border.height_at(x[inside], y[inside])
    heights[~inside] = heights_on(rings, vertices, border, x[~inside], y[~inside])
    return heights


def _sides(border: Border) -> tuple[float, float]:
    west, south, east, north = border.bounds
    return east - west, north - south


def _level(site: Site, known: Array, weight: Array) -> float:
    """How high the ground is where nothing is known: as the outermost that is [m]."""
    alone = float((weight * known).sum() / max(float(weight.sum()), 1e-9))
    return next(iter(_around(site)), alone)


def _around(site: Site) -> list[float]:
    """How high the outermost heights are that were read [m], if there are any."""
    return [far.mean - site.datum_height for far in site.surroundings[-1:]]


def _plane(site: Site, points: Array) -> Array:
    """Height of the plane that levelling takes away [m]; far out it flattens.

    It holds to one diagonal of the site from its middle. From there on its rise grows with the
    logarithm of the distance: else a slope of the site would lift the landscape by kilometres.
    """
    held = float(np.sqrt(site.size[0] ** 2 + site.size[1] ** 2))
    far = np.maximum(np.sqrt((points * points).sum(axis=1)) / held, 1.0)
    share = (1.0 + portable.log(far)) / far
    return np.asarray(share * (site.slope[0] * points[:, 0] + site.slope[1] * points[:, 1]))


def _relief(layers: list[Beyond], ring: Ring) -> Array:
    """What the layers add at a ring's nodes [m]."""
    total = np.zeros(len(ring.points))
    first = 0
    for number, part in enumerate(ring.parts):
        count = len(part) - 1
        points = ring.points[first : first + count]
        along, across = points[:, number % 2], points[:1, 1 - number % 2]
        east, north = (along, across) if number % 2 == 0 else (across, along)
        for relief in layers:
            total[first : first + count] += relief(east, north, ring.cell).ravel()
        first += count
    return total


def _smoothed(values: Array) -> Array:
    """Values along a closed ring, their shortest waves gone."""
    return 0.25 * (np.roll(values, 1, axis=0) + np.roll(values, -1, axis=0)) + 0.5 * values
