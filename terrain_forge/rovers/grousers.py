"""Bars across the treads of a rover's wheels."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Interval

from terrain_forge.base import Positive, RecipeError, Spec
from terrain_forge.model import Grousers, Rover, Shape, Wheel


@dataclass(frozen=True, kw_only=True)
class GrouserSpec(Spec):
    """Bars across a wheel's tread."""

    count: Annotated[int, Interval(ge=3, le=200)] = 24
    """How many, evenly around the wheel."""
    height_m: Positive = 0.01
    """Above the tread [m]; the wheel's radius reaches to their tops."""
    thickness_m: Positive = 0.004
    """Along the tread [m]."""
    collides: bool = False
    """Whether physics sees the bars. By default it rolls on a smooth cylinder of the wheel's
    radius: bars on hard ground jolt as they would on rock."""


def add_grousers(rover: Rover, spec: GrouserSpec) -> Rover:
    """The rover with bars on its wheels, which weigh what they did.

    A wheel's cylinder is seen as the drum between the bars; it collides as that too, or as before.

    Raises:
        RecipeError: if they are too high for the wheels.
    """
    if spec.height_m >= 0.5 * min(wheel.radius for wheel in rover.wheels):
        raise RecipeError(
            f"{spec.height_m:g} m, must be less than half the wheel's radius",
            key=("rover", "grousers", "height_m"),
        )
    bars = Grousers(count=spec.count, height=spec.height_m, thickness=spec.thickness_m)
    wheels = {wheel.link: wheel.replace(grousers=bars) for wheel in rover.wheels}
    links = [
        link.replace(shapes=_shapes(link.shapes, wheels[link.name], spec.collides))
        if link.name in wheels
        else link
        for link in rover.links
    ]
    return rover.replace(links=tuple(links), wheels=tuple(wheels.values()))


def _shapes(shapes: tuple[Shape, ...], wheel: Wheel, collides: bool) -> tuple[Shape, ...]:
    made: list[Shape] = []
    for shape in shapes:
        if shape.kind != "cylinder" or shape.size[0] < wheel.radius:
            made.append(shape)
            continue
        assert wheel.grousers
        drum = shape.replace(size=(shape.size[0] - wheel.grousers.height, *shape.size[1:]))
        if shape.collides and not collides:
            made.append(shape.replace(visible=False))
            drum = drum.replace(collides=False)
        if drum.visible or drum.collides:
            made += [drum, *_bars(shape, wheel, collides)]
    return tuple(made)


def _bars(rim: Shape, wheel: Wheel, collides: bool) -> list[Shape]:
    assert wheel.grousers
    bars = wheel.grousers
    # Their outer edges, not the middles of their tops, reach the wheel's radius.
    top, tread = math.sqrt(wheel.radius**2 - bars.thickness**2 / 4), wheel.radius - bars.height
    size, made = (bars.thickness, wheel.width, top - tread), []
    for angle in (2 * math.pi * n / bars.count for n in range(bars.count)):
        place = (top + tread) / 2 * np.array([math.sin(angle), 0.0, math.cos(angle)])
        made.append(
            Shape(
                kind="box", size=size, position=rim.position + place,
                rpy=np.array([0.0, angle, 0.0]), collides=collides, rgb=rim.rgb,
            )
        )  # fmt: skip
    return made
