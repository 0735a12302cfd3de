"""Tables and poses are written part by part, whose ends nothing shows."""

from __future__ import annotations

import numpy as np
import pytest

from terrain_forge.model import ImuSensor
from terrain_forge.recording.rig import folders_of
from terrain_forge.recording.texts import table, written
from terrain_forge.recording.truth import base_poses, body_table, sensor_poses
from terrain_forge.sensors import NANOSECONDS, Setting, instruments_of, motion_of_path
from tests.helpers import worlds
from tests.helpers.rovers import morpheus

_ROWS = 20_000


def test_a_long_table_comes_in_parts(tmp_path):
    numbers = np.arange(_ROWS)
    columns = {"a []": 0.1 * numbers, "b []": numbers}
    parts = list(table(columns, 5 * numbers))
    assert max(map(len, parts)) < 0.6 * sum(map(len, parts))
    lines = [f"{5 * n},{0.1 * n},{n}" for n in numbers.tolist()]
    written(iter(parts))(tmp_path / "table.csv")
    told = (tmp_path / "table.csv").read_text().splitlines()
    assert told == ["#timestamp [ns],a [],b []", *lines]
    assert b"".join(table({"a []": np.zeros(0)}, numbers[:0])) == b"#timestamp [ns],a []\n"


@pytest.mark.slow
def test_a_row_hangs_on_its_own_time_alone():
    imu = ImuSensor(name="imu", rate_hz=1000.0, position_m=(0.1, 0.0, 0.2))
    world = worlds.world(rover=morpheus().replace(sensors=(imu,)))
    motion = motion_of_path(world.trajectories[0])
    setting = Setting(world=world, motion=motion, scenery=None, gravity=3.711, seed=1)
    folders = folders_of(instruments_of(setting), quick=False)
    times = (np.arange(_ROWS) * motion.end / _ROWS * NANOSECONDS).astype(np.int64)
    for told in (
        lambda some: body_table(setting, folders, some),
        lambda some: base_poses(setting, some),
        lambda some: sensor_poses(folders[0], some),
    ):
        whole, *parts = (
            b"".join(told(some)).splitlines()
            for some in (times, times[:1], times[1:8192], times[8192:])
        )
        assert whole == [parts[0][0], *(row for part in parts for row in part[1:])]
        assert len(whole) == _ROWS + 1
