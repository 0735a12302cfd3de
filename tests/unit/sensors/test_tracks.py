"""Wheel tracks of a rover that comes back beside or across its own way: those of each pass."""

from __future__ import annotations

import numpy as np
import pytest

from terrain_forge.scene import GROUND
from terrain_forge.sensors import Curve, Motion, Scenery, Setting, take_exposure
from terrain_forge.sensors.labels import CLASSES, Labels
from tests.helpers import worlds
from tests.helpers.rovers import morpheus

_ASIDE = 0.3
"""Distance of the lanes [m]."""
_LANES = 3


@pytest.fixture(scope="module")
def setting():
    """The rover goes east, turns, comes back 0.3 m aside, turns, and goes east again."""
    world = worlds.world(rocks=0, rover=morpheus())
    x, turn = np.linspace(-4.0, 4.0, 161), np.linspace(0.0, np.pi, 30)[1:-1]
    places, headings = [], []
    for lane in range(_LANES):
        way = 1 if lane % 2 == 0 else -1
        places.append(np.column_stack([way * x, np.full(len(x), _ASIDE * lane)]))
        headings.append(np.full(len(x), 0.0 if way > 0 else np.pi))
        bend = np.column_stack([way * np.sin(turn), 1.0 - np.cos(turn)]) * 0.5 * _ASIDE
        places.append(bend + np.array([way * 4.0, _ASIDE * lane]))
        headings.append(turn if way > 0 else np.pi - turn)
    plan = np.concatenate(places[:-1])
    samples = np.zeros((len(plan), 6))
    samples[:, :2], samples[:, 5] = plan, np.concatenate(headings[:-1])
    samples[:, 2] = world.ground.height_at(plan[:, 0], plan[:, 1])
    motion = Motion(path="lanes", source="path", base=Curve(begin=0.0, step=0.3, samples=samples))
    with Scenery(world, motion) as scenery:
        yield Setting(world=world, motion=motion, scenery=scenery, gravity=3.711, seed=1)


def _strips(setting, x=0.0):
    """Places under the wheels of each lane as the rover passes x, shape [lanes, 2, 3]."""
    gauge = np.abs(setting.world.rover.wheel_centres[:, 1]).max()
    y = _ASIDE * np.arange(_LANES)[:, None] + gauge * np.array([-1.0, 1.0])
    east = np.full(y.shape, x)
    return np.stack([east, y, setting.world.ground.height_at(east, y)], axis=-1)


@pytest.mark.parametrize("done", range(_LANES + 1))
def test_the_wheels_of_each_pass_leave_a_track(setting, done):
    labels, places = Labels(setting.scenery), _strips(setting).reshape(-1, 3)
    lane = 8.0 + 0.5 * np.pi * _ASIDE
    kinds = labels.of(places, np.full(len(places), GROUND, np.int32), done * lane - 1.0)
    told = (kinds == CLASSES.index("track")).reshape(_LANES, 2)
    assert told[:done].all()
    assert not told[done:].any()


def test_pictures_show_the_tracks_of_each_pass(setting):
    """From above: a strip that was pressed is not as bright as before."""
    middle = np.array([0.0, _ASIDE, worlds.hill(0.0, _ASIDE) + 1.5])
    rays = np.stack(np.meshgrid(np.linspace(-0.3, 0.3, 60), np.linspace(-0.6, 0.6, 240)), axis=-1)
    rays = np.concatenate([rays, np.ones((*rays.shape[:2], 1))], axis=-1)
    rays = (rays / np.linalg.norm(rays, axis=-1, keepdims=True)).astype(np.float32)
    pose = {"rays": rays, "position": middle, "rotation": np.diag([1.0, -1.0, -1.0]), "time": 1.0}
    bare, made = (take_exposure(setting, **pose, tracks_behind=b) for b in (None, 1e3))
    north = middle[1] - rays[..., 1] * made.distance
    changed = (made.radiance != bare.radiance)[..., 0]
    for y in _strips(setting)[..., 1].ravel():
        strip = np.abs(north - y) < 0.02
        assert changed[strip].mean() > 0.8
    assert not changed[np.abs(north - 0.07) < 0.02].any()  # between two strips
