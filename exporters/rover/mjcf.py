"""The rover as an MJCF model of its own; `<attach>` or include it, or open it alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from terrain_forge.exporters.mjcf.rover import (
    rover_actuators,
    rover_assets,
    rover_body,
    rover_classes,
    rover_equalities,
    rover_sensors,
)
from terrain_forge.exporters.mjcf.xml import element

from terrain_forge.model import Rover


def write_mjcf(path: Path, rover: Rover, *, gravity: float, friction: float) -> None:
    """Write the rover, its motors and sensors, with the settings that the world's export has.

    Args:
        path: The file.
        rover: The rover.
        gravity: Of the world [m/s²].
        friction: Sliding friction of its geoms.
    """
    option = element(
        "option",
        timestep=0.002,
        gravity=(0.0, 0.0, -gravity),
        integrator="implicitfast",
        cone="elliptic",
        impratio=10,
        solver="Newton",
        jacobian="sparse",
    )
    parts = [
        element("compiler", angle="radian", autolimits="true"),
        option,
        element("default", rover_classes(friction)),
        element("asset", rover_assets(rover, "meshes")),
        element("worldbody", [rover_body(rover, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))]),
        element("equality", rover_equalities(rover)),
        element("actuator", rover_actuators(rover)),
        element("sensor", rover_sensors(rover)),
    ]
    text = element("mujoco", parts, model=rover.name) + "\n"
    path.write_text(text, encoding="utf-8", newline="\n")
