"""What rays of sensors meet: ground beyond the edge, the rover itself; mounts that see nothing."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from terrain_forge.base import DataError, RecipeError, TerrainForgeError, kernel
from terrain_forge.geometry import rover_looks
from terrain_forge.model import Trajectory
from terrain_forge.scene import BODY, GROUND, MISSED, OUTSIDE, RayScene, shade8, subject_of
from terrain_forge.scene.embree import INCOHERENT
from terrain_forge.scene.packets import ACTIVE, FAR, packet_memory, set_ray
from terrain_forge.sensors import (
    Curve,
    Motion,
    RoverLinks,
    Scenery,
    Setting,
    check_mounts,
    motion_of_path,
    rolled,
)
from terrain_forge.terrain import heights_beyond
from tests.helpers import worlds
from tests.helpers.rovers import morpheus, skid4

DOWN = np.array([0.0, 0.0, -1.0])


@pytest.fixture(scope="module")
def scenery():
    world = worlds.with_horizon(worlds.world(rover=skid4()))
    with Scenery(world, motion_of_path(world.trajectories[0])) as scenery:
        yield scenery


def beyond_edge(scenery):
    return partial(heights_beyond, scenery.world.ground, scenery.world.horizon)


def border(bounds, count=4000):
    """Points on a rectangle and the outward directions there, corners among them."""
    west, south, east, north = bounds
    part = np.linspace(0, 1, count)
    x, y = west + part * (east - west), south + part * (north - south)
    points = [np.column_stack([x, 0 * x + level]) for level in (south, north)]
    points += [np.column_stack([0 * y + level, y]) for level in (west, east)]
    outward = np.repeat([[0.0, -1.0], [0.0, 1.0], [-1.0, 0.0], [1.0, 0.0]], count, axis=0)
    return np.concatenate(points), outward


def test_the_ground_goes_on_beyond_its_edge_without_step_or_crack(scenery):
    ground = scenery.world.ground
    points, outward = border(ground.bounds)
    edge = ground.height_at(*points.T)
    for away in (1e-6, 1e-3):
        beyond = beyond_edge(scenery)(*(points + away * outward).T)
        assert np.abs(beyond - edge).max() < 2.0 * away + 1e-6
    random = np.random.default_rng(0)
    directions = random.normal(size=(len(points), 3))
    directions[:, 2] = -np.abs(directions[:, 2]) - 3.0
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    starts = np.column_stack([points, edge + 1e-4]) - 2e-3 * directions
    hits = scenery.scene.cast(starts, directions)
    assert set(np.unique(hits.rock)) == {GROUND, OUTSIDE}
    assert hits.distance.max() < 0.02


def test_light_falls_on_both_sides_of_the_edge_alike(scenery):
    ground, apron = scenery.world.ground, scenery.world.horizon
    slopes = np.gradient(ground.elevation.astype(float), ground.spacing)
    normals = np.stack([-slopes[1], -slopes[0], np.ones(ground.shape)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    west, south, east, north = ground.bounds
    x, y = apron.mesh.vertices[:, 0], apron.mesh.vertices[:, 1]
    edge = np.flatnonzero((x >= west) & (x <= east) & (y >= south) & (y <= north))
    rows, columns = (
        np.round((c[edge] - o) / ground.spacing).astype(int) for c, o in ((y, south), (x, west))
    )
    assert len(set(zip(rows, columns, strict=True))) == len(edge) == 2 * sum(ground.shape) - 4
    assert apron.normals[edge] == pytest.approx(normals[rows, columns])
    assert np.array_equal(apron.mesh.vertices[edge, 2], ground.elevation[rows, columns])
    assert apron.normals[:, 2].min() > 0.5


def test_rays_meet_the_apron_where_its_heights_are_and_out_to_the_horizon(scenery):
    random = np.random.default_rng(1)
    west, south, east, north = scenery.world.ground.bounds
    half = np.array([east - west, north - south]) / 2
    away = np.exp(random.uniform(np.log(1e-3), np.log(0.98 * scenery.world.horizon.reach), 5000))
    turn = random.uniform(0, 2 * np.pi, 5000)
    towards = np.column_stack([np.cos(turn), np.sin(turn)])
    towards /= np.abs(towards).max(axis=1, keepdims=True)
    points = np.array([west + east, south + north]) / 2 + towards * (half + away[:, None])
    heights = beyond_edge(scenery)(*points.T)
    assert np.array_equal(heights, scenery.height_at(*points.T))
    hits = scenery.scene.cast(np.column_stack([points, heights + 20.0]), DOWN)
    assert np.all(hits.rock == OUTSIDE)
    assert np.abs(hits.distance - 20.0).max() < 1e-3
    near = away < 20.0
    assert np.abs(hits.distance - 20.0)[near].max() < 2e-5
    far = away > 0.9 * scenery.world.horizon.reach  # level, but for the body's curvature
    drop = np.hypot(*(points - np.clip(points, (west, south), (east, north))).T) ** 2
    level = heights + drop / (2 * scenery.world.site.body.mean_radius)
    assert np.ptp(level[far]) < 0.2
    with pytest.raises(ValueError, match="beyond the world's edge"):
        beyond_edge(scenery)(0.0, 0.0)


def test_what_lies_within_the_world_is_met_as_before_to_the_bit(scenery):
    random = np.random.default_rng(2)
    origins = random.uniform((-11, -7, 3), (11, 7, 6), (4000, 3))
    directions = random.normal(size=(4000, 3))
    with_apron = scenery.scene.cast(origins, directions)
    subject = subject_of(scenery.world.replace(horizon=None))
    with RayScene(subject, often=True) as alone:
        without = alone.cast(origins, directions)
    with RayScene(subject) as seldom:
        nearly = seldom.cast(origins, directions)
    met = without.rock != MISSED
    assert np.array_equal(without.rock[met], with_apron.rock[met])
    assert np.array_equal(without.distance[met], with_apron.distance[met])
    assert np.array_equal(without.normal[met], with_apron.normal[met])
    assert np.mean(nearly.rock == without.rock) > 0.999
    same = met & (nearly.rock == without.rock)
    assert np.abs(nearly.distance[same] - without.distance[same]).max() < 1e-4
    down = directions[:, 2] < -0.01
    assert not np.any(with_apron.rock[down] == MISSED)


def test_the_apron_follows_the_dtm_as_far_as_it_goes():
    """A ridge that the site's DTM shows beyond the edge is there, a bump at the edge runs out."""
    posts = np.arange(-60.0, 61.0)
    ridge = 3.0 * np.exp(-(((posts - 30.0) / 6.0) ** 2))
    dtm = worlds.patch(np.tile(ridge, (len(posts), 1)), (1.0, 0.0, 60.0, 0.0, 1.0, 60.0))
    world = worlds.world()
    world = worlds.with_horizon(world.replace(site=world.site.replace(dtm=dtm)))
    edge = partial(heights_beyond, world.ground, world.horizon)
    along = np.linspace(-20.0, 20.0, 9)
    crest = edge(np.full(9, 30.0), along)
    below = edge(np.full(9, 45.0), along)
    assert np.all(np.abs(crest - below - 3.0) < 0.4)
    assert np.abs(edge(np.full(9, 300.0), along)).max() < 0.5


def test_rays_meet_the_rover_where_it_is_at_their_time(scenery):
    """The body is a box 0.86 × 0.44 m whose top is 0.36 m above base_link's origin."""
    times = np.array([2.0, 9.5])
    state = scenery.motion.base.at(times)
    over = state.position + np.einsum("nij,j->ni", state.rotation, (-0.1, 0.05, 1.5))
    down = -state.rotation[:, :, 2]
    hits = scenery.cast(over, down, times)
    assert np.all(hits.rock == BODY)
    assert hits.distance == pytest.approx(1.5 - 0.36, abs=1e-5)
    assert hits.normal == pytest.approx(state.rotation[:, :, 2], abs=1e-5)
    elsewhere = scenery.cast(over, down, times[::-1].copy())
    assert np.all(elsewhere.rock != BODY)
    within = state.position + np.einsum("nij,j->ni", state.rotation, (0.0, 0.0, 0.25))
    assert scenery.cast(within, down, times).rock.tolist() == [BODY, BODY]


def test_one_point_or_direction_serves_all_rays(scenery):
    above = scenery.motion.base.at(2.0).position[0] - 1.5 * DOWN
    places, ways = above + np.outer(np.arange(12), [0.05, 0.0, 0.0]), np.tile(DOWN, (12, 1))
    whole = scenery.cast(places, ways, 2.0).distance
    assert np.ptp(whole) > 0.1
    assert np.array_equal(scenery.cast(places, DOWN, np.full(12, 2.0)).distance, whole)
    assert np.array_equal(scenery.cast(above, ways[:5], [2.0]).distance, whole[[0] * 5])
    assert np.array_equal(scenery.scene.cast(above, DOWN).rock, [GROUND])


@pytest.mark.parametrize(
    ("origins", "directions", "times", "message"),
    [
        (
            np.zeros((4, 3)),
            np.ones((3, 3)),
            2.0,
            r"shape \(4, 3\) and directions of shape \(3, 3\)",
        ),
        ([0, 0], [1, 1], 2.0, r"shape \(2,\) and .* both must be \(rays, 3\)"),
        ("up", DOWN, 2.0, "origins of rays must be numbers"),
        (DOWN, [0, np.nan, 1], 2.0, "directions of rays must be finite"),
        (DOWN, [0, 0, 0], 2.0, "a length above 0"),
        (np.zeros((4, 3)), DOWN, [2.0, 3.0], "2 times for 4 rays: one, or one for each"),
        (DOWN, DOWN, [], r"times of shape \(0,\)"),
        (DOWN, DOWN, np.nan, "times of rays must be finite"),
    ],
)
def test_rays_that_are_none_are_refused_in_a_line(scenery, origins, directions, times, message):
    with pytest.raises(DataError, match=message):
        scenery.cast(origins, directions, times)


def test_rays_at_what_is_closed_are_refused(scenery):
    with Scenery(scenery.world, scenery.motion) as closed:
        above = scenery.motion.base.at(2.0).position - 1.5 * DOWN
        assert closed.cast(above, DOWN[None], 2.0).rock == [BODY]
    with pytest.raises(TerrainForgeError, match="closed"):
        closed.cast(above, DOWN[None], 2.0)
    with pytest.raises(TerrainForgeError, match="closed"):
        closed.rover_at(5.0)


@pytest.mark.slow
def test_the_rover_throws_a_shadow(scenery):
    time = 5.0
    state = scenery.motion.base.at(time)
    under = state.position[0] + state.rotation[0] @ [0.0, 0.0, 0.05]
    beside = state.position[0] + state.rotation[0] @ [0.0, 2.0, 0.3]
    rover = scenery.rover_at(time)
    starts = np.stack([under, beside]) - scenery.scene.origin
    room, poses = packet_memory(2), np.repeat(scenery.poses_at(time), 8, axis=0)
    dark = np.zeros(2, np.bool_)
    _shade(scenery.scene.handle, rover.bodies, poses, INCOHERENT, starts, room, dark)
    assert dark.tolist() == [True, False]


@kernel
def _shade(scene, bodies, poses, query, starts, room, dark):
    ray, own = room[0], room[1]
    word = ray.view(np.uint32)
    word[ACTIVE] = 0
    for lane in range(len(starts)):
        start = starts[lane]
        set_ray(ray, word, lane, (start[0], start[1], start[2]), (0.0, 0.0, 1.0), 0.0, np.inf)
    shade8(scene, bodies, poses, query, ray, own)
    for lane in range(len(starts)):
        dark[lane] = ray[FAR, lane] < 0.0


def test_links_and_wheels_move_in_what_rays_meet():
    rover = morpheus()
    step = 0.1
    samples = np.zeros((101, 6))
    samples[:, 0] = 0.2 * step * np.arange(101)
    base = Curve(begin=0.0, step=step, samples=samples)
    tilted = np.tile([0.1, 0.2, 0.3, 0.0, 0.5, 0.0], (101, 1))
    rocker = Curve(begin=0.0, step=step, samples=tilted)
    world = worlds.world(rover=rover)
    ideal = Motion(path="line", source="path", base=base)
    assert rolled(rover, ideal)[-1] == pytest.approx(2.0 / rover.wheel_radii)
    motion = Motion(path="line", source="drive", base=base, links=(("rocker_left", rocker),))
    with Scenery(world, motion) as scenery:
        places = RoverLinks(rover, motion).at(4.0)
        place, turn = places["rocker_left"]
        assert place == pytest.approx([0.1, 0.2, 0.3])
        wheel = next(link for link in rover.links if link.parent == "rocker_left")
        assert places[wheel.name][0] == pytest.approx(place + turn @ wheel.origin)
        angle = 4.0 * 0.2 / rover.wheels[0].radius
        spun = places[wheel.name][1]
        assert np.trace(turn.T @ spun) == pytest.approx(1.0 + 2.0 * np.cos(angle))
        assert (turn.T @ spun)[0, 2] == pytest.approx(np.sin(angle))  # forwards: z turns to x
        row = next(n for n, look in enumerate(rover_looks(rover)) if look.link == "rocker_left")
        assert scenery.rover_at(4.0).bodies.rotation[row] == pytest.approx(turn)


def test_sensors_that_see_nothing_are_refused(scenery):
    world, motion = scenery.world, scenery.motion
    setting = Setting(world=world, motion=motion, scenery=scenery, gravity=3.7, seed=1)
    seeing = [sensor for sensor in world.rover.sensors if sensor.kind != "imu"]
    check_mounts(setting, seeing)
    inside = seeing[0].replace(position_m=(0.0, 0.0, 0.3))
    with pytest.raises(RecipeError, match=r"inside a box of the rover's link 'base_link'"):
        check_mounts(setting, [inside])
    with pytest.raises(RecipeError, match=r"or, where that is its housing, give it near_m: 0\.\d+"):
        check_mounts(setting, [inside])
    check_mounts(setting, [inside.replace(near_m=1.0)])
    with pytest.raises(RecipeError, match=r"'lidar' is 0\.\d+ m below the ground after .* s of"):
        check_mounts(setting, [seeing[1].replace(position_m=(0.9, 0.0, -0.4))])


def test_a_sensor_sees_through_its_housing_and_no_farther(scenery):
    """From within the chassis: all of it is nearer than a metre, the ground below is not."""
    place = np.array([[0.0, 0.0, 0.3]])
    base = scenery.motion.base.at(1.0)
    origin = base.position + (base.rotation[0] @ place[0])
    ahead = base.rotation[:, :, 0]
    assert scenery.cast(origin, ahead, 1.0).rock[0] == BODY
    free = scenery.cast(origin, ahead, 1.0, near=1.0)
    assert free.rock[0] != BODY
    assert free.distance[0] > 1.0


def test_a_mast_that_drives_into_a_hill_is_refused():
    """The sensor hangs free of the rover, and low: only the hill on the way reaches it."""
    world = worlds.world(rover=skid4())
    time = np.linspace(0.0, 20.0, 241)
    east = np.linspace(-8.0, 8.0, 241)
    level = np.column_stack([east, np.full(241, -3.0), np.full(241, 0.3)])
    way = Trajectory(
        name="through", time=time, position=level, rpy=np.zeros((241, 3)), closed=False
    )
    motion = motion_of_path(way)
    with Scenery(world, motion) as scenery:
        setting = Setting(world=world, motion=motion, scenery=scenery, gravity=3.7, seed=1)
        with pytest.raises(RecipeError, match=r"below the ground after 1\d\.\d s of 'through'"):
            check_mounts(setting, [world.rover.sensors[1]])
