"""Routes of all kinds: exact lengths, corners, spot turns, speed profiles, files."""

from __future__ import annotations

import numpy as np
import pytest

from terrain_forge import Recipe, plan, realise
from terrain_forge.base import DataError, RecipeError
from terrain_forge.paths import (
    FigureEight,
    Lawnmower,
    Loop,
    PathSpec,
    Planned,
    Polyline,
    Recorded,
    Spiral,
    Spline,
    Triangle,
    deviation,
    duration,
    make_trajectory,
    plan_route,
    read_recorded,
    sample_times,
    spline_places,
    straight_places,
)
from terrain_forge.paths.files import write_trajectory
from terrain_forge.paths.recorded import follow
from terrain_forge.paths.trajectory import pose_at, stretches
from terrain_forge.recipe.schema import adapter
from terrain_forge.rovers import find_rover
from tests.helpers import worlds

ROVER = find_rover("morpheus")
BEND = ((-5.0, 0.0), (0.0, 0.0), (0.0, 4.0))


def spec_of(route, **changes):
    return PathSpec(**{"name": "p", "route": route, "speed_m_s": 0.4} | changes)


def route_of(route, **changes):
    return plan_route(spec_of(route, **changes), rover=ROVER, driven=False)


def lay(route, **changes):
    spec = spec_of(route, **changes)
    planned = plan_route(spec, rover=ROVER, driven=False)
    ground = worlds.ground()
    return make_trajectory(planned, spec=spec, ground=ground, rover=ROVER, seed=3)


SHAPES = [
    Loop(length_m=30.0),
    Loop(length_m=30.0, aspect=0.4),
    Triangle(length_m=30.0),
    Triangle(length_m=30.0, corner_radius_m=0.7),
    Lawnmower(length_m=60.0),
    Lawnmower(length_m=60.0, rows=4, row_spacing_m=1.5, corner_radius_m=0.0),
    Lawnmower(length_m=60.0, corner_radius_m=0.3),
    Spiral(length_m=50.0),
    FigureEight(length_m=40.0),
]


@pytest.mark.parametrize("shape", SHAPES, ids=lambda s: s.kind)
def test_a_shape_has_its_length_to_a_thousandth(shape):
    assert route_of(shape).length == pytest.approx(shape.length_m, rel=1e-3)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda s: s.kind)
def test_a_shape_turned_and_moved_is_the_same_shape(shape):
    moved = type(shape)(**vars(shape) | {"centre_m": (3.0, -2.0), "orientation_deg": 90.0})
    one, other = route_of(shape), route_of(moved)
    x, y = one.position.T
    assert np.allclose(other.position, np.stack([3.0 - y, -2.0 + x], -1), atol=1e-9)
    assert np.allclose(other.heading, one.heading + np.pi / 2)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda s: s.kind)
def test_headings_are_the_way_that_is_gone(shape):
    route = route_of(shape)
    steps = np.diff(route.position, axis=0)
    moves = np.linalg.norm(steps, axis=1) > 1e-9
    gone = np.arctan2(steps[moves, 1], steps[moves, 0])
    middle = 0.5 * (route.heading[1:] + route.heading[:-1])[moves]
    assert np.abs(np.angle(np.exp(1j * (gone - middle)))).max() < 1e-3


def test_shapes_by_their_size():
    """Closed forms: a circle's πd, a triangle's three sides, rows and the arcs between them."""
    assert route_of(Loop(size_m=10.0)).length == pytest.approx(10.0 * np.pi, rel=1e-4)
    assert route_of(Triangle(size_m=10.0)).length == pytest.approx(30.0)
    mower = Lawnmower(size_m=8.0, rows=3, row_spacing_m=2.0)
    # Arcs of radius 1 take 1 m from each inner end of a row.
    assert route_of(mower).length == pytest.approx(3 * 8.0 - 4.0 + 2 * np.pi, rel=1e-3)
    assert np.ptp(route_of(FigureEight(size_m=12.0)).position[:, 0]) == pytest.approx(
        12.0, rel=1e-3
    )
    assert np.ptp(route_of(Spiral(size_m=9.0)).position[:, 0]) == pytest.approx(9.0, rel=1e-2)


def test_closed_shapes_end_as_they_began():
    for shape in (Loop(length_m=30.0), Triangle(length_m=30.0), FigureEight(length_m=40.0)):
        route = route_of(shape)
        assert route.closed
        assert np.allclose(route.position[0], route.position[-1], atol=1e-9)
        turns = (route.heading[-1] - route.heading[0]) / (2 * np.pi)
        assert turns == pytest.approx(round(turns), abs=1e-9)
    assert not route_of(Spiral(length_m=50.0)).closed


def test_shapes_without_room_say_how_much_they_need():
    with pytest.raises(RecipeError, match=r"more than .* do") as caught:
        route_of(Triangle(length_m=3.0, corner_radius_m=1.0))
    assert caught.value.key[-1] == "length_m"
    needed = float(str(caught.value).split("more than ")[1].split(" m")[0])
    assert needed == pytest.approx(2 * np.pi, rel=1e-3)  # nothing but the arcs: a circle
    route_of(Triangle(length_m=needed + 0.01, corner_radius_m=1.0))
    with pytest.raises(RecipeError, match="at most half of row_spacing_m"):
        route_of(Lawnmower(length_m=60.0, row_spacing_m=1.0, corner_radius_m=0.6))
    for wrong in (Loop(), Loop(length_m=3.0, size_m=1.0)):
        with pytest.raises(RecipeError, match="one of length_m and size_m"):
            route_of(wrong)


def test_points_that_are_the_same_are_named():
    for points, closed, said in (
        (((0.0, 0.0), (0.0, 0.0)), False, "points 0 and 1 of"),
        (((0.0, 0.0), (1.0, 0.0), (0.0, 0.0)), True, "points 2 and 0 of"),
    ):
        with pytest.raises(RecipeError, match=said):
            route_of(Polyline(points_m=points, closed=closed))


def test_rounded_corners_stay_on_their_legs():
    route = route_of(Polyline(points_m=BEND, corner_radius_m=1.0))
    assert route.length == pytest.approx(9.0 - 2.0 + np.pi / 2, rel=1e-4)
    assert len(route.turns) == 0
    x, y = route.position.T
    arc = (x > -1.0 + 1e-9) & (y < 1.0 - 1e-9)
    assert np.allclose(np.hypot(x[arc] + 1.0, y[arc] - 1.0), 1.0, atol=1e-9)
    with pytest.raises(RecipeError, match="at most 4 m do"):
        route_of(Polyline(points_m=BEND, corner_radius_m=4.2))
    back = ((0.0, 0.0), (4.0, 0.0), (0.0, 0.0))
    with pytest.raises(RecipeError, match="do not fit"):
        route_of(Polyline(points_m=back, corner_radius_m=0.1))
    assert len(route_of(Polyline(points_m=back)).turns) == 1  # on the spot it can turn back


def test_the_rover_stops_turns_on_the_spot_and_goes_on():
    """Closed form: each leg s/v + v/a, the turn 1.5 · 90° / rate."""
    path = lay(Polyline(points_m=BEND), acceleration_m_s2=0.2, turn_rate_deg_s=10.0, rate_hz=20.0)
    ramps, turn = 2 * 0.4 / 0.2, 1.5 * 90.0 / 10.0
    assert path.time[-1] == pytest.approx(5.0 / 0.4 + 4.0 / 0.4 + ramps + turn, abs=0.05)
    ((begin, end),) = path.spot_turns
    assert begin == pytest.approx(5.0 / 0.4 + 0.4 / 0.2, abs=0.05)
    assert end - begin == pytest.approx(turn, abs=0.05)
    still = (path.time > begin) & (path.time < end)
    assert np.allclose(path.position[still, :2], 0.0, atol=1e-9)
    assert np.degrees(path.rpy[0, 2]) == pytest.approx(0.0)
    assert np.degrees(path.rpy[-1, 2]) == pytest.approx(90.0)
    rate = np.degrees(np.gradient(path.rpy[:, 2], path.time))
    assert rate.max() == pytest.approx(10.0, rel=0.01)
    speed = np.linalg.norm(np.gradient(path.position[:, :2], path.time, axis=0), axis=1)
    assert speed.max() < 0.4 * 1.01
    assert np.abs(np.diff(speed) * 20.0).max() < 0.2 * 1.05
    assert max(speed[0], speed[-1]) < 0.02


def test_a_leg_too_short_for_full_speed_peaks_below_it():
    route = route_of(Polyline(points_m=((0.0, 0.0), (0.2, 0.0))), acceleration_m_s2=0.2)
    assert duration(route) == pytest.approx(2.0 * np.sqrt(0.2 / 0.2))
    time = np.linspace(0.0, duration(route), 201)
    place, _ = pose_at(route, time)
    assert place[100, 0] == pytest.approx(0.1)
    assert np.gradient(place[:, 0], time).max() == pytest.approx(np.sqrt(0.2 * 0.2), rel=0.01)


def test_without_stops_the_speed_is_constant():
    route = route_of(Polyline(points_m=BEND, corner_radius_m=1.0))
    (only,) = stretches(route)
    assert only.duration == pytest.approx(route.length / 0.4)
    assert route_of(Polyline(points_m=BEND)).acceleration > 0.0


def test_a_closed_polyline_turns_back_into_its_first_direction():
    path = lay(Polyline(points_m=((-4.0, -3.0), (4.0, -3.0), (0.0, 4.0)), closed=True))
    assert len(path.spot_turns) == 3
    assert path.spot_turns[-1, 1] == pytest.approx(path.time[-1])
    assert np.allclose(path.position[0], path.position[-1], atol=1e-9)
    assert path.rpy[-1, 2] - path.rpy[0, 2] == pytest.approx(2 * np.pi)


@pytest.mark.parametrize("places_between", [spline_places, straight_places])
def test_simulators_follow_spot_turns(places_between):
    """Gazebo's and USD's interpolation stay within 5 mm and 1 mrad of stops and turns."""
    path = lay(Polyline(points_m=BEND))
    times = sample_times(path, places_between)
    poses = path.at(times)
    found = deviation(
        path,
        times=times,
        position=poses.position,
        quaternion=poses.quaternion,
        places_between=places_between,
    )
    assert found.within()


def read(folder, text, **changes):
    (folder / "track.csv").write_text(text)
    spec = Recorded(**{"file": "track.csv"} | changes)
    poses = read_recorded(spec, folder, key=("file",))
    return follow(spec, poses, key=("file",))


def plan_file(folder, file, **changes):
    spec = spec_of(Recorded(file=file, **changes), rate_hz=12.0)
    poses = read_recorded(spec.route, folder, key=("file",))
    route = plan_route(spec, rover=ROVER, driven=False, recorded=poses)
    return make_trajectory(route, spec=spec, ground=worlds.ground(), rover=ROVER, seed=3)


@pytest.mark.parametrize("suffix", ["csv", "tum"])
@pytest.mark.parametrize("route", [Spline(points_m=BEND), Polyline(points_m=BEND)])
def test_our_own_files_read_back_as_the_same_motion(tmp_path, suffix, route):
    path = lay(route)
    write_trajectory(path, tmp_path)
    again = plan_file(tmp_path, f"p.{suffix}", timing="recorded")
    assert again.time[-1] == pytest.approx(path.time[-1], abs=1e-6)
    assert np.allclose(again.position, path.position, atol=1e-6)
    tolerance = 1e-6 if suffix == "csv" else 1e-3  # the yaw of a tilted pose, from its quaternion
    assert np.allclose(again.rpy[:, 2], path.rpy[:, 2], atol=tolerance)


@pytest.mark.parametrize("suffix", ["csv", "tum"])
def test_a_recorded_stance_is_kept(tmp_path, suffix):
    """A suspension's motion, which the ground does not tell: here a shaken and raised one."""
    flat = lay(Spline(points_m=BEND))
    count = len(flat.time)
    swing = 0.1 * np.sin(0.7 * np.arange(count)[:, None] + np.arange(3))
    path = flat.replace(
        position=flat.position + swing * (0.0, 0.0, 1.0), rpy=flat.rpy + swing * (1.0, 1.0, 0.0)
    )
    write_trajectory(path, tmp_path)
    again = plan_file(tmp_path, f"p.{suffix}", timing="recorded", attitude="recorded")
    assert np.allclose(again.position, path.position, atol=1e-6)
    assert np.allclose(again.rpy, path.rpy, atol=1e-6)
    level = plan_file(tmp_path, f"p.{suffix}", timing="recorded")
    assert np.abs(level.position[:, 2] - path.position[:, 2]).max() > 0.05


def test_a_recorded_track_is_followed_at_the_paths_own_speed(tmp_path):
    path = lay(Spline(points_m=BEND))
    write_trajectory(path, tmp_path)
    again = plan_file(tmp_path, "p.tum")
    assert again.time[-1] == pytest.approx(path.time[-1], rel=1e-3)
    away = np.linalg.norm(again.position[:, None, :2] - path.position[None, :, :2], axis=2)
    assert away.min(axis=1).max() < 0.02


def test_files_of_all_kinds(tmp_path):
    plain, _ = read(tmp_path, "0 0\n1 0\n2 0.5\n")
    commas, _ = read(tmp_path, "# a comment\n0,0\n1,0\n2,0.5\n")
    named, _ = read(tmp_path, "what,Y,X\na,0,0\nb,0,1\nc,0.5,2\n")
    assert np.array_equal(plain.position, commas.position)
    assert np.array_equal(plain.position, named.position)
    turned, _ = read(tmp_path, "0 0\n1 0\n2 0.5\n", turn_deg=90.0, origin_m=(3.0, 4.0))
    x, y = plain.position.T
    assert np.allclose(turned.position, np.stack([3.0 - y, 4.0 + x], -1))
    _, time = read(tmp_path, "t,x,y,yaw_deg\n5,0,0,0\n6,1,0,10\n8,2,0,20\n", timing="recorded")
    assert time[0] == 0.0
    assert time[-1] == 3.0


@pytest.mark.parametrize(
    ("text", "changes", "said"),
    [
        ("", {}, "empty"),
        ("a,b\n1,2\n3,4\n", {}, "needs columns x and y .*, found a, b"),
        ("x;y\n1;2\n3;4\n", {}, "with commas or blanks between them, found x;y"),
        ("0 0 0 0 0 0 0 1\n1 1 0 0 0 0 0 0\n", {}, "quaternion of pose 2 has the length 0"),
        ("0 0 0\n1 1 1\n", {}, "3 columns without names"),
        ("x,y\n0,0\n1,nan\n", {}, "line 3: y must be a number"),
        ("x,y\n0,0\n1\n", {}, "line 3: 1 fields, expected 2"),
        ("x,x_m,y\n0,0,0\n1,1,1\n", {}, "two columns for x"),
        ("x,y\n0,0\n", {}, "1 poses"),
        ("t,x,y\n1,0,0\n1,1,0\n", {}, "time of pose 2"),
        ("x,y\n0,0\n1,0\n", {"timing": "recorded"}, "has no times"),
        (
            "t,x,y,yaw\n0,0,0,0\n1,1,0,0\n",
            {"timing": "recorded", "attitude": "recorded"},
            "needs columns z and qw, qx, qy, qz",
        ),
        ("x,y\n0,0\n0.01,0\n", {}, "does not move by 0.1 m"),
    ],
)
def test_wrong_files_are_refused_in_words(tmp_path, text, changes, said):
    with pytest.raises(DataError, match=said):
        read(tmp_path, text, **changes)


FLAT = {
    "name": "yard",
    "body": "mars",
    "dtm": {"kind": "flat", "size_m": [24, 16]},
    "terrain": {"spacing_m": 0.25},
    "rocks": {"library": {"shapes": 1}},
}


def test_a_file_is_an_input_and_the_site_needs_it_no_more(tmp_path):
    (tmp_path / "track.csv").write_text("x,y\n-5,0\n0,1\n5,0\n")
    path = {"name": "p", "route": {"kind": "file", "file": "track.csv"}, "speed_m_s": 0.5}
    recipe: Recipe = adapter().validate_python({**FLAT, "paths": [path]})
    site = plan(recipe, folder=tmp_path)
    assert [name for name, _ in site.inputs] == ["track.csv"]
    (tmp_path / "track.csv").unlink()
    (laid,) = realise(site).trajectories
    assert laid.position[0, :2] == pytest.approx((-5.0, 0.0))
    with pytest.raises(DataError, match=r"track\.csv"):
        plan(recipe, folder=tmp_path)
    (tmp_path / "track.csv").write_text("x,y\n-5,0\n0,1\n50,0\n")
    with pytest.raises(RecipeError, match="leaves the terrain"):
        plan(recipe, folder=tmp_path)


def test_planned_paths_may_not_shape_the_world():
    planned = Planned(start_m=(-8.0, 0.0), goal_m=(8.0, 0.0))
    path = {"name": "p", "route": vars(planned), "speed_m_s": 0.5}
    for changes, said in [
        ({"corridor": {"width_m": 1.0}}, "corridor"),
        ({"route": vars(planned) | {"goal_m": (80.0, 0.0)}}, "outside the site"),
        ({"route": vars(planned) | {"goal_m": (-8.0, 0.0)}}, "from the place before it"),
    ]:
        with pytest.raises(RecipeError, match=said):
            plan(adapter().validate_python({**FLAT, "paths": [path | changes]}))
    ripples = {"kind": "fractal", "mask": {"route": {"path": "p", "within_m": 1.0}}}
    terrain = {"spacing_m": 0.25, "layers": [ripples]}
    with pytest.raises(RecipeError, match="cannot shape it"):
        plan(adapter().validate_python({**FLAT, "terrain": terrain, "paths": [path]}))


def test_a_recorded_stance_needs_its_times(tmp_path):
    with pytest.raises(RecipeError, match="needs `timing: recorded`") as error:
        read(tmp_path, "x,y\n0,0\n1,0\n", attitude="recorded")
    assert error.value.key == ("attitude",)
