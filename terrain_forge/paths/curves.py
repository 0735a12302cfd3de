"""Curves in the plane as dense points: splines, polylines with arcs or spot turns at corners."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from terrain_forge.base import Array, Key, RecipeError, portable
from terrain_forge.paths.cubic import cubic_spline

STEP = 0.02
"""Distance of a curve's points [m]."""
LONGEST = 100_000.0
"""Length of a route [m]."""
MAX_KNOTS = 100_000
"""Points that a route is given by."""
SHARPEST = 0.5
"""Turn between two of its points [rad], beyond which a curve is not smooth."""
SPOT_STEP = 0.05
"""Turn between two points of a spot turn [rad]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Curve:
    """A curve as dense points; a turn on the spot is a run of points at one place."""

    position: Array
    """Points, east and north [m], shape [points, 2]."""
    heading: Array
    """Direction of travel, counter-clockwise from east [rad], continuous, shape [points]."""
    turns: tuple[tuple[int, int], ...] = ()
    """First and last point of each turn on the spot."""
    attitude: Array | None = None
    """Recorded height [m], roll and pitch [rad] at each point, shape [points, 3]; None where the
    ground tells them."""

    @property
    def distance(self) -> Array:
        """Length along the curve [m], from 0, shape [points]."""
        steps = np.linalg.norm(np.diff(self.position, axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(steps)])


def trace_spline(points: Array, *, closed: bool, key: Key) -> Curve:
    """The C² curve through points.

    Args:
        points: East and north [m], shape [points, 2].
        closed: Whether it returns to the first point.
        key: Where the points stand in the recipe.

    Raises:
        RecipeError: if neighbouring points are the same, or if the curve turns back on itself.
    """
    points = np.vstack([points, points[:1]]) if closed else points
    chords = _legs(points, closed, key)
    # Centripetal parameters keep the curve from looping at sharp corners (Lee 1989,
    # doi:10.1016/0010-4485(89)90003-1).
    knots = np.concatenate([[0.0], np.cumsum(np.sqrt(chords))])
    curve = cubic_spline(knots, points, closed=closed)
    traced = trace(curve, curve.derivative(), (0.0, knots[-1]), samples=64 * len(points))
    turns = np.abs(np.diff(traced.heading))
    if turns.max() > SHARPEST:
        x, y = traced.position[int(np.argmax(turns))]
        raise RecipeError(f"the route turns back on itself at ({x:.2f}, {y:.2f}) m", key=key)
    return traced


def trace(
    curve: Callable[[Array], Array],
    tangent: Callable[[Array], Array],
    ends: tuple[float, float],
    *,
    samples: int,
) -> Curve:
    """A parametric curve and its derivative as dense points, between the parameter's two ends.

    Its length is first measured from so many samples.
    """
    fine = np.linspace(*ends, samples + 1)
    rough = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve(fine), axis=0), axis=1))])
    require_length(float(rough[-1]))
    count = max(int(np.ceil(rough[-1] / STEP)), 2)
    parameter = np.interp(np.linspace(0.0, rough[-1], count + 1), rough, fine)
    along = tangent(parameter)
    heading = np.unwrap(portable.arctan2(along[:, 1], along[:, 0]))
    return Curve(position=curve(parameter), heading=heading)


def require_length(length: float, *, key: Key = ()) -> None:
    """Refuse a route that is too long to be traced.

    Raises:
        RecipeError: with its length.
    """
    if not length <= LONGEST:
        raise RecipeError(f"a route of {length:.3g} m, at most {LONGEST:,.0f} m", key=key)


def trace_polyline(points: Array, *, closed: bool, radius: float, key: Key) -> Curve:
    """Straight legs with an arc around each corner, or with spot turns.

    Args:
        points: Corners, east and north [m], shape [points, 2].
        closed: Whether a last leg returns to the first point; the curve then ends in the direction
            in which it began.
        radius: Radius of the arcs [m]; 0 for turns on the spot.
        key: Where the points stand in the recipe.

    Raises:
        RecipeError: if neighbouring points are the same, or an arc does not fit onto its legs.
    """
    corners = np.vstack([points, points[:1]]) if closed else points
    lengths = _legs(corners, closed, key)
    require_length(float(lengths.sum()), key=key)
    along = np.diff(corners, axis=0) / lengths[:, None]
    heading = portable.arctan2(along[:, 1], along[:, 0])
    following = np.roll(heading, -1) if closed else heading[1:]
    change = following - heading[: len(following)]
    turn = np.pi - (np.pi - change) % (2.0 * np.pi)
    if radius > 0.0:
        _require_arcs(corners, lengths, turn, radius, closed, (*key[:-1], "corner_radius_m"))
    cut = radius * portable.tan(0.5 * np.abs(turn)) if radius > 0.0 else np.zeros(len(turn))
    before = np.concatenate([[cut[-1] if closed else 0.0], cut])[: len(lengths)]
    after = np.concatenate([cut, np.zeros(len(lengths) - len(cut))])
    ahead, turns = float(heading[0]), list[tuple[int, int]]()
    parts: list[tuple[Array, Array]] = []  # each begins at the last point of the one before
    for leg, direction in enumerate(along):
        begin = corners[leg] + before[leg] * direction
        straight = _straight(begin, corners[leg + 1] - after[leg] * direction)
        parts.append((straight, np.full(len(straight), ahead)))
        if leg == len(turn) or abs(turn[leg]) < 1e-9:
            continue
        first = sum(len(part) - 1 for part, _ in parts)
        parts.append(_turn(straight[-1], ahead, float(turn[leg]), radius))
        ahead += float(turn[leg])
        if radius == 0.0:
            turns.append((first, first + len(parts[-1][0]) - 1))
    position, headings = (
        np.concatenate([parts[0][n][:1], *(part[n][1:] for part in parts)]) for n in range(2)
    )
    return Curve(position=position, heading=headings, turns=tuple(turns))


def _straight(begin: Array, end: Array) -> Array:
    """The points of a straight line [m], shape [points, 2]."""
    count = max(int(np.ceil(portable.norm(end - begin) / STEP)), 1)
    share = np.linspace(0.0, 1.0, count + 1)[:, None]
    return np.asarray((1.0 - share) * begin + share * end)


def _turn(begin: Array, heading: float, angle: float, radius: float) -> tuple[Array, Array]:
    """Points and headings of a turn to the left on an arc, or on the spot for radius 0."""
    step = STEP / radius if radius else SPOT_STEP
    headings = heading + angle * np.linspace(0.0, 1.0, max(int(abs(angle) / step), 1) + 1)
    if radius == 0.0:
        return np.repeat(begin[None], len(headings), axis=0), headings
    side = np.copysign(radius, angle)
    centre = begin + side * np.array([-np.sin(heading), np.cos(heading)])
    return centre + side * np.stack([np.sin(headings), -np.cos(headings)], -1), headings


def _legs(points: Array, closed: bool, key: Key) -> Array:
    """Lengths between neighbouring points [m]; of a closed curve the last is the first again."""
    if len(points) > MAX_KNOTS:
        raise RecipeError(f"{len(points):,} points, at most {MAX_KNOTS:,}", key=key)
    lengths: Array = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if lengths.min() < 1e-6:
        at = int(np.argmin(lengths))
        following = (at + 1) % (len(points) - int(closed))
        raise RecipeError(f"points {at} and {following} of the route are the same", key=key)
    return lengths


def _require_arcs(
    corners: Array, lengths: Array, turn: Array, radius: float, closed: bool, key: Key
) -> None:
    """Refuse arcs that need more of a leg than there is."""
    tangent = portable.tan(0.5 * np.minimum(np.abs(turn), np.pi - 1e-9))
    ends = np.concatenate([[tangent[-1] if closed else 0.0], tangent])
    ends = np.concatenate([ends, np.zeros(len(lengths) + 1 - len(ends))])
    fitting = lengths / np.maximum(ends[:-1] + ends[1:], 1e-12)
    if fitting.min() < radius * (1.0 - 1e-9):
        leg = int(np.argmin(fitting))
        (x, y), (east, north) = corners[leg], corners[leg + 1]
        raise RecipeError(
            f"{radius:g} m do not fit onto the leg from ({x:g}, {y:g}) to ({east:g}, {north:g}) m, "
            f"at most {fitting[leg]:.3g} m do; at 0 the rover turns on the spot",
            key=key,
        )
