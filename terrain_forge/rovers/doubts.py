"""What of a rover that was read can hardly be meant: other units, wheels in the air, no rest."""

from __future__ import annotations

from collections import defaultdict
from itertools import combinations

import numpy as np

from terrain_forge.base import Array
from terrain_forge.model import Rover

_LARGEST_RADIUS = 3.0
"""Radius from which a wheel is one of another unit [m]; the largest tyres of lorries have 2 m."""
_HANGING = 0.2
"""Height over a wheel's radius from which it hangs in the air; a wheel sinks in, and a frame
gives, by less."""
_MOST_WHEELS = 40
"""Wheels that nothing moves against each other, up to which they are looked at."""
_TURN = 1e-3
"""Angle that is none [rad]."""
_ROUNDING = 1e-9
"""Height that is none [m], and the area of a triangle that has none [m²]."""


def doubts_of(rover: Rover) -> tuple[str, ...]:
    """What of a rover can hardly be meant, a sentence each."""
    found = doubt_unit(rover), doubt_stance(rover), doubt_rest(rover), doubt_gears(rover)
    return tuple(filter(None, found))


def doubt_unit(rover: Rover) -> str:
    """A question where lengths are those of another unit; empty where they are not."""
    if max(rover.wheel_radii, default=0.0) <= _LARGEST_RADIUS:
        return ""
    return (
        f"wheels of {told_radii(rover)} m: are the lengths of the rover's file in another unit "
        "than metres?"
    )


def told_radii(rover: Rover) -> str:
    """The radii of the wheels [m], or the least and the largest."""
    low, high = (f"{value:.2f}" for value in (min(rover.wheel_radii), max(rover.wheel_radii)))
    return low if low == high else f"{low} to {high}"


def doubt_stance(rover: Rover) -> str:
    """A sentence where not all wheels touch level ground, however the rover settles; else empty.

    It is about four wheels or more that nothing moves against each other. They can stand on three
    of them that have the others at or above their plane.
    """
    parent = {link.name: link.parent for link in rover.links}
    groups = defaultdict[str, list[int]](list)
    for number, wheel in enumerate(rover.wheels):
        groups[parent[wheel.link]].append(number)
    found = list[str]()
    for group in groups.values():
        low = rover.wheel_centres[group] - rover.wheel_radii[group, None] * (0.0, 0.0, 1.0)
        heights = _least_heights(low)
        found += [
            f"{rover.wheels[number].link} hangs {height:.2g} m"
            for number, height in zip(group, heights.tolist(), strict=True)
            if height > _HANGING * rover.wheels[number].radius
        ]
    if not found:
        return ""
    return (
        f"not all driven wheels touch level ground, and nothing moves them against each other: "
        f"where the rover stands on others, {', '.join(found)} above it"
    )


def doubt_rest(rover: Rover) -> str:
    """A sentence where joints cannot have the angle 0, at which the rover is put down; else empty.

    Limits leave it out, or a gear asks for another: simulations begin with a jump.
    """
    found = [
        f"{link.name} turns from {link.limits[0]:.3g} to {link.limits[1]:.3g} rad"
        for link in rover.links
        if link.joint == "passive" and link.limits
        if not link.limits[0] - _TURN <= 0.0 <= link.limits[1] + _TURN
    ]
    found += [
        f"{gear.link} is {gear.offset:.3g} rad ahead of {gear.leader} by its gear"
        for gear in rover.couplings
        if abs(gear.offset) > _TURN
    ]
    if not found:
        return ""
    return (
        f"the rover is put down with all joints at 0, where some cannot be: {', '.join(found)}; it "
        "will jump and stand otherwise than its paths say"
    )


def doubt_gears(rover: Rover) -> str:
    """A sentence where gears lead back to a joint by another ratio, which locks it; else empty."""
    turns: dict[str, tuple[str, float]] = {}  # a joint's angle, as a factor on another's

    def first(name: str) -> tuple[str, float]:
        factor = 1.0
        while name in turns:
            name, ratio = turns[name]
            factor *= ratio
        return name, factor

    locked = set()
    for gear in rover.couplings:
        (one, own), (other, its) = first(gear.link), first(gear.leader)
        if one != other and own:
            turns[one] = other, gear.ratio * its / own
        elif one == other and abs(own - gear.ratio * its) > _TURN * abs(own):
            locked |= {gear.link, gear.leader}
    if not locked:
        return ""
    return f"gears that contradict each other lock the joints of {', '.join(sorted(locked))}"


def _least_heights(low: Array) -> Array:
    """Heights of points above the plane of three that is below all and nearest to them [m]."""
    if not 4 <= len(low) <= _MOST_WHEELS:
        return np.zeros(len(low))
    a, b, c = np.moveaxis(low[list(combinations(range(len(low)), 3))], 1, 0)
    normal = np.cross(b - a, c - a)
    wide = np.abs(normal[:, 2]) > _ROUNDING
    a, normal = a[wide], normal[wide]
    heights = ((low - a[:, None]) * normal[:, None]).sum(axis=-1) / normal[:, None, 2]
    heights = heights[heights.min(axis=1) > -_ROUNDING]
    if not len(heights):
        return np.zeros(len(low))
    return np.asarray(heights[np.argmin(heights.max(axis=1))])
