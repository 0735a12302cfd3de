"""A machine as its file describes it, before it is known what of it is a wheel."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

import numpy as np

from terrain_forge.base import Array
from terrain_forge.model import Coupling, Shape

TURNING = ("revolute", "continuous")
"""Kinds of joints that turn about an axis."""


_KIND = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,30}")

Solid = tuple[Array, Shape]
"""Placement in a body's frame, shape [4, 4], of a shape whose own position means nothing."""
bare_shape = partial(Shape, position=np.zeros(3), rpy=np.zeros(3))
"""A shape for a solid."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Joint:
    """What holds a body to its parent."""

    name: str = ""
    """Unique name."""
    kind: str = "fixed"
    """`fixed`, `revolute`, `continuous`, or another word for what the rover cannot use."""
    axis: Array = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))
    """In the body's frame, unit vector, shape [3]."""
    limits: tuple[float, float] | None = None
    """Of a revolute joint [rad]."""
    damping: float = 0.0
    """Viscous damping [N m s/rad]."""
    friction: float = 0.0
    """Dry friction [N m]."""
    effort: float | None = None
    """Largest torque of its motor [N m], where the file tells."""
    rate: float | None = None
    """Largest rate [rad/s], where the file tells."""
    driven: bool = False
    """Whether the file names a motor on it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Body:
    """A rigid body. Its joint turns about its frame's origin."""

    name: str
    """Unique name."""
    parent: str
    """Name of its parent; empty for the root."""
    placement: Array
    """In the parent's frame at rest, shape [4, 4]."""
    joint: Joint = field(default_factory=Joint)
    """What holds it to its parent."""
    mass: float = 0.0
    """Mass [kg]."""
    centre_of_mass: Array = field(default_factory=lambda: np.zeros(3))
    """In its frame [m], shape [3]."""
    inertia: Array = field(default_factory=lambda: np.zeros((3, 3)))
    """About the centre of mass, in its axes [kg m²], shape [3, 3]."""
    solids: tuple[Solid, ...] = ()
    """Geometry."""
    told: Array = field(default_factory=lambda: np.eye(4))
    """The frame that the file gives it, in its frame, shape [4, 4]."""


class Unread(NamedTuple):
    """What of a file changes how its machine moves, and is not read."""

    kind: str
    """What it is: `spring`, `tendon`, …"""
    name: str
    """Its name, or what it acts on."""
    joint: str = ""
    """The joint that it acts on, if on one alone: on one that is held it does nothing."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Assembly:
    """Bodies and joints of a file."""

    name: str
    """As the file calls it."""
    bodies: tuple[Body, ...]
    """Parents before children; the first is the root."""
    gears: tuple[Coupling, ...]
    """Joints that follow others; by the names of joints, where a rover's are by those of links."""
    sensors: tuple[str, ...] = ()
    """The kinds of sensors that the file has, which are not read."""
    unread: tuple[Unread, ...] = ()
    """What else is not read and changes the motion."""

    @property
    def notes(self) -> tuple[str, ...]:
        """What of the file is not read, a sentence each."""
        if not self.sensors:
            return ()
        kinds = Counter(kind if _KIND.fullmatch(kind) else "other" for kind in self.sensors)
        told = ", ".join(f"{number} {kind}" for kind, number in sorted(kinds.items()))
        return (f"Sensors of its file are not read, the recipe's `sensors` add some: {told}.",)
