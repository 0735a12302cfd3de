import json
import math
import shutil

import numpy as np
import pytest
from terrain_forge.exporters import mjcf

from terrain_forge.driving import drive, load_scene
from terrain_forge.driving.controller import SKID_GAIN, PlanarPath, wheel_rates, wrap
from terrain_forge.model import Export, Mesh, Trajectory
from terrain_forge.recipe import DriveSpec, ValidateSpec
from terrain_forge.rocks import overlapping_pairs
from terrain_forge.validation import validate
from terrain_forge.validation.checks.drives import drive_checks
from terrain_forge.validation.sample import random_points
from terrain_forge.validation.suite import quick_checks
from terrain_forge.validation.surface_mesh import heights_on, read_mesh
from terrain_forge.writers import write_obj, write_stl
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


def apart(world):
    """The hand-made world with only those of its rocks that lie apart and off the path, sunk in."""
    route = world.trajectories[0].position[:, None, :2]
    near = np.linalg.norm(route - world.field.position[:, :2], axis=-1).min(axis=0)
    clear = world.field.select(near > 0.8 + world.field.diameter)
    second = [b for _, b in overlapping_pairs(clear, world.library)]
    kept = clear.select(~np.isin(clear.id, second))
    sunk = kept.position - np.outer(0.1 * kept.diameter, (0.0, 0.0, 1.0))
    return world.replace(field=kept.replace(position=sunk))


@pytest.fixture(scope="module")
def hill():
    """Over the hand-made ground, along the part of its path that goes up most."""
    world = worlds.world(rover=morpheus())
    whole = world.trajectories[0]
    part = whole.time < 7.0
    arc = whole.replace(time=whole.time[part], position=whole.position[part], rpy=whole.rpy[part])
    return apart(world.replace(trajectories=(arc,)))


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


def test_heights_on_a_mesh_are_those_of_the_triangulated_ground():
    ground = worlds.ground()
    rows, columns = ground.shape
    east, north = np.meshgrid(ground.east, ground.north)
    vertices = np.column_stack([east.ravel(), north.ravel(), ground.elevation.ravel()])
    sw = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    faces = np.vstack(
        [
            np.column_stack([sw, sw + 1, sw + columns + 1]),
            np.column_stack([sw, sw + columns + 1, sw + columns]),
        ]
    )
    points = np.random.default_rng(1).uniform((-12, -8), (12, 8), (300, 2))
    found = heights_on(Mesh(vertices=vertices, faces=faces), points)
    np.testing.assert_allclose(found, ground.height_at(*points.T), atol=1e-12)
    assert np.isnan(heights_on(Mesh(vertices=vertices, faces=faces), np.array([[13.0, 0.0]])))


def test_meshes_are_read_as_they_were_written(tmp_path):
    mesh = worlds.library().prototypes[0].hulls[0]
    obj, stl = tmp_path / "a.obj", tmp_path / "a.stl"
    write_obj(obj, vertices=mesh.vertices, faces=mesh.faces, normals=mesh.vertices)
    write_stl(stl, vertices=mesh.vertices, faces=mesh.faces)
    read = read_mesh(obj)
    np.testing.assert_allclose(read.vertices, mesh.vertices, atol=1e-6)
    np.testing.assert_array_equal(read.faces, mesh.faces)
    triangles = read_mesh(stl)
    np.testing.assert_allclose(
        triangles.vertices[triangles.faces], mesh.vertices[mesh.faces], atol=1e-6
    )


def test_rocks_that_overlap_are_found():
    library = worlds.library()
    field = worlds.field(3).replace(
        position=np.array([[0, 0, 0], [5, 0, 0], [5.4, 0.1, 0]]), scale=np.ones(3)
    )
    assert overlapping_pairs(field, library) == [(1, 2)]
    spread = field.replace(position=np.array([[0, 0, 0], [5, 0, 0], [9, 0, 0]]))
    assert overlapping_pairs(spread, library) == []


def test_outlines_tell_what_circles_cannot():
    """Long rocks side by side: their circles overlap, they do not."""
    library = worlds.library()
    field = worlds.field(2).replace(
        prototype=np.array([1, 1]),
        position=np.array([[0, 0, 0], [0, 1.0, 0]]),
        quaternion=np.array([[1.0, 0, 0, 0]] * 2),
        scale=np.ones(2),
    )
    hull = library.prototypes[1].hulls[0].vertices
    assert 2 * np.hypot(hull[:, 0], hull[:, 1]).max() > 1.0 > np.ptp(hull[:, 1])
    assert overlapping_pairs(field, library) == []


def test_agreement_finds_a_ground_that_is_off(hill, tmp_path):
    (tmp_path / "mjcf").mkdir()
    mjcf.export(hill, tmp_path / "mjcf", options=mjcf.Options())
    exports = [Export(folder="mjcf", kind="mjcf", options={})]
    assert all(check.passed for check in quick_checks(hill, tmp_path, exports, points=200))
    lifted = hill.ground.replace(elevation=hill.ground.elevation + np.float32(0.002))
    checks = quick_checks(hill.replace(ground=lifted), tmp_path, exports, points=200)
    off = {c.name: c for c in checks}
    assert not off["mjcf: ground"].passed
    assert off["mjcf: ground"].figure == pytest.approx(0.002, abs=1e-5)
    moved = hill.field.replace(position=hill.field.position + np.array([0, 0, 0.05]))
    checks = quick_checks(hill.replace(field=moved), tmp_path, exports, points=200)
    off = {c.name: c for c in checks}
    assert not off["mjcf: rocks"].passed


@pytest.mark.parametrize("target", ["sdf", "usd"])
def test_agreement_reads_the_other_formats(hill, tmp_path, target):
    from terrain_forge.model import exporter

    (tmp_path / target).mkdir()
    module = exporter(target)
    module.export(hill, tmp_path / target, options=module.Options())
    exports = [Export(folder=target, kind=target, options={})]
    check, *replays = quick_checks(hill, tmp_path, exports, points=2000)
    assert check.name == f"{target}: ground"
    assert check.passed
    assert [replay.passed for replay in replays] == [True, True]
    lifted = hill.ground.replace(elevation=hill.ground.elevation + np.float32(0.002))
    check, *_ = quick_checks(hill.replace(ground=lifted), tmp_path, exports, points=2000)
    assert not check.passed


def test_random_points_cover_the_ground_evenly(hill):
    points = random_points(hill, 4000)
    west, south, east, north = hill.ground.bounds
    assert hill.ground.covers(*points.T).all()
    counts, *_ = np.histogram2d(*points.T, bins=4, range=[(west, east), (south, north)])
    chi_squared = ((counts - 250) ** 2 / 250).sum()
    assert chi_squared < 37.7  # 15 degrees of freedom, α = 0.001


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
