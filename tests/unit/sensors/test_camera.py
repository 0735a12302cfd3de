"""Pictures and what is true of them: places, depth, both eyes, flow, labels, the Sun's flare."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from terrain_forge.base import DataError
from terrain_forge.model import (
    CameraSensor,
    Equidistant,
    FixedExposure,
    LensFlare,
    RadialTangential,
    StereoSensor,
)
from terrain_forge.scene import GROUND
from terrain_forge.sensors import Scenery, Setting, instrument_kinds, instruments_of, motion_of_path
from terrain_forge.sensors.channels import depth_file
from terrain_forge.sensors.flare import SunSeen, add_sun
from terrain_forge.sensors.instruments.camera import CameraFrames
from terrain_forge.sensors.instruments.stereo import StereoFrames
from terrain_forge.sensors.labels import CLASSES, Labels
from terrain_forge.sensors.lens import OPTICAL, lens_of, project, rays_of
from terrain_forge.sensors.picture import tracked
from tests.helpers import worlds
from tests.helpers.rovers import morpheus

_NUMBER = 61
_SIZE = {"width_px": 96, "height_px": 64}
_MAST = {"position_m": (0.3, 0.0, 0.9), "rpy_deg": (2.0, 20.0, -5.0), **_SIZE}
_BARREL = RadialTangential(k=(-0.17, 0.02, 1e-3, -2e-3))


@pytest.fixture(scope="module")
def setting():
    world = worlds.world(rover=morpheus())
    motion = motion_of_path(world.trajectories[0])
    with Scenery(world, motion) as scenery:
        yield Setting(world=world, motion=motion, scenery=scenery, gravity=3.711, seed=4)


def _image(content):
    """Of a PNG; those of 16 bits and three channels by OpenCV."""
    if content[24] == 16 and content[25] == 2:
        cv2 = pytest.importorskip("cv2")
        return cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED)[:, :, ::-1]
    return np.array(Image.open(io.BytesIO(content)))


def _array(content):
    return np.load(io.BytesIO(content))


def _points(camera, depth, number=_NUMBER):
    """Where pixels lie by their depth, the written calibration and the pose, shape [h, w, 3]."""
    lens, eye = camera.lens(camera.truth_style), camera.eye(camera.times[number] / 1e9)
    rays = rays_of(lens).astype(float)
    own = rays / rays[:, :, 2:] * depth[:, :, None]
    return eye.position[:, None] + np.einsum("hij,hwj->hwi", eye.rotation, own)


def _on_ground(setting, points):
    return np.abs(points[:, 2] - setting.world.ground.height_at(points[:, 0], points[:, 1]))


@pytest.mark.parametrize(
    "more",
    [
        {"distortion": _BARREL, "rolling_shutter_s": 0.05},
        {"distortion": Equidistant(k=(0.02, -0.001, 0.0, 0.0)), "horizontal_fov_deg": 110.0},
        {"distortion": _BARREL, "images": ("raw", "rectified")},
    ],
)
def test_depth_lies_on_the_ground(setting, more):
    sensor = CameraSensor(
        name="eye", channels=("depth", "class"), depth_factor=None, **_MAST, **more
    )
    camera = CameraFrames(sensor, setting)
    camera.check()
    files = camera.measure(_NUMBER)
    assert set(files) == {stream.name for stream in camera.streams()}
    classes, depth = _image(files["class"]), _array(files["depth"])
    for name, least in (("ground", 1000), ("rock", 50)):
        found = classes == CLASSES.index(name)
        assert np.count_nonzero(found) > least
        if name == "ground":
            assert _on_ground(setting, _points(camera, depth)[found]).max() < 1e-4
    assert np.array_equal(np.isinf(depth), classes == CLASSES.index("sky"))


@pytest.mark.slow
def test_any_picture_alone_is_that_of_the_whole(setting):
    sensor = StereoSensor(
        name="pair", channels=("depth", "instance", "flow", "disparity"), distortion=_BARREL,
        images=("raw", "rectified"), motion_blur=2, **_MAST,
    )  # fmt: skip
    whole, alone = StereoFrames(sensor, setting), StereoFrames(sensor, setting)
    wanted = [whole.measure(number) for number in (57, _NUMBER)][-1]
    assert alone.measure(_NUMBER) == wanted
    assert set(wanted) == {stream.name for stream in whole.streams()}


def test_both_eyes_agree_but_where_one_is_hidden(setting):
    channels = ("depth", "disparity", "instance")
    sensor = StereoSensor(
        name="pair", channels=channels, depth_factor=None, baseline_m=0.2, **_MAST
    )
    left, right = StereoFrames(sensor, setting).eyes
    files, others = left.measure(_NUMBER), right.measure(_NUMBER)
    depth, other = _array(files["depth"]), _array(others["depth"])
    disparity, hidden = _image(files["disparity"]) / 256.0, _image(files["occlusion"]) > 0
    f, *_ = left.calibration()["intrinsics"]
    near = np.isfinite(depth)
    assert np.allclose(disparity[near], f * 0.2 / depth[near], atol=1 / 512)
    rows, columns = np.nonzero(near & ~hidden)
    at = columns - f * 0.2 / depth[rows, columns]
    low = np.clip(np.floor(at).astype(int), 0, 94)
    z = depth[rows, columns]
    between = np.stack([other[rows, low], other[rows, low + 1]])
    slack = 0.02 * z + 0.1 * np.abs(np.diff(between, axis=0)[0])
    agree = (between.min(axis=0) - slack <= z) & (z <= between.max(axis=0) + slack)
    assert agree.mean() > 0.995
    # of hidden ones that lie within the other picture, the other sees something nearer
    rows, columns = np.nonzero(near & hidden)
    at = np.rint(columns - f * 0.2 / depth[rows, columns]).astype(int)
    inside = (at >= 1) & (at <= 94)
    rows, at, z = rows[inside], at[inside], depth[rows, columns][inside]
    nearest = np.min([other[rows, at + k] for k in (-1, 0, 1)], axis=0)
    assert np.count_nonzero(inside) > 5
    assert (nearest < z).mean() > 0.9


def test_eyes_roll_together(setting):
    """A pixel's place is looked for where the other eye is when it sees that row."""
    sensor = StereoSensor(
        name="pair", channels=("depth", "disparity"), depth_factor=None, baseline_m=0.2,
        rate_hz=1.0, rolling_shutter_s=0.8, **_MAST,
    )  # fmt: skip
    left, _ = StereoFrames(sensor, setting).eyes
    outside = 0
    for number in range(4, 12):
        files = left.measure(number)
        depth, hidden = _array(files["depth"]), _image(files["occlusion"]) > 0
        near = np.isfinite(depth)
        beside = np.arange(96) - left.calibration()["intrinsics"][0] * 0.2 / depth < -0.5
        assert not np.any(near & beside & ~hidden)
        outside += np.count_nonzero(near & beside)
    assert outside > 500


def test_eyes_that_see_the_sky_alone_miss_nothing(setting):
    sky = {**_MAST, "rpy_deg": (0.0, -60.0, 0.0)}
    for rolls in (0.0, 0.02):
        sensor = StereoSensor(
            name="pair", channels=("disparity",), baseline_m=0.2, rolling_shutter_s=rolls, **sky
        )
        files = StereoFrames(sensor, setting).eyes[0].measure(_NUMBER)
        assert not _image(files["occlusion"]).any()


def test_flow_leads_to_the_same_place_in_the_next_picture(setting):
    sensor = CameraSensor(
        name="eye", channels=("depth", "flow", "class"), depth_factor=None, rate_hz=2.0,
        distortion=_BARREL, **_MAST,
    )  # fmt: skip
    camera = CameraFrames(sensor, setting)
    number = 9
    files = camera.measure(number)
    flow = _image(files["flow"]).astype(float)
    known = (flow[:, :, 2] == 1) & (_image(files["class"]) != CLASSES.index("sky"))
    points = _points(camera, _array(files["depth"]), number)[known]
    then = camera.eye(camera.times[number + 1] / 1e9)
    position, rotation = then.middle
    pixels, seen = project(camera.lens("raw"), (points - position) @ rotation)
    rows, columns = np.nonzero(known)
    found = np.stack([columns, rows], -1) + (flow[known][:, :2] - 32768.0) / 64.0
    assert seen.all()
    assert np.abs(found - pixels).max() < 1 / 128 + 1e-3
    assert np.ptp(flow[known][:, 0]) > 64
    last = _image(camera.measure(len(camera.times) - 1)["flow"])
    assert not last.any()


def test_flow_of_a_rolling_shutter_is_at_the_time_of_the_place_in_the_row(setting):
    """Where rows are slow: a place lies between rows, and is seen between their times."""
    sensor = CameraSensor(
        name="eye", channels=("depth", "flow", "class"), depth_factor=None, rate_hz=2.0,
        rolling_shutter_s=0.4, **_MAST,
    )  # fmt: skip
    camera, number = CameraFrames(sensor, setting), 9
    files = camera.measure(number)
    flow = _image(files["flow"]).astype(float)
    known = (flow[:, :, 2] == 1) & (_image(files["class"]) != CLASSES.index("sky"))
    points = _points(camera, _array(files["depth"]), number)[known]
    middle, last = camera.times[number + 1] / 1e9, sensor.height_px - 1
    row = np.nonzero(known)[0].astype(float)
    for _ in range(40):
        state = camera.state(middle + 0.4 * (row / last - 0.5))
        turned = np.einsum("nij,ni->nj", state.rotation @ OPTICAL, points - state.position)
        pixels, seen = project(camera.lens("raw"), turned)
        row = np.clip(pixels[:, 1], 0.0, last)
    rows, columns = np.nonzero(known)
    found = np.stack([columns, rows], -1) + (flow[known][:, :2] - 32768.0) / 64.0
    assert seen.all()
    assert np.ptp(row) > 0.5 * last
    assert np.abs(found - pixels).max() < 1 / 128 + 1e-3


def test_labels_are_what_rays_meet_and_tracks_are_behind(setting):
    ahead = {"name": "eye", "channels": ("instance", "class", "depth"), "depth_factor": None}
    back = {"position_m": (-1.0, 0.0, 1.2), "rpy_deg": (0.0, 30.0, 180.0), **_SIZE}
    world = setting.world
    for more, tracks in ((_MAST, False), (back, True)):
        camera = CameraFrames(CameraSensor(**ahead, **more), setting)
        number = 150
        files = camera.measure(number)
        ids, classes = _image(files["instance"]).astype(int) - 1, _image(files["class"])
        assert set(ids[ids >= 0]) <= set(world.field.id.tolist())
        assert np.array_equal(ids >= 0, classes == CLASSES.index("rock"))
        eye = camera.eye(camera.times[number] / 1e9)
        rays = np.einsum("hij,hwj->hwi", eye.rotation, rays_of(camera.lens("raw")).astype(float))
        hits = setting.scenery.cast(
            np.tile(eye.position[0], (rays[..., 0].size, 1)), rays.reshape(-1, 3), eye.time
        )
        rocks = np.where(hits.rock >= 0, world.field.id[np.maximum(hits.rock, 0)], -1)
        assert (rocks.reshape(ids.shape) == ids).mean() > 0.999
        pressed = classes == CLASSES.index("track")
        assert (np.count_nonzero(pressed) > 50) == tracks
        if tracks:  # wheels stand at either side of where the rover came from
            places = _points(camera, _array(files["depth"]), number)[pressed][:, :2]
            way = setting.motion.base.samples[:, :2]
            away = np.linalg.norm(places[:, None] - way, axis=2).min(axis=1)
            gauge = np.abs(world.rover.wheel_centres[:, 1]).max()
            assert np.abs(away - gauge).max() < 0.5 * world.rover.wheels[0].width + 0.02


def test_tracks_begin_at_the_front_wheels(setting):
    labels, wheels = Labels(setting.scenery), setting.world.rover.wheel_centres
    along = np.array([0.05, 0.35, 0.55, -0.1])  # the front wheels stand at 0.42 m
    own = np.column_stack([along, np.full(4, wheels[:, 1].max()), np.zeros(4)])
    ground = np.full(4, GROUND, np.int32)

    def told(one, time):
        state = one.motion.base.at(np.array([time]))
        points = state.position + own @ state.rotation[0].T
        return [CLASSES[kind] for kind in labels.of(points, ground, tracked(one, time))]

    assert told(setting, 10.0) == ["track", "track", "ground", "track"]
    assert told(setting, 0.0) == ["ground"] * 4
    assert told(replace(setting, tracks=False), 10.0) == ["ground"] * 4


class _EvenScene:
    """Stands in for a world: the same radiance everywhere, or the time of the picture."""

    def __init__(self, see):
        self.see, self.times = see, []

    def __call__(self, setting, *, rays, time, colour, **_):
        from terrain_forge.sensors.picture import Exposure

        shape = rays.shape[:2]
        self.times.append(np.unique(time))
        value = np.full((*shape, 3 if colour else 1), self.see(float(np.mean(time))), np.float32)
        far = np.full(shape, np.inf, np.float32)
        return Exposure(
            radiance=value, depth=far, distance=far, instance=np.full(shape, -2, np.int32),
            normal=np.zeros((*shape, 3), np.float32), sunlit=np.zeros(shape, np.bool_),
        )  # fmt: skip


@pytest.fixture
def even(monkeypatch):
    def stand_in(see):
        scene = _EvenScene(see)
        monkeypatch.setattr("terrain_forge.sensors.instruments.camera.take_exposure", scene)
        return scene

    return stand_in


def test_noise_of_the_eyes_has_nothing_in_common(setting, even):
    even(lambda _: 20.0)
    sensor = StereoSensor(
        name="pair", exposure=FixedExposure(time_s=2e-4), flare=None, vignetting=None, bits=12,
        gain_mismatch=0.05, width_px=200, height_px=160,
    )  # fmt: skip
    left, right = (eye.picture(3).astype(float) for eye in StereoFrames(sensor, setting).eyes)
    assert abs(np.corrcoef(left.ravel(), right.ravel())[0, 1]) < 3.3 / np.sqrt(left.size)
    assert right.mean() / left.mean() == pytest.approx(1.05, abs=0.002)


def test_a_stamp_is_the_middle_of_what_is_averaged(setting, even):
    """Of a light that grows with time, the mean over the exposure is that at its middle."""
    scene = even(lambda time: 10.0 * time)
    sensor = CameraSensor(
        name="eye", exposure=FixedExposure(time_s=0.06), motion_blur=4, f_number=60.0, flare=None,
        vignetting=None, bits=16, **_SIZE,
    )  # fmt: skip
    camera = CameraFrames(sensor, setting)
    number, per = 60, camera.calibration()["electronics"]
    assert camera.times[number] == 4_000_000_000
    found = camera.picture(number).mean() / per["values_per_electron_at_gain_1"]
    wanted = 40.0 * 0.06 * per["electrons_per_radiance_and_second"]
    assert found == pytest.approx(wanted, rel=0.002)
    moments = np.concatenate(scene.times)
    assert np.allclose(moments[:4], 4.0 + 0.06 * np.array([-0.375, -0.125, 0.125, 0.375]))
    for number in (-1, len(camera.times), 6.0, True, "six", None):
        for look in (camera.measure, camera.picture):
            with pytest.raises(DataError, match=f"eye has no measurement {number}: 0 to "):
                look(number)
    rolling = CameraSensor(name="eye", rolling_shutter_s=0.05, **_SIZE)
    times = CameraFrames(rolling, setting).eye(4.0).times
    assert times[[0, -1]] == pytest.approx([3.975, 4.025])


def test_the_left_eye_meters_for_both(setting, even):
    even(lambda time: 5.0 + time)
    left, right = StereoFrames(StereoSensor(name="pair", **_MAST), setting).eyes
    assert [left.shutter(n) for n in (0, 40)] == [right.shutter(n) for n in (0, 40)]
    assert left.shutter(0) != left.shutter(40)
    told = right.tables([40, 0])["exposure"]
    rows = list(zip(told["exposure [s]"], told["gain []"], strict=True))
    assert rows == [left.shutter(40), left.shutter(0)]


def test_a_pair_is_recorded_as_two_cameras_in_the_order_of_the_rig(setting):
    rig = (StereoSensor(name="pair", **_MAST), CameraSensor(name="eye", **_MAST))
    world = setting.world.replace(rover=setting.world.rover.replace(sensors=rig))
    made = instruments_of(Setting(
        world=world, motion=setting.motion, scenery=setting.scenery, gravity=1.0, seed=1
    ))  # fmt: skip
    assert [one.sensor.name for one in made] == ["pair_left", "pair_right", "eye"]
    assert {one.folder for one in made} == {"cam"}
    assert {"camera", "stereo"} <= set(instrument_kinds())
    left, right = (one.state(np.array([5.0])) for one in made[:2])
    apart = (right.position - left.position)[0]
    assert np.allclose(left.rotation[0].T @ apart, [0.0, -0.12, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("more", "what"),
    [
        ({"exposure": FixedExposure(time_s=0.1)}, "exposure of up to 0.1 s .* rate_hz 15"),
        ({"rolling_shutter_s": 0.07}, "rolling_shutter_s 0.07"),
        ({"horizontal_fov_deg": 175.0}, "a pinhole shows 170 at most"),
        ({"channels": ("disparity",)}, "disparity is a stereo pair's"),
    ],
)
def test_what_cannot_be_taken_is_refused(more, what):
    with pytest.raises(ValueError, match=what):
        CameraSensor(name="eye", **more)


_FLARE = LensFlare()


def _lit(towards, *, flare=_FLARE, part=1.0, key=3, size=(160, 120)):
    sensor = CameraSensor(name="eye", width_px=size[0], height_px=size[1], horizontal_fov_deg=60.0)
    lens = lens_of(sensor, rectified=False)
    towards = np.array(towards) / np.linalg.norm(towards)
    light = np.zeros((size[1], size[0], 1), np.float32)
    sky = np.ones(light.shape[:2], np.bool_)
    add_sun(light, sky, lens, SunSeen(towards, 0.005, 500.0, part), flare, np.uint64(key))
    return lens, light[:, :, 0]


def test_the_suns_disc_is_where_the_sun_is_and_as_bright():
    lens, light = _lit((0.2, -0.1, 1.0), flare=None, size=(640, 480))
    (pixel,), _ = project(lens, np.array([[0.2, -0.1, 1.0]]))
    rows, columns = np.nonzero(light > 0.0)
    assert [columns.mean(), rows.mean()] == pytest.approx(pixel, abs=0.6)
    solid = rays_of(lens)[:, :, 2].astype(float) ** 3 / lens.focal[0] ** 2
    assert (light * solid).sum() == pytest.approx(500.0, rel=0.1)


def test_the_veil_has_its_part_of_the_light_and_a_hidden_sun_has_none():
    """Over a hemisphere, by a fisheye that sees all of it."""
    bent = Equidistant()
    sensor = CameraSensor(
        name="eye", width_px=400, height_px=400, horizontal_fov_deg=180.0, distortion=bent
    )
    lens, flare = lens_of(sensor, rectified=False), LensFlare(veil=0.1, star=0.0, ghosts=0)
    light = np.zeros((400, 400, 1), np.float32)
    sky = np.zeros((400, 400), np.bool_)
    sun = SunSeen(np.array([0.0, 0.0, 1.0]), 0.005, 500.0, 1.0)
    add_sun(light, sky, lens, sun, flare, np.uint64(1))
    rays = rays_of(lens).astype(float)
    angle = np.arctan2(np.hypot(rays[:, :, 0], rays[:, :, 1]), rays[:, :, 2])
    solid = np.where(angle < 0.5 * np.pi, np.sin(angle) / angle / lens.focal[0] ** 2, 0.0)
    assert (light[:, :, 0] * solid).sum() == pytest.approx(0.1 * 500.0, rel=0.01)
    for towards, part in (((0.0, 0.0, 1.0), 0.0), ((0.1, 0.0, -1.0), 1.0)):
        assert not _lit(towards, part=part)[1].any()


def test_a_fisheye_sees_the_sun_beside_and_behind_itself():
    """Its picture of 220° shows the disc 100° off the axis; what is behind the lens gives none."""
    sensor = CameraSensor(
        name="eye", width_px=400, height_px=400, horizontal_fov_deg=220.0, distortion=Equidistant()
    )
    lens, lit = lens_of(sensor, rectified=False), {}
    sky = np.ones((400, 400), np.bool_)
    for degrees in (60, 89, 91, 100, 180):
        angle, light = np.radians(degrees), np.zeros((400, 400, 1), np.float32)
        towards = np.array([np.sin(angle), 0.0, np.cos(angle)])
        add_sun(light, sky, lens, SunSeen(towards, 0.01, 500.0, 1.0), _FLARE, np.uint64(3))
        lit[degrees] = light[:, :, 0]
        if degrees < 110:
            row, column = np.unravel_index(light.argmax(), (400, 400))
            assert np.hypot(row - 199.5, column - 199.5 - angle * lens.focal[0]) < 2.5
            assert light.max() == pytest.approx(500.0 / (np.pi * 0.01**2), rel=0.05)
    rectified, light = lens_of(sensor, rectified=True), np.zeros((400, 400, 1), np.float32)
    sun = SunSeen(np.array([0.1, 0.0, -0.1]), 0.01, 500.0, 1.0)
    add_sun(light, sky, rectified, sun, _FLARE, np.uint64(3), glass=lens)
    assert light.any()  # stray light comes through the same glass
    veil = [lit[degrees][:, :100].mean() for degrees in (89, 91)]
    assert 0.9 * veil[0] < veil[1] < veil[0]
    assert not lit[180].any()


def test_a_picture_has_the_sun_beside_a_fisheye(setting):
    """It looks away from the Sun, which is 100° off its axis."""
    sun = np.asarray(setting.world.lighting.towards_sun)
    frame = setting.motion.base.at(np.array([_NUMBER / 15.0])).rotation[0]
    east, north, up = frame.T @ sun
    yaw = np.degrees(np.arctan2(-north, -east))
    pitch = 80.0 - np.degrees(np.arctan2(up, np.hypot(east, north)))
    sensor = CameraSensor(
        name="eye", width_px=96, height_px=96, horizontal_fov_deg=230.0, flare=None,
        distortion=Equidistant(), position_m=(0.3, 0.0, 2.5), rpy_deg=(0.0, -pitch, yaw),
        exposure=FixedExposure(time_s=1e-7), psf_px=0.0,
    )  # fmt: skip
    camera = CameraFrames(sensor, setting)
    _, rotation = camera.eye(_NUMBER / 15.0).middle
    towards = sun @ rotation
    assert np.degrees(np.arccos(towards[2])) == pytest.approx(100.0, abs=0.5)
    picture, ((place,), _) = camera.picture(_NUMBER), project(camera.lens("raw"), towards[None])
    row, column = np.unravel_index(picture.argmax(), picture.shape)
    assert picture.max() > 20 * np.median(picture)
    assert [column, row] == pytest.approx(place, abs=1.0)


def test_ghosts_lie_on_the_line_through_sun_and_middle_each_camera_its_own():
    only = LensFlare(veil=0.0, star=0.0)
    lens, light = _lit((0.3, -0.2, 1.0), flare=only)
    light[np.hypot(*np.indices(light.shape) - np.array([[[30]], [[120]]])) < 4] = 0.0
    rows, columns = np.nonzero(light > 0.1 * light.max())
    across, down = columns - lens.centre[0], rows - lens.centre[1]
    aside = (0.2 * across + 0.3 * down) / np.hypot(0.3, 0.2)
    weight = light[rows, columns]
    assert abs((aside * weight).sum() / weight.sum()) < 2.0
    assert not np.array_equal(light, _lit((0.3, -0.2, 1.0), flare=only, key=4)[1])


def test_depth_of_16_bits_has_nothing_behind_the_plane_of_a_fisheye():
    depth = np.array([[-1.5, -1e-4, 0.0, 2.0, 65.535, 66.0, np.inf]], np.float32)
    seen = np.asarray(Image.open(io.BytesIO(depth_file(depth, 1000.0))))
    assert seen.tolist() == [[0, 0, 0, 2000, 65535, 0, 0]]
    np.testing.assert_array_equal(np.load(io.BytesIO(depth_file(depth, None))), depth)
