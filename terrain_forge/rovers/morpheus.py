"""MORPHEUS, the six-wheeled rover of the University of Padova, as a parametric description.

Published (Giubilato et al. 2020, arXiv:2006.00057): six wheels, each with its own motor, on three
rockers joined to the body by passive revolute joints (left, right, and one across the rear);
skid-steering; a ZED stereo camera. Mass and dimensions are not published: every default of
`MorpheusDimensions` is an assumption, plausible for a rover of that class, and can be changed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Interval

from terrain_forge.base import Positive, RecipeError, Spec
from terrain_forge.model import Link, Rover, Shape, Wheel
from terrain_forge.rovers.parts import (
    ALONG_Y,
    FRAME,
    LENS,
    METAL,
    PAINT,
    PANEL,
    BuiltRoverSpec,
    look,
    make_link,
    make_shape,
    sensor_rig,
    wheel_link,
)

_X, _Y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
_ROCKER_LIMIT = math.radians(35.0)
_ROCKER_DAMPING = 5.0
_ZED = {"source": "ZED camera, as published: Giubilato et al. 2020, arXiv:2006.00057"}


@dataclass(frozen=True, kw_only=True)
class MorpheusDimensions(Spec):
    """What is not published about MORPHEUS; docs/rovers.md tells where each default comes from."""

    SOURCE: ClassVar[str] = "assumption"

    wheel_radius_m: Positive = 0.14
    """Radius of a wheel [m]."""
    wheel_width_m: Positive = 0.12
    """Width of a wheel [m]."""
    wheel_spacing_m: Positive = 0.42
    """Distance between neighbouring axles: front at +, middle at 0, rear at - [m]."""
    track_m: Positive = 0.76
    """Distance between the middle planes of left and right wheels [m]."""
    pivot_height_m: Positive = 0.08
    """Height of the rockers' pivots above the axles [m]."""
    clearance_m: Positive = 0.28
    """Height of the body's underside above the ground [m]."""
    body_m: tuple[Positive, Positive, Positive] = (0.72, 0.46, 0.16)
    """Length, width and height of the body [m]."""
    mast_height_m: Positive = 0.80
    """Height of the sensor mast's top above the ground [m]."""
    body_mass_kg: Positive = 29.2
    """Mass of the body with batteries and electronics [kg]."""
    mast_mass_kg: Positive = 1.0
    """Mass of the mast with its sensors [kg]."""
    rocker_mass_kg: Positive = 2.0
    """Mass of each of the three rockers [kg]."""
    wheel_mass_kg: Positive = 2.3
    """Mass of a wheel with its motor [kg]."""
    stereo_baseline_m: Positive = field(default=0.12, metadata=_ZED)
    """Distance of the two cameras [m]."""
    camera_tilt_deg: Annotated[float, Interval(ge=-90, le=90)] = 12.0
    """How far the cameras look down [degrees]."""
    torque_limit_n_m: Positive = 20.0
    """Largest torque of a wheel's motor [N m]."""
    speed_limit_m_s: Positive = 1.0
    """Largest speed over ground [m/s]."""
    tilt_limit_deg: Annotated[float, Interval(gt=0, lt=90)] = 30.0
    """Largest tilt in which it may be driven [degrees]."""


@dataclass(frozen=True, kw_only=True)
class MorpheusSpec(BuiltRoverSpec):
    """MORPHEUS with a choice of looks and dimensions."""

    kind: Literal["morpheus"] = "morpheus"
    """This rover."""
    dimensions: MorpheusDimensions = field(default_factory=MorpheusDimensions)
    """Lengths, masses and limits."""


def morpheus(spec: MorpheusSpec | None = None) -> Rover:
    """The rover of these dimensions; of the assumed ones where none are given.

    Raises:
        RecipeError: if its parts do not fit together.
    """
    spec = spec or MorpheusSpec()
    d = spec.dimensions
    _require_fit(spec)
    detailed = spec.model == "detailed"
    axles = {wheel.link: (parent, wheel) for parent, wheel in _wheels(spec)}
    pivots = _pivots(d)
    return Rover(
        name="morpheus",
        links=(
            _body(d, detailed=detailed),
            *(_rocker(name, d, detailed=detailed) for name in pivots),
            *(
                wheel_link(
                    wheel,
                    parent,
                    wheel.centre - pivots[parent],
                    d.wheel_mass_kg,
                    grousers=spec.grousers,
                    detailed=detailed,
                )
                for parent, wheel in axles.values()
            ),
        ),
        wheels=tuple(wheel for _, wheel in axles.values()),
        sensors=sensor_rig(
            head=(0.4 * d.body_m[0], 0.0, d.mast_height_m),
            tilt=math.radians(d.camera_tilt_deg),
            baseline=d.stereo_baseline_m,
            imu=(0.0, 0.0, d.clearance_m + d.body_m[2] / 2),
        ),
        torque_limit=d.torque_limit_n_m,
        speed_limit=d.speed_limit_m_s,
        tilt_limit=math.radians(d.tilt_limit_deg),
        clearance=d.clearance_m,
        step_limit=spec.step_limit_m,
    )


def _require_fit(spec: MorpheusSpec) -> None:
    d = spec.dimensions
    top = d.clearance_m + d.body_m[2]
    wrong = {
        "wheel_spacing_m": (d.wheel_spacing_m, 2 * d.wheel_radius_m, "two wheel radii"),
        "track_m": (d.track_m, 2 * d.wheel_width_m, "two wheel widths"),
        "mast_height_m": (d.mast_height_m, top, "the body's top"),
    }
    for name, (found, least, meaning) in wrong.items():
        if found <= least:
            raise RecipeError(
                f"{found:g} m, must be more than {meaning}, {least:g} m",
                key=("rover", "dimensions", name),
            )
    if spec.grousers and spec.grousers.height_m >= 0.5 * d.wheel_radius_m:
        raise RecipeError(
            f"{spec.grousers.height_m:g} m, must be less than half the wheel's radius",
            key=("rover", "grousers", "height_m"),
        )


def _wheels(spec: MorpheusSpec) -> list[tuple[str, Wheel]]:
    """Each wheel with the rocker that carries it."""
    d = spec.dimensions
    axles = {
        "wheel_front_left": ("rocker_left", d.wheel_spacing_m, 1.0),
        "wheel_front_right": ("rocker_right", d.wheel_spacing_m, -1.0),
        "wheel_middle_left": ("rocker_left", 0.0, 1.0),
        "wheel_middle_right": ("rocker_right", 0.0, -1.0),
        "wheel_rear_left": ("rocker_rear", -d.wheel_spacing_m, 1.0),
        "wheel_rear_right": ("rocker_rear", -d.wheel_spacing_m, -1.0),
    }
    return [
        (
            parent,
            Wheel(
                link=name,
                centre=np.array([x, side * d.track_m / 2, d.wheel_radius_m]),
                radius=d.wheel_radius_m,
                width=d.wheel_width_m,
                grousers=spec.grousers.record() if spec.grousers else None,
            ),
        )
        for name, (parent, x, side) in axles.items()
    ]


def _body(d: MorpheusDimensions, *, detailed: bool) -> Link:
    length, _, height = d.body_m
    top = d.clearance_m + height
    box = make_shape("box", d.body_m, (0.0, 0.0, d.clearance_m + height / 2), PAINT)
    pole = d.mast_height_m - top
    mast = make_shape("cylinder", (0.02, pole), (0.4 * length, 0.0, top + pole / 2), FRAME)
    head = make_shape(
        "box",
        (0.04, d.stereo_baseline_m + 0.06, 0.04),
        (0.4 * length, 0.0, d.mast_height_m),
        LENS,
        rpy=(0.0, math.radians(d.camera_tilt_deg), 0.0),
        collides=False,
    )
    parts = [(box, d.body_mass_kg), (mast, 0.5 * d.mast_mass_kg), (head, 0.5 * d.mast_mass_kg)]
    looks = [box, mast, head, *_equipment(d)] if detailed else []
    unseen = [shape.replace(collides=False) for shape in looks]
    return make_link("base_link", "", "free", (0.0, 0.0, 0.0), parts, looks=unseen)


def _equipment(d: MorpheusDimensions) -> list[Shape]:
    """Deck with a solar panel, the cameras' lenses, the lidar, a box of electronics, an antenna."""
    length, width, height = d.body_m
    top, x = d.clearance_m + height, 0.4 * length
    tilt, half = math.radians(d.camera_tilt_deg), d.stereo_baseline_m / 2
    ahead = np.array([0.022 * math.cos(tilt), 0.0, -0.022 * math.sin(tilt)])
    lens_rpy = (0.0, math.pi / 2 + tilt, 0.0)
    eyes = [ahead + np.array([x, y, d.mast_height_m]) for y in (half, -half)]
    lenses = [look("cylinder", (0.012, 0.01), eye, METAL, rpy=lens_rpy) for eye in eyes]
    panels = [
        look("box", (0.27 * length, 0.92 * width, 0.012), (at * length, 0, top + 0.03), PANEL)
        for at in (-0.33, -0.04)
    ]
    rail = look("box", (0.62 * length, 0.03, 0.024), (-0.185 * length, 0, top + 0.012), FRAME)
    return [
        *lenses,
        *panels,
        rail,
        look("cylinder", (0.045, 0.09), (x, 0, d.mast_height_m + 0.065), FRAME),
        look("box", (0.10, 0.6 * width, 0.06), (0.22 * length, 0, top + 0.03), METAL),
        look("cylinder", (0.006, 0.30), (-0.47 * length, 0.4 * width, top + 0.15), FRAME),
        look("box", (1.02 * length, 0.9 * width, 0.03), (0, 0, d.clearance_m + 0.03), FRAME),
    ]


def _pivots(d: MorpheusDimensions) -> dict[str, tuple[float, float, float]]:
    """Where the rockers are hinged to the body: half-way between the wheels that each carries."""
    side = d.track_m / 2 - d.wheel_width_m / 2 - 0.03
    height = d.wheel_radius_m + d.pivot_height_m
    return {
        "rocker_left": (d.wheel_spacing_m / 2, side, height),
        "rocker_right": (d.wheel_spacing_m / 2, -side, height),
        "rocker_rear": (-d.wheel_spacing_m, 0.0, height),
    }


def _rocker(name: str, d: MorpheusDimensions, *, detailed: bool) -> Link:
    """A beam between two wheels: along x at the sides, hinged about y; across the rear, about x."""
    across = name == "rocker_rear"
    length = d.track_m - d.wheel_width_m - 0.02
    size = (0.04, length, 0.05) if across else (d.wheel_spacing_m, 0.03, 0.05)
    beam = make_shape("box", size, (0.0, 0.0, 0.0), FRAME)
    return make_link(
        name,
        "base_link",
        "passive",
        _pivots(d)[name],
        [(beam, d.rocker_mass_kg)],
        looks=_beam_looks(beam, d, across=across) if detailed else [],
        axis=_X if across else _Y,
        limits=(-_ROCKER_LIMIT, _ROCKER_LIMIT),
        damping=_ROCKER_DAMPING,
    )


def _beam_looks(beam: Shape, d: MorpheusDimensions, *, across: bool) -> list[Shape]:
    """The beam with a hub at its pivot and a leg down to each axle."""
    drop = d.pivot_height_m
    half = (beam.size[1] if across else d.wheel_spacing_m) / 2 - 0.015
    along = np.array(_Y if across else _X)
    hub_rpy = (0.0, math.pi / 2, 0.0) if across else ALONG_Y
    legs = [
        look("box", (0.03, 0.03, drop), side * half * along - (0, 0, drop / 2), FRAME)
        for side in (1, -1)
    ]
    hub = look("cylinder", (0.035, 0.06), (0, 0, 0), METAL, rpy=hub_rpy)
    return [beam.replace(collides=False), hub, *legs]
