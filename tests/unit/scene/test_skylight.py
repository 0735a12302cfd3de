"""How much of the sky nodes see: past a ball, amid a rock, and for one camera alone."""

import numpy as np
import pytest

from terrain_forge.model import Heightfield
from terrain_forge.scene import open_scene
from terrain_forge.scene.camera import map_camera, pinhole_camera
from terrain_forge.scene.skylight import sky_shares
from tests.helpers import worlds


@pytest.fixture(scope="module")
def scene():
    """Level ground of 129 x 129 nodes with rocks on it, one of them large."""
    world = worlds.world(rocks=9)
    ground = Heightfield(elevation=np.zeros((129, 129)), spacing=0.15, origin=(-9.6, -9.6))
    place = world.field.position.copy()
    place[:, 2] = 0.2
    place[0] = 3.0, 2.0, 0.3
    size = np.append(2.5, world.field.scale[1:])
    field = world.field.replace(position=place, scale=size, diameter=size)
    look = world.appearance.replace(ground_rgb=np.full((129, 129, 3), 107))
    with open_scene(worlds.on_ground(world, ground, field=field, appearance=look)) as scene:
        yield scene


@pytest.fixture(scope="module")
def shares(scene):
    return sky_shares(scene)


def test_open_ground_sees_all_and_a_rock_s_foot_less(shares):
    assert np.median(shares) > 0.99
    assert shares.min() < 0.5


def test_a_rock_s_top_is_no_hole_in_the_ground(scene, shares):
    row, column = (round((p + 9.6) / 0.15) for p in (2.0, 3.0))
    assert shares[row, column] == 1.0
    assert shares[row - 12 : row + 13, column - 12 : column + 13].min() < 0.95


def test_one_camera_sees_the_same_close_by_and_nearly_so_far_away(scene, shares):
    camera = pinhole_camera(
        position=np.array([-9.0, -9.0, 2.0]), yaw=0.8, pitch=0.3, field_of_view=1.2,
        width=320, height=240,
    )  # fmt: skip
    alone = sky_shares(scene, camera)
    away = np.hypot(*np.meshgrid(scene.subject.ground.east + 9.0, scene.subject.ground.north + 9.0))
    seen = np.add.outer(scene.subject.ground.north, scene.subject.ground.east) > -18.0
    assert np.abs(alone - shares)[(away < 2.0) & seen].max() < 1e-6
    assert 0.0 < np.abs(alone - shares).mean() < 0.03


def test_a_map_of_coarse_pixels_looks_at_fewer_nodes(scene, shares):
    fine, coarse = (
        sky_shares(scene, map_camera(middle=(0, 0), top=50, pixel=pixel, width=90, height=90))
        for pixel in (0.001, 0.5)
    )
    assert np.array_equal(fine, shares)
    assert 0.0 < np.abs(coarse - shares).mean() < 0.02
