"""What our own rovers are built of: links of massive parts, wheels with grousers, a rig."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from annotated_types import Interval
from numpy.typing import ArrayLike

from terrain_forge.base import Positive, Spec
from terrain_forge.model import Grousers, Link, Sensor, Shape, Wheel
from terrain_forge.rovers.inertia import combine

Colour = tuple[float, float, float]

PAINT: Colour = (0.82, 0.82, 0.80)
FRAME: Colour = (0.30, 0.30, 0.32)
TYRE: Colour = (0.16, 0.16, 0.17)
METAL: Colour = (0.62, 0.62, 0.64)
LENS: Colour = (0.08, 0.08, 0.10)
PANEL: Colour = (0.10, 0.14, 0.30)

ALONG_Y = (math.pi / 2, 0.0, 0.0)
"""Roll, pitch, yaw of a cylinder whose axis is y [rad]."""
_WHEEL_DAMPING = 0.1


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

    def record(self) -> Grousers:
        """These bars as the rover's description holds them."""
        return Grousers(count=self.count, height=self.height_m, thickness=self.thickness_m)


@dataclass(frozen=True, kw_only=True)
class RoverSpec(Spec):
    """What a recipe may say about any rover."""

    step_limit_m: Positive | None = None
    """Highest step or rock that it goes over [m], at most its smallest wheel's diameter; by default
    the lower of its clearance and 0.8 of that diameter, an assumption (docs/rovers.md)."""


@dataclass(frozen=True, kw_only=True)
class BuiltRoverSpec(RoverSpec):
    """What a recipe may say about a rover of our own."""

    model: Literal["detailed", "simplified"] = "simplified"
    """How it looks; masses, inertias and what physics touches are the same."""
    grousers: GrouserSpec | None = None
    """Bars across the wheels' treads; without it they are smooth."""


def make_shape(
    kind: str,
    size: tuple[float, ...],
    position: ArrayLike,
    rgb: Colour,
    *,
    rpy: ArrayLike = (0.0, 0.0, 0.0),
    collides: bool = True,
    visible: bool = True,
) -> Shape:
    """A shape; see `Shape` for what its figures mean."""
    return Shape(
        kind=kind,
        size=size,
        position=np.asarray(position, dtype=np.float64),
        rpy=np.asarray(rpy, dtype=np.float64),
        collides=collides,
        rgb=rgb,
        visible=visible,
    )


def look(
    kind: str,
    size: tuple[float, ...],
    position: ArrayLike,
    rgb: Colour,
    *,
    rpy: ArrayLike = (0.0, 0.0, 0.0),
) -> Shape:
    """A shape visual only: it neither weighs nor collides."""
    return make_shape(kind, size, position, rgb, rpy=rpy, collides=False)


def make_link(
    name: str,
    parent: str,
    joint: str,
    origin: ArrayLike,
    parts: Sequence[tuple[Shape, float]],
    *,
    looks: Sequence[Shape] = (),
    axis: ArrayLike = (0.0, 1.0, 0.0),
    limits: tuple[float, float] | None = None,
    damping: float = 0.0,
) -> Link:
    """A link that weighs what its parts do.

    Args:
        name: Name of the link and of its joint.
        parent: Name of the parent; empty for the root.
        joint: Kind of joint.
        origin: Of the joint, in the parent's frame [m].
        parts: Shapes and their masses [kg].
        looks: What is seen in place of the parts, where there is any.
        axis: Of the joint.
        limits: Of the joint [rad].
        damping: Of the joint [N m s/rad].
    """
    mass, centre, inertia = combine(parts)
    solids = [shape.replace(visible=not looks) for shape, _ in parts]
    return Link(
        name=name,
        parent=parent,
        joint=joint,
        origin=np.asarray(origin, dtype=np.float64),
        axis=np.asarray(axis, dtype=np.float64),
        limits=limits,
        damping=damping,
        mass=mass,
        centre_of_mass=centre,
        inertia=inertia,
        shapes=(*(s for s in solids if s.visible or s.collides), *looks),
    )


def wheel_link(
    wheel: Wheel,
    parent: str,
    origin: ArrayLike,
    mass: float,
    *,
    grousers: GrouserSpec | None,
    detailed: bool,
) -> Link:
    """The driven link of a wheel, which weighs as a cylinder about y however it looks.

    Args:
        wheel: The wheel.
        parent: Link that carries it.
        origin: Its centre in the parent's frame [m].
        mass: Its mass [kg].
        grousers: Bars across its tread.
        detailed: Whether spokes and a hub show that it turns.
    """
    solid = make_shape(
        "cylinder",
        (wheel.radius, wheel.width),
        (0.0, 0.0, 0.0),
        TYRE,
        rpy=ALONG_Y,
        collides=grousers is None or not grousers.collides,
    )
    return make_link(
        wheel.link,
        parent,
        "motor",
        origin,
        [(solid, mass)],
        looks=_wheel_material(wheel, grousers, detailed=detailed),
        damping=_WHEEL_DAMPING,
    )


def _wheel_material(wheel: Wheel, grousers: GrouserSpec | None, *, detailed: bool) -> list[Shape]:
    if not detailed and grousers is None:
        return []
    touched = grousers is not None and grousers.collides
    tread = wheel.radius - (grousers.height_m if grousers else 0.0)
    drum = make_shape(
        "cylinder", (tread, wheel.width), (0.0, 0.0, 0.0), TYRE, rpy=ALONG_Y, collides=touched
    )
    bars = _bars(wheel, grousers, tread) if grousers else []
    return [drum, *bars, *(_spokes(wheel, tread) if detailed else [])]


def _bars(wheel: Wheel, grousers: GrouserSpec, tread: float) -> list[Shape]:
    # Their outer edges, not the middles of their tops, reach the wheel's radius.
    top = math.sqrt(wheel.radius**2 - grousers.thickness_m**2 / 4)
    size = (grousers.thickness_m, wheel.width, top - tread)
    bars = []
    for angle in (2 * math.pi * n / grousers.count for n in range(grousers.count)):
        place = (top + tread) / 2 * np.array([math.sin(angle), 0.0, math.cos(angle)])
        turn = (0.0, angle, 0.0)
        bars.append(make_shape("box", size, place, TYRE, rpy=turn, collides=grousers.collides))
    return bars


def _spokes(wheel: Wheel, tread: float) -> list[Shape]:
    """A hub and three bars across each side of the wheel, which show that it turns."""
    hub = look("cylinder", (0.3 * tread, 1.1 * wheel.width), (0, 0, 0), METAL, rpy=ALONG_Y)
    size = (0.12 * tread, 1.02 * wheel.width, 1.8 * tread)
    angles = (0.0, math.pi / 3, 2 * math.pi / 3)
    return [hub, *(look("box", size, (0, 0, 0), METAL, rpy=(0, a, 0)) for a in angles)]


def make_sensor(
    name: str,
    kind: str,
    position: ArrayLike,
    properties: tuple[tuple[str, float], ...],
    *,
    rpy: ArrayLike = (0.0, 0.0, 0.0),
) -> Sensor:
    """A sensor on base_link."""
    return Sensor(
        name=name,
        kind=kind,
        link="base_link",
        position=np.asarray(position, dtype=np.float64),
        rpy=np.asarray(rpy, dtype=np.float64),
        properties=properties,
    )


def sensor_rig(
    *, head: tuple[float, float, float], tilt: float, baseline: float, imu: ArrayLike
) -> tuple[Sensor, ...]:
    """Stereo camera (ZED at its 720p setting), lidar and IMU; their figures are nominal.

    `noise` is the standard deviation of a pixel's intensity (0 to 1) and of a range [m]. The IMU's
    are densities, of white noise [rad/s/√Hz, m/s²/√Hz] and of the walk of its bias [rad/s²/√Hz,
    m/s³/√Hz], those of an ADIS16448 (Burri et al. 2016, doi:10.1177/0278364915620033).

    Args:
        head: Between the cameras, in base_link's frame [m].
        tilt: How far the cameras look down [rad].
        baseline: Distance of the cameras [m].
        imu: Place of the IMU in base_link's frame [m].
    """
    camera = (
        ("width_px", 1280.0),
        ("height_px", 720.0),
        ("horizontal_fov", math.radians(85.0)),
        ("rate", 15.0),
        ("baseline", baseline),
        ("noise", 0.007),
    )
    lidar = (
        ("channels", 16.0),
        ("vertical_fov", math.radians(30.0)),
        ("horizontal_samples", 1800.0),
        ("range_min", 0.5),
        ("range_max", 100.0),
        ("rate", 10.0),
        ("noise", 0.01),
    )
    inertial = (
        ("rate", 200.0),
        ("gyro_noise", 1.6968e-4),
        ("gyro_walk", 1.9393e-5),
        ("accelerometer_noise", 2.0e-3),
        ("accelerometer_walk", 3.0e-3),
    )
    x, y, z = head
    half, down = baseline / 2, (0.0, tilt, 0.0)
    return (
        make_sensor("camera_left", "camera", (x + 0.02, y + half, z), camera, rpy=down),
        make_sensor("camera_right", "camera", (x + 0.02, y - half, z), camera, rpy=down),
        make_sensor("lidar", "lidar", (x, y, z + 0.08), lidar),
        make_sensor("imu", "imu", imu, inertial),
    )
