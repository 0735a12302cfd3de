"""Learning to drive: the environment."""

from __future__ import annotations

import copy
import pickle
import shutil
import sys
import threading
import warnings
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import terrain_forge as tf
from terrain_forge.variation import name_of, read_summary, worlds
from tests.helpers.driving_worlds import ID, make, mix_up_shapes, recipe

gymnasium = pytest.importorskip("gymnasium")
from terrain_forge import learning  # noqa: E402
from terrain_forge.learning import starter  # noqa: E402
from terrain_forge.learning.sight import DepthCamera, HeightScan  # noqa: E402


@pytest.mark.parametrize("sight", ["heights", "depth", "none"])
def test_it_passes_gymnasiums_checker(made, sight):
    from gymnasium.utils.env_checker import check_env

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(make(made, sight=sight).unwrapped, skip_render_check=True)


def episode(env, seed, steps=12):
    seen, told = env.reset(seed=seed)
    found = [*seen.values()]
    for n in range(steps):
        seen, reward, *_, told = env.step(np.array([0.8, np.sin(n)], np.float32))
        found += [*seen.values(), np.array(reward)]
    return np.concatenate([np.ravel(part) for part in found]), told["world"]


def test_a_seed_tells_all_that_follows(made):
    env = make(made)
    first = [episode(env, seed) for seed in (1, 2, 3, 1)]
    assert np.array_equal(first[0][0], first[3][0])
    assert not np.array_equal(first[0][0], first[1][0])
    assert np.array_equal(episode(make(made), 1)[0], first[0][0])


class Drawing:
    """Stands in for MuJoCo's renderer, which cannot be copied either."""

    def __init__(self, *_):
        self.lock = threading.Lock()

    def update_scene(self, *_):
        """Draw nothing."""

    def render(self):
        """A black picture."""
        return np.zeros((4, 4, 3), np.uint8)

    def close(self):
        """Let go of nothing."""


def test_a_copy_goes_on_as_the_one_that_it_is_of(made, monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "egl")
    monkeypatch.setattr("mujoco.Renderer", Drawing)
    env, action = make(made, render_mode="rgb_array"), np.array([0.8, 0.3], np.float32)
    episode(env, 1, 3)
    env.render()
    copies = copy.deepcopy(env), pickle.loads(pickle.dumps(env))
    for _ in range(5):
        seen, reward, *_ = env.step(action)
        for one in copies:
            also, gained, *_ = one.step(action)
            assert np.array_equal(also["proprioception"], seen["proprioception"])
            assert gained == reward
    assert copies[1].render().shape == (4, 4, 3)
    assert np.array_equal(copies[0].reset()[0]["heights"], env.reset()[0]["heights"])


def test_two_in_the_same_world_do_not_meet(made):
    one, other = make(made, numbers=[0]), make(made, numbers=[0])
    one.reset(seed=1)
    seen = one.step(np.array([0.5, 0.0], np.float32))[0]["proprioception"]
    one.reset(seed=1)
    other.reset(seed=2)
    other.step(np.array([1.0, 1.0], np.float32))
    assert np.array_equal(one.step(np.array([0.5, 0.0], np.float32))[0]["proprioception"], seen)


def test_side_by_side_they_do_what_each_does_alone(made):
    given = {"worlds": str(made.directory), "distance_m": 3.0}
    many = gymnasium.make_vec(ID, num_envs=2, vectorization_mode="sync", **given)
    seen, _ = many.reset(seed=7)
    action = np.array([[0.5, 0.1], [0.2, -0.4]], np.float32)
    seen, reward, *_ = many.step(action)
    for n in range(2):
        alone = make(made)
        alone.reset(seed=7 + n)
        own, gained, *_ = alone.step(action[n])
        assert np.array_equal(own["heights"], seen["heights"][n])
        assert np.array_equal(own["proprioception"], seen["proprioception"][n])
        assert gained == reward[n]
    many.close()


@pytest.mark.slow
def test_in_processes_of_their_own_they_do_the_same(made):
    """Gymnasium's AsyncVectorEnv: steps, observations and what is told, over an episode's end."""
    given = {"worlds": str(made.directory), "distance_m": 3.0}
    rounds = []
    for mode in ("sync", "async"):
        many = gymnasium.make_vec(ID, num_envs=2, vectorization_mode=mode, **given)
        seen, _ = many.reset(seed=7)
        random, found, ends = np.random.default_rng(2), [], 0
        for _ in range(60):
            turn = 0.1 * random.standard_normal((2, 1))
            action = np.concatenate([np.zeros((2, 1)), turn], axis=1).astype(np.float32)
            seen, reward, ended, late, _ = many.step(action)
            found += [seen["heights"].copy(), seen["proprioception"].copy(), reward, ended, late]
            ends += int(ended.sum())
        many.close()
        assert ends >= 1  # stuck after five seconds: it begins anew
        rounds.append(found)
    for one, other in zip(*rounds, strict=True):
        assert np.array_equal(one, other)


def test_driving_to_the_goal_pays_and_standing_does_not(made):
    env = make(made, numbers=[0])
    seen, told = env.reset(seed=3, options={"world": 0})
    assert told["world"] == name_of(0)
    way, total, over = told["distance"], 0.0, False
    while not over:
        p = seen["proprioception"]
        bearing = np.arctan2(p[1], p[2])
        action = np.array([1.0 - min(abs(bearing), 0.9), np.clip(2 * bearing, -1, 1)], np.float32)
        seen, reward, ended, late, told = env.step(action)
        total, over = total + reward, ended or late
    assert told["ended"] == "arrived"
    assert 4.0 < total - (way - told["distance"]) < 5.0
    env.reset(seed=3)
    for _ in range(60):
        *_, ended, _late, told = env.step(np.zeros(2, np.float32))
        if ended:
            break
    assert told["ended"] == "stuck"


def test_a_rover_that_turned_in_the_last_seconds_is_not_stuck(made):
    env = make(made, numbers=[0])
    env.reset(seed=3)
    place, ended, steps = env.unwrapped.arena.data.qpos[:2].copy(), False, 0
    while not ended:
        turn = 1.0 if steps < 40 else 0.0
        *_, ended, _late, told = env.step(np.array([0.0, turn], np.float32))
        steps += 1
        if steps == 60:
            assert np.hypot(*(env.unwrapped.arena.data.qpos[:2] - place)) < 0.1, "on the spot"
    assert told["ended"] == "stuck"
    assert 75 < steps < 95  # five seconds after all but 15 degrees of its turn


@pytest.mark.parametrize("what", ["qpos", "qvel"])
def test_a_simulation_that_breaks_is_a_failure(made, what):
    env = make(made).unwrapped
    env.reset(seed=1)
    env.step(np.zeros(2, np.float32))
    getattr(env.arena.data, what)[0] = 1e11  # MuJoCo then puts all where it was at first
    seen, reward, ended, late, told = env.step(np.zeros(2, np.float32))
    assert (ended, late, told["ended"]) == (True, False, "unstable")
    assert reward == pytest.approx(-5.0 - 0.05 * 0.1)
    assert env.observation_space.contains(seen)
    env.reset(seed=1)
    assert not env.step(np.zeros(2, np.float32))[2]


def test_attitude_and_place_are_of_one_moment(made):
    env = make(made, sight="none").unwrapped
    seen, _ = env.reset(seed=1)
    for _ in range(5):
        w, x, y, z = env.arena.data.qpos[env.parts.pose][3:]
        pitch, roll = np.arcsin(2 * (w * y - z * x)), np.arctan2(y * z + w * x, 0.5 - x * x - y * y)
        assert np.allclose(seen["proprioception"][3:5], [pitch, roll], rtol=0, atol=1e-6)
        seen, *_ = env.step(np.array([1.0, 1.0], np.float32))


def test_numbers_may_be_told_one_by_one(made):
    env = learning.DriveEnv(made.directory, numbers=(n for n in (1,)))
    assert [folder.name for folder in env.folders] == [name_of(1)]
    assert learning.DriveEnv(made.directory, distance_m=np.float32(3.0), difficulty=[0, 1])


def test_a_drive_ends_once_a_wheel_is_beyond_the_border(made):
    env = make(made).unwrapped
    env.reset(seed=3)
    arena = env.arena
    west, *_ = arena.world.ground.bounds
    arena.set_down(env.parts, np.array([west + 0.8, 0.0]), np.pi)
    for _ in range(60):
        *_, ended, _late, told = env.step(np.array([1.0, 0.0], np.float32))
        if ended:
            break
    assert told["ended"] == "left the world"
    assert arena.data.xpos[env.parts.body, 0] > west + 0.1
    assert arena.data.xmat[env.parts.body, 8] > 0.9, "upright still"


def test_heights_ahead_show_what_stands_there(made):
    env = make(made).unwrapped
    seen = env.reset(seed=0)[0]["heights"]
    arena, parts = env.arena, env.parts
    x, y, z, *_ = arena.data.qpos[parts.pose]
    turn = arena.data.xmat[parts.body]
    heading = np.arctan2(turn[3], turn[0])
    for row, column in ((0, 0), (5, 4), (12, 8)):
        ahead, aside = -0.5 + 0.25 * row, -1.0 + 0.25 * column
        east = x + ahead * np.cos(heading) - aside * np.sin(heading)
        north = y + ahead * np.sin(heading) + aside * np.cos(heading)
        i = round((north - arena.origin[1]) / arena.spacing)
        j = round((east - arena.origin[0]) / arena.spacing)
        if 2 <= i < arena.top.shape[0] - 2 and 2 <= j < arena.top.shape[1] - 2:
            around = arena.top[i - 2 : i + 3, j - 2 : j + 3]
            assert seen[row, column] == pytest.approx(around.max() - z, abs=1e-5)


@pytest.mark.parametrize("spacing", [0.05, 0.1, 0.125, 0.2, 0.25])
def test_no_spike_between_the_points_hides_and_none_is_seen_on_one_side_more(spacing):
    """What stands on one node is seen by the points next to it, whichever way the rover heads."""
    generator = np.random.default_rng(3)
    count = round(8 / spacing) + 1
    origin, off = np.array([-4.0, -4.0]), []
    for number in range(150):
        yaw = generator.uniform(-np.pi, np.pi)
        place = generator.uniform(-0.5, 0.5, 2)
        turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
        spike = place + turn @ (generator.uniform(-0.3, 2.3), generator.uniform(-0.9, 0.9))
        i, j = np.rint((spike - origin) / spacing).astype(int)
        top = np.zeros((count, count), np.float32)
        top[j, i] = 1.0
        arena = SimpleNamespace(
            folder=number, written=0, top=top, spacing=spacing, origin=tuple(origin),
            data=SimpleNamespace(qpos=np.array([*place, 0.0, 1.0, 0.0, 0.0, 0.0])),
        )  # fmt: skip
        scan = HeightScan()
        scan.begin(arena)
        seen = scan.look(arena, SimpleNamespace(pose=slice(0, 7)), np.cos(yaw), np.sin(yaw))
        rows, columns = np.nonzero(seen > 0.5)
        assert len(rows)
        points = place[:, None] + turn @ np.array([-0.5 + 0.25 * rows, -1.0 + 0.25 * columns])
        off.append(points.mean(axis=1) - origin - spacing * np.array([i, j]))
    assert np.abs(np.mean(off, axis=0)).max() < 0.03


def test_depths_end_where_the_ground_begins(made):
    env = make(made, sight="depth").unwrapped
    env.reset(seed=2)
    arena, parts = env.arena, env.parts
    arena.top[:] = 0.0
    camera = DepthCamera()
    camera.begin(arena)
    x, y = (arena.origin[axis] + 0.5 * arena.spacing * arena.top.shape[1 - axis] for axis in (0, 1))
    arena.data.xpos[parts.body] = x, y, 0.3
    arena.data.xmat[parts.body] = np.eye(3).ravel()
    seen = camera.look(arena, parts, 1.0, 0.0)
    eye = 0.3 + max(2.0 * arena.rover.clearance, 0.4)
    down = np.radians(20.0) - np.linspace(np.radians(25.0), -np.radians(25.0), 16)
    for row in (8, 11, 15):
        assert seen[row, 12] == pytest.approx(eye / np.sin(down[row]), abs=2e-3)


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({"numbers": [0, 77, 99]}, "no world 00077, 00099; it has 2, 00000 to 00001$"),
        ({"numbers": range(9)}, "no world 00002, 00003, 00004, 00005, 00006, …; it has"),
        ({"numbers": []}, "numbers: none given"),
        ({"difficulty": (0.9, 1.0)}, "no worlds of difficulty 0.9 to 1: theirs is"),
    ],
)
def test_worlds_that_are_not_there_are_told(made, given, why):
    with pytest.raises(tf.OutputError, match=why):
        make(made, **given)


def test_worlds_of_two_rovers_are_refused_at_once(made, tmp_path):
    out = shutil.copytree(made.directory, tmp_path / "mixed")
    drawn = out / name_of(1) / "drawn.json"
    rover = read_summary(out / name_of(1))["rover"]
    drawn.write_text(drawn.read_text().replace(f'"{rover}"', '"other"'))
    with pytest.raises(tf.OutputError, match=f"has the rover 'other', 00000 has '{rover}': give"):
        learning.DriveEnv(out)
    assert learning.DriveEnv(out, numbers=[1]).arena.folder.name == name_of(1)


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({"sight": "height"}, "sight: .*did you mean 'heights'"),
        ({"sight": None}, "sight: "),
        ({"speed_m_s": -1.0}, "speed_m_s: "),
        ({"speed_m_s": 50.0}, "speed_m_s: 50 is above the rover's "),
        ({"distance_m": float("nan")}, "distance_m: "),
        ({"distance_m": 0.4}, "distance_m: 0.4, more than 0.4 m, where the rover has arrived"),
        ({"difficulty": (0.2, 7.0)}, r"difficulty\[1\]: "),
        ({"difficulty": (0.5, 0.2)}, "difficulty: must have the least first"),
        ({"difficulty": 0.5}, "difficulty: "),
        ({"numbers": [-1]}, r"numbers\[0\]: "),
        ({"numbers": np.array([True, False])}, r"numbers\[0\]: "),
        ({"numbers": [0.5]}, r"numbers\[0\]: "),
        ({"numbers": 5}, "numbers: must be a list, found 5"),
        ({"worlds": 123}, "worlds: must be a path, found 123"),
        ({"distance_m": "5"}, "distance_m: must be a valid number"),
        ({"speed_m_s": True}, "speed_m_s: must be a valid number"),
        ({"difficulty": ("0", "1")}, r"difficulty\[0\]: must be a valid number"),
    ],
)
def test_an_argument_that_cannot_be_is_named(made, given, why):
    with pytest.raises(ValueError, match=why) as caught:
        learning.DriveEnv(**{"worlds": made.directory, **given})
    assert "\n" not in str(caught.value)


def test_a_reset_goes_to_the_world_that_is_named(made):
    env = make(made, numbers=[1])
    for world in (1, np.int64(1), name_of(1)):
        assert env.reset(seed=3, options={"world": world})[1]["world"] == name_of(1)
    for world in (0, -1, True, "00000", "one"):
        with pytest.raises((tf.OutputError, ValueError), match="world"):
            env.reset(options={"world": world})
    for world in (-1, 1.5, True, [1]):
        with pytest.raises(ValueError, match=r"^options.world: must be a whole number from 0 on"):
            env.reset(options={"world": world})
    with pytest.raises(ValueError, match=r"^options.worlds: unknown key"):
        env.reset(options={"worlds": 1})
    with pytest.raises(ValueError, match=r"^options: must be a mapping of keys, found \[1\]"):
        env.reset(options=[1])


def test_a_step_before_the_first_reset_is_refused(made):
    with pytest.raises(gymnasium.error.ResetNeeded, match="call reset first"):
        make(made).unwrapped.step(np.zeros(2, np.float32))


@pytest.mark.parametrize(
    "action", [[np.nan, 0.0], [0.0], [0.0, 0.0, 0.0], None, "x", {"a": 1}, [None, 1.0], 0.5]
)
def test_an_action_that_is_not_two_numbers_is_refused(made, action):
    env = make(made)
    env.reset(seed=1)
    for given in (action, np.array(action)):
        with pytest.raises(ValueError, match="expected two numbers"):
            env.step(given)


def test_difficulty_can_rise_while_one_learns(made):
    levels = sorted(read_summary(path)["difficulty"] for path in made.folders)
    many = gymnasium.make_vec(ID, num_envs=2, vectorization_mode="sync", worlds=made.directory)
    for level in (levels[0], levels[-1]):
        many.set_attr("difficulty", [(level, level)] * 2)
        for seed in range(3):
            assert np.allclose(many.reset(seed=seed)[1]["difficulty"], level)
    with pytest.raises(ValueError, match="difficulty"):
        many.set_attr("difficulty", [(2, 3)] * 2)
    many.close()


def test_without_a_display_a_picture_is_refused_in_a_line(made, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "MUJOCO_GL"):
        monkeypatch.delenv(name, raising=False)
    env = make(made, render_mode="rgb_array")
    env.reset(seed=1)
    if sys.platform == "linux":
        with pytest.raises(tf.OutputError, match="MUJOCO_GL=egl"):
            env.render()


def test_a_world_whose_scene_is_gone_is_named(made, tmp_path):
    out = tmp_path / "out"
    shutil.copytree(made.directory, out)
    (out / name_of(1) / "mjcf" / "world.xml").unlink()
    env = gymnasium.make(ID, worlds=out, distance_m=3.0)
    with pytest.raises(tf.OutputError, match=rf"{name_of(1)} is not whole, make it again: MuJoCo"):
        env.reset(options={"world": 1})


def test_worlds_made_anew_in_their_folder_are_driven_in(made, tmp_path):
    out = shutil.copytree(made.directory, tmp_path / "out")
    env = gymnasium.make(ID, worlds=out, numbers=[0], distance_m=3.0)
    assert np.ptp(env.reset(seed=1)[0]["heights"]) > 0.1
    shutil.rmtree(out)
    flat = replace(recipe().terrain, layers=())
    worlds(replace(recipe(), terrain=flat, rocks=tf.RocksSpec()), out, count=1, workers=0)
    for one in (env, gymnasium.make(ID, worlds=out, distance_m=3.0)):
        assert np.ptp(one.reset(seed=1)[0]["heights"]) == 0.0


def test_damaged_arrays_of_a_world_are_named(made, tmp_path):
    out = tmp_path / "out"
    shutil.copytree(made.directory, out)
    mix_up_shapes(out / name_of(1))
    text = rf"{name_of(1)}: holds no readable .* \(a rock's shape is numbered "
    with pytest.raises(tf.OutputError, match=text):
        gymnasium.make(ID, worlds=out, distance_m=3.0).reset(options={"world": 1})
    with pytest.raises(tf.OutputError, match=text):
        learning.Grounds.of(out)


def test_the_goal_is_not_where_the_rover_is(made):
    env = gymnasium.make(ID, worlds=made.directory, distance_m=0.41)
    assert min(env.reset(seed=seed)[1]["distance"] for seed in range(20)) > 0.35


def test_a_folder_without_worlds_is_told(tmp_path):
    with pytest.raises(tf.OutputError, match="holds no worlds"):
        gymnasium.make(ID, worlds=tmp_path)


@pytest.mark.slow
def test_worlds_to_begin_with_are_made_once_for_many_at_once(tmp_path, monkeypatch):
    monkeypatch.setenv("TERRAIN_FORGE_CACHE", str(tmp_path))
    for _ in range(2):  # they make them, and find them
        many = gymnasium.make_vec(ID, num_envs=3, vectorization_mode="async")
        _, told = many.reset(seed=1)
        assert len(told["world"]) == 3
        many.close()
    (folder,) = (path for path in tmp_path.glob("drive-*") if path.is_dir())
    made = folder.stat().st_mtime_ns
    assert starter.starter_worlds() == folder
    assert folder.stat().st_mtime_ns == made
    assert len([*folder.glob("*/drawn.json")]) == starter.COUNT
