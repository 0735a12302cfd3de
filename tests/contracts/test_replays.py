"""What consumers make of the path between the samples that they are given."""

from xml.etree import ElementTree

import numpy as np
import pytest
from pxr import Gf, Usd
from terrain_forge.exporters import sdf, usd

from terrain_forge.model import Export, Trajectory, plain_options
from terrain_forge.paths import (
    ANGLE_LIMIT,
    POSITION_LIMIT,
    angles_between,
    deviation,
    sample_times,
    spline_places,
    straight_places,
)
from terrain_forge.paths.interpolation import turns_between
from terrain_forge.validation.suite import quick_checks

RADIUS = 4.0


def circle(*, speed, rate, rounds=0.9, shake=0.0):
    """A circle at constant speed, its pitch shaken at 2 Hz."""
    time = np.arange(0, rounds * 2 * np.pi * RADIUS / speed, 1 / rate)
    angle = speed / RADIUS * time
    position = np.stack([RADIUS * np.cos(angle), RADIUS * np.sin(angle), 0 * angle], -1)
    pitch = shake * np.sin(2 * np.pi * 2.0 * time)
    rpy = np.stack([0 * angle, pitch, angle + np.pi / 2], -1)
    return Trajectory(name="circle", time=time, position=position, rpy=rpy, closed=False)


def off(trajectory, places_between, times=None):
    times = trajectory.time if times is None else times
    poses = trajectory.at(times)
    return deviation(
        trajectory,
        times=times,
        position=poses.position,
        quaternion=poses.quaternion,
        places_between=places_between,
    )


def test_straight_lines_cut_a_circle_by_its_sagitta():
    step = 2.0 / 5.0
    found = off(circle(speed=2.0, rate=5.0), straight_places)
    assert found.position == pytest.approx(RADIUS * (1 - np.cos(step / RADIUS / 2)), rel=5e-3)
    assert found.angle < 1e-6  # a steady turn is a steady turn


def test_gazebos_spline_goes_through_its_samples_and_follows_a_parabola():
    times = np.arange(0, 3, 0.25)
    places = np.stack([times, times**2, 1 - 2 * times + 3 * times**2], -1)
    assert np.allclose(spline_places(times, places, times), places, atol=1e-12)
    asked = np.linspace(0.25, 2.5, 100)
    wanted = np.stack([asked, asked**2, 1 - 2 * asked + 3 * asked**2], -1)
    assert np.allclose(spline_places(times, places, asked), wanted, atol=1e-12)


def test_gazebos_spline_brakes_at_the_ends_of_an_open_path():
    """Half the first step as tangent: off by 2/27 of the step at a third of it."""
    times = np.arange(0, 3.0)
    places = np.stack([times, 0 * times, 0 * times], -1)
    found = spline_places(times, places, np.array([1 / 3]))[0, 0]
    assert 1 / 3 - found == pytest.approx(2 / 27)
    there_and_back = np.stack([np.sin(np.pi * times), 0 * times, 0 * times], -1)
    there_and_back[-1] = there_and_back[0]
    closed = spline_places(times, there_and_back, np.array([1e-6]))[0]
    assert np.allclose(closed, there_and_back[0], atol=1e-9)  # the tangents cancel


def test_turns_are_steady_and_take_the_short_way():
    quarter = np.array([[1.0, 0, 0, 0], [-np.sqrt(0.5), 0, 0, -np.sqrt(0.5)]])
    found = turns_between(np.array([0.0, 1.0]), quarter, np.array([0.5]))
    eighth = np.array([[np.cos(np.pi / 8), 0, 0, np.sin(np.pi / 8)]])
    assert angles_between(found, eighth)[0] < 1e-12
    assert angles_between(quarter[:1], quarter[1:])[0] == pytest.approx(np.pi / 2)
    still = turns_between(np.array([0.0, 1.0]), quarter[[0, 0]], np.array([0.3]))
    assert np.allclose(still, quarter[0])


@pytest.mark.parametrize("places_between", [spline_places, straight_places])
def test_a_drive_at_walking_pace_needs_no_more_samples(places_between):
    """The promise: within 5 mm and 1 mrad at 0.4 m/s and 12 Hz."""
    drive = circle(speed=0.4, rate=12.0)
    found = off(drive, places_between)
    assert found.position < POSITION_LIMIT
    assert found.angle < ANGLE_LIMIT
    assert np.array_equal(sample_times(drive, places_between), drive.time)


@pytest.mark.parametrize("places_between", [spline_places, straight_places])
@pytest.mark.parametrize(
    "drive",
    [
        circle(speed=6.0, rate=12.0),
        circle(speed=0.4, rate=12.0, shake=0.02),
        circle(speed=5.0, rate=5.0 / 3.0),  # a sample every 3 m
    ],
)
def test_a_fast_or_shaken_drive_gets_as_many_as_the_limits_need(drive, places_between):
    times = sample_times(drive, places_between)
    assert len(times) > len(drive.time)
    assert np.isin(drive.time, times).all()
    assert off(drive, places_between, times).within()


def replay_checks(world, folder):
    exports = [Export(folder=kind, kind=kind, options={}) for kind in ("sdf", "usd")]
    checks = quick_checks(world, folder, exports, points=10)
    return [check for check in checks if "paths between samples" in check.name]


@pytest.fixture
def exported(small_world, tmp_path):
    drives = (circle(speed=0.4, rate=12.0, shake=0.004), small_world.trajectories[0])
    world = small_world.replace(trajectories=drives)
    for exporter in (sdf, usd):
        folder = tmp_path / exporter.__name__.rsplit(".", 1)[1]
        folder.mkdir()
        exporter.export(world, folder, options=exporter.Options())
    return world, tmp_path


def test_the_exports_stay_on_their_paths(exported):
    checks = replay_checks(*exported)
    assert [check.name.split(":")[0] for check in checks] == ["sdf", "sdf", "usd", "usd"]
    assert all(check.passed and 0 < check.figure < check.limit for check in checks)


def test_a_moved_waypoint_and_a_turned_sample_are_found(exported):
    world, folder = exported
    scene = folder / "sdf/scene.sdf"
    tree = ElementTree.parse(scene)
    pose = list(tree.iter("waypoint"))[40].find("pose")
    x, *rest = pose.text.split()
    pose.text = " ".join([f"{float(x) + 0.02}", *rest])
    tree.write(scene)
    stage = Usd.Stage.Open(str(folder / "usd/scene.usda"), Usd.Stage.LoadNone)
    orient = stage.GetPrimAtPath("/World/Paths/circle").GetAttribute("xformOp:orient")
    orient.Set(Gf.Quatd(1, 0, 0, 0), orient.GetTimeSamples()[30])
    stage.GetRootLayer().Save()
    passed = {check.name: check.passed for check in replay_checks(world, folder)}
    assert list(passed.values()) == [False, True, True, False]


def test_a_scene_without_its_replay_fails(exported):
    world, folder = exported
    lost = world.replace(trajectories=(world.trajectories[0].replace(name="lost"),))
    assert [check.passed for check in replay_checks(lost, folder)] == [False, False]


@pytest.mark.parametrize(
    ("release", "flavour"), [("garden", "gz"), (None, "gz"), (None, "classic")]
)
def test_a_heightmap_agrees_with_the_ground_and_a_turned_one_does_not(
    small_world, tmp_path, release, flavour
):
    options = sdf.Options(ground="heightmap", release=release, flavour=flavour)
    (tmp_path / "sdf").mkdir()
    sdf.export(small_world, tmp_path / "sdf", options=options)
    exports = [Export(folder="sdf", kind="sdf", options=plain_options(options))]
    check, *_ = quick_checks(small_world, tmp_path, exports, points=500)
    assert check.passed
    step = 1 / 65535 if release else 1 / 255
    span = np.ptp(small_world.ground.elevation)
    assert check.limit == pytest.approx((step / 2 + 1e-6) * span, rel=0.02)
    turned = small_world.ground.replace(elevation=small_world.ground.elevation[::-1])
    check, *_ = quick_checks(small_world.replace(ground=turned), tmp_path, exports, points=500)
    assert not check.passed
