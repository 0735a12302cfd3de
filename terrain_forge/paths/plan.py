"""Routes from the recipe, before there is any ground."""

from __future__ import annotations

import numpy as np

from terrain_forge.base import Array, DataError, Key, RecipeError, TerrainForgeError
from terrain_forge.model import Route, Rover
from terrain_forge.paths.curves import Curve, trace_polyline, trace_spline
from terrain_forge.paths.named_shape import NamedShape
from terrain_forge.paths.obstacles import highest_step
from terrain_forge.paths.recorded import RecordedPoses, follow
from terrain_forge.paths.spec import Corridor, PathSpec, Planned, Polyline, Recorded, RouteSpec

CORRIDOR_MARGIN = 0.4
"""What a default corridor is wider than the rover [m]."""
CORRIDOR_CLEARANCE = 0.15
"""Height of rocks that a default corridor keeps for rovers that go over them [m]."""

ACCELERATION = 0.2
"""Gain and loss of speed at stops where the recipe names none [m/s²]."""


def plan_route(
    spec: PathSpec,
    *,
    rover: Rover,
    driven: bool,
    recorded: RecordedPoses | None = None,
    key: Key = ("paths",),
) -> Route:
    """The route of a path that is known before the ground, its corridor resolved.

    A corridor is the default where the validation drives it. A path from a file comes with the
    poses of that; the key is where the path stands in the recipe.

    Raises:
        RecipeError: if two neighbouring points are the same, if the curve turns back on itself, or
            if a shape or an arc has no space.
        DataError: if a recorded path cannot be followed.
    """
    try:
        curve, time = _trace(spec.route, recorded, (*key, "route"))
    except RecipeError as error:
        raise RecipeError(str(error), key=error.key or (*key, "route")) from None
    corridor = spec.corridor or (Corridor() if driven else Corridor(width_m=0.0))
    width = rover.width + CORRIDOR_MARGIN if corridor.width_m is None else corridor.width_m
    clearance = corridor.clearance_m
    if clearance is None:
        clearance = min(CORRIDOR_CLEARANCE, highest_step(rover))
    return as_route(curve, spec=spec, time=time, corridor=(width, clearance), key=(*key, "route"))


def as_route(
    curve: Curve,
    *,
    spec: PathSpec,
    time: Array | None = None,
    corridor: tuple[float, float] = (0.0, 0.0),
    key: Key = ("paths",),
) -> Route:
    """A curve as the route of a path, with the recorded times of its points [s], if there are any.

    The corridor is the width [m], 0 for none, and the clearance [m] of its strip without rocks.

    Raises:
        DataError: if a recorded path does not move at all.
    """
    distance = curve.distance
    if distance[-1] <= 0.0:
        raise DataError("the path does not move", key=key)
    return Route(
        name=spec.name,
        position=curve.position,
        heading=curve.heading,
        distance=distance,
        closed=time is None and not isinstance(spec.route, Planned) and spec.route.closed,
        speed=spec.speed_m_s if time is None else float(distance[-1] / time[-1]),
        corridor_width=corridor[0],
        corridor_clearance=corridor[1],
        turns=np.array(curve.turns, np.int64).reshape(-1, 2),
        acceleration=spec.acceleration_m_s2 or (ACCELERATION if curve.turns else 0.0),
        turn_rate=float(np.radians(spec.turn_rate_deg_s)),
        time=time,
        attitude=curve.attitude,
    )


def _trace(
    route: RouteSpec, recorded: RecordedPoses | None, key: Key
) -> tuple[Curve, Array | None]:
    """The curve of a route, and its times where they are recorded."""
    if isinstance(route, Recorded):
        assert recorded is not None, "a route from a file comes with what was read from it"
        return follow(route, recorded, key=(*key, "file"))
    if isinstance(route, NamedShape):
        return route.curve(key), None
    assert not isinstance(route, Planned), "it is found once there are ground and rocks"
    points, key = np.asarray(route.points_m, np.float64), (*key, "points_m")
    if isinstance(route, Polyline):
        radius = route.corner_radius_m
        return trace_polyline(points, closed=route.closed, radius=radius, key=key), None
    return trace_spline(points, closed=route.closed, key=key), None


def sketch_route(route: RouteSpec) -> Array | None:
    """Points of a route for a sketch of it, shape [points, 2] [m].

    Of one that is found later they are its stops. None for one from a file, or that cannot be.
    """
    if isinstance(route, Planned):
        return np.array([place for _, place in route.stops])
    if isinstance(route, Recorded):
        return None
    try:
        return _trace(route, None, ())[0].position
    except TerrainForgeError:
        return None


def require_inside(
    route: Route,
    *,
    size: tuple[float, float],
    rover: Rover,
    key: Key = ("paths",),
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
            key=(*key, "route"),
        )


def overhang(
    route: Route, *, bounds: tuple[float, float, float, float], rover: Rover
) -> tuple[float, tuple[float, float]]:
    """How far a corner of the rover gets beyond bounds [m] (negative: stays within), and where.

    The bounds are the west, south, east and north [m].
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
