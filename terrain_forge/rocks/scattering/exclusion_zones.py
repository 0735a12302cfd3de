"""Circles that are kept free of rocks: the recipe's own, and where a rover starts."""

from __future__ import annotations

from math import hypot

from terrain_forge.model import ExclusionZone, Route, Rover
from terrain_forge.rocks.populations import ExclusionSpec


def exclusion_zones(
    exclusion_zones: tuple[ExclusionSpec, ...], *, routes: tuple[Route, ...], rover: Rover
) -> tuple[ExclusionZone, ...]:
    """The circles that a recipe keeps free, then the starts of routes that have no corridor.

    A start is cleared of all rocks as far as the rover reaches, whichever way it is turned.

    Args:
        exclusion_zones: the recipe's circles.
        routes: all routes of the site.
        rover: who drives them.
    """
    own = [
        ExclusionZone(centre=circle.centre_m, radius=circle.radius_m, clearance=circle.clearance_m)
        for circle in exclusion_zones
    ]
    starts = [
        ExclusionZone(
            centre=(float(route.position[0, 0]), float(route.position[0, 1])),
            radius=0.5 * hypot(rover.length, rover.width),
            clearance=0.0,
        )
        for route in routes
        if route.corridor_width == 0.0
    ]
    return (*own, *starts)
