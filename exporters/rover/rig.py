"""What all formats of the rover agree on."""

from __future__ import annotations

import numpy as np

from terrain_forge.model import Link, Rover

SKID_GAIN = 2.0
"""Commanded over wanted turn rate: skidding wheels turn a rover at about half the kinematic
rate."""
_LIMIT_RATE = 10.0
"""Rate that a passive joint does not reach [rad/s]; URDF wants one."""


def joint_name(link: str) -> str:
    """What the joint of a link is called in URDF and SDF, where links and joints share names."""
    return f"{link}_joint"


def sides(rover: Rover) -> tuple[list[str], list[str]]:
    """Joints of the left and of the right wheels."""
    left = [joint_name(wheel.link) for wheel in rover.wheels if wheel.centre[1] > 0]
    right = [joint_name(wheel.link) for wheel in rover.wheels if wheel.centre[1] <= 0]
    return left, right


def track(rover: Rover) -> float:
    """Mean distance of the left wheels from the right ones [m]."""
    return float(2 * np.abs(rover.wheel_centres[:, 1]).mean())


def wheel_radius(rover: Rover) -> float:
    """Mean radius of the wheels [m]."""
    return float(np.mean([wheel.radius for wheel in rover.wheels]))


def joint_rate(rover: Rover, link: Link) -> float:
    """Largest rate of a joint [rad/s]."""
    radii = {wheel.link: wheel.radius for wheel in rover.wheels}
    return rover.speed_limit / radii[link.name] if link.name in radii else _LIMIT_RATE
