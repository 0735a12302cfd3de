"""The USD export: light and sky, the rover that replays its path, and its sensors."""

from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, UsdLux, UsdPhysics, UsdRender
from terrain_forge.exporters.usd import Options, export

from terrain_forge.base import matrix_from_quaternion
from terrain_forge.model import MARS, simple_sensors
from tests.helpers.rovers import morpheus
from tests.helpers.usd_stages import labelled


def test_gravity_and_sun(small_world, stage):
    scenes = [p for p in stage.Traverse() if p.IsA(UsdPhysics.Scene)]
    assert len(scenes) == 1
    scene = UsdPhysics.Scene(scenes[0])
    assert scene.GetGravityMagnitudeAttr().Get() == pytest.approx(small_world.site.body.gravity)
    assert scene.GetGravityDirectionAttr().Get() == Gf.Vec3f(0, 0, -1)
    sun = UsdLux.DistantLight(stage.GetPrimAtPath("/World/Sun"))
    matrix = UsdGeom.XformCache().GetLocalToWorldTransform(sun.GetPrim())
    shines = matrix.TransformDir(Gf.Vec3d(0, 0, -1))
    assert np.allclose(shines, -small_world.lighting.towards_sun, atol=1e-6)


def shining(light):
    """How bright a light is."""
    return light.GetIntensityAttr().Get() * 2.0 ** light.GetExposureAttr().Get()


@pytest.mark.parametrize("lights", ["display", "physical"])
def test_lights_are_for_display_or_as_in_nature(small_world, tmp_path, lights):
    """For display level white ground is less than white where a renderer takes light as it is."""
    told = export(small_world, tmp_path, options=Options(lights=lights)).losses
    stage = Usd.Stage.Open(str(tmp_path / "world.usda"))
    sun = UsdLux.DistantLight(stage.GetPrimAtPath("/World/Sun")).GetIntensityAttr().Get()
    sky = UsdLux.DomeLight(stage.GetPrimAtPath("/World/Sky"))
    light = small_world.lighting
    if lights == "physical":
        assert sun == pytest.approx(light.irradiance)
        assert any("W/m²" in loss for loss in told)
    else:
        level = sun * light.towards_sun[2] / np.pi
        level += shining(sky) * np.mean(light.sky_rgb)
        assert 0.4 < level < 1.0


def test_the_sky_lights_the_world(small_world, stage):
    sky = UsdLux.DomeLight(stage.GetPrimAtPath("/World/Sky"))
    assert np.allclose(sky.GetColorAttr().Get(), small_world.lighting.sky_rgb)
    assert 0 < shining(sky) < small_world.lighting.irradiance


def brightest(sky, rows, columns):
    """A dome's image, the sum of its colours, and the direction of its brightest pixel."""
    file = Path(sky.GetTextureFileAttr().Get().resolvedPath).read_bytes()
    header, pixels = file.split(f"-Y {rows} +X {columns}\n".encode(), 1)
    assert header.startswith(b"#?RADIANCE")
    image = np.frombuffer(pixels, np.uint8).reshape(rows, columns, 4).astype(float)
    bright = image[..., :3].sum(axis=-1) * 2.0 ** (image[..., 3] - 136.0)
    row, column = np.unravel_index(bright.argmax(), bright.shape)
    # OpenEXR's map of longitudes, which USD takes: the middle on z, to its right towards -x.
    lat, lon = np.pi * (0.5 - (row + 0.5) / rows), np.pi * (1.0 - 2.0 * (column + 0.5) / columns)
    own = Gf.Vec3d(np.cos(lat) * np.sin(lon), np.sin(lat), np.cos(lat) * np.cos(lon))
    return bright, UsdGeom.Xformable(sky).GetLocalTransformation().TransformDir(own)


def test_a_dusty_sky_is_an_image_with_its_glow_where_the_sun_is(small_world, tmp_path):
    light = small_world.lighting.replace(
        dust=MARS.dust, sun_azimuth=np.radians(60.0), sun_elevation=np.radians(20.0)
    )
    export(small_world.replace(lighting=light), tmp_path, options=Options())
    stage = Usd.Stage.Open(str(tmp_path / "world.usda"))
    sky = UsdLux.DomeLight(stage.GetPrimAtPath("/World/Sky"))
    _, towards = brightest(sky, 256, 512)
    assert np.dot(towards, light.towards_sun) > np.cos(np.radians(1.5))


def test_a_black_sky_is_an_image_with_the_earth_and_stars(small_world, tmp_path):
    earth = np.array([-0.5, 0.6, 0.62]) / np.linalg.norm([-0.5, 0.6, 0.62])
    light = small_world.lighting.replace(
        sky_rgb=(0.0, 0.0, 0.0), earth=tuple(earth), earth_diameter=0.033,
        earth_sun=tuple(-earth), celestial=np.eye(3), star_gain=10.0,
    )  # fmt: skip
    export(small_world.replace(lighting=light), tmp_path, options=Options())
    stage = Usd.Stage.Open(str(tmp_path / "world.usda"))
    sky = UsdLux.DomeLight(stage.GetPrimAtPath("/World/Sky"))
    image, towards = brightest(sky, 512, 1024)
    assert np.dot(towards, earth) > np.cos(0.0165)
    # As bright as the Sun makes it, from all that is on its disc: 2/3 of its albedo over π.
    level = shining(sky)
    sun = UsdLux.DistantLight(stage.GetPrimAtPath("/World/Sun")).GetIntensityAttr().Get()
    up = np.pi * (0.5 - (np.arange(512) + 0.5) / 512)
    received = level * (image * np.cos(up)[:, None]).sum() * (np.pi / 512) ** 2
    assert received / sun == pytest.approx(0.95 * 2.0 / 3.0 * 0.0165**2, rel=0.1)
    assert 500 < (image > 0.0).sum() < 1800
    # Sirius, in the frame that this light has: a third of that image's longitudes from the north.
    ra, dec = np.radians((101.287, -16.716))
    east, north = np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra)
    column = int(np.arctan2(east, north) % (2 * np.pi) / np.pi * 512)
    assert image[int((0.5 - dec / np.pi) * 512), column] > 0.0


@pytest.mark.parametrize(("poses", "rate"), [(12, 24), (10, 10)])
def test_the_replay_is_as_long_as_the_path(small_world, tmp_path, poses, rate):
    """At 24 time codes a second, as programs play, where each pose then falls on a whole one."""
    (path,) = small_world.trajectories
    path = path.replace(time=np.arange(len(path.time)) / poses)
    export(small_world.replace(trajectories=(path,)), tmp_path, options=Options())
    stage = Usd.Stage.Open(str(tmp_path / "scene.usda"))
    assert stage.GetTimeCodesPerSecond() == stage.GetFramesPerSecond() == rate
    assert stage.GetEndTimeCode() == pytest.approx(path.time[-1] * rate)
    places = stage.GetPrimAtPath("/World/Paths/arc").GetAttribute("xformOp:translate")
    codes = np.round(places.GetTimeSamples(), 6)
    assert np.isin(np.arange(len(path.time)) * rate // poses, codes).all()


def test_cameras_look_where_the_sensors_do(small_world, stage):
    rover = morpheus()
    cameras = [sensor for sensor in simple_sensors(rover.sensors) if sensor.view]
    assert len(cameras) == 2
    cache = UsdGeom.XformCache(0)
    base = small_world.trajectories[0]
    turn = matrix_from_quaternion(base.quaternion[0])
    for sensor in cameras:
        prim = stage.GetPrimAtPath(f"/World/Paths/arc/{sensor.name}/camera")
        matrix = cache.GetLocalToWorldTransform(prim)
        pitch = sensor.rpy[1]
        ahead = turn @ (np.cos(pitch), 0, -np.sin(pitch))
        assert np.allclose(matrix.TransformDir(Gf.Vec3d(0, 0, -1)), ahead, atol=1e-6)
        assert np.allclose(matrix.TransformDir(Gf.Vec3d(1, 0, 0)), turn @ (0, -1, 0), atol=1e-6)
        place = turn @ sensor.position + base.position[0]
        assert np.allclose(matrix.ExtractTranslation(), place, atol=1e-6)
        camera = UsdGeom.Camera(prim).GetCamera(Usd.TimeCode(0))
        view = camera.GetFieldOfView(Gf.Camera.FOVHorizontal)
        assert np.radians(view) == pytest.approx(np.radians(85))


def test_the_rig_holds_the_sensors_figures(stage):
    """Size and pixels of the images, left and right, and what USD has no schema for."""
    rover = morpheus()
    for sensor in simple_sensors(rover.sensors):
        frame = stage.GetPrimAtPath(f"/World/Paths/arc/{sensor.name}")
        assert frame.GetCustomDataByKey("kind") == sensor.kind
        told = frame.GetCustomDataByKey("figures")
        for name, value in sensor.figures.items():
            assert (list(told[name]) if isinstance(value, list) else told[name]) == value
        place = UsdGeom.Xformable(frame).GetLocalTransformation().ExtractTranslation()
        assert np.allclose(place, sensor.position)
    for side in ("left", "right"):
        camera = UsdGeom.Camera(stage.GetPrimAtPath(f"/World/Paths/arc/camera_{side}/camera"))
        assert camera.GetStereoRoleAttr().Get() == side
        lens = camera.GetCamera(Usd.TimeCode(0))
        assert lens.GetFieldOfView(Gf.Camera.FOVHorizontal) == pytest.approx(85, abs=1e-3)
        wanted = 2 * np.degrees(np.arctan(np.tan(np.radians(42.5)) * 720 / 1280))
        assert lens.GetFieldOfView(Gf.Camera.FOVVertical) == pytest.approx(wanted, abs=1e-3)
        product = UsdRender.Product(stage.GetPrimAtPath(f"/Render/arc_camera_{side}"))
        assert product.GetResolutionAttr().Get() == Gf.Vec2i(1280, 720)
        assert product.GetCameraRel().GetTargets() == [camera.GetPath()]
    assert [prim.GetName() for prim in labelled(stage, "rover")] == ["arc"]
