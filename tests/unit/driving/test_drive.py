import json
import math
import shutil

import numpy as np
import pytest
from terrain_forge.exporters import mjcf

from terrain_forge.driving import drive, load_scene
from terrain_forge.driving.controller import SKID_GAIN, PlanarPath, wheel_rates, wrap
from terrain_forge.model import Trajectory
from terrain_forge.recipe import DriveSpec, ValidateSpec
from terrain_forge.validation import validate
from terrain_forge.validation.checks.drives import drive_checks
from tests.helpers import worlds
from tests.helpers.rovers import morpheus

ARC = DriveSpec(path="arc", film=False)
NO_ROCKS = np.array([], dtype=int)


def path(points, *, speed=0.4, name="arc", closed=False, yaw=None):
    """A trajectory along a polyline of close points over flat ground."""
    points = np.asarray(points, dtype=float)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    heading = np.unwrap(np.arctan2(*np.gradient(points, axis=0).T[::-1]))
    zero = np.zeros(len(points))
    return Trajectory(
        name=name,
        time=np.concatenate([[0], np.cumsum(steps)]) / speed,
        position=np.column_stack([points, zero]),
        rpy=np.column_stack([zero, zero, heading if yaw is None else zero + yaw]),
        closed=closed,
    )


def line(start, end, **options):
    return path(np.linspace(start, end, 100), **options)


def plain(trajectory, *, slope=0.0, field=None):
    """A plane that rises to the east, with a path and few rocks or none."""
    world = worlds.world(rover=morpheus())
    east = world.ground.east
    elevation = np.tile(math.tan(slope) * east, (world.ground.shape[0], 1))
    return world.replace(
        ground=world.ground.replace(elevation=elevation),
        field=world.field.select(NO_ROCKS) if field is None else field,
        trajectories=(trajectory,),
    )


def drive_through(world, folder, **limits):
    mjcf.export(world, folder, options=mjcf.Options(timestep_s=0.004))
    trajectory = world.trajectories[0]
    spec = DriveSpec(path=trajectory.name, **limits)
    return drive(scene=folder / "scene.xml", trajectory=trajectory, rover=world.rover, spec=spec)


def test_another_scene_of_the_same_ground_changes_nothing(tmp_path):
    """The rover goes on in it as it stands and moves."""
    way = line((-5, 0), (4, 0))
    world = plain(way)
    alone = drive_through(world, tmp_path)
    scenes = [load_scene(tmp_path / "scene.xml") for _ in range(3)]
    handed = list[float]()

    def onward(progress):
        if progress < 3.0 * (len(handed) + 1) or len(handed) == 2:
            return None
        handed.append(progress)
        return scenes[len(handed)]

    result = drive(scene=scenes[0], trajectory=way, rover=world.rover, spec=ARC, onward=onward)
    assert len(handed) == 2
    assert result.completed
    assert len(result.time) == len(alone.time)
    assert np.abs(result.position - alone.position).max() < 1e-3
    assert np.abs(result.wheel_rate - alone.wheel_rate).max() < 0.02
    assert result.energy.driving == pytest.approx(alone.energy.driving, rel=0.01)


def boulder_at(position):
    """One rock of 2.5 m."""
    return (
        worlds.field()
        .select(np.array([3]))
        .replace(
            position=np.array([position]),
            quaternion=np.array([[1.0, 0, 0, 0]]),
            scale=np.array([2.5]),
            diameter=np.array([2.5]),
        )
    )


@pytest.fixture(scope="module")
def driven(hill, tmp_path_factory):
    return drive_through(hill, tmp_path_factory.mktemp("driven"))


@pytest.fixture(scope="module")
def validated(hill, tmp_path_factory):
    """A folder in which the hill was validated with a drive, and what came of it."""
    folder = tmp_path_factory.mktemp("validated")
    return folder, validate(hill, folder, spec=ValidateSpec(drive="arc", points=100))


def test_a_point_beside_the_path_is_measured_to_its_left():
    track = PlanarPath.of(line((0, 0), (4, 0)))
    distance, offset, heading = track.nearest(np.array([1.3, 0.2]), near=1.0)
    assert (distance, offset, heading) == pytest.approx((1.3, 0.2, 0.0))
    assert track.nearest(np.array([1.3, -0.2]), near=1.0)[1] == pytest.approx(-0.2)
    assert track.speed == pytest.approx(0.4)


def test_the_path_goes_straight_on_beyond_its_end():
    track = PlanarPath.of(line((0, 0), (3, 4)))
    np.testing.assert_allclose(track.point(5.5), (3.3, 4.4))


def test_a_path_that_crosses_itself_is_followed_in_order():
    angle = np.linspace(0, 2 * np.pi, 400)
    eight = np.column_stack([4 * np.sin(angle), 4 * np.sin(angle) * np.cos(angle)])
    track = PlanarPath.of(path(eight))
    crossing = np.zeros(2)
    first = track.nearest(crossing, near=0.2)[0]
    half_way = track.nearest(crossing, near=track.length / 2)[0]
    assert first < 0.1
    assert half_way == pytest.approx(track.length / 2, abs=0.1)


def test_wheels_turn_alike_straight_on_and_oppositely_on_the_spot():
    rover = morpheus()
    np.testing.assert_allclose(wheel_rates(rover, 0.28, 0.0), 2.0)
    spot = wheel_rates(rover, 0.0, 0.3)
    left = rover.wheel_centres[:, 1] > 0
    np.testing.assert_allclose(spot[left], -0.3 * SKID_GAIN * 0.38 / 0.14)
    np.testing.assert_allclose(spot[~left], -spot[left])
    fast = wheel_rates(rover, 3.0, 0.5)
    assert np.abs(fast).max() * 0.14 == pytest.approx(rover.speed_limit)


def test_angles_wrap_into_one_turn():
    assert [wrap(a) for a in (math.pi, 3 * math.pi, 4.0)] == pytest.approx(
        [math.pi, math.pi, 4.0 - 2 * math.pi]
    )


def test_the_rover_follows_its_path_over_a_hill(hill, driven):
    result = driven
    assert result.reason == "arrived"
    assert result.largest_cross_track < 0.12
    assert result.distance == pytest.approx(hill.trajectories[0].length, rel=0.02)
    ground = hill.ground.height_at(*result.position.T[:2])
    assert np.abs(result.position[:, 2] - ground).max() < 0.1
    assert math.radians(2) < result.largest_tilt < math.radians(15)
    assert result.rocks == ()
    assert np.diff(result.time)[:-1] == pytest.approx(0.1)


@pytest.mark.slow
def test_a_closed_loop_ends_where_it_began(tmp_path):
    angle = np.linspace(0, 2 * np.pi, 300)
    loop = path(1.5 * np.column_stack([np.cos(angle), np.sin(angle)]), closed=True)
    result = drive_through(plain(loop), tmp_path)
    assert result.completed
    assert np.linalg.norm(result.position[-1] - result.position[0]) < 0.1
    assert result.distance == pytest.approx(3 * np.pi, rel=0.02)
    assert result.largest_tilt < math.radians(1)


def test_limits_decide_what_passes(driven):
    result = driven
    strict = DriveSpec(path="arc", cross_track_m=0.001, tilt_deg=1.0, time_factor=1.0)
    missed = [c.name for c in drive_checks(result, strict) if not c.passed]
    assert missed == [
        "drive arc: time",
        "drive arc: largest cross-track error",
        "drive arc: largest tilt",
    ]
    assert all(c.passed for c in drive_checks(result, DriveSpec(path="arc")))


def test_a_validation_writes_its_report(validated):
    folder, result = validated[0] / "validation", validated[1]
    report = json.loads((folder / "report.json").read_text())
    assert result.passed
    assert report["verdict"] == "pass"
    assert report["drive"]["reason"] == "arrived"
    assert len(report["checks"]) == len(result.checks)
    assert (folder / "mjcf" / "scene.xml").is_file()
    assert {n for n, _ in result.timings} == {"drive_wall_time_s", "drive_real_time_factor"}
    track = np.genfromtxt(folder / "drive_arc.csv", delimiter=",", names=True)
    np.testing.assert_allclose(track["x_m"], result.drive.position[:, 0], atol=1e-8)
    assert np.abs(np.diff(track["yaw_rad"])).max() < 0.5
    tum = np.loadtxt(folder / "drive_arc.tum")
    np.testing.assert_allclose(tum[:, 7], result.drive.quaternion[:, 0], atol=1e-8)


@pytest.mark.slow
def test_a_validation_repeats_byte_for_byte(hill, validated, tmp_path):
    first, result = validated
    again = validate(hill, tmp_path, spec=ValidateSpec(drive="arc", points=100))
    assert again.drive == result.drive
    drive = {f"drive_arc{end}" for end in (".csv", "_wheels.csv", ".tum", ".png", ".webp")}
    assert {file.name for file in again.files} == {"report.json", "terrain.png", *drive}
    for file in again.files:
        assert file.read_bytes() == (first / file.relative_to(tmp_path)).read_bytes()


def test_a_validation_again_leaves_nothing_old(hill, validated, tmp_path):
    shutil.copytree(validated[0], tmp_path, dirs_exist_ok=True)
    assert (tmp_path / "validation" / "drive_arc.csv").exists()
    files = [file for file in (tmp_path / "validation").rglob("*") if file.is_file()]
    earlier = [file.relative_to(tmp_path).as_posix() for file in files]
    (tmp_path / "validation" / "drive_notes.txt").touch()
    validate(hill, tmp_path, spec=ValidateSpec(points=10), earlier=earlier)
    left = sorted(file.name for file in (tmp_path / "validation").iterdir())
    assert left == ["drive_notes.txt", "report.json", "terrain.png"]


def test_drives_that_hold_are_not_driven_again(hill, validated, tmp_path, monkeypatch):
    """Another format is written: the report says the same, and no rover moved."""
    folder, first = validated
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
    monkeypatch.setattr("terrain_forge.validation.checks.drives.drive", None)
    earlier = [file.relative_to(folder).as_posix() for file in first.files]
    spec = ValidateSpec(drive="arc", points=100)
    again = validate(hill, tmp_path, spec=spec, earlier=earlier, keep_drives=True)
    assert again.checks == first.checks
    assert {*again.files} == {tmp_path / name for name in earlier}
    for name in earlier:
        assert (tmp_path / name).read_bytes() == (folder / name).read_bytes()


def test_a_failed_check_is_a_result(hill, tmp_path):
    result = validate(hill, tmp_path, spec=ValidateSpec(drive="nowhere"))
    assert not result.passed
    (failure,) = [check for check in result.checks if not check.passed]
    assert failure.note == "the path does not lie within this world"
    assert json.loads((tmp_path / "validation/report.json").read_text())["verdict"] == "fail"


def test_sizes_are_judged_by_the_truth(hill, tmp_path):
    (tmp_path / "truth").mkdir()
    verification = {
        "populations": [
            {"name": n, "count": {"observed": 9}, "kolmogorov_smirnov": {"p_value": p}}
            for n, p in (("good", 0.4), ("bad", 1e-5))
        ]
    }
    (tmp_path / "truth" / "size_frequency.json").write_text(json.dumps(verification))
    checks = validate(hill, tmp_path, spec=ValidateSpec()).checks
    verdicts = {c.name: c.passed for c in checks if "sizes" in c.name}
    assert verdicts == {"rocks: sizes of good": True, "rocks: sizes of bad": False}


def test_too_many_rocks_without_rest_are_told_with_what_keeps_them_off(hill, tmp_path):
    (tmp_path / "truth").mkdir()
    verification = {
        "populations": [
            {"name": name, "kolmogorov_smirnov": None,
             "dynamic": {"expected": 50, "dynamic": 50 - fixed, "fixed": fixed}}
            for name, fixed in (("few", 5), ("many", 6))
        ]
    }  # fmt: skip
    (tmp_path / "truth" / "size_frequency.json").write_text(json.dumps(verification))
    checks = validate(hill, tmp_path, spec=ValidateSpec()).checks
    few, many = (check for check in checks if "without rest" in check.name)
    assert few.passed
    assert "max_slope_deg" not in few.note
    assert not many.passed
    assert "max_slope_deg" in many.note


def test_a_start_inside_a_rock_is_reported(tmp_path):
    trajectory = line((-4, 0), (4, 0))
    world = plain(trajectory, field=boulder_at(trajectory.position[0]))
    result = validate(world, tmp_path, spec=ValidateSpec(drive=ARC, points=10))
    assert not result.passed
    assert result.drive is None
    assert result.checks[-1].note == (
        "the rover's start at (-4.00, 0.00, 0.00) m is not free: it lies in rock_3"
    )


def test_a_start_off_the_ground_is_reported(hill, tmp_path):
    start = hill.trajectories[0]
    raised = start.replace(position=start.position + np.array([0, 0, 5.0]))
    world = hill.replace(trajectories=(raised,))
    result = validate(world, tmp_path, spec=ValidateSpec(drive=ARC, points=10))
    assert result.drive is None
    assert "does not stand at its start" in result.checks[-1].note


def test_a_scene_written_anew_within_a_second_is_read_anew(tmp_path):
    reliefs = []
    for slope in (0.0, 0.3):
        world = plain(line((-4, 0), (4, 0)), slope=slope)
        mjcf.export(world, tmp_path, options=mjcf.Options())
        reliefs.append(float(np.ptp(load_scene(tmp_path / "scene.xml").hfield_data)))
    assert reliefs == pytest.approx([0.0, 1.0])
