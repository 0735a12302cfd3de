"""Systems that pip brings, each through its driver, on a short drive past some rocks.

They are looked for in the environment of the Python that TERRAIN_FORGE_SLAM_PYTHON names.
"""

from __future__ import annotations

import json
import subprocess
from dataclasses import replace

import pytest

import terrain_forge as tf
from terrain_forge.evaluation import find_system

pytestmark = [pytest.mark.consumer, pytest.mark.slow]

RECIPE = {
    "schema": 1, "name": "short", "seed": 3, "body": "mars", "exports": [],
    "dtm": {"kind": "flat", "size_m": [24, 16]},
    "terrain": {"spacing_m": 0.25, "layers": [
        {"kind": "fractal", "rms_slope": {"slope_deg": 8}, "keep_means": False},
    ]},
    "rocks": {
        "library": {"shapes": 2, "seed": 7},
        "populations": [
            {"name": "boulders", "size_frequency": {"kind": "golombek", "k": 0.3},
             "diameter_m": [0.4, 1.0]},
        ],
    },
    "paths": [
        {"name": "there", "route": {"kind": "spline", "points_m": [[-6, 0], [0, 0.5], [6, 0]]},
         "speed_m_s": 1},
    ],
    "sensors": [{"name": "lidar", "kind": "lidar", "preset": "vlp-16",
                 "position_m": [0, 0, 0.9]},
                {"name": "imu", "kind": "imu", "position_m": [0, 0, 0.3]}],
    "dataset": {"still_s": 0.5, "ramp_s": 0.5},
}  # fmt: skip
SYSTEMS = {
    "kiss-icp": "kiss_icp", "kiss-slam": "kiss_slam", "genz-icp": "evalio", "loam": "evalio",
}  # fmt: skip


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    place = tmp_path_factory.mktemp("systems")
    (place / "short.yaml").write_text(json.dumps(RECIPE))  # JSON is YAML
    tf.build(place / "short.yaml", place / "out")
    tf.record(place / "out", end=4.0)
    return place / "out"


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_system_follows_a_short_drive(python, recorded, name):
    if subprocess.run([python, "-c", f"import {SYSTEMS[name]}"], capture_output=True).returncode:
        pytest.skip(f"{SYSTEMS[name]} is not installed")
    system = find_system(name)
    there = replace(
        system, packages=(), command=system.command.replace("{python}", str(python))
    )  # no environment of its own is installed for a test
    (result,) = tf.evaluate(recorded, [there], options=tf.ScoreOptions(align="origin"))
    assert result.run.status == "done", f"{result.run.why}\n{result.run.log}"
    assert result.score.tracked > 0.8
    assert result.score.ate.rms < 0.5
    assert 0.0 < result.run.processor_s
    assert result.frames > 20
    if name.startswith("kiss-"):
        assert result.run.map is not None
        table = (recorded / "dataset" / "slam" / "maps.csv").read_text()
        assert f"{name} 1" in table
