"""What of a recording is refused before there is a world."""

import re

import pytest
from pydantic import TypeAdapter

from terrain_forge.base import RecipeError
from terrain_forge.building import learn
from terrain_forge.making import plan
from terrain_forge.pipeline import check
from terrain_forge.recipe import load_recipe
from terrain_forge.recording import Order
from terrain_forge.recording import cost as recording_cost
from terrain_forge.recording.cost import measurement_cost
from terrain_forge.rovers import AnySensor, built_in_rovers, find_rover, rover_of
from terrain_forge.sensors import require_free
from tests.helpers.command_line import run
from tests.helpers.rovers import rocker_urdf

RECIPE = """schema: 1
name: early
body: moon
dtm: {kind: flat, size_m: [12, 8]}
terrain: {spacing_m: 0.1}
rover: skid4
paths:
- {name: ahead, route: {kind: polyline, points_m: [[0, 0], [2, 0]]}, speed_m_s: 0.5, rate_hz: 10}
sensors:
- {name: eye, kind: camera, rate_hz: RATE, position_m: [0.4, 0, 1]}
- {name: imu, kind: imu}
dataset: {path: ahead, still_s: 0, ramp_s: 0}
exports: []
"""


@pytest.fixture
def told(tmp_path):
    def of(rate, was="", now=""):
        file = tmp_path / "early.yaml"
        file.write_text(RECIPE.replace("RATE", str(rate)).replace(was or "\0", now))
        return "\n".join(check(load_recipe(file).recipe, folder=tmp_path))

    return of


def test_a_path_shorter_than_a_frame_is_refused(told):
    with pytest.raises(RecipeError, match=r"'ahead' lasts 4 s, sensor 'eye' takes 5 s"):
        told(0.2)


def test_a_path_shorter_than_its_ramps_is_refused(told):
    with pytest.raises(RecipeError, match="'ahead' lasts 4 s, starting and stopping takes 5 s"):
        told(6, "ramp_s: 0", "ramp_s: 5")
    told(6, "ramp_s: 0", "ramp_s: 5, motion: drive")  # which starts as it does
    told(6, "ramp_s: 0", "ramp_s: 3.9")


def test_a_drive_lasts_as_long_as_its_path_after_it_stood(told):
    assert "14 s, 15 measurements" in told(1, "still_s: 0, ramp_s: 0", "still_s: 4, ramp_s: 2")
    drive = "still_s: 4, ramp_s: 2, motion: drive"
    assert "8 s, 9 measurements" in told(1, "still_s: 0, ramp_s: 0", drive)


def test_a_path_longer_than_a_frame_has_a_cost(told):
    assert "4 s, 2 measurements" in told(0.3)
    quick = told(6, "dataset: {", "dataset: {profile: quick, ")
    assert "4 s, 13 measurements" in quick  # every second one
    assert "4 s, 4 measurements" in told(0.3, "kind: camera", "kind: stereo")  # of two cameras


@pytest.mark.parametrize(
    ("was", "now", "warned"),
    [
        ("kind: imu", "kind: imu, rate_hz: 9999", True),
        ("kind: imu", "kind: imu, rate_hz: 1000", False),
        ("kind: imu}\ndataset: {path", "kind: imu, rate_hz: 9999}\ntiles: null # {path", True),
        ("imu}\ndataset: {", "imu, rate_hz: 250}\ndataset: {motion: drive, ", False),
    ],
)
def test_a_rate_far_above_what_a_path_holds_is_warned_of(told, was, now, warned):
    lines = told(1, was, now)
    text = (
        "warning      imu: 9999 Hz, the motion along a path of rate_hz 10 holds nothing above 5 Hz"
    )
    assert (text in lines) == ("warning  " in lines) == warned


@pytest.mark.parametrize("tilt", [-90, -45, 12, 30, 90])
@pytest.mark.parametrize("model", ["simplified", "detailed"])
@pytest.mark.parametrize("name", built_in_rovers())
def test_a_built_in_rover_sees_with_its_own_rig(name, model, tilt):
    rover = find_rover(name, model=model, dimensions={"camera_tilt_deg": tilt})
    for sensor in rover.sensors:
        require_free(sensor, rover)


@pytest.mark.parametrize("sensors", ["[{}]", "{{add: [{}]}}"])
def test_a_sensor_on_a_link_that_another_carries_is_looked_at_where_it_is(sensors, tmp_path):
    """A knuckle that does not steer is a part of its rocker."""
    own = rocker_urdf(tmp_path).relative_to(tmp_path)
    lidar = "{name: lid, kind: lidar, link: left_knuckle, position_m: [0, 0, HEIGHT]}"
    begin, rest = RECIPE.replace("skid4", f"{{kind: file, file: {own}}}").split("sensors:")
    dataset = rest[rest.index("dataset:") :]
    file = tmp_path / "early.yaml"

    def lines(height):
        told = sensors.format(lidar.replace("HEIGHT", height))
        file.write_text(f"{begin}sensors: {told}\n{dataset}")
        return "\n".join(check(load_recipe(file).recipe, folder=tmp_path))

    assert "4 s, " in lines("0.3")
    with pytest.raises(RecipeError, match=r"'lid' is .* below the level of the ground"):
        lines("-0.4")


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ("storage: mcaps", r"'rosbag2': storage: must be 'mcap' or 'sqlite3', found \"mcaps\""),
        ("sensors: [imu, eve]", r"no sensor 'eve' \(did you mean 'eye'\?\), there are: eye, imu"),
        ("sensors: [imu, cam0]", ""),
        ("sensors: [imu, cam1]", r"'rosbag2': no sensor 'cam1', there are: eye, imu"),
    ],
)
def test_options_of_formats_are_refused_with_file_and_line(option, message, tmp_path):
    file = tmp_path / "early.yaml"
    formats = f"  formats:\n    rosbag2:\n      {option}\n"
    recipe = RECIPE.replace("dataset: {path: ahead, ", f"dataset:\n  path: ahead\n{formats}#")
    file.write_text(recipe.replace("RATE", "5"))
    done = run("check", file)
    assert (done.returncode, len(done.complaints)) == ((2, 1) if message else (0, 0))
    if message:
        key = f"dataset.formats.rosbag2.{option.partition(':')[0]}"
        assert re.search(rf"early.yaml:16: {key}: .*{message}", done.complaints[0])


@pytest.mark.parametrize("end", [1e10, 1.7e308, float("inf")])
def test_a_recording_may_end_at_any_time_after_the_motion(end):
    assert Order(end=end).span == Order().span
    assert Order(end=2.5).span == (0, 2_500_000_000)


_BENT = "distortion: {kind: radtan, k: [-0.1, 0, 0, 0]}"
_PAIR = f"{{name: pair, kind: stereo, position_m: [0.4, 0, 1], {_BENT}}}"
_EYE = "{name: eye, kind: camera, rate_hz: 5, position_m: [0.4, 0, 1]}"


@pytest.mark.parametrize(
    ("was", "now", "message"),
    [
        (f"{_EYE}\n- {{name: imu, kind: imu}}", f"{_PAIR}~formats: [kitti]",
         "11: dataset.formats: .*'kitti' needs "
         r"pictures without distortion, which no camera records: give it images: \[rectified\]"),
        (f"{_EYE}\n- {{name: imu, kind: imu}}",
         f"{_PAIR[:-1]}, images: [raw, rectified]}}~formats: [kitti]", ""),
        ("{name: imu, kind: imu}", "{name: lid, kind: lidar, position_m: [0, 0, 1.5]}~formats: "
         "{clouds: {lidar: eye}}", r"12: .*clouds.lidar: .*no lidar 'eye', there are: lid$"),
        ("{name: imu, kind: imu}", "{name: lid, kind: lidar, position_m: [0, 0, 1.5]}~formats: "
         "{clouds: {lidar: cam0}}", r"12: .*clouds.lidar: .*no lidar 'cam0', there are: lid$"),
        (_EYE, f"{_EYE[:-1]}, channels: [depth]}}\n{_EYE.replace('eye', 'bare').join(['- ', ''])}"
         "~formats: {tum: {camera: bare}}", "13: dataset.formats: "
         r".*'tum' needs depth, which camera 'bare' does not record"),
        ("kind: imu}", "kind: imu, rate_hz: 400}~motion: drive",
         r"11: sensors\[1\].rate_hz: 'imu': rate_hz 400 is more than a drive is logged at, 250 Hz"),
        ("kind: imu}", "kind: imu, rate_hz: 250}~motion: drive", ""),
        *(("imu, kind: imu}", f"one, kind: {kind}, rate_hz: 400}}~motion: drive",
           r"11: sensors\[1\].rate_hz: 'one': rate_hz 400 is more than a drive is logged at, 250")
          for kind in ("odometry", "inclinometer", "sun_sensor, position_m: [0, 0, 2]")),
        ("- {name: ahead, route: {kind: polyline, points_m: [[0, 0], [2, 0]]}, speed_m_s: 0.5, "
         "rate_hz: 10}\n", "", r"7: paths: a recording needs a path .* the world has none"),
        ("sensors:\n- {name: eye, kind: camera, rate_hz: 5, position_m: [0.4, 0, 1]}\n"
         "- {name: imu, kind: imu}", "sensors: []", "9: sensors: a recording needs a sensor"),
        ("name: imu, ", "name: imu, link: wheel_rear_left, ",
         r"11: sensors\[1\].link: 'imu' sits on the wheel 'wheel_rear_left', with which"),
        ("[0.4, 0, 1]", "[0.4, 0, 0]", r"10: .*'eye' is at the level of the ground .*: raise it"),
        ("[0.4, 0, 1]", "[0.4, 0, -1]", r"10: .*'eye' is 1 m below the level of the ground"),
    ],
)  # fmt: skip
def test_what_no_recording_can_be_is_refused_with_file_and_line(was, now, message, tmp_path):
    file, (now, _, more) = tmp_path / "early.yaml", now.partition("~")
    recipe = RECIPE.replace("RATE", "5")
    if was.startswith("- {name: ahead"):
        recipe = recipe.replace("paths:\n", "paths: []\n").replace("path: ahead, ", "")
    assert was in recipe
    recipe = recipe.replace(was, now)
    if more:
        recipe = recipe.replace("still_s: 0, ", f"still_s: 0, {more}, ")
    file.write_text(recipe)
    done = run("check", file)
    assert (done.returncode, len(done.complaints)) == ((2, 1) if message else (0, 0)), done.stderr
    assert re.search(f"early.yaml:{message}" if message else "", "".join(done.complaints))


@pytest.fixture
def reference(tmp_path, monkeypatch):
    """A cache of its own, and two cores."""
    monkeypatch.setenv("TERRAIN_FORGE_CACHE", str(tmp_path))
    monkeypatch.setattr(recording_cost, "processors", lambda: 2)


_BARE = {"name": "x", "width_px": 320, "height_px": 240}
_DISPARITY = {"kind": "stereo", "channels": ["depth", "disparity"]}


@pytest.mark.parametrize(
    ("figures", "seconds"),
    [
        ({}, 0.065),
        ({"width_px": 64, "height_px": 48}, 0.016),
        ({"width_px": 1280, "height_px": 720}, 0.51),
        ({"motion_blur": 4}, 0.37),
        ({"colour": True}, 0.085),
        ({"channels": ["depth", "normals", "instance", "class", "shadow", "flow"]}, 0.11),
        (_DISPARITY, 0.17),
        ({"kind": "lidar", "preset": "vlp-16"}, 0.009),
        ({"kind": "lidar", "preset": "os1-64"}, 0.0155),
        ({"kind": "lidar", "preset": "livox-avia"}, 0.012),
    ],
)
def test_a_measurement_takes_what_was_measured(figures, seconds):
    """Processor time of the machine of the rates, in worlds of the tests of recordings."""
    told = {
        "kind": "camera",
        **(_BARE if figures.get("kind") != "lidar" else {"name": "x"}),
        **figures,
    }
    (sensor,) = TypeAdapter(tuple[AnySensor, ...]).validate_python([told])
    assert seconds / 1.5 < measurement_cost(sensor)[0] < 1.5 * seconds


@pytest.mark.usefixtures("reference")
def test_the_time_of_a_recording_counts_all_that_is_done_and_is_learnt(tmp_path):
    def seconds(more="", side=2000):
        big = f"{{name: big, kind: camera, position_m: [0.4, 0, 1.2], width_px: {side}}}"
        (tmp_path / "early.yaml").write_text(
            RECIPE.replace("RATE", "10")
            .replace("sensors:\n", f"sensors:\n- {big}\n")
            .replace("dataset: {", f"dataset: {{{more}")
        )
        site = plan(load_recipe(tmp_path / "early.yaml").recipe)
        return recording_cost.recording_cost(site, rover_of(site).sensors).seconds

    large = seconds()
    assert seconds(side=300) < large
    assert seconds("formats: [rosbag2, rosbag1], ") > large
    learn({"recording": 1.0}, {"recording": 4.0}, {"recording": 4.0})
    assert seconds() > 1.5 * large
