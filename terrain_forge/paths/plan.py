"""Routes from the recipe, before there is any ground."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrain_forge.errors import RecipeError
from terrain_forge.paths.route import Route
from terrain_forge.paths.spec import Corridor, PathSpec, Spline
from terrain_forge.rovers.description import Rover

Array = NDArray[np.float64]

STEP = 0.02
"""Distance of a route's points [m]."""
SHARPEST = 0.5
"""Turn between two of its points [rad], beyond which a route is no smooth curve."""
CORRIDOR_MARGIN = 0.4
"""What a default corridor is wider than the rover [m]."""


def plan_route(
    spec: PathSpec, *, rover: Rover, driven: bool, key: tuple[str | int, ...] = ("paths",)
) -> Route:
    """The route of a path, its corridor resolved.

    Args:
        spec: the path as the recipe has it.
        rover: who drives.
        driven: whether the validation drives it, so that a corridor is the default.
        key: where the path stands in the recipe.

    Raises:
        RecipeError: if two neighbouring points are the same, or if the curve turns back on itself.
    """
    position, heading, distance = _trace(spec.route, (*key, "route", "points_m"))
    corridor = spec.corridor or (Corridor() if driven else Corridor(width_m=0.0))
    width = corridor.width_m
    return Route(
        name=spec.name,
        position=position,
        heading=heading,
        distance=distance,
        closed=spec.route.closed,
        speed=spec.speed_m_s,
        corridor_width=rover.width + CORRIDOR_MARGIN if width is None else width,
        corridor_clearance=corridor.clearance_m,
    )


def require_inside(
    route: Route,
    *,
    size: tuple[float, float],
    rover: Rover,
    key: tuple[str | int, ...] = ("paths",),
) -> None:
    """Refuse a route on which a corner of the rover would leave the terrain.

    Raises:
        RecipeError: with the farthest point.
    """
    east, north = 0.5 * size[0], 0.5 * size[1]
    excess, (x, y) = overhang(route, bounds=(-east, -north, east, north), rover=rover)
    if excess > 0.0:
        raise RecipeError(
            f"path {route.name!r} leaves the terrain: at ({x:.1f}, {y:.1f}) m the rover stands out "
            f"by {excess:.2f} m; the site reaches {east:g} m east and {north:g} m north",
            key=(*key, "route", "points_m"),
        )


def overhang(
    route: Route, *, bounds: tuple[float, float, float, float], rover: Rover
) -> tuple[float, tuple[float, float]]:
    """How far a corner of the rover gets beyond bounds [m] (negative: stays within), and where.

    Args:
        route: where it drives.
        bounds: west, south, east, north [m].
        rover: who drives.
    """
    forward = np.stack([np.cos(route.heading), np.sin(route.heading)], -1)
    left = np.stack([-forward[:, 1], forward[:, 0]], -1)
    corners = [
        route.position + 0.5 * (along * rover.length * forward + across * rover.width * left)
        for along in (-1, 1)
        for across in (-1, 1)
    ]
    low, high = np.array(bounds[:2]), np.array(bounds[2:])
    excess = np.max([np.maximum(low - corner, corner - high).max(axis=1) for corner in corners], 0)
    worst = int(np.argmax(excess))
    return float(excess[worst]), (float(route.position[worst, 0]), float(route.position[worst, 1]))


def _trace(spline: Spline, key: tuple[str | int, ...]) -> tuple[Array, Array, Array]:
    """Points every few centimetres of the C² curve, headings, and distances along it."""
    from scipy.interpolate import CubicSpline

    points = np.asarray(spline.points_m, np.float64)
    if spline.closed:
        points = np.vstack([points, points[:1]])
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if chords.min() < 1e-6:
        at = int(np.argmin(chords))
        raise RecipeError(
            f"points {at} and {(at + 1) % len(spline.points_m)} of the spline are the same",
            key=key,
        )
    # Centripetal parameters keep the curve from looping at sharp corners (Lee 1989,
    # doi:10.1016/0010-4485(89)90003-1).
    knots = np.concatenate([[0.0], np.cumsum(np.sqrt(chords))])
    curve = CubicSpline(knots, points, bc_type="periodic" if spline.closed else "natural")
    fine = np.linspace(0.0, knots[-1], 64 * len(points) + 1)
    rough = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve(fine), axis=0), axis=1))])
    count = max(int(np.ceil(rough[-1] / STEP)), 2)
    parameter = np.interp(np.linspace(0.0, rough[-1], count + 1), rough, fine)
    position, tangent = curve(parameter), curve(parameter, 1)
    steps = np.linalg.norm(np.diff(position, axis=0), axis=1)
    heading = np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0]))
    turns = np.abs(np.diff(heading))
    if turns.max() > SHARPEST:
        x, y = position[int(np.argmax(turns))]
        raise RecipeError(f"the route turns back on itself at ({x:.2f}, {y:.2f}) m", key=key)
    return position, heading, np.concatenate([[0.0], np.cumsum(steps)])
