"""MORPHEUS, the six-wheeled rover of the University of Padova, as a parametric description.

Published (Giubilato et al. 2020, arXiv:2006.00057): six wheels, each with its own motor, on three
rockers joined to the body by passive revolute joints (left, right, and one across the rear);
skid-steering; a ZED stereo camera. Mass and dimensions are not published: every default of
`MorpheusDimensions` is an assumption, plausible for a rover of that class, and can be changed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from terrain_forge.records import Record
from terrain_forge.rovers.description import Link, Rover, Sensor, Shape, Wheel
from terrain_forge.rovers.inertia import combine

_BODY_RGB = (0.82, 0.82, 0.80)
_FRAME_RGB = (0.30, 0.30, 0.32)
_WHEEL_RGB = (0.16, 0.16, 0.17)
_SENSOR_RGB = (0.08, 0.08, 0.10)

_X, _Y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
_ROCKER_LIMIT = math.radians(35.0)
_ROCKER_DAMPING = 5.0
_WHEEL_DAMPING = 0.1


@dataclass(frozen=True, kw_only=True, eq=False)
class MorpheusDimensions(Record):
    """What is not published about MORPHEUS; all defaults are assumptions."""

    wheel_radius: float = 0.14
    """Radius of a wheel [m]."""
    wheel_width: float = 0.12
    """Width of a wheel [m]."""
    wheel_spacing: float = 0.42
    """Distance between neighbouring axles: front at +, middle at 0, rear at - [m]."""
    track: float = 0.76
    """Distance between the middle planes of left and right wheels [m]."""
    pivot_height: float = 0.08
    """Height of the rockers' pivots above the axles [m]."""
    clearance: float = 0.28
    """Height of the body's underside above the ground [m]."""
    body: tuple[float, float, float] = (0.72, 0.46, 0.16)
    """Length, width and height of the body [m]."""
    mast_height: float = 0.80
    """Height of the sensor mast's top above the ground [m]."""
    body_mass: float = 29.2
    """Mass of the body with batteries and electronics [kg]."""
    mast_mass: float = 1.0
    """Mass of the mast with its sensors [kg]."""
    rocker_mass: float = 2.0
    """Mass of each of the three rockers [kg]."""
    wheel_mass: float = 2.3
    """Mass of a wheel with its motor [kg]."""
    stereo_baseline: float = 0.12
    """Distance of the two cameras [m]; that of a ZED."""
    camera_tilt: float = math.radians(12.0)
    """How far the cameras look down [rad]."""
    torque_limit: float = 20.0
    """Largest torque of a wheel's motor [N m]."""
    speed_limit: float = 1.0
    """Largest speed over ground [m/s]."""
    tilt_limit: float = math.radians(30.0)
    """Largest tilt in which it may be driven [rad]."""


def morpheus(dimensions: MorpheusDimensions | None = None) -> Rover:
    """The rover of these dimensions; of the assumed ones where none are given.

    Raises:
        ValueError: if a length or a mass is not positive.
    """
    d = dimensions or MorpheusDimensions()
    _require_positive(d)
    return Rover(
        name="morpheus",
        links=(
            _body(d),
            *(_rocker(name, d) for name in _pivots(d)),
            *(_wheel_link(*axle, d) for axle in _axles(d)),
        ),
        wheels=tuple(
            Wheel(
                link=name,
                centre=np.array([x, side * d.track / 2, d.wheel_radius]),
                radius=d.wheel_radius,
                width=d.wheel_width,
            )
            for name, _, x, side in _axles(d)
        ),
        sensors=_rig(d),
        torque_limit=d.torque_limit,
        speed_limit=d.speed_limit,
        tilt_limit=d.tilt_limit,
        clearance=d.clearance,
    )


def _require_positive(d: MorpheusDimensions) -> None:
    numbers = {name: value for name, value in vars(d).items() if name != "camera_tilt"}
    for name, value in numbers.items():
        if min(value if isinstance(value, tuple) else (value,)) <= 0:
            raise ValueError(f"MORPHEUS {name} is {value}: must be greater than 0")


def _axles(d: MorpheusDimensions) -> list[tuple[str, str, float, float]]:
    """Name, parent, x [m] and side (left +1) of each wheel."""
    front, middle, rear = d.wheel_spacing, 0.0, -d.wheel_spacing
    return [
        ("wheel_front_left", "rocker_left", front, 1.0),
        ("wheel_front_right", "rocker_right", front, -1.0),
        ("wheel_middle_left", "rocker_left", middle, 1.0),
        ("wheel_middle_right", "rocker_right", middle, -1.0),
        ("wheel_rear_left", "rocker_rear", rear, 1.0),
        ("wheel_rear_right", "rocker_rear", rear, -1.0),
    ]


def _shape(
    kind: str,
    size: tuple[float, ...],
    position: ArrayLike,
    rgb: tuple[float, float, float],
    *,
    rpy: ArrayLike = (0.0, 0.0, 0.0),
    collides: bool = True,
) -> Shape:
    return Shape(
        kind=kind,
        size=size,
        position=np.asarray(position, dtype=np.float64),
        rpy=np.asarray(rpy, dtype=np.float64),
        collides=collides,
        rgb=rgb,
    )


def _link(
    name: str,
    parent: str,
    joint: str,
    origin: ArrayLike,
    parts: list[tuple[Shape, float]],
    *,
    axis: ArrayLike = _Y,
    limit: float = 0.0,
    damping: float = 0.0,
) -> Link:
    mass, centre, inertia = combine(parts)
    return Link(
        name=name,
        parent=parent,
        joint=joint,
        origin=np.asarray(origin, dtype=np.float64),
        axis=np.asarray(axis, dtype=np.float64),
        limit=limit,
        damping=damping,
        mass=mass,
        centre_of_mass=centre,
        inertia=inertia,
        shapes=tuple(shape for shape, _ in parts),
    )


def _body(d: MorpheusDimensions) -> Link:
    length, _, height = d.body
    top = d.clearance + height
    box = _shape("box", d.body, (0.0, 0.0, d.clearance + height / 2), _BODY_RGB)
    mast_length = d.mast_height - top
    mast = _shape(
        "cylinder", (0.02, mast_length), (0.4 * length, 0.0, top + mast_length / 2), _FRAME_RGB
    )
    head = _shape(
        "box",
        (0.04, d.stereo_baseline + 0.06, 0.04),
        (0.4 * length, 0.0, d.mast_height),
        _SENSOR_RGB,
        rpy=(0.0, d.camera_tilt, 0.0),
        collides=False,
    )
    parts = [(box, d.body_mass), (mast, 0.5 * d.mast_mass), (head, 0.5 * d.mast_mass)]
    return _link("base_link", "", "free", (0.0, 0.0, 0.0), parts)


def _pivots(d: MorpheusDimensions) -> dict[str, tuple[float, float, float]]:
    """Where the rockers are hinged to the body: half-way between the wheels that each carries."""
    side = d.track / 2 - d.wheel_width / 2 - 0.03
    height = d.wheel_radius + d.pivot_height
    return {
        "rocker_left": (d.wheel_spacing / 2, side, height),
        "rocker_right": (d.wheel_spacing / 2, -side, height),
        "rocker_rear": (-d.wheel_spacing, 0.0, height),
    }


def _rocker(name: str, d: MorpheusDimensions) -> Link:
    """A beam between two wheels: along x at the sides, hinged about y; across the rear, about x."""
    across = name == "rocker_rear"
    length = d.track - d.wheel_width - 0.02
    size = (0.04, length, 0.05) if across else (d.wheel_spacing, 0.03, 0.05)
    return _link(
        name,
        "base_link",
        "passive",
        _pivots(d)[name],
        [(_shape("box", size, (0.0, 0.0, 0.0), _FRAME_RGB), d.rocker_mass)],
        axis=_X if across else _Y,
        limit=_ROCKER_LIMIT,
        damping=_ROCKER_DAMPING,
    )


def _wheel_link(name: str, parent: str, x: float, side: float, d: MorpheusDimensions) -> Link:
    centre = np.array([x, side * d.track / 2, d.wheel_radius])
    tyre = _shape(
        "cylinder",
        (d.wheel_radius, d.wheel_width),
        (0.0, 0.0, 0.0),
        _WHEEL_RGB,
        rpy=(math.pi / 2, 0.0, 0.0),
    )
    return _link(
        name,
        parent,
        "motor",
        centre - _pivots(d)[parent],
        [(tyre, d.wheel_mass)],
        axis=_Y,
        damping=_WHEEL_DAMPING,
    )


def _rig(d: MorpheusDimensions) -> tuple[Sensor, ...]:
    """Stereo camera (ZED at its 720p setting), lidar and IMU; their figures are nominal.

    `noise` is the standard deviation of a pixel's intensity (0 to 1) and of a range [m]. The IMU's
    are densities, of white noise [rad/s/√Hz, m/s²/√Hz] and of the walk of its bias [rad/s²/√Hz,
    m/s³/√Hz], those of an ADIS16448 (Burri et al. 2016, doi:10.1177/0278364915620033).
    """
    mast_x = 0.4 * d.body[0]
    camera = (
        ("width_px", 1280.0),
        ("height_px", 720.0),
        ("horizontal_fov", math.radians(85.0)),
        ("rate", 15.0),
        ("baseline", d.stereo_baseline),
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
    imu = (
        ("rate", 200.0),
        ("gyro_noise", 1.6968e-4),
        ("gyro_walk", 1.9393e-5),
        ("accelerometer_noise", 2.0e-3),
        ("accelerometer_walk", 3.0e-3),
    )
    half = d.stereo_baseline / 2
    down = (0.0, d.camera_tilt, 0.0)
    centre = (0.0, 0.0, d.clearance + d.body[2] / 2)
    return (
        _sensor("camera_left", "camera", (mast_x + 0.02, half, d.mast_height), camera, rpy=down),
        _sensor("camera_right", "camera", (mast_x + 0.02, -half, d.mast_height), camera, rpy=down),
        _sensor("lidar", "lidar", (mast_x, 0.0, d.mast_height + 0.08), lidar),
        _sensor("imu", "imu", centre, imu),
    )


def _sensor(
    name: str,
    kind: str,
    position: ArrayLike,
    properties: tuple[tuple[str, float], ...],
    *,
    rpy: ArrayLike = (0.0, 0.0, 0.0),
) -> Sensor:
    return Sensor(
        name=name,
        kind=kind,
        link="base_link",
        position=np.asarray(position, dtype=np.float64),
        rpy=np.asarray(rpy, dtype=np.float64),
        properties=properties,
    )
