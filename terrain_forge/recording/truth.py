"""The truth of a recording: exact places of the body and of each sensor, at their own times."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import quaternion_from_matrix
from terrain_forge.datasets import Poses, tum_text
from terrain_forge.recording.rig import Folder, body_of
from terrain_forge.recording.texts import STAMP, Blocks, blocks, table_rows
from terrain_forge.sensors import NANOSECONDS, Setting, State

EPOCH = 1_600_000_000 * NANOSECONDS
"""The stamp of time 0 [ns]."""
_LEAST_RATE = 200
"""Of the body's truth [Hz]."""
_HEAD = "# timestamp [s] x y z [m] qx qy qz qw\n"
_COLUMNS = (
    *("p_RS_R_x [m]", "p_RS_R_y [m]", "p_RS_R_z [m]"),
    *("q_RS_w []", "q_RS_x []", "q_RS_y []", "q_RS_z []"),
    *("v_RS_R_x [m s^-1]", "v_RS_R_y [m s^-1]", "v_RS_R_z [m s^-1]"),
    *("b_w_RS_S_x [rad s^-1]", "b_w_RS_S_y [rad s^-1]", "b_w_RS_S_z [rad s^-1]"),
    *("b_a_RS_S_x [m s^-2]", "b_a_RS_S_y [m s^-2]", "b_a_RS_S_z [m s^-2]"),
)


def body_times(setting: Setting, folders: Sequence[Folder]) -> NDArray[np.int64]:
    """When the body's truth is told, from 0 [ns]: with the first IMU, or 200 times a second."""
    body = body_of(folders)
    if body is not None and body.sensor.rate_hz >= _LEAST_RATE:
        return body.instrument.times
    step = NANOSECONDS // _LEAST_RATE
    return np.arange(int(setting.motion.end * NANOSECONDS / step + 1e-6) + 1, dtype=np.int64) * step


def body_table(setting: Setting, folders: Sequence[Folder], times: NDArray[np.int64]) -> Blocks:
    """EuRoC's table of the body's truth at times [ns]."""
    body = body_of(folders)
    biases = getattr(body.instrument, "biases", None) if body else None
    yield f"{','.join([STAMP, *_COLUMNS])}\n".encode()
    for part in blocks(len(times)):
        some = times[part]
        state = body.state(some) if body else setting.motion.base.at(some / NANOSECONDS)
        turn = quaternion_from_matrix(state.rotation)
        told = biases(some) if biases else np.zeros((len(some), 6))
        values = np.hstack([state.position, turn, state.velocity, told])
        yield table_rows(some + EPOCH, *values.T)


def base_poses(setting: Setting, times: NDArray[np.int64]) -> Blocks:
    """Poses of base_link at times [ns]."""
    return _poses(lambda some: setting.motion.base.at(some / NANOSECONDS), times)


def sensor_poses(folder: Folder, times: NDArray[np.int64]) -> Blocks:
    """Poses of a sensor's frame at times [ns]."""
    return _poses(folder.state, times)


def _poses(states: Callable[[NDArray[np.int64]], State], times: NDArray[np.int64]) -> Blocks:
    yield _HEAD.encode()
    for part in blocks(len(times)):
        state = states(times[part])
        poses = Poses(
            stamps=times[part] + EPOCH,
            position=state.position,
            quaternion=quaternion_from_matrix(state.rotation),
        )
        yield tum_text(poses).encode()
