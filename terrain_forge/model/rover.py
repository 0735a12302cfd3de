"""What a rover is: links, joints, wheels; simulator formats are written from this."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from terrain_forge.base import (
    Array,
    Record,
    matrix_from_quaternion,
    portable,
    quaternion_from_rpy,
    shaped,
)
from terrain_forge.model.mesh import Mesh
from terrain_forge.model.sensor import Sensor

RESTING = 0.05
"""What of a rover is no higher at rest stands on the ground, as a part of its smallest wheel's
radius."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Shape(Record):
    """A solid on a link. Axis of a cylinder: the shape's z."""

    kind: str
    """`box`, `cylinder`, `sphere` or `mesh`."""
    size: tuple[float, ...]
    """Box, and box around a mesh: full lengths x, y, z; cylinder: radius, length; sphere: radius
    [m]."""
    position: Array = field(metadata=shaped(3))
    """Centre in the link's frame [m], shape [3]."""
    rpy: Array = field(metadata=shaped(3))
    """Roll, pitch, yaw in the link's frame [rad], shape [3]."""
    collides: bool
    """Whether physics sees it."""
    rgb: tuple[float, float, float]
    """sRGB colour, 0 to 1."""
    visible: bool = True
    """Whether people and cameras see it."""
    mesh: Mesh | None = None
    """Triangles of a mesh, its box's centre as origin; a convex one where it collides. None for the
    other kinds."""

    @property
    def half_extents(self) -> Array:
        """Half the lengths of a box around it along the link's axes [m], shape [3]."""
        turn = matrix_from_quaternion(quaternion_from_rpy(self.rpy))
        if self.kind == "sphere":
            return np.full(3, self.size[0])
        if self.kind == "cylinder":
            along = np.abs(turn[:, 2])
            aside = np.sqrt(np.maximum(1.0 - along**2, 0.0))
            return np.asarray(self.size[0] * aside + 0.5 * self.size[1] * along)
        return np.asarray(portable.product(np.abs(turn), 0.5 * np.array(self.size)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Link(Record):
    """A rigid body and the joint that holds it to its parent. Link frames are parallel at rest.

    A joint has the name of its link.
    """

    name: str
    """Unique name."""
    parent: str
    """Name of the parent link; empty for the root, `base_link`."""
    joint: str
    """`free` (root), `fixed`, `passive` or `motor` (both revolute)."""
    origin: Array = field(metadata=shaped(3))
    """The joint in the parent's frame, and origin of this link's frame [m], shape [3]."""
    axis: Array = field(metadata=shaped(3))
    """Axis of a revolute joint, unit vector, shape [3]."""
    limits: tuple[float, float] | None = None
    """A revolute joint turns between these angles [rad]; None: without end."""
    damping: float = 0.0
    """Viscous damping of the joint [N m s/rad]."""
    friction: float = 0.0
    """Dry friction of the joint [N m]."""
    rate_limit: float | None = None
    """Largest rate of a passive joint [rad/s]; None where nobody tells one."""
    mass: float
    """Mass [kg]."""
    centre_of_mass: Array = field(metadata=shaped(3))
    """In the link's frame [m], shape [3]."""
    inertia: Array = field(metadata=shaped(3, 3))
    """About the centre of mass [kg m²], shape [3, 3]."""
    shapes: tuple[Shape, ...]
    """Geometry."""


def moments(inertia: Array) -> dict[str, float]:
    """The six moments and products of an inertia [kg m²], by the names of URDF and SDF."""
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertia.tolist()
    return {"ixx": xx, "ixy": xy, "ixz": xz, "iyy": yy, "iyz": yz, "izz": zz}


@dataclass(frozen=True, kw_only=True, eq=False)
class Grousers(Record):
    """Bars across a wheel's tread, evenly around it; the wheel's radius reaches to their tops."""

    count: int
    """How many."""
    height: float
    """Above the tread [m]."""
    thickness: float
    """Along the tread [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Wheel(Record):
    """A driven wheel: a link of the rover that rolls on the ground."""

    link: str
    """Name of its link (whose joint is the motor)."""
    centre: Array = field(metadata=shaped(3))
    """In base_link's frame at rest [m], shape [3]."""
    radius: float
    """Rolling radius [m]."""
    width: float
    """Width [m]."""
    grousers: Grousers | None = None
    """Its grousers; None for a smooth tread."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Coupling(Record):
    """A gear between two passive joints, such as a rocker-bogie's differential."""

    link: str
    """Link whose joint follows: its angle is `ratio` times that of the other, plus `offset`."""
    leader: str
    """Link whose joint is followed."""
    ratio: float
    """Angle per angle; -1 for a differential of two rockers that turn about the same axis."""
    offset: float = 0.0
    """Angle where the leader's is 0 [rad]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Rover(Record):
    """A wheeled rover.

    base_link: x forward, y left, z up, origin on the ground amid the driven wheels.
    """

    name: str
    """Name, as the recipe writes it."""
    links: tuple[Link, ...]
    """Bodies, parents before children; the first is base_link."""
    wheels: tuple[Wheel, ...]
    """Driven wheels."""
    sensors: tuple[Sensor, ...]
    """The sensor rig, each in the frame of a link of these."""
    torque_limit: float
    """Largest torque of a wheel's motor [N m]."""
    speed_limit: float
    """Largest speed over ground [m/s]."""
    tilt_limit: float
    """Largest tilt in which it may be driven [rad]."""
    clearance: float
    """Free height under the body [m]."""
    step_limit: float | None = None
    """Highest step or rock that it goes over [m]; None for what clearance and wheels allow
    (`paths.obstacles.highest_step`)."""
    couplings: tuple[Coupling, ...] = ()
    """Gears between passive joints."""
    held: tuple[str, ...] = ()
    """Joints of the rover's own file that are held at rest."""
    steering: tuple[str, ...] = ()
    """Those of them that steer wheels."""
    notes: tuple[str, ...] = ()
    """What was taken otherwise than the rover's own file says, a sentence each."""
    unread: tuple[str, ...] = ()
    """What of that file changes how the rover moves and is left out, a sentence each."""

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "sensors", tuple(sensor.seated for sensor in self.sensors))

    @property
    def losses(self) -> tuple[str, ...]:
        """What any export differs in from the rover's own file, a sentence each."""
        return (*self.notes, *self.unread)

    @property
    def mass(self) -> float:
        """Mass of the whole rover [kg]."""
        return sum(link.mass for link in self.links)

    @property
    def origins(self) -> dict[str, Array]:
        """Each link's origin in base_link's frame at rest [m]."""
        places: dict[str, Array] = {}
        for link in self.links:
            places[link.name] = places.get(link.parent, np.zeros(3)) + link.origin
        return places

    @cached_property
    def wheel_centres(self) -> Array:
        """Centres of the wheels in base_link's frame at rest [m], shape [wheels, 3]."""
        return np.array([wheel.centre for wheel in self.wheels])

    @cached_property
    def wheel_radii(self) -> Array:
        """Radii of the wheels [m], shape [wheels]."""
        return np.array([wheel.radius for wheel in self.wheels])

    @property
    def length(self) -> float:
        """Along x [m], evenly about base_link: over all wheels and what else is on the ground."""
        span = 2.0 * float(np.abs(self.wheel_centres[:, 0]).max())
        return max(span + 2.0 * float(self.wheel_radii.max()), 2.0 * self._rests[0])

    @property
    def width(self) -> float:
        """The same along y [m]."""
        span = 2.0 * float(np.abs(self.wheel_centres[:, 1]).max())
        return max(span + max(wheel.width for wheel in self.wheels), 2.0 * self._rests[1])

    @cached_property
    def _rests(self) -> tuple[float, float]:
        """How far from base_link what else is on the ground reaches along x and along y [m].

        Wheels that nothing drives, balls and skids.
        """
        places, driven = self.origins, {wheel.link for wheel in self.wheels}
        highest = RESTING * float(self.wheel_radii.min())
        reach = np.zeros(2)
        for link in self.links:
            for shape in link.shapes if link.name not in driven else ():
                centre, half = places[link.name] + shape.position, shape.half_extents
                if shape.collides and centre[2] - half[2] <= highest:
                    reach = np.maximum(reach, np.abs(centre[:2]) + half[:2])
        return float(reach[0]), float(reach[1])
