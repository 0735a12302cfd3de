"""What lies beyond a world's edge, out to the horizon: rings of falling resolution.

The innermost ring has the border's own nodes, so that there is no step and no crack; each further
one lies a cell farther out. The DTM is followed as far as the site holds it. What the ground is
above the DTM, and all beyond the DTM, is the last ring smoothed along itself, so that a hill at the
border runs out over about its own length; then all is level. Farther out the body curves away.
"""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrain_forge.base import Array, Mask, linear_from_srgb
from terrain_forge.dtm import cubic, patch_pixels
from terrain_forge.model import Mesh, Site, World
from terrain_forge.scene import Apron
from terrain_forge.writers import vertex_normals

_RINGS = (1, 1, 2, 4, 8)
"""Rings before their nodes are halved, from the border on; the last goes on."""
_FEWEST = 32
"""Cells along the shorter side below which nothing is halved any more."""
_EYE = 5.0
"""Height over the site's relief from which the horizon is looked at [m]."""
_INWARD = 2
"""Cells over which the ground's slope across its border is taken."""
_RUNOUT = 0.1
"""How far that slope goes on, as a part of the site's shorter side."""
_DTM_EDGE = 2.0
"""Pixels over which the DTM fades out at the edge of what the site holds."""


class _Ring(NamedTuple):
    """A closed polygon of nodes, counter-clockwise from the south-western corner."""

    away: float
    """Distance from the border, along the axes [m]."""
    parts: tuple[Array, ...]
    """How far along their side the nodes lie, both corners among them: S, E, N, W."""
    kept: NDArray[np.int64]
    """Rows of the last ring's nodes that it goes on from."""
    points: Array
    """East and north [m], shape [nodes, 2]."""


class WorldEdge:
    """The ground beyond a world's edge. There are no rocks on it."""

    def __init__(self, world: World) -> None:
        self.world = world
        self._bounds = west, south, east, north = world.ground.bounds
        self._sides = east - west, north - south

    @cached_property
    def reach(self) -> float:
        """How far it goes on [m]: to the horizon of an eye 5 m above the site's relief."""
        radius = self.world.site.body.mean_radius
        return float(np.sqrt(2.0 * radius * (_EYE + np.ptp(self.world.ground.elevation))))

    @cached_property
    def apron(self) -> Apron:
        """It, for rays."""
        heights, rgb = self._values
        points = np.concatenate([ring.points for ring in self._rings])
        vertices = np.column_stack([points, heights])
        mesh = Mesh(vertices=vertices, faces=self._faces())
        normals = vertex_normals(vertices, mesh.faces)
        border = len(self._rings[0].points)
        normals[:border] = _border_normals(self.world)
        return Apron(mesh=mesh, normals=normals, rgb=rgb)

    def heights_at(self, east: ArrayLike, north: ArrayLike) -> Array:
        """Heights of the triangulated apron under points beyond the edge [m].

        Raises:
            ValueError: if a point lies within the world or beyond the reach.
        """
        x, y = np.broadcast_arrays(*(np.asarray(c, np.float64) for c in (east, north)))
        west, south, far_east, far_north = self._bounds
        beyond = np.stack([south - y, x - far_east, y - far_north, west - x])
        away, side = beyond.max(axis=0), beyond.argmax(axis=0)
        aways = np.array([ring.away for ring in self._rings])
        if not np.all((away >= 0.0) & (away <= aways[-1])):
            raise ValueError(f"point not 0 to {aways[-1]:.0f} m beyond the world's edge")
        width, depth = self._sides
        along = np.choose(
            side, [x - west + away, y - south + away, far_east + away - x, far_north + away - y]
        ) / (np.choose(side % 2, [width, depth]) + 2.0 * away)
        heights = np.empty(x.shape)
        strip = np.clip(np.searchsorted(aways, away, side="right") - 1, 0, len(aways) - 2)
        for number in np.unique(strip):
            for edge in range(4):
                chosen = (strip == number) & (side == edge)
                if chosen.any():
                    places = np.column_stack([x[chosen], y[chosen]])
                    heights[chosen] = self._on_strip(int(number), edge, along[chosen], places)
        return heights

    def _on_strip(self, number: int, side: int, along: Array, places: Array) -> Array:
        """Heights between a ring and the next, along one side."""
        fine, coarse = self._rings[number].parts[side], self._rings[number + 1].parts[side]
        i, j = (
            np.clip(np.searchsorted(t, along, side="right") - 1, 0, len(t) - 2)
            for t in (fine, coarse)
        )
        outward, inward = _partners(len(fine) - 1, len(coarse) - 1)
        starts = self._starts[number : number + 2]
        rows = [
            (s + sum(len(p) - 1 for p in ring.parts[:side]), s, len(ring.points))
            for s, ring in zip(starts, self._rings[number : number + 2], strict=True)
        ]

        def node(which: int, index: NDArray[np.int64]) -> NDArray[np.int64]:
            first, start, count = rows[which]
            return np.asarray(start + (first - start + index) % count)

        near = _plane(self._vertices, (node(0, i), node(1, outward[i]), node(0, i + 1)), places)
        far = _plane(self._vertices, (node(1, j), node(1, j + 1), node(0, inward[j])), places)
        return np.where(near[1], near[0], far[0])

    @cached_property
    def _vertices(self) -> Array:
        return self.apron.mesh.vertices

    @cached_property
    def _starts(self) -> list[int]:
        """Row of each ring's first node."""
        counts = [len(ring.points) for ring in self._rings]
        return [sum(counts[:number]) for number in range(len(counts))]

    @cached_property
    def _rings(self) -> list[_Ring]:
        ground = self.world.ground
        rows, columns = ground.shape
        parts = tuple(np.linspace(0.0, 1.0, n) for n in (columns, rows, columns, rows))
        border = np.concatenate(
            [
                np.column_stack([ground.east, np.full(columns, ground.north[0])])[:-1],
                np.column_stack([np.full(rows, ground.east[-1]), ground.north])[:-1],
                np.column_stack([ground.east, np.full(columns, ground.north[-1])])[:0:-1],
                np.column_stack([np.full(rows, ground.east[0]), ground.north])[:0:-1],
            ]
        )
        rings = [_Ring(0.0, parts, np.arange(len(border)), border)]
        left, level = _RINGS[0], 0
        while (away := rings[-1].away) < self.reach:
            kept = [np.arange(len(part) - 1) for part in parts]
            if left == 0 and min(len(part) for part in parts) > _FEWEST:
                ends = [len(part) - 1 for part in parts]
                every = [np.append(np.arange(0, n, 2), n) for n in ends]
                parts = tuple(part[rows] for part, rows in zip(parts, every, strict=True))
                kept = [rows[:-1] for rows in every]
                level = min(level + 1, len(_RINGS) - 1)
                left = _RINGS[level]
            left = max(left - 1, 0)
            first = np.cumsum([0, *(len(part) - 1 for part in rings[-1].parts)])[:-1]
            perimeter = 2.0 * sum(self._sides) + 8.0 * away
            away += perimeter / sum(len(part) - 1 for part in parts)
            keep = np.concatenate([f + rows for f, rows in zip(first, kept, strict=True)])
            rings.append(_Ring(away, parts, keep, self._around(parts, away)))
        return rings

    def _around(self, parts: tuple[Array, ...], away: float) -> Array:
        """Nodes of a ring at some distance from the border."""
        west, south, east, north = self._bounds
        west, south, east, north = west - away, south - away, east + away, north + away
        corners = np.array([[west, south], [east, south], [east, north], [west, north]])
        ends = np.roll(corners, -1, axis=0)
        return np.concatenate(
            [a + part[:-1, None] * (b - a) for part, a, b in zip(parts, corners, ends, strict=True)]
        )

    @cached_property
    def _values(self) -> tuple[Array, Array]:
        """Height [m] and linear colour of all nodes."""
        world, rings = self.world, self._rings
        ground, border = world.ground, rings[0].points
        inner = self._around(rings[0].parts, -_INWARD * ground.spacing)
        every = np.concatenate([inner, *(ring.points for ring in rings)])
        dtm, weight = _dtm_at(world.site, every)
        start = len(inner)
        height = _border(ground.elevation).astype(np.float64)
        rise = height - ground.height_at(*inner.T)
        rise -= weight[start : start + len(border)] * (
            dtm[start : start + len(border)] - dtm[:start]
        )
        runout = _RUNOUT * min(self._sides)
        linear = linear_from_srgb(np.arange(256) / 255.0)
        colour = linear[_border(world.appearance.ground_rgb)]
        state = np.column_stack([height, rise / (_INWARD * ground.spacing), colour])
        mean, states = state.mean(axis=0), [state]
        for last, ring in pairwise(rings):
            step, count = ring.away - last.away, len(ring.points)
            below = dtm[start : start + len(last.points)]
            start += len(last.points)
            here, share = dtm[start : start + count], weight[start : start + count]
            state = np.column_stack([states[-1], below])
            state = _smoothed(_smoothed(state))[ring.kept]
            slope = state[:, 1] / (1.0 + step / runout)
            level = (1.0 - share) / (1.0 + min(self._sides) / step)
            found = state[:, 0] + slope * step + share * (here - state[:, 5])
            found += level * (mean[0] - found)
            colour = state[:, 2:5] + level[:, None] * (mean[2:] - state[:, 2:5])
            states.append(np.column_stack([found, slope, colour]))
        whole = np.concatenate(states)
        points = every[len(inner) :]
        west, south, east, north = self._bounds
        off = points - np.clip(points, (west, south), (east, north))
        whole[:, 0] -= (off * off).sum(axis=1) / (2.0 * world.site.body.mean_radius)
        return whole[:, 0], whole[:, 2:]

    def _faces(self) -> NDArray[np.int32]:
        faces = []
        for (start, ring), (next_start, outer) in pairwise(
            zip(self._starts, self._rings, strict=True)
        ):
            first = next_first = 0
            for part, outer_part in zip(ring.parts, outer.parts, strict=True):
                fine, coarse = np.arange(len(part)), np.arange(len(outer_part))
                own = start + (first + fine) % len(ring.points)
                far = next_start + (next_first + coarse) % len(outer.points)
                outward, inward = _partners(len(part) - 1, len(outer_part) - 1)
                faces.append(np.column_stack([own[:-1], far[outward], own[1:]]))
                faces.append(np.column_stack([far[:-1], far[1:], own[inward]]))
                first, next_first = first + len(part) - 1, next_first + len(outer_part) - 1
        return np.concatenate(faces).astype(np.int32)


def _partners(fine: int, coarse: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The outer node of each inner cell's triangle, and the inner node of each outer cell's."""
    if fine == coarse:
        return np.arange(fine), np.arange(1, coarse + 1)
    return (np.arange(fine) + 1) // 2, np.minimum(2 * np.arange(coarse) + 1, fine)


def _plane(
    vertices: Array, corners: tuple[NDArray[np.int64], ...], places: Array
) -> tuple[Array, Mask]:
    """Heights of triangles' planes at places, and whether those lie in them."""
    a, b, c = (vertices[corner] for corner in corners)
    u, v, p = b - a, c - a, places - a[:, :2]
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    s = (p[:, 0] * v[:, 1] - p[:, 1] * v[:, 0]) / area
    t = (u[:, 0] * p[:, 1] - u[:, 1] * p[:, 0]) / area
    inside = (s >= -1e-9) & (t >= -1e-9) & (s + t <= 1.0 + 1e-9)
    return a[:, 2] + s * u[:, 2] + t * v[:, 2], inside


def _smoothed(values: Array) -> Array:
    """Values along a closed ring, their shortest waves gone."""
    return 0.25 * (np.roll(values, 1, axis=0) + np.roll(values, -1, axis=0)) + 0.5 * values


def _border(grid: NDArray[Any]) -> NDArray[Any]:
    """Values of a grid at its border's nodes, counter-clockwise from the south-western corner."""
    return np.concatenate([grid[0, :-1], grid[:-1, -1], grid[-1, :0:-1], grid[:0:-1, 0]])


def _dtm_at(site: Site, points: Array) -> tuple[Array, Array]:
    """The DTM's heights in the site's frame at points [m], and how far it is to be followed."""
    if site.dtm is None:
        return np.zeros(len(points)), np.zeros(len(points))
    east, north = points.T
    column, row = patch_pixels(site.dtm, site.crs, east, north)
    rows, columns = site.dtm.heights.shape
    inside = np.minimum(np.minimum(column, columns - 1 - column), np.minimum(row, rows - 1 - row))
    column, row = np.clip(column, 0, columns - 1), np.clip(row, 0, rows - 1)
    heights = cubic(site.dtm.heights, column=column[None], row=row[None])[0]
    heights -= site.datum_height + site.slope[0] * east + site.slope[1] * north
    return heights, np.clip(inside / _DTM_EDGE, 0.0, 1.0)


def _border_normals(world: World) -> Array:
    """Unit normals of the ground at its border's nodes, as the renderer takes them."""
    z, spacing = world.ground.elevation, world.ground.spacing
    strips = ((z[:2], 0), (z[:, -2:].T, 1), (z[-2:], 1), (z[:, :2].T, 0))  # S, E, N, W
    slopes = []
    for number, (strip, own) in enumerate(strips):
        across, along = (part[own] for part in np.gradient(strip.astype(np.float64), spacing))
        east, north = (along, across) if number % 2 == 0 else (across, along)
        side = np.column_stack([-east, -north, np.ones(len(east))])
        slopes.append(side[:-1] if number < 2 else side[:0:-1])
    normals = np.concatenate(slopes)
    return np.asarray(normals / np.sqrt((normals * normals).sum(axis=1, keepdims=True)))
