"""The kind of sensor that the documentation makes is one: it measures, recorded and told."""

import re

import numpy as np

import terrain_forge as tf
from terrain_forge.datasets import open_recording
from terrain_forge.recording import early as early_file
from terrain_forge.rovers import find_rover
from terrain_forge.sensors import instrument as instrument_file
from tests.helpers import worlds
from tests.helpers.places import ROOT


def test_the_kind_of_the_documentation_measures_heights(tmp_path, monkeypatch):
    text = (ROOT / "docs" / "sensors.md").read_text(encoding="utf-8")
    names: dict[str, object] = {"__name__": "altimeter"}
    exec(re.search(r"```python\n(.*?)```", text, re.DOTALL)[1], names)
    sensor = names["AltimeterSensor"](
        name="height", position_m=(1.5, 0, 0.5), rpy_deg=(0, 90, 0), noise_m=0.0, rate_hz=2.0
    )
    kinds = {"altimeter": names["Altimeter"]}
    for place in (instrument_file, early_file):
        monkeypatch.setattr(place, "instrument_kinds", lambda: kinds)
    world = worlds.world(rover=find_rover("skid4").replace(sensors=(sensor,)))
    tf.record(world, tmp_path, end=4.0)
    (height,) = open_recording(tmp_path).series("altimeter")
    poses = open_recording(tmp_path).truth_of(height)
    ahead = poses.matrices[:, :3, 0]
    met = poses.position + height.table[1] * ahead
    assert len(met) == 8
    np.testing.assert_allclose(met[:, 2], world.ground.height_at(met[:, 0], met[:, 1]), atol=1e-4)
