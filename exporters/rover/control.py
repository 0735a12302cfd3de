"""Controllers of the rover for ros2_control: skid-steering by a diff-drive controller."""

from __future__ import annotations

from pathlib import Path

from ruamel.yaml import YAML

from terrain_forge.model import Rover

from .rig import SKID_GAIN, sides, track, wheel_radius

_RATE = 50
_TURN_RATE = 0.4


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
