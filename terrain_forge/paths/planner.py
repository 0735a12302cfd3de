"""Planned paths: the cheapest path over what the rover can pass, made smooth and checked."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, Key, RecipeError, checked
from terrain_forge.model import Route, Rover
from terrain_forge.paths.curves import Curve, trace_spline
from terrain_forge.paths.lattice import GridPath, bend, cheapest_path, straighten
from terrain_forge.paths.obstacles import Obstacles, half_diagonal
from terrain_forge.paths.plan import as_route
from terrain_forge.paths.spec import PathSpec, Planned
from terrain_forge.paths.traversability_field import (
    IMPASSABLE,
    UNKNOWN,
    Traversability,
    border_width,
)

Weight = NDArray[np.float32]
Place = tuple[float, float]
Stop = tuple[str, Place]
Line = tuple[Array, NDArray[np.bool_], Obstacles]
"""Points east and north [m], which of them stay, and the obstacles beside them."""

DISLIKE = 9.0
"""How much dearer than smooth level ground a node of almost full cost is, in units of the former;
grows with the square of the cost."""
MOST_NODES = 1100
"""Rows or columns of the grid that is searched first; larger ones are coarsened."""
LINE_STEP = 0.25
"""Distance of the points of the line that is smoothed [m]."""
OVER_BORDER = "the rover would stand out over the border of the terrain"
KNOTS = (4, 2, 1)
"""Every how many of them the spline goes through; more of them where it would touch something."""


@checked
def plan_path(
    spec: PathSpec,
    route: Planned,
    *,
    field: Traversability,
    rover: Rover,
    key: Key = ("paths",),
) -> Route:
    """The planned route of a path on a finished world.

    The field says what ground and rocks mean to the rover; the key is the path's in the recipe.

    Raises:
        RecipeError: if a place is blocked, by what; if there is no way; or if the way is too narrow
            for the rover where it turns.
    """
    key = (*key, "route")
    turning = require_free(route, lambda _: field, rover=rover, key=key)

    def line(clearance: float) -> Line:
        found, fixed = _line(field, route.stops, clearance, key)
        return found, fixed, field.obstacles

    return smooth_route(spec, line, (0.5 * rover.width + route.margin_m, turning), rover, key)


def require_off_border(
    route: Planned, *, size: tuple[float, float], spacing: float, rover: Rover, key: Key
) -> None:
    """Refuse places at the border of the terrain, which is known before the ground.

    Raises:
        RecipeError: says which.
    """
    border = border_width(rover, spacing)
    for name, place in route.stops:
        for coordinate, length in zip(place, size, strict=True):
            node, last = round((coordinate + 0.5 * length) / spacing), round(length / spacing)
            if not border <= node <= last - border:
                raise RecipeError(_at(place, OVER_BORDER), key=(*key, "route", name))


def require_free(
    route: Planned, field_at: Callable[[Place], Traversability], *, rover: Rover, key: Key
) -> float:
    """Refuse places that are blocked; returns the clearance [m] with which the rover can turn.

    Raises:
        RecipeError: says by what.
    """
    needed = 0.5 * rover.width + route.margin_m
    turning = max(needed, half_diagonal(rover))
    for name, place in route.stops:
        reason = blocked_by(field_at(place), place, needed if name == "via_m" else turning)
        if reason:
            raise RecipeError(_at(place, reason), key=(*key, name))
    return turning


def _at(place: Place, reason: str) -> str:
    return f"({place[0]:g}, {place[1]:g}) m: {reason}"


def smooth_route(
    spec: PathSpec,
    line: Callable[[float], Line],
    clearances: tuple[float, float],
    rover: Rover,
    key: Key,
) -> Route:
    """The route along a line that is found for a clearance [m], or with one to turn on the way.

    Raises:
        RecipeError: if the way is too narrow for the rover where it turns.
    """
    needed, turning = clearances
    curve, touched = _curve(*line(needed), rover, key)
    if touched:
        # Where the rover's corners would touch, there may be a way on which it can even turn.
        with suppress(RecipeError):
            curve, touched = _curve(*line(turning), rover, key)
    if touched:
        raise RecipeError(
            f"the only way is too narrow for the rover, which touches {touched}; a larger margin_m "
            "makes it keep off",
            key=(*key, "margin_m"),
        )
    return as_route(curve, spec=spec, key=key)


def _line(
    field: Traversability, stops: tuple[Stop, ...], needed: float, key: Key
) -> tuple[Array, NDArray[np.bool_]]:
    """A line through all stops, east and north [m], and which of its points are stops."""
    weight = node_weights(field, needed)
    legs = [
        leg_between(field, weight, (begin, end), (*key, name))
        for (_, begin), (name, end) in pairwise(stops)
    ]
    line = np.concatenate([legs[0], *(leg[1:] for leg in legs[1:])])
    fixed = np.zeros(len(line), np.bool_)
    fixed[np.cumsum([len(leg) - 1 for leg in legs])] = True
    return places_of(field, bend(weight, nodes_of(field, line), fixed)), fixed


def node_weights(field: Traversability, needed: float) -> Weight:
    """Cost of a metre at each node, from 1; infinite where less clearance is than needed [m]."""
    passable = (field.cost >= 0.0) & (field.cost < IMPASSABLE) & (field.clearance >= needed)
    weight = np.where(passable, 1.0 + DISLIKE * field.cost**2, np.inf)
    return weight.astype(np.float32)


def blocked_by(field: Traversability, place: Place, needed: float) -> str:
    """Why the rover cannot be at a place [m] with so much clearance [m]; empty if it can."""
    row, column = field.node(place)
    rows, columns = field.cost.shape
    inside = 0 <= row < rows and 0 <= column < columns
    if not inside or field.cost[row, column] == UNKNOWN:
        return OVER_BORDER
    node = places_of(field, np.array([(column, row)]))[0]
    away = np.minimum(*(field.obstacles.distances(point) for point in (np.array(place), node)))
    if len(away) and away.min() < needed:
        n = int(np.argmin(away))
        gap = f"{away[n]:.2f} m from" if away[n] > 0.0 else "inside"
        return (
            f"{gap} {field.obstacles.describe(n)}; the rover needs {needed:.2f} m beside rocks "
            f"above {field.highest_step:.2f} m"
        )
    if field.clearance[row, column] < needed:
        return (
            f"{field.clearance[row, column]:.2f} m from a step above {field.highest_step:.2f} m in "
            f"the ground; the rover needs {needed:.2f} m"
        )
    slope, steepest = math.degrees(field.slope[row, column]), math.degrees(field.steepest)
    if field.cost[row, column] >= IMPASSABLE:
        return f"the ground slopes by {slope:.1f}°, the rover may be driven on {steepest:.1f}°"
    return ""


def leg_between(
    field: Traversability, weight: Weight, ends: tuple[Place, Place], key: Key
) -> Array:
    """A line between two places, east and north [m], shape [points, 2]."""
    path, stride = _grid_path(field, weight, ends)
    if not len(path.nodes):
        x, y = places_of(field, np.array([path.nearest[::-1]]) * stride)[0]
        area = path.reached * (stride * field.spacing) ** 2
        raise RecipeError(
            f"no way leads from ({ends[0][0]:g}, {ends[0][1]:g}) m to ({ends[1][0]:g}, "
            f"{ends[1][1]:g}) m: the rover can reach {area:.4g} m², nearest at ({x:.2f}, {y:.2f}) "
            f"m; it goes over steps and rocks up to {field.highest_step:.2f} m and slopes up to "
            f"{math.degrees(field.steepest):.0f}°",
            key=key,
        )
    if len(path.nodes) == 1:
        return np.array(ends)
    coarse = _coarsened(weight, stride)
    line = straighten(coarse, path.nodes, step=LINE_STEP / (stride * field.spacing))
    points = places_of(field, line * stride)
    points[0], points[-1] = ends
    return points


def _grid_path(
    field: Traversability, weight: Weight, ends: tuple[Place, Place]
) -> tuple[GridPath, int]:
    """The cheapest path on the coarsest grid that has one, and that grid's stride [nodes]."""
    stride = max(math.ceil(max(weight.shape) / MOST_NODES), 1)
    while True:
        coarse = _coarsened(weight, stride)
        last = np.array(coarse.shape) - 1
        nodes = np.rint(np.array([field.node(place) for place in ends]) / stride).astype(int)
        (start, goal) = map(tuple, np.minimum(nodes, last).tolist())
        path = cheapest_path(coarse, start=start, goal=goal)
        if len(path.nodes) or stride == 1:
            return path, stride
        stride = max(stride // 2, 1)


def _coarsened(weight: Weight, stride: int) -> Weight:
    """Every so manieth node, with the largest weight of the square around it that is its own."""
    if stride == 1:
        return weight
    from scipy.ndimage import maximum_filter

    return np.asarray(maximum_filter(weight, size=2 * (stride // 2) + 1))[::stride, ::stride]


def places_of(field: Traversability, nodes: Array | NDArray[np.int64]) -> Array:
    """East and north [m] of columns and rows, shape [n, 2]."""
    return np.asarray(np.asarray(field.origin) + field.spacing * nodes)


def nodes_of(field: Traversability, points: Array) -> Array:
    """Columns and rows of east and north [m], shape [n, 2]."""
    nodes: Array = (points - np.asarray(field.origin)) / field.spacing
    return nodes


def _curve(
    line: Array, fixed: NDArray[np.bool_], obstacles: Obstacles, rover: Rover, key: Key
) -> tuple[Curve, str]:
    """The smooth curve along a line, through its fixed points, and the obstacle that it touches.

    Through as few of the line's points as it takes to touch none.
    """
    if len(line) == 2:
        line = np.stack([line[0], line.mean(axis=0), line[1]])
        fixed = np.array([False, False, True])
    stays = np.append(0, np.flatnonzero(fixed))
    for every in KNOTS:
        # Every so manieth point, those that stay, and none close to these.
        chosen = np.arange(len(line)) % every == 0
        for n in stays.tolist():
            chosen[max(n - every // 2, 0) : n + every // 2 + 1] = False
        chosen[stays] = True
        curve = trace_spline(line[chosen], closed=False, key=key)
        touched = obstacles.first_touched(curve.position, curve.heading, rover)
        if not touched:
            break
    return curve, touched
