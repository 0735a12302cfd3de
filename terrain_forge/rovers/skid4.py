"""A simple rover of our own: four driven wheels on a stiff body, steered by skidding."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Interval

from terrain_forge.base import Positive, RecipeError, Spec
from terrain_forge.model import Link, Rover, Wheel
from terrain_forge.rovers.parts import (
    FRAME,
    LENS,
    METAL,
    PAINT,
    BuiltRoverSpec,
    look,
    make_link,
    make_shape,
    sensor_rig,
    wheel_link,
)

_ZED = {"source": "ZED camera, as that of MORPHEUS"}


@dataclass(frozen=True, kw_only=True)
class Skid4Dimensions(Spec):
    """Lengths, masses and limits of the four-wheeled rover, of our own choice."""

    SOURCE: ClassVar[str] = "our choice"

    wheel_radius_m: Positive = 0.165
    """Radius of a wheel [m]."""
    wheel_width_m: Positive = 0.12
    """Width of a wheel [m]."""
    wheelbase_m: Positive = 0.52
    """Distance of the front axle from the rear one [m]."""
    track_m: Positive = 0.60
    """Distance between the middle planes of left and right wheels [m]."""
    clearance_m: Positive = 0.14
    """Height of the body's underside above the ground [m]."""
    body_m: tuple[Positive, Positive, Positive] = (0.86, 0.44, 0.22)
    """Length, width and height of the body [m]."""
    mast_height_m: Positive = 0.70
    """Height of the sensor mast's top above the ground [m]."""
    body_mass_kg: Positive = 36.0
    """Mass of the body with batteries and electronics [kg]."""
    mast_mass_kg: Positive = 1.0
    """Mass of the mast with its sensors [kg]."""
    wheel_mass_kg: Positive = 2.75
    """Mass of a wheel with its motor [kg]."""
    stereo_baseline_m: Positive = field(default=0.12, metadata=_ZED)
    """Distance of the two cameras [m]."""
    camera_tilt_deg: Annotated[float, Interval(ge=-90, le=90)] = 12.0
    """How far the cameras look down [degrees]."""
    torque_limit_n_m: Positive = 30.0
    """Largest torque of a wheel's motor [N m]."""
    speed_limit_m_s: Positive = 1.0
    """Largest speed over ground [m/s]."""
    tilt_limit_deg: Annotated[float, Interval(gt=0, lt=90)] = 30.0
    """Largest tilt in which it may be driven [degrees]."""


@dataclass(frozen=True, kw_only=True)
class Skid4Spec(BuiltRoverSpec):
    """A four-wheeled rover without suspension, steered by skidding."""

    kind: Literal["skid4"] = "skid4"
    """This rover."""
    dimensions: Skid4Dimensions = field(default_factory=Skid4Dimensions)
    """Lengths, masses and limits."""


def skid4(spec: Skid4Spec | None = None) -> Rover:
    """The four-wheeled rover.

    Raises:
        RecipeError: if its parts do not fit together.
    """
    spec = spec or Skid4Spec()
    d = spec.dimensions
    _require_fit(spec)
    wheels = _wheels(spec)
    return Rover(
        name="skid4",
        links=(
            _body(d, detailed=spec.model == "detailed"),
            *(
                wheel_link(
                    wheel,
                    "base_link",
                    wheel.centre,
                    d.wheel_mass_kg,
                    grousers=spec.grousers,
                    detailed=spec.model == "detailed",
                )
                for wheel in wheels
            ),
        ),
        wheels=wheels,
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


def _require_fit(spec: Skid4Spec) -> None:
    d = spec.dimensions
    wrong = {
        "wheelbase_m": (d.wheelbase_m, 2 * d.wheel_radius_m, "two wheel radii"),
        "track_m": (d.track_m, d.body_m[1] + d.wheel_width_m, "the body and a wheel are wide"),
        "mast_height_m": (d.mast_height_m, d.clearance_m + d.body_m[2], "the body's top"),
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


def _wheels(spec: Skid4Spec) -> tuple[Wheel, ...]:
    d = spec.dimensions
    return tuple(
        Wheel(
            link=f"wheel_{end}_{side}",
            centre=np.array([x * d.wheelbase_m / 2, y * d.track_m / 2, d.wheel_radius_m]),
            radius=d.wheel_radius_m,
            width=d.wheel_width_m,
            grousers=spec.grousers.record() if spec.grousers else None,
        )
        for end, x in (("front", 1.0), ("rear", -1.0))
        for side, y in (("left", 1.0), ("right", -1.0))
    )


def _body(d: Skid4Dimensions, *, detailed: bool) -> Link:
    length, width, height = d.body_m
    top, x = d.clearance_m + height, 0.4 * length
    box = make_shape("box", d.body_m, (0.0, 0.0, d.clearance_m + height / 2), PAINT)
    pole = d.mast_height_m - top
    mast = make_shape("cylinder", (0.02, pole), (x, 0.0, top + pole / 2), FRAME)
    head = (0.04, d.stereo_baseline_m + 0.06, 0.04)
    tilt = (0.0, math.radians(d.camera_tilt_deg), 0.0)
    eyes = make_shape("box", head, (x, 0.0, d.mast_height_m), LENS, rpy=tilt, collides=False)
    parts = [(box, d.body_mass_kg), (mast, 0.5 * d.mast_mass_kg), (eyes, 0.5 * d.mast_mass_kg)]
    looks = [shape.replace(collides=False) for shape, _ in parts]
    looks += [
        look("box", (0.7 * length, 0.8 * width, 0.02), (-0.1 * length, 0, top + 0.01), METAL),
        look("box", (0.03, 1.05 * width, 0.08), (length / 2, 0, d.clearance_m + 0.06), FRAME),
        look("box", (0.03, 1.05 * width, 0.08), (-length / 2, 0, d.clearance_m + 0.06), FRAME),
        look("cylinder", (0.045, 0.09), (x, 0, d.mast_height_m + 0.065), FRAME),
    ]
    seen = looks if detailed else []
    return make_link("base_link", "", "free", (0.0, 0.0, 0.0), parts, looks=seen)
