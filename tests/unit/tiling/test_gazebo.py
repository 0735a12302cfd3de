"""The SDF of a site in tiles in Gazebo's own libraries: its levels, and its physics at borders."""

from __future__ import annotations

import subprocess

import numpy as np
import pytest

from tests.helpers.gazebo import rested

pytestmark = pytest.mark.consumer
RADIUS = 0.2
BALL = """<model name="{name}"><pose>{x!r} {y!r} {z!r} 0 0 0</pose><link name="ball">
<inertial><mass>5</mass><inertia><ixx>0.08</ixx><iyy>0.08</iyy><izz>0.08</izz><ixy>0</ixy>
<ixz>0</ixz><iyz>0</iyz></inertia></inertial><collision name="ball"><geometry><sphere>
<radius>{radius}</radius></sphere></geometry></collision></link></model>"""


def read_levels(build, site):
    """What the program prints: models and their places, levels and their numbers and models."""
    program = build("gazebo_levels", "sdformat12")
    command = [program, site / "sdf/world.sdf", site]
    run = subprocess.run(command, capture_output=True, text=True)
    assert run.returncode == 0, run.stdout + run.stderr
    lines = [line.split() for line in run.stdout.splitlines()]
    models = {line[1]: np.array(line[2:5], float) for line in lines if line[0] == "model"}
    levels = [(np.array(line[2:9], float), line[9:]) for line in lines if line[0] == "level"]
    return models, levels


def loaded(levels, place, *, size=1.0):
    """Models of the levels that a performer's box at a place meets, as gz-sim loads them."""
    found = set()
    for numbers, names in levels:
        if (np.abs(place - numbers[:3]) <= 0.5 * (numbers[3:6] + size)).all():
            found |= set(names)
    return found


def test_all_within_half_a_tile_is_loaded(built, whole, build):
    models, levels = read_levels(build, built)
    assert len(levels) == 6
    random = np.random.default_rng(6)
    for east, north in (random.uniform(-1, 1, (200, 2)) * (24.9, 19.9)).tolist():
        place = np.array([east, north, float(whole.ground.height_at(east, north)) + 0.3])
        here = loaded(levels, place)
        assert here <= set(models)
        sides = np.array([[-10.0], [0.0], [10.0]])
        columns = np.clip((east + sides + 25.0) // 20.0, 0, 2).astype(int).ravel().tolist()
        rows = np.clip((north + sides + 20.0) // 20.0, 0, 1).astype(int).ravel().tolist()
        assert {f"six_{row:03}_{column:03}" for row in rows for column in columns} <= here
        if all(1.0 < value % 10.0 < 9.0 for value in (east + 5.0, north)):
            assert len(here) <= 4


def test_balls_rest_where_tiles_meet(built, whole, build, tmp_path):
    """Dropped beside the border of two tiles and the corner of four, none falls through."""
    (tmp_path / "models").symlink_to(built)
    places = {"border": (-5.0, -9.3), "side": (15.0, 6.2), "north": (4.1, 0.0), "corner": (-5.0, 0)}
    balls = "".join(
        BALL.format(
            name=name, x=float(x), y=float(y), radius=RADIUS,
            z=float(whole.ground.height_at(x, y)) + 1.5,
        )
        for name, (x, y) in places.items()
    )  # fmt: skip
    world = tmp_path / "balls.sdf"
    text = (built / "sdf/world.sdf").read_text(encoding="utf-8")
    world.write_text(text.replace("</world>", f"{balls}</world>"), encoding="utf-8")
    found = rested(build, tmp_path, world, 5)
    assert set(found) == set(places)
    for name, pose in found.items():
        height = pose[2] - float(whole.ground.height_at(pose[0], pose[1]))
        assert 0.5 * RADIUS < height < 1.5, name  # on the ground, or on a rock
