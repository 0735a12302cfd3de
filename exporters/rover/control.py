"""How the rover is driven in all formats: its joints, and its controllers for ros2_control."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from ruamel.yaml import YAML

from terrain_forge.model import Link, Rover

SKID_GAIN = 2.0
"""Commanded over wanted turn rate: skidding wheels turn a rover at about half the kinematic
rate."""
_UNREACHED = 10.0
"""Rate that a passive joint does not reach [rad/s], where nobody tells one and URDF wants one."""
_RATE = 50
_TURN_RATE = 0.4


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
    if link.name in radii:
        return rover.speed_limit / radii[link.name]
    return _UNREACHED if link.rate_limit is None else link.rate_limit


def write_controllers(path: Path, rover: Rover) -> None:
    """Write the parameters of the controller manager, a joint state broadcaster and a diff drive.

    Spot turns skid: `wheel_separation_multiplier` makes up for it.
    """
    left, right = sides(rover)
    drive = {
        "left_wheel_names": left,
        "right_wheel_names": right,
        "wheel_separation": round(track(rover), 6),
        "wheel_radius": round(wheel_radius(rover), 6),
        "wheel_separation_multiplier": SKID_GAIN,
        "left_wheel_radius_multiplier": 1.0,
        "right_wheel_radius_multiplier": 1.0,
        "base_frame_id": "base_link",
        "odom_frame_id": "odom",
        "open_loop": False,
        "enable_odom_tf": True,
        "cmd_vel_timeout": 0.5,
        "publish_rate": float(_RATE),
        "linear.x.has_velocity_limits": True,
        "linear.x.max_velocity": rover.speed_limit,
        "linear.x.min_velocity": -rover.speed_limit,
        "angular.z.has_velocity_limits": True,
        "angular.z.max_velocity": _TURN_RATE,
        "angular.z.min_velocity": -_TURN_RATE,
    }
    kinds = {
        "joint_state_broadcaster": {"type": "joint_state_broadcaster/JointStateBroadcaster"},
        "diff_drive_controller": {"type": "diff_drive_controller/DiffDriveController"},
    }
    document = {
        "controller_manager": {"ros__parameters": {"update_rate": _RATE, **kinds}},
        "diff_drive_controller": {"ros__parameters": drive},
    }
    yaml = YAML(typ="safe", pure=True)
    yaml.default_flow_style = False
    yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    with path.open("w", encoding="utf-8", newline="\n") as file:
        yaml.dump(document, file)
