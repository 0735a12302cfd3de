"""Pictures are exact in place, hang on nothing but the world, and show what is there by then."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from terrain_forge.base import compass_to_direction
from terrain_forge.model import Heightfield, Lighting, Mesh
from terrain_forge.scene import (
    GROUND,
    MISSED,
    Instances,
    RayScene,
    Subject,
    look,
    prepare_stage,
)
from terrain_forge.sensors import Scenery, Setting, motion_of_path, take_exposure, travelled
from tests.helpers import worlds

_WIDTH, _HEIGHT = 96, 64
_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""From the optical frame to one that looks ahead, left, up."""
_LIGHT = Lighting(sun_azimuth=4.3, sun_elevation=0.5, irradiance=586.2, sky_rgb=(0.0, 0.0, 0.0))


def _rays(times=1, *, width=_WIDTH, height=_HEIGHT, focal=90.0, bend=0.0):
    """Rays through a lens, `times` as many each way; `bend` distorts it."""
    x = (np.arange(width * times) + 0.5) / times - 0.5 * width
    y = (np.arange(height * times) + 0.5) / times - 0.5 * height
    x, y = np.broadcast_arrays(x[None, :] / focal, y[:, None] / focal)
    farther = 1.0 + bend * (x * x + y * y)
    rays = np.stack([x * farther, y * farther, np.ones_like(x)], axis=-1)
    return (rays / np.linalg.norm(rays, axis=-1, keepdims=True)).astype(np.float32)


def _turned(yaw, pitch):
    """From the optical frame to the world of a camera that looks down by `pitch`."""
    ahead = np.array([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), -np.sin(pitch)])
    left = np.array([-np.sin(yaw), np.cos(yaw), 0.0])
    return np.stack([ahead, left, np.cross(ahead, left)], axis=-1) @ _OPTICAL


@pytest.fixture(scope="module")
def setting():
    world = worlds.world()
    motion = motion_of_path(world.trajectories[0])
    with Scenery(world, motion) as scenery:
        yield Setting(world=world, motion=motion, scenery=scenery, gravity=3.7, seed=1)


@pytest.fixture(scope="module")
def pose(setting):
    state = setting.motion.base.at(6.0)
    return {
        "position": state.position[0] + [0.0, 0.0, 1.1],
        "rotation": _turned(np.arctan2(*state.rotation[0, [1, 0], 0]), 0.35),
        "time": 6.0,
    }


@pytest.fixture(scope="module")
def exposure(setting, pose):
    return take_exposure(setting, rays=_rays(), **pose, tracks_behind=None)


@pytest.fixture(scope="module")
def ball():
    """A white ball on black ground, and what light it is in."""
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=0.3)
    subject = Subject(
        ground=Heightfield(elevation=np.zeros((41, 41)), spacing=0.5, origin=(-10.0, -10.0)),
        ground_rgb=np.zeros((41, 41, 3), np.uint8),
        instances=Instances(
            meshes=(Mesh(vertices=mesh.vertices, faces=mesh.faces),),
            mesh=np.zeros(1, np.int32),
            position=np.array([[2.0, 0.3, 0.2]]),
            rotation=np.eye(3)[None],
            scale=np.ones(1),
            grain=np.full(1, 1e-6),
            rgb=np.ones((1, 3)),
        ),
        lighting=_LIGHT,
        sun_diameter=0.006,
        seed=3,
    )
    with RayScene(subject) as scene:
        yield scene, prepare_stage(scene, _LIGHT, 1)


def _centroid(image):
    weight = image / image.sum()
    return (np.indices(image.shape) + 0.5).reshape(2, -1) @ weight.ravel()


@pytest.mark.parametrize("yaw", [0.1, 0.117, 0.1234, 0.3, -0.1])
@pytest.mark.parametrize("bend", [0.0, -0.2])
def test_a_bright_ball_is_where_the_lens_puts_it(ball, yaw, bend):
    scene, stage = ball
    place, turn = np.tile([0.0, 0.0, 1.0], (400, 1)), np.tile(_turned(yaw, 0.4), (400, 1, 1))

    def picture(times):
        rays = _rays(times, bend=bend)
        height = len(rays)
        seen = look(scene, stage, rays=rays, position=place[:height], rotation=turn[:height])
        return seen.radiance[..., 0].astype(np.float64), seen.instance == 0

    image, _ = picture(1)
    fine, mask = picture(6)
    fine = fine.reshape(_HEIGHT, 6, _WIDTH, 6).mean(axis=(1, 3))
    assert mask.sum() > 36 * 100
    assert _centroid(image) == pytest.approx(_centroid(fine), abs=0.03)
    assert np.abs(image - fine).max() < 0.25 * fine.max()


def test_depth_leads_to_the_ground(setting, pose, exposure):
    on_ground = exposure.instance == GROUND
    rays = _rays()[on_ground].astype(np.float64)
    scale = exposure.depth[on_ground] / rays[:, 2]
    found = pose["position"] + (rays * scale[:, None]) @ pose["rotation"].T
    height = setting.world.ground.height_at(found[:, 0], found[:, 1])
    assert on_ground.mean() > 0.3
    assert found[:, 2] == pytest.approx(height, abs=2e-5)
    assert exposure.distance[on_ground] == pytest.approx(scale, rel=1e-6)


def test_ids_and_normals_are_those_of_single_rays(setting, pose, exposure):
    rays = _rays().reshape(-1, 3) @ pose["rotation"].T
    hits = setting.scenery.scene.cast(pose["position"], rays)
    assert np.array_equal(exposure.instance.ravel(), hits.rock)
    assert (hits.rock >= 0).sum() > 50
    seen = hits.rock != MISSED
    agree = (exposure.normal.reshape(-1, 3)[seen] * hits.normal[seen]).sum(axis=-1)
    assert np.quantile(agree, 0.01) > 0.9
    assert np.array_equal(np.isinf(exposure.depth.ravel()), ~seen)


def test_sunlit_is_what_sees_the_sun(setting, pose, exposure):
    scene = setting.scenery.scene
    rays = _rays().reshape(-1, 3) @ pose["rotation"].T
    hits = scene.cast(pose["position"], rays)
    seen = hits.rock >= 0
    place = pose["position"] + rays[seen] * hits.distance[seen, None]
    sun = setting.world.lighting.towards_sun
    free = scene.cast(place + 2e-3 * hits.normal[seen], sun).rock == MISSED
    free &= hits.normal[seen] @ sun > 0.0
    assert (free == exposure.sunlit.ravel()[seen]).mean() > 0.98
    assert 0.05 < free.mean() < 0.95


def test_nothing_hangs_on_the_screen(setting, pose, exposure):
    part = take_exposure(setting, rays=_rays()[7:, 5:], **pose, tracks_behind=None)
    inside = np.s_[1:, 1:]
    assert np.array_equal(part.instance, exposure.instance[7:, 5:])
    same = part.radiance[inside] == pytest.approx(exposure.radiance[7:, 5:][inside], rel=1e-5)
    assert same


def test_a_wide_penumbra_has_no_steps(ball):
    """The shadow of a wall 2 m high under a Sun 17° wide, straight down the picture."""
    light = _LIGHT.replace(sun_azimuth=1.5 * np.pi)
    elevation = np.zeros((41, 41))
    elevation[:, 30:] = 2.0
    subject = Subject(
        ground=Heightfield(elevation=elevation[:, ::-1], spacing=0.5, origin=(-10.0, -10.0)),
        ground_rgb=np.full((41, 41, 3), 150, np.uint8),
        instances=ball[0].subject.instances,
        lighting=light,
        sun_diameter=0.3,
        seed=3,
    )
    place = np.tile([0.0, 0.0, 6.0], (_HEIGHT, 1))
    down = np.tile(np.diag([1.0, -1.0, -1.0]), (_HEIGHT, 1, 1))
    with RayScene(subject) as scene:
        stage = prepare_stage(scene, light, 1)
        seen = look(scene, stage, rays=_rays(), position=place, rotation=down)
    shone, direct = seen.radiance[..., 0], seen.direct[..., 0]
    share = ((shone - shone[:, :8].mean()) / direct)[:, 14:48]
    assert share[:, 0].mean() < 0.1
    assert share[:, -1].mean() > 0.9
    assert np.diff(share.mean(axis=0)).max() < 0.07
    assert share.std(axis=0).max() < 0.15


def test_texture_stays_where_it_is_while_the_camera_moves(ball):
    scene, _ = ball
    bright = Subject(
        **{
            name: getattr(scene.subject, name)
            for name in ("ground", "instances", "lighting", "sun_diameter", "seed")
        },
        ground_rgb=np.full((41, 41, 3), 150, np.uint8),
    )
    focal, height = 400.0, 2.0
    pictures = []
    with RayScene(bright) as lit:
        stage = prepare_stage(lit, _LIGHT, 1)
        for step in (0, 12):
            place = np.tile([-4.0 + step * height / focal, -3.0, height], (_HEIGHT, 1))
            down = np.tile(np.diag([1.0, -1.0, -1.0]), (_HEIGHT, 1, 1))
            seen = look(lit, stage, rays=_rays(focal=focal), position=place, rotation=down)
            pictures.append(seen.radiance[..., 0])
    first, moved = pictures[0][:, 12:], pictures[1][:, :-12]
    assert np.corrcoef(first.ravel(), moved.ravel())[0, 1] > 0.99
    assert np.corrcoef(first.ravel(), pictures[1][:, 12:].ravel())[0, 1] < 0.5


def test_threads_and_repetition_change_nothing(setting, pose, exposure, use_threads):
    use_threads(3)
    again = take_exposure(setting, rays=_rays(), **pose, tracks_behind=None)
    for name in ("radiance", "depth", "instance", "normal", "sunlit"):
        assert np.array_equal(getattr(again, name), getattr(exposure, name))


def test_a_rolling_shutter_sees_each_row_from_its_own_place(setting, pose, exposure):
    position = np.tile(pose["position"], (_HEIGHT, 1))
    position[:, 0] += 0.002 * np.arange(_HEIGHT)
    rolling = take_exposure(
        setting,
        rays=_rays(),
        position=position,
        rotation=pose["rotation"],
        time=np.full(_HEIGHT, pose["time"]),
    )
    later = take_exposure(setting, rays=_rays(), **(pose | {"position": position[40]}))
    for name in ("depth", "instance", "sunlit"):
        assert np.array_equal(getattr(rolling, name)[40], getattr(later, name)[40])
        assert np.array_equal(getattr(rolling, name)[0], getattr(exposure, name)[0])
    assert not np.array_equal(rolling.depth[40], exposure.depth[40])


def test_only_tracks_that_are_made_already_are_seen(setting):
    done = float(travelled(setting.motion, 6.0))
    state = setting.motion.base.at([6.0, 4.0, 8.0])
    middle = state.position[0] + [0.0, 0.0, 4.0]
    pose = {"position": middle, "rotation": np.diag([1.0, -1.0, -1.0]), "time": 6.0}
    rays = _rays(focal=40.0)
    bare = take_exposure(setting, rays=rays, **pose)
    made = take_exposure(setting, rays=rays, **pose, tracks_behind=done)
    changed = np.abs(made.radiance - bare.radiance)[..., 0] > 1e-3 * bare.radiance.mean()
    assert changed.sum() > 30
    place = middle + (rays * made.distance[..., None])[changed] @ pose["rotation"].T
    ahead = state.rotation[0, :, 0]
    assert ((place - state.position[0]) @ ahead).max() < 0.15
    assert done == pytest.approx(np.hypot(*np.diff(setting.motion.base.at(
        np.linspace(0.0, 6.0, 500)).position[:, :2], axis=0).T).sum(), rel=1e-3)  # fmt: skip


def test_radiance_is_that_of_the_ground_in_the_sun(setting, pose):
    """Level ground in its own colour has the radiance of a Lambert surface."""
    exposure = take_exposure(setting, rays=_rays(), **pose, colour=True)
    lighting, albedo = setting.world.lighting, np.array([166, 110, 74]) / 255.0
    linear = np.where(albedo > 0.04045, ((albedo + 0.055) / 1.055) ** 2.4, albedo / 12.92)
    white = lighting.irradiance * compass_to_direction(0.0, lighting.sun_elevation)[2] / np.pi
    open_ground = (exposure.instance == GROUND) & exposure.sunlit
    found = exposure.radiance[open_ground].mean(axis=0) / (white * linear)
    assert found == pytest.approx(1.0, abs=0.35)
    grey = take_exposure(setting, rays=_rays(), **pose)
    assert grey.radiance.shape[2] == 1
    assert grey.radiance[open_ground] == pytest.approx(
        exposure.radiance[open_ground].mean(axis=-1, keepdims=True), rel=0.05
    )
