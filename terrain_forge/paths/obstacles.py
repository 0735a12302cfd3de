"""What the rover cannot pass: rocks that are too high for it, and their outlines in plan."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, Record, kernel, portable
from terrain_forge.model import RockField, RockLibrary, Rover, rotations
from terrain_forge.rocks import edges, exposed_points, extent

STEP_PER_WHEEL = 0.8
"""Height of a step that a rover on rockers climbs, over the diameter of its smallest wheel. In the
validation drive MORPHEUS climbs steps across its whole width up to one diameter at a friction of
0.7; the rest is margin."""
DIRECTIONS = 64
"""Directions in which outlines are known: gaps are told at most 0.12 % of a rock's radius short."""
_ANGLES = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
UNITS = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)])
"""Unit vectors of the directions, shape [2, directions]."""


def highest_step(rover: Rover) -> float:
    """Height of the highest step or rock that a rover goes over [m].

    The rover's own limit, where it has one; else its wheels must climb it and its body clear it.
    """
    if rover.step_limit is not None:
        return rover.step_limit
    smallest = min(wheel.radius for wheel in rover.wheels)
    return min(rover.clearance, STEP_PER_WHEEL * 2.0 * smallest)


def half_diagonal(rover: Rover) -> float:
    """Radius of the circle in which the rover can turn on the spot [m]."""
    return 0.5 * math.hypot(rover.length, rover.width)


@dataclass(frozen=True, kw_only=True, eq=False)
class Obstacles(Record):
    """Rocks higher than the rover goes over, with the convex outlines of what is above ground."""

    id: NDArray[np.int32]
    """Ids of the rocks, shape [obstacles]."""
    centre: Array
    """East and north of their centres of mass [m], shape [obstacles, 2]."""
    height: Array
    """Their heights above the ground [m], shape [obstacles]."""
    support: Array
    """How far each outline reaches from the centre in each of `DIRECTIONS` directions, counter-
    clockwise from east [m], shape [obstacles, directions]."""

    def __post_init__(self) -> None:
        count = len(self.id)
        self.freeze("id", np.int32, ("obstacles",))
        self.freeze("centre", np.float64, (count, 2))
        self.freeze("height", np.float64, (count,))
        self.freeze("support", np.float64, (count, DIRECTIONS))

    def __len__(self) -> int:
        return len(self.id)

    def describe(self, number: int) -> str:
        """A rock, its place and its height in words."""
        (x, y), height = self.centre[number], self.height[number]
        return f"rock {self.id[number]} at ({x:.2f}, {y:.2f}) m, {height:.2f} m high"

    def distances(self, point: Array) -> Array:
        """Distance of a point, shape [2], to each outline [m], negative within it."""
        reach = portable.product(np.asarray(point, np.float64) - self.centre, UNITS)
        return np.asarray(np.max(reach - self.support, axis=1, initial=-np.inf))

    def gaps(self, number: int, position: Array, heading: Array, rover: Rover) -> Array:
        """Gaps between one outline and the rover's own rectangle at poses [m], shape [poses].

        Positions are those of base_link [m], shape [poses, 2]. By separating axes in the outline's
        directions: negative where they overlap, too small by at most 3 % of the rover's half
        diagonal near its corners.
        """
        offset = position - self.centre[number]
        turned = np.subtract.outer(heading, _ANGLES)
        along, across = np.abs(np.cos(turned)), np.abs(np.sin(turned))
        reach = 0.5 * (rover.length * along + rover.width * across)
        gaps = portable.product(offset, UNITS) - reach - self.support[number]
        return np.asarray(np.max(gaps, axis=1))

    def beside(
        self, position: Array, heading: Array, rover: Rover, farthest: float
    ) -> Iterator[tuple[int, NDArray[np.intp], Array]]:
        """Obstacles near a track: which, the poses near it, and the rover's gaps to it there [m].

        Positions of base_link [m], shape [poses, 2], are near up to a gap of `farthest` [m].
        """
        from scipy.spatial import cKDTree

        reach = self.support.max(axis=1) + half_diagonal(rover) + farthest
        track = cKDTree(position)
        for number in range(len(self)):
            near = track.query_ball_point(self.centre[number], reach[number], return_sorted=True)
            if near:
                poses = np.array(near)
                yield number, poses, self.gaps(number, position[poses], heading[poses], rover)

    def first_touched(self, position: Array, heading: Array, rover: Rover) -> str:
        """The obstacle that the rover touches first along a track, in words; empty for none."""
        first, found = len(position), ""
        for number, poses, gaps in self.beside(position, heading, rover, 0.0):
            at = int(poses[np.argmax(gaps < 0.0)])
            if gaps.min() < 0.0 and at < first:
                first, found = at, self.describe(number)
        return found


def find_obstacles(rocks: RockField, library: RockLibrary, rover: Rover) -> Obstacles:
    """The rocks that stand higher above the ground than the rover goes over."""
    high = rocks.select(rocks.collides & (rocks.height > highest_step(rover)))
    turns, buried = rotations(high), high.buried_fraction
    support = np.empty((len(high), DIRECTIONS))
    for shape in np.unique(high.prototype):
        mesh, rows = library.prototypes[shape].meshes[0], np.flatnonzero(high.prototype == shape)
        _fill_supports(mesh.vertices.copy(), edges(mesh), rows, turns, buried, UNITS, support)
    support *= high.scale[:, None]
    return Obstacles(id=high.id, centre=high.position[:, :2], height=high.height, support=support)


@kernel
def _fill_supports(vertices, edges, rows, turns, buried, units, support):  # type: ignore[no-untyped-def]
    """Reach of the exposed part of some rocks of one shape in each direction [mean axes]."""
    for rock in rows:
        up = turns[rock, 2, 0], turns[rock, 2, 1], turns[rock, 2, 2]
        low, high = extent(vertices, up)
        level = low + buried[rock] * (high - low)
        points = exposed_points(vertices, edges, turns[rock], up, level)
        for d in range(units.shape[1]):
            reach = -np.inf
            for p in range(len(points)):
                reach = max(reach, points[p, 0] * units[0, d] + points[p, 1] * units[1, d])
            support[rock, d] = reach
