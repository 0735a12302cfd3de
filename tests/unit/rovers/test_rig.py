"""The sensors that a recipe gives to its rover, and what each format makes of them."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import fields
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from pxr import Gf, Usd, UsdGeom, UsdValidation
from pydantic import TypeAdapter
from terrain_forge.exporters.rover import Options, export

from terrain_forge.base import RecipeError
from terrain_forge.model import CameraSensor, sensor_kinds, simple_sensors
from terrain_forge.recipe import load_recipe
from terrain_forge.rovers import FileRover, SensorsChoice, resolve_rover, with_sensors
from tests.helpers import rovers, worlds
from tests.helpers.rovers import morpheus

_NOSE = {"name": "nose", "kind": "camera", "position_m": [0.5, 0.0, 0.2], "rpy_deg": [0, 30, 0]}
_OWN = ["camera_left", "camera_right", "lidar", "imu"]


def rig(told, rover=None):
    """A rover with the sensors that a recipe tells of."""
    choice = TypeAdapter(SensorsChoice).validate_python(told)
    return with_sensors(rover or morpheus(), choice)


def names(rover):
    return [sensor.name for sensor in simple_sensors(rover.sensors)]


def test_a_list_takes_the_place_of_the_rig_and_add_adds_to_it():
    assert names(rig([_NOSE])) == ["nose"]
    assert names(rig({"add": [_NOSE]})) == [*_OWN, "nose"]
    swapped = rig({"add": [{"name": "camera", "kind": "stereo", "baseline_m": 0.3}]})
    assert sorted(names(swapped)) == sorted(_OWN)
    left, right = swapped.sensors[-1].simple
    np.testing.assert_allclose(left.position - right.position, (0, 0.3, 0), atol=1e-15)
    assert not rig([]).sensors


def test_a_preset_fills_in_what_is_not_given_in_a_list_as_in_add():
    told = {"name": "imu", "kind": "imu", "preset": "stim300", "gyro_noise": 0.5}
    for choice in ([told], {"add": [told]}):
        imu = rig(choice).sensors[-1]
        assert (imu.gyro_noise, imu.accelerometer_noise) == (0.5, 0.07 / 60)


RECIPE = """schema: 1
name: rigged
body: moon
dtm: {kind: flat, size_m: [6, 4]}
terrain: {spacing_m: 0.1}
rover: morpheus
sensors:
"""
WRONG = {
    "  - {name: base_link, kind: imu}": (
        "8: sensors[0].name: 'base_link' is the name of a link or frame, choose another"
    ),
    "  - {name: map, kind: imu}": "8: sensors[0].name: 'map' is the name of a link or frame",
    "  - {name: a, kind: camera}\n  - {name: a, kind: imu}": (
        "9: sensors[1].name: 'a' is the name of another sensor too"
    ),
    "  - {name: a, kind: stereo}\n  - {name: a_left, kind: imu}": (
        "9: sensors[1].name: 'a_left' is the name of another sensor too"
    ),
    "  add:\n  - {name: camera_left, kind: imu}": (
        "8: sensors.add: 'camera_left' is the name of a sensor of the rover too"
    ),
    "  add:\n  - {name: a, kind: imu, link: bace_link}": (
        "9: sensors.add[0].link: 'bace_link' is no link of the rover morpheus (did you mean "
        "'base_link'?), there are: base_link,"
    ),
    "  - name: a\n    kind: imu\n    preset: adis16449": (
        "10: sensors[0].preset: unknown preset 'adis16449' (did you mean 'adis16448'?), there are:"
    ),
    "  add:\n  - name: a\n    kind: imu\n    preset: [1]": (
        "11: sensors.add[0].preset: unknown preset (1,), there are:"
    ),
    "  - {name: a, kind: sonar}": "8: sensors[0]: unknown kind 'sonar'",
    "  ad: []": "8: sensors.ad: unknown key 'ad' (did you mean 'add'?), allowed: add",
    "  - {name: a, kind: camera, rate_hz: 0}": "8: sensors[0].rate_hz: must be",
}


def make_rover(path):
    """The rover of a recipe; an error has the file's name and line."""
    file = load_recipe(path)
    try:
        return with_sensors(morpheus(), file.recipe.sensors)
    except RecipeError as error:
        raise RecipeError(file.locate(error)) from None


@pytest.mark.parametrize("told", WRONG)
def test_what_a_rig_cannot_be_is_one_line_with_its_place(tmp_path, told):
    (tmp_path / "r.yaml").write_text(RECIPE + told + "\n")
    with pytest.raises(RecipeError) as refused:
        make_rover(tmp_path / "r.yaml")
    assert str(refused.value).startswith(f"{tmp_path / 'r.yaml'}:{WRONG[told]}")
    assert "\n" not in str(refused.value)


def test_all_that_a_kind_says_it_says_in_a_format_is_a_field_of_its():
    for kind in sensor_kinds().values():
        own = TypeAdapter(kind).validate_python({"name": "a"})
        for form in ("sdf", "mjcf", "usd"):
            assert set(own.said(form)) <= {field.name for field in fields(own)}


def test_a_rover_of_yours_carries_sensors_in_every_format(tmp_path):
    """On a link of its own, without a rig before."""
    rover = rovers.read(rovers.rocker_urdf(tmp_path))
    assert not rover.sensors
    eyes = {"name": "eyes", "kind": "stereo", "link": "left_rocker", "position_m": [0.1, 0, 0.6]}
    rover = rig([eyes, {"name": "imu", "kind": "imu"}], rover)
    report = exported(rover, tmp_path / "o")
    folder, own = tmp_path / "o", {"eyes_left", "eyes_right", "imu"}
    place = rover.origins["left_rocker"] + (0.1, 0.06, 0.6)
    sdf = {s.get("name"): s for s in ET.parse(folder / "tub.sdf").getroot().iter("sensor")}
    assert set(sdf) == own
    told = np.array(sdf["eyes_left"].findtext("pose").split(), float)
    np.testing.assert_allclose(told, [*place, 0, 0, 0], atol=1e-8)
    model = mujoco.MjModel.from_xml_path(str(folder / "tub.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert {model.camera(n).name for n in range(model.ncam)} == {"eyes_left", "eyes_right"}
    seen = data.camera("eyes_left").xpos - data.body("base_link").xpos
    np.testing.assert_allclose(seen, place, atol=1e-9)
    robot = ET.parse(folder / "tub.urdf").getroot()
    assert own <= {link.get("name") for link in robot.findall("link")}
    stage = Usd.Stage.Open(str(folder / "tub.usda"))
    assert all(stage.GetPrimAtPath(f"/tub/base_link/{name}") for name in own)
    assert any(loss.startswith("MJCF does not say of the rover's camera: rate_hz") for loss in
               report.losses)  # fmt: skip


def exported(rover, folder):
    folder.mkdir()
    return export(worlds.world().replace(rover=rover), folder, options=Options())


_BENDS = [-0.17, 0.02, 1e-3, -2e-3, 0.01]
_FOCAL = (468.0, 477.0)
# The first pixel's centre is at 0: the axis is 333 px from the left edge, 233 from the upper one.
_LENS = {
    "width_px": 640, "height_px": 480, "focal_px": _FOCAL, "centre_px": [332.5, 232.5],
    "distortion": {"kind": "radtan", "k": _BENDS},
}  # fmt: skip


@pytest.fixture(scope="module")
def bent(tmp_path_factory):
    """The export of a rover whose camera has a lens that bends, its axis off the middle."""
    folder = tmp_path_factory.mktemp("bent") / "o"
    exported(rig([_NOSE | _LENS]), folder)
    return folder


def test_usd_holds_all_figures_as_custom_data(tmp_path, monkeypatch):
    held = {
        "table": [1.5, -2.0],
        "firing": {"order": ["a", "b"], "dual": True},
        "none": [],
        "parts": [{"a": 1}, {"a": 2}],
    }
    monkeypatch.setattr(CameraSensor, "figures", held)
    exported(rig([_NOSE]), tmp_path / "o")
    stage = Usd.Stage.Open(str(tmp_path / "o" / "morpheus.usda"))
    told = stage.GetPrimAtPath("/morpheus/base_link/nose").GetCustomDataByKey("figures")
    assert list(told["table"]) == held["table"]
    assert list(told["firing"]["order"]) == ["a", "b"]
    assert told["firing"]["dual"] is True
    assert told["parts"] == {"0": {"a": 1}, "1": {"a": 2}}
    assert len(told["none"]) == 0


def test_sdf_holds_intrinsics_and_distortion(bent):
    camera = ET.parse(bent / "morpheus.sdf").getroot().find(".//sensor/camera")
    told = {name: float(camera.findtext(f"lens/intrinsics/{name}")) for name in ("fx", "fy")}
    assert list(told.values()) == pytest.approx(_FOCAL)
    middle = [float(camera.findtext(f"lens/intrinsics/{c}")) for c in ("cx", "cy")]
    assert middle == pytest.approx([333, 233])
    bends = [float(camera.findtext(f"distortion/{n}")) for n in ("k1", "k2", "p1", "p2", "k3")]
    assert bends == _BENDS
    middle = [float(number) for number in camera.findtext("distortion/center").split()]
    assert middle == pytest.approx([333 / 640, 233 / 480])


def test_mujoco_and_usd_see_the_axis_off_the_middle(bent):
    """What is straight ahead is drawn at the principal point, by the viewers' own frusta."""
    model = mujoco.MjModel.from_xml_path(str(bent / "morpheus.xml"))
    data, scene, camera = mujoco.MjData(model), mujoco.MjvScene(model, 9), mujoco.MjvCamera()
    mujoco.mj_forward(model, data)
    camera.type, camera.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, 0
    every = mujoco.mjtCatBit.mjCAT_ALL
    mujoco.mjv_updateScene(model, data, mujoco.MjvOption(), None, camera, every, scene)
    eye = scene.camera[0]
    left = eye.frustum_width - eye.frustum_center
    shown = left / (2 * eye.frustum_width), eye.frustum_top / (eye.frustum_top - eye.frustum_bottom)
    assert shown == pytest.approx((333 / 640, 233 / 480), rel=1e-5)
    fx, fy = (480 if n else 640 for n in range(2))
    fx *= eye.frustum_near / (2 * eye.frustum_width)
    fy *= eye.frustum_near / (eye.frustum_top - eye.frustum_bottom)
    assert (fx, fy) == pytest.approx(_FOCAL, rel=1e-5)
    stage = Usd.Stage.Open(str(bent / "morpheus.usda"))
    prim = stage.GetPrimAtPath("/morpheus/base_link/nose/camera")
    window = UsdGeom.Camera(prim).GetCamera(Usd.TimeCode(0)).frustum.window
    size = window.GetSize()
    shown = -window.GetMin()[0] / size[0], window.GetMax()[1] / size[1]
    assert shown == pytest.approx((333 / 640, 233 / 480), rel=1e-5)
    assert (640 / size[0], 480 / size[1]) == pytest.approx(_FOCAL, rel=1e-5)
    space = "omni:lensdistortion:opencvPinhole"
    assert prim.GetAttribute(f"{space}:k1").Get() == pytest.approx(-0.17)
    assert prim.GetAttribute(f"{space}:imageSize").Get() == Gf.Vec2i(640, 480)
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert not UsdValidation.ValidationContext(validators).Validate(stage)


def test_what_a_format_cannot_say_is_a_loss_with_its_field(tmp_path):
    fisheye = {"kind": "equidistant"}
    rover = rig([
        _NOSE | {"distortion": fisheye, "rolling_shutter_s": 0.01, "horizontal_fov_deg": 120},
        {"name": "top", "kind": "lidar", "preset": "os1-64"},
        {"name": "imu", "kind": "imu", "preset": "stim300"},
    ])  # fmt: skip
    losses = exported(rover, tmp_path / "o").losses

    def lost(start):
        return next(loss for loss in losses if loss.startswith(start)).removeprefix(start)

    of_camera = lost("SDF does not say of the rover's camera: ")
    assert {"distortion", "rolling_shutter_s", "noise"} <= set(of_camera[:-1].split(", "))
    assert "width_px" not in of_camera
    assert "azimuth offsets" in lost("SDF does not say of the rover's lidar: ")
    of_imu = lost("SDF does not say of the rover's IMU: ")[:-1].split(", ")
    assert "gyro_range" in of_imu
    assert "gyro_bias" not in of_imu
    assert "distortion" not in lost("USD does not say of the rover's camera: ")
    stage = Usd.Stage.Open(str(tmp_path / "o" / "morpheus.usda"))
    prim = stage.GetPrimAtPath("/morpheus/base_link/nose/camera")
    assert prim.GetAttribute("omni:lensdistortion:model").Get() == "opencvFisheye"
    bias = ET.parse(tmp_path / "o" / "morpheus.sdf").getroot().find(".//imu//x/noise/bias_stddev")
    assert float(bias.text) == pytest.approx(np.radians(4 / 3600))


def test_an_inclinometer_is_a_frame_of_mujocos(tmp_path):
    rover = rig([
        {"name": "tilt", "kind": "inclinometer", "rpy_deg": [0, 20, 0]},
        {"name": "wheels", "kind": "odometry"},
        {"name": "sun", "kind": "sun_sensor"},
    ])  # fmt: skip
    losses = exported(rover, tmp_path / "o").losses
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "o" / "morpheus.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    half = np.radians(10)
    told = data.sensor("tilt_framequat").data
    np.testing.assert_allclose(told, [np.cos(half), 0, np.sin(half), 0], atol=1e-12)
    assert "A Sun sensor is a bare site in MJCF; its figures are not part of the model." in losses
    assert "SDF has no sensor for the rover's wheel odometry: it is left out." in losses


def test_a_sensor_sits_on_a_link_that_the_rover_holds_as_on_any(tmp_path):
    """A knuckle that does not steer is a part of its rocker, which leans by 0.1 rad."""
    file = FileRover(file=str(rovers.rocker_urdf(tmp_path).relative_to(tmp_path)))
    found = resolve_rover(file, tmp_path)
    told = [{"name": "eye", "kind": "camera", "link": "left_knuckle", "position_m": [0, 0, 0.1]}]
    choice = TypeAdapter(SensorsChoice).validate_python(told)
    rover = with_sensors(found.rover, choice, frames=found.frames)
    (eye,) = rover.sensors
    assert eye.link == "left_rocker"
    wheel = next(w for w in rover.wheels if w.link == "left_front_wheel")
    arm = 0.1 * np.array([np.sin(0.1), 0, np.cos(0.1)])
    np.testing.assert_allclose(rover.origins[eye.link] + eye.position, wheel.centre + arm)
    np.testing.assert_allclose(eye.rpy, (0, 0.1, 0), atol=1e-12)
    assert found.frames["mast"][0] == found.frames["base_footprint"][0] == "base_link"
    with pytest.raises(RecipeError, match=r"'knuckle' is no link of the rover tub \(did you mean"):
        with_sensors(
            rover, TypeAdapter(SensorsChoice).validate_python([told[0] | {"link": "knuckle"}]),
            frames=found.frames,
        )  # fmt: skip


def carrying(file, told, **choices):
    """The rover of a file with sensors."""
    found = resolve_rover(FileRover(file=file.name, **choices), file.parent)
    choice = TypeAdapter(SensorsChoice).validate_python(told)
    return with_sensors(found.rover, choice, frames=found.frames)


@pytest.mark.parametrize("base", [None, "arm"])
def test_a_link_of_a_sensor_is_that_of_the_file(tmp_path, base):
    """Sites of an MJCF and sensors that are told alike stand alike, also where joints turn."""
    places = {"base_link": (0.1, 0.2, 0.5), "arm": (0.3, 0, 0.1), "left_rear": (0, 0.1, 0.05)}
    sites, text = {}, rovers.buggy_mjcf(tmp_path).read_text().replace('"chassis"', '"base_link"')
    for link, place in places.items():
        at = " ".join(map(str, place))
        sites[link] = f'<site name="on_{link}" pos="{at}" euler="10 20 30"/>'
    for link, site in sites.items():
        start = text.index(">", text.index(f'body name="{link}"')) + 1
        text = text[:start] + site + text[start:]
    text = text.replace('name="arm" pos', 'name="arm" euler="0 20 0" pos')
    file = tmp_path / "sited.xml"
    file.write_text(text.replace('angle="degree"', 'angle="degree" eulerseq="XYZ"'))
    told = [
        {"name": f"on_{link}", "kind": "imu", "link": link, "position_m": place,
         "rpy_deg": (10, 20, 30)} for link, place in places.items()
    ]  # fmt: skip
    rover = carrying(file, [*told, {"name": "own", "kind": "imu", "position_m": (0.1, 0, 0.4)}],
                     wheels=("lf", "lr", "rf", "rr"), base=base)  # fmt: skip
    assert rover.sensors[-1].position_m == (0.1, 0, 0.4)
    assert {sensor.link for sensor in rover.sensors} == set(places)
    source, ours = (
        mujoco.MjModel.from_xml_path(str(file)), rovers.on_the_flat(rover, tmp_path / "o")
    )  # fmt: skip
    seen = [between_sites(model, list(places)) for model in (source, ours)]
    np.testing.assert_allclose(seen[0], seen[1], atol=1e-9)
    assert "base_link" in next(note for note in rover.notes if "origin moved" in note)


def between_sites(model, links):
    """Poses of sites and places of a wheel, each as the first site sees it, at the joints' 0."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    one = data.site(f"on_{links[0]}")
    turn = one.xmat.reshape(3, 3)
    found = []
    for link in links:
        site = data.site(f"on_{link}")
        found.append(turn.T @ np.column_stack([site.xpos - one.xpos, site.xmat.reshape(3, 3)]))
    found.append(turn.T @ np.tile((data.body("right_rear").xpos - one.xpos)[:, None], 4))
    return np.array(found)


def test_a_rig_of_a_packages_rover_is_told_as_a_recipe_reads_it(tmp_path, monkeypatch):
    """Its base_link is 0.45 m above the ground; what its YAML file says without a link is not."""
    from terrain_forge.rovers import built_in, rig_of

    text = rovers.rocker_urdf(tmp_path).read_text().replace("package://tub/meshes/", "")
    (tmp_path / "wheel.stl").write_bytes((tmp_path / "tub" / "meshes" / "wheel.stl").read_bytes())
    (tmp_path / "crate.urdf").write_text(text)
    (tmp_path / "crate.yaml").write_text(
        "sensors:\n"
        "  - {name: free, kind: imu, position_m: [0, 0, 0.2]}\n"
        "  - {name: body, kind: imu, link: base_link, position_m: [0, 0, 0.2]}\n"
        "  - {name: arm, kind: imu, link: left_rocker, position_m: [0, 0, 0.2]}\n"
    )
    monkeypatch.setattr(built_in, "plugins", lambda _: {"fleet": None})
    fleet = SimpleNamespace(__path__=[tmp_path])
    monkeypatch.setattr(built_in, "load_plugin", lambda *_: fleet)
    built_in.built_in_rovers.cache_clear()
    try:
        choice = built_in.built_in_rovers()["crate"]()
        rover = resolve_rover(choice, tmp_path).rover
        free, body, arm = rover.sensors
        told = rig_of(choice, tmp_path)
    finally:
        built_in.built_in_rovers.cache_clear()
    assert (free.link, body.link, arm.link) == ("base_link", "base_link", "left_rocker")
    assert free.position_m == (0, 0, 0.2)
    wheel = next(w for w in rover.wheels if w.link == "left_front_wheel")
    away = body.position - wheel.centre  # the rocker leans by 0.1 rad
    leant = (0.4 * np.cos(0.1) - 0.2 * np.sin(0.1), -0.4 * np.sin(0.1) - 0.2 * np.cos(0.1))
    np.testing.assert_allclose(away[[0, 2]], (-leant[0], 0.2 - leant[1]), atol=1e-9)
    np.testing.assert_allclose(arm.rpy_deg, (0, np.degrees(0.1), 0), atol=1e-9)
    assert [sensor.get("link") for sensor in told] == [None, None, "left_rocker"]
    np.testing.assert_allclose(told[1]["position_m"], body.position, atol=1e-12)
    np.testing.assert_allclose(told[2]["position_m"], (0, 0, 0.2), atol=1e-12)
    np.testing.assert_allclose(told[2].get("rpy_deg", (0, 0, 0)), 0, atol=1e-12)


def test_exports_tell_what_of_the_file_is_left_out(tmp_path):
    tie = '<equality><connect body1="arm" body2="chassis" anchor="0 0 1"/></equality></mujoco>'
    file = rovers.buggy_mjcf(tmp_path)
    file.write_text(file.read_text().replace("</mujoco>", tie))
    rover = rovers.read(file, wheels=("lf", "lr", "rf", "rr"))
    (told,) = rover.unread
    assert told.endswith(": equality connect: arm with chassis.")
    assert {told, *rover.notes} <= set(exported(rover, tmp_path / "o").losses)
