"""The curves of named shapes."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from terrain_forge.base import Array, Key, RecipeError
from terrain_forge.paths.curves import Curve, trace, trace_polyline
from terrain_forge.paths.shape_spec import (
    FigureEight,
    Lawnmower,
    Loop,
    NamedShape,
    Spiral,
    Triangle,
)

Planar = Callable[[Array], Array]

_SAMPLES = 20_000
"""Parameters from which a smooth shape's length is measured: within 1e-7."""


def trace_shape(spec: NamedShape, key: Key) -> Curve:
    """The curve of a named shape, its length that of the recipe within 0.1 %.

    Raises:
        RecipeError: if neither or both of length and size are given, or if they are too short for
            the shape's corners or rows.
    """
    if (spec.length_m is None) == (spec.size_m is None):
        found = "neither" if spec.length_m is None else "both"
        raise RecipeError(f"one of length_m and size_m is needed, found {found}", key=key)
    if isinstance(spec, Triangle | Lawnmower):
        curve = _trace_corners(spec, key)
    else:
        curve = _trace_smooth(spec)
    angle = math.radians(spec.orientation_deg)
    cos, sin = math.cos(angle), math.sin(angle)
    turned = curve.position @ np.array([[cos, sin], [-sin, cos]])
    return Curve(
        position=turned + np.asarray(spec.centre_m),
        heading=curve.heading + angle,
        turns=curve.turns,
    )


def is_closed(spec: NamedShape) -> bool:
    """Whether a shape ends where it begins."""
    return not isinstance(spec, Lawnmower | Spiral)


def _trace_smooth(spec: NamedShape) -> Curve:
    curve, tangent, ends = _smooth(spec)
    points = curve(np.linspace(*ends, _SAMPLES + 1))
    unit = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    scale = spec.length_m / unit if spec.length_m else (spec.size_m or 0.0) / np.ptp(points[:, 0])
    return trace(lambda t: scale * curve(t), tangent, ends, samples=_SAMPLES)


def _smooth(spec: NamedShape) -> tuple[Planar, Planar, tuple[float, float]]:
    """A shape of unit size, its derivative, and the ends of its parameter."""
    full = (0.0, 2.0 * np.pi)
    if isinstance(spec, Loop):
        b = spec.aspect
        return (
            _pair(np.cos, lambda t: b * np.sin(t)),
            _pair(lambda t: -np.sin(t), lambda t: b * np.cos(t)),
            full,
        )
    if isinstance(spec, FigureEight):
        return (
            _pair(np.sin, lambda t: 0.5 * np.sin(2.0 * t)),
            _pair(np.cos, lambda t: np.cos(2.0 * t)),
            full,
        )
    assert isinstance(spec, Spiral)
    return (
        _pair(lambda t: t * np.cos(t), lambda t: t * np.sin(t)),
        _pair(lambda t: np.cos(t) - t * np.sin(t), lambda t: np.sin(t) + t * np.cos(t)),
        (np.pi, np.pi + 2.0 * np.pi * spec.turns),
    )


def _pair(x: Planar, y: Planar) -> Planar:
    return lambda t: np.stack([x(t), y(t)], -1)


def _trace_corners(spec: Triangle | Lawnmower, key: Key) -> Curve:
    if isinstance(spec, Triangle):
        radius = spec.corner_radius_m
        lost = 3.0 * _shortening(radius, 2.0 * np.pi / 3.0)
        side = spec.size_m or ((spec.length_m or 0.0) + lost) / 3.0
        _check_capacity(spec, side, 2.0 * math.sqrt(3.0) * radius, 3.0 * side - lost, key)
        low, high = -side / math.sqrt(12.0), side / math.sqrt(3.0)
        points = np.array([(-0.5 * side, low), (0.5 * side, low), (0.0, high)])
        return trace_polyline(points, closed=True, radius=radius, key=(*key, "corner_radius_m"))
    across = spec.row_spacing_m
    radius = 0.5 * across if spec.corner_radius_m is None else spec.corner_radius_m
    if radius > 0.5 * across:
        raise RecipeError(
            f"{radius:g} m, at most half of row_spacing_m, {0.5 * across:g} m",
            key=(*key, "corner_radius_m"),
        )
    gaps = spec.rows - 1
    extra = gaps * (across - 2.0 * _shortening(radius, 0.5 * np.pi))
    row = spec.size_m or ((spec.length_m or 0.0) - extra) / spec.rows
    _check_capacity(spec, row, 2.0 * radius, spec.rows * row + extra, key)
    key = (*key, "corner_radius_m")
    return trace_polyline(_rows(spec, row), closed=False, radius=radius, key=key)


def _rows(spec: Lawnmower, length: float) -> Array:
    """Ends of the rows, in the order of the drive."""
    north = (np.arange(spec.rows) - 0.5 * (spec.rows - 1)) * spec.row_spacing_m
    east = 0.5 * length * np.where(np.arange(spec.rows) % 2, 1.0, -1.0)
    return np.stack([np.stack([east, -east], -1).ravel(), np.repeat(north, 2)], -1)


def _shortening(radius: float, turn: float) -> float:
    """By how much an arc around a corner is shorter than the corner [m]."""
    return radius * (2.0 * math.tan(0.5 * turn) - turn)


def _check_capacity(
    spec: Triangle | Lawnmower, side: float, least: float, length: float, key: Key
) -> None:
    if side <= 0.0 or side < least * (1.0 - 1e-9):
        pieces = 3 if isinstance(spec, Triangle) else spec.rows
        shortest = length + pieces * (least - side)
        given = "size_m" if spec.size_m else "length_m"
        found, needed = (side, least) if spec.size_m else (length, shortest)
        raise RecipeError(
            f"{found:g} m leave no room for the shape's corners, more than {needed:.4g} m do",
            key=(*key, given),
        )
