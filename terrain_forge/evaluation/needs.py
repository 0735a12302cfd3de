"""What a recording has for a system: its sensors, their folders, its frame."""

from __future__ import annotations

from terrain_forge.base import DataError
from terrain_forge.datasets import Recording, pair_of
from terrain_forge.evaluation.adapter import SENSOR_PLACES, Adapter
from terrain_forge.sensors import instrument_kinds, is_folder


def sensor_places(recording: Recording) -> dict[str, str]:
    """What stands for the sensors of `SENSOR_PLACES` in a recording, those that it has."""
    found = {}
    if pair := pair_of(recording):
        found = {"left": pair.left.key, "right": pair.right.key}
    for lidar in recording.lidars[:1]:
        found["lidar"] = lidar.key
    return found


def frames_given(recording: Recording, adapter: Adapter) -> int:
    """How many sweeps, or else pictures, a system is given; 0 if it looks at neither."""
    if "lidar" in adapter.needs and recording.lidars:
        return len(recording.lidars[0].stamps)
    if {"mono", "stereo", "rgbd"} & {*adapter.needs} and recording.cameras:
        pair = pair_of(recording)
        return len((pair.left if pair else recording.cameras[0]).stamps)
    return 0


def require_sensors(recording: Recording, adapter: Adapter) -> None:
    """Refuse a recording that lacks what a system needs.

    Raises:
        DataError: says what is missing.
    """
    there = {
        "mono": bool(recording.cameras),
        "stereo": bool(recording.pairs),
        "rgbd": any("depth" in camera.channels for camera in recording.cameras),
        "lidar": bool(recording.lidars),
        "imu": bool(recording.imus),
        "odometry": bool(recording.series("odometry")),
    }
    served = sensor_places(recording)
    places = [SENSOR_PLACES[one] for one in adapter.sensor_places() if one not in served]
    needs: list[str] = [need for need in adapter.needs if not there[need]]
    if missing := [*needs, *(one for one in dict.fromkeys(places) if one not in needs)]:
        raise DataError(f"{adapter.name} needs {' and '.join(missing)}, which was not recorded")


def require_frame(recording: Recording, adapter: Adapter) -> None:
    """Refuse a frame that is none; that of a sensor's folder may yet not have been recorded.

    Raises:
        DataError: lists what there is.
    """
    known = adapter.frame in ("base_link", "body") or adapter.frame[:1] == "{"
    if not known and not is_folder(adapter.frame, instrument_kinds().values()):
        try:
            recording.sensor(adapter.frame)
        except DataError as error:
            raise DataError(f"{adapter.name}: frame: {error}, base_link, body") from None
