"""Circles that are kept free of rocks: the recipe's own, and where a rover starts."""

from __future__ import annotations

from math import hypot

from terrain_forge.model import Clearing, Route, Rover
from terrain_forge.rocks.populations import KeepOut


def clearings(
    keep_out: tuple[KeepOut, ...], *, routes: tuple[Route, ...], rover: Rover
) -> tuple[Clearing, ...]:
    """The circles that a recipe keeps free, then the starts of routes that have no corridor.

    A start is cleared of all rocks as far as the rover reaches, whichever way it is turned.

    Args:
        keep_out: the recipe's circles.
        routes: all routes of the site.
        rover: who drives them.
    """
    own = [
        Clearing(centre=circle.centre_m, radius=circle.radius_m, clearance=circle.clearance_m)
        for circle in keep_out
    ]
    starts = [
        Clearing(
            centre=(float(route.position[0, 0]), float(route.position[0, 1])),
            radius=0.5 * hypot(rover.length, rover.width),
            clearance=0.0,
        )
        for route in routes
        if route.corridor_width == 0.0
    ]
    return (*own, *starts)
