"""`TerrainForge/Drive-v0`: a rover drives to a goal over one of many worlds, in MuJoCo."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Literal

import gymnasium
import mujoco
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from terrain_forge.base import Array, OutputError
from terrain_forge.driving import TURN_RATE, eased, wheel_rates
from terrain_forge.learning.arena import Arena, find_parts, load_arena
from terrain_forge.learning.requests import (
    Arguments,
    Asked,
    Difficulty,
    Wished,
    folders_of,
    of_difficulty,
    require_one_rover,
    require_request,
)
from terrain_forge.learning.sight import DepthCamera, HeightScan
from terrain_forge.learning.starter import starter_worlds

Observation = dict[str, NDArray[np.float32]]
RATE = 10.0
"""Actions a second [Hz]."""
REACHED = 0.4
"""How near the goal the rover has arrived [m]."""
ARRIVED, FAILED, TIME_COST = 5.0, -5.0, 0.05
"""Reward of an arrival and of a failure, and what a second costs."""
TIPPED = math.radians(60.0)
STUCK_TIME, STUCK_WAY, STUCK_TURN = 5.0, 0.1, math.radians(15.0)
"""A rover is stuck that is nearer than so far [m] to where it was so long ago [s], and whose
heading is less than so much [rad] from what it was then, whole turns counted."""
_BAD = ("QPOS", "QVEL", "QACC")
_UNSTABLE = [int(getattr(mujoco.mjtWarning, f"mjWARN_BAD{name}")) for name in _BAD]
"""Warnings after which MuJoCo has put the rover where its model has it."""
_SETTLING = 0.5
_TRIES = 200


class DriveEnv(gymnasium.Env[Observation, Array]):
    """A rover drives to a goal; docs/learning.md tells what it sees and what it is rewarded for.

    Args:
        worlds: Folder that `terrain-forge worlds` made, with MJCF exports; without it a few worlds
            of our own, which are made once.
        difficulty: Only worlds whose wished difficulty lies between these, 0 to 1. The attribute of
            this name can be set, for a curriculum; the next reset goes by it.
        numbers: Only worlds of these numbers, such as those to train on.
        distance_m: From start to goal.
        speed_m_s: Speed of the action 1, at most the rover's own limit.
        sight: What it sees of the ground ahead: `heights`, `depth`, or `none`.
        render_mode: `rgb_array` for pictures, which need OpenGL: without a display set the
            environment variable MUJOCO_GL to egl or osmesa before Python begins.

    Raises:
        OutputError: if there are no such worlds.
        ValueError: for an argument that cannot be.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": int(RATE)}  # noqa: RUF012

    def __init__(
        self,
        worlds: Path | str | None = None,
        *,
        difficulty: tuple[float, float] | None = None,
        numbers: Sequence[int] | None = None,
        distance_m: float = 5.0,
        speed_m_s: float = 0.5,
        sight: Literal["heights", "depth", "none"] = "heights",
        render_mode: str | None = None,
    ) -> None:
        numbers = tuple(numbers) if isinstance(numbers, Iterable) else numbers
        require_request(
            Arguments,
            {
                "difficulty": difficulty,
                "worlds": worlds,
                "numbers": numbers,
                "distance_m": distance_m,
                "speed_m_s": speed_m_s,
                "sight": sight,
                "render_mode": render_mode,
            },
        )
        if distance_m <= REACHED:
            raise ValueError(
                f"distance_m: {distance_m:g}, more than {REACHED:g} m, where the rover has arrived"
            )
        self._all = folders_of(Path(worlds) if worlds else starter_worlds(), numbers)
        require_one_rover(self._all)
        self.difficulty = difficulty
        self.render_mode = render_mode
        self._distance, self._speed = distance_m, speed_m_s
        self._limit = 4.0 * distance_m / speed_m_s
        self.arena = load_arena(self.folders[0])
        """The world that it drives in."""
        fastest = self.arena.rover.speed_limit
        if speed_m_s > fastest:
            raise ValueError(f"speed_m_s: {speed_m_s:g} is above the rover's {fastest:g} m/s")
        self.parts = find_parts(self.arena.model, self.arena.rover)
        """Where MuJoCo holds the rover."""
        wheels = len(self.arena.rover.wheels)
        self._sight: HeightScan | DepthCamera | None = None
        if sight != "none":
            self._sight = HeightScan() if sight == "heights" else DepthCamera()
        seen: dict[str, spaces.Space[Any]] = {
            "proprioception": spaces.Box(-10.0, 10.0, (11 + wheels,), np.float32)
        }
        if self._sight is not None:
            seen[sight] = self._sight.space
        self._sight_name = sight
        self._trail: list[tuple[float, float]] = []
        self._headings: list[float] = []
        self.observation_space = spaces.Dict(seen)  # type: ignore[assignment]
        self.action_space = spaces.Box(-1.0, 1.0, (2,), np.float32)  # type: ignore[assignment]
        self._renderer: Any = None

    @property
    def difficulty(self) -> Difficulty:
        """Between which wished difficulties its worlds lie; None for all.

        Raises:
            OutputError: when set to what no world has.
            ValueError: when set to other than two numbers of 0 to 1.
        """
        return self._difficulty

    @difficulty.setter
    def difficulty(self, between: Difficulty) -> None:
        require_request(Wished, {"difficulty": between})
        self.folders = self._all if between is None else of_difficulty(self._all, between)
        """Folders of the worlds that it draws from."""
        self._difficulty = between

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin in a random world, at a random start, towards a goal that some way leads to.

        Args:
            seed: Of all that follows.
            options: `world`, the number of a world, or the name of its folder.

        Raises:
            OutputError: if there is no such world, or in none a way that long.
            ValueError: for other options.
        """
        super().reset(seed=seed)
        order = self._asked(options or {})
        for folder in order:
            arena = load_arena(folder)
            if mission := self._mission(arena):
                break
        else:
            raise OutputError(
                f"none of {len(order)} worlds in {self.folders[0].parent} has a way of "
                f"{self._distance:g} m that the rover can go"
            )
        self._enter(arena)
        arena = self.arena
        start, self._goal, heading = mission
        arena.set_down(self.parts, start, heading)
        arena.advance(round(_SETTLING / arena.model.opt.timestep))
        self._steps = max(round(1.0 / RATE / arena.model.opt.timestep), 1)
        self._bounds = arena.world.ground.bounds
        self._time, self._rates = 0.0, np.zeros(len(arena.rover.wheels))
        self._action = (0.0, 0.0)
        if self._sight is not None:
            self._sight.begin(arena)
        self._way = self._to_goal()
        self._trail, self._headings = [self._place()], [self._heading()]
        return self._observe(), self._told("")

    def _asked(self, options: dict[str, Any]) -> list[Path]:
        """The worlds to begin in, by their order."""
        require_request(Asked, {"options": options})
        world = options.get("world")
        if world is None:
            return [self.folders[n] for n in self.np_random.permutation(len(self.folders))]
        name = world if isinstance(world, str) else f"{world:05}"
        found = [path for path in self._all if path.name == name]
        if not found:
            last = f"{self._all[0].name} to {self._all[-1].name}"
            raise OutputError(f"reset: no world {name} among {len(self._all)}, {last}")
        return found

    def _enter(self, arena: Arena) -> None:
        if len(arena.rover.wheels) != len(self.arena.rover.wheels):
            raise OutputError(
                f"{arena.folder} has another rover than {self.arena.folder}: give `numbers` of "
                "worlds with one, which worlds.csv tells"
            )
        if arena.model is not self.arena.model:
            self.arena, self.parts = arena, find_parts(arena.model, arena.rover)
            self.close()

    def step(self, action: Array) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Drive for a tenth of a second: speed and turn rate, each -1 to 1; beyond it is cut.

        Raises:
            ResetNeeded: before the first reset.
            ValueError: for an action that holds what is no number.
        """
        if not self._trail:
            raise gymnasium.error.ResetNeeded("step: no drive has begun, call reset first")
        arena, parts = self.arena, self.parts
        data, tick = arena.data, self._steps * arena.model.opt.timestep
        self._action = ahead, aside = _numbers(action)
        speed, turn = ahead * self._speed, aside * TURN_RATE
        wanted = wheel_rates(arena.rover, speed, turn)
        self._rates = eased(arena.rover, wanted, self._rates, time=4.0 * tick)
        data.ctrl[parts.motors] = parts.sides * self._rates
        arena.advance(self._steps)
        # Servos follow the angle that their rates add up to: it stays within the motors' reach.
        held = data.actuator_length[parts.motors] + parts.lag * data.qvel[parts.axles]
        run = np.minimum(data.act[parts.activations], held + parts.reach)
        data.act[parts.activations] = np.maximum(run, held - parts.reach)
        self._time += tick
        stable = not data.warning.number[_UNSTABLE].any()
        way = self._to_goal() if stable else self._way
        reward = self._way - way - TIME_COST * tick
        self._way = way
        self._trail.append(self._place())
        last = self._headings[-1]
        self._headings.append(last + math.remainder(self._heading() - last, math.tau))
        why = self._ended() if stable else "unstable"
        if why:
            reward += ARRIVED if why == "arrived" else FAILED
        truncated = not why and self._time >= self._limit
        return self._observe(), float(reward), bool(why), truncated, self._told(why)

    def _ended(self) -> str:
        """Why the drive is over; empty if it is not."""
        data = self.arena.data
        if not math.isfinite(self._way):
            return "unstable"
        if self._way < REACHED:
            return "arrived"
        west, south, east, north = self._bounds
        # A wheel beyond the border hangs over nothing: the rover tips because it has left.
        x, y = data.xpos[self.parts.wheels, :2].T
        if x.min() < west or x.max() > east or y.min() < south or y.max() > north:
            return "left the world"
        if data.xmat[self.parts.body, 8] < math.cos(TIPPED):
            return "tipped over"
        return "stuck" if self._is_stuck() else ""

    def _is_stuck(self) -> bool:
        trail, headings, back = self._trail, self._headings, round(STUCK_TIME * RATE)
        if len(trail) <= back:
            return False
        turned = abs(headings[-1] - headings[-1 - back])
        return turned < STUCK_TURN and math.dist(trail[-1], trail[-1 - back]) < STUCK_WAY

    def _place(self) -> tuple[float, float]:
        x, y = self.arena.data.qpos[self.parts.pose][:2].tolist()
        return x, y

    def _heading(self) -> float:
        turn = self.arena.data.xmat[self.parts.body]
        return math.atan2(turn[3], turn[0])

    def _to_goal(self) -> float:
        return math.dist(self._place(), self._goal)

    def _told(self, why: str) -> dict[str, Any]:
        return {
            "world": self.arena.folder.name,
            "difficulty": -1.0 if self.arena.difficulty is None else self.arena.difficulty,
            "distance": self._way,
            "arrived": why == "arrived",
            "ended": why,
        }

    def _observe(self) -> Observation:
        data, parts = self.arena.data, self.parts
        turn = data.xmat[parts.body].tolist()
        x, y = self._place()
        yaw = math.atan2(turn[3], turn[0])
        cos, sin = math.cos(yaw), math.sin(yaw)
        bearing = math.atan2(self._goal[1] - y, self._goal[0] - x) - yaw
        moving = data.qvel[parts.velocity].tolist()
        rates = parts.sides * data.qvel[parts.axles] * self.arena.rover.wheel_radii
        seen = np.array(
            [
                0.1 * self._way,
                math.sin(bearing),
                math.cos(bearing),
                math.asin(min(max(-turn[6], -1.0), 1.0)),
                math.atan2(turn[7], turn[8]),
                cos * moving[0] + sin * moving[1],
                cos * moving[1] - sin * moving[0],
                moving[2],
                moving[5],
                *self._action,
                *rates,
            ],
            np.float32,
        )
        found = {"proprioception": np.minimum(np.maximum(seen, -10.0), 10.0)}
        if self._sight is not None:
            found[self._sight_name] = self._sight.look(self.arena, self.parts, cos, sin)
        return found

    def _mission(self, arena: Arena) -> tuple[Array, tuple[float, float], float] | None:
        """Start [m], goal [m] and heading [rad], where some way leads from one to the other."""
        nodes = np.argwhere(arena.ways > 0)
        if not len(nodes):
            return None
        rows, columns = arena.ways.shape
        reach = self._distance / arena.spacing
        for _ in range(_TRIES):
            start = nodes[self.np_random.integers(len(nodes))]
            turn, aside = self.np_random.uniform((0.0, -1.0), (math.tau, 1.0)).tolist()
            row = round(start[0] + reach * math.sin(turn))
            column = round(start[1] + reach * math.cos(turn))
            if not (0 <= row < rows and 0 <= column < columns):
                continue
            if arena.ways[row, column] != arena.ways[tuple(start)]:
                continue
            place, goal = arena.place_of(start), arena.place_of(np.array([row, column]))
            if math.dist(place, goal) <= REACHED:  # to whole nodes
                continue
            x, y = goal.tolist()
            return place, (x, y), turn + 0.5 * math.pi * aside
        return None

    def render(self) -> NDArray[np.uint8] | None:  # type: ignore[override]
        """A picture from behind and above, where the render mode asks for it.

        Raises:
            OutputError: without a display, where MuJoCo was not told to draw without one.
        """
        if self.render_mode != "rgb_array":
            return None
        _require_display()
        if self._renderer is None:
            self._renderer = mujoco.Renderer(self.arena.model, 360, 640)
        camera = mujoco.MjvCamera()
        camera.lookat[:] = self.arena.data.xpos[self.parts.body]
        camera.distance, camera.elevation = 4.0, -25.0
        turn = self.arena.data.xmat[self.parts.body]
        camera.azimuth = math.degrees(math.atan2(turn[3], turn[0]))
        self._renderer.update_scene(self.arena.data, camera)
        picture: NDArray[np.uint8] = self._renderer.render()
        return picture

    def __getstate__(self) -> dict[str, Any]:
        """All but what draws, which cannot be copied; a copy gets its own."""
        return {**vars(self), "_renderer": None}

    def close(self) -> None:
        """Let go of what draws."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None


def _numbers(action: Any) -> tuple[float, float]:
    """The two numbers of an action, cut to -1 to 1.

    Raises:
        ValueError: for anything else.
    """
    try:
        ahead, aside = (float(one) for one in np.ravel(action))
    except (TypeError, ValueError, OverflowError):
        ahead = aside = math.nan
    if math.isnan(ahead + aside):
        raise ValueError(f"action: {action}, expected two numbers of -1 to 1")
    return min(max(ahead, -1.0), 1.0), min(max(aside, -1.0), 1.0)


def _require_display() -> None:
    """MuJoCo ends the process where GLFW finds no display."""
    windows = {"DISPLAY", "WAYLAND_DISPLAY", "MUJOCO_GL"} & os.environ.keys()
    if sys.platform == "linux" and not windows:
        raise OutputError(
            "pictures need OpenGL, and there is no display: set MUJOCO_GL=egl or MUJOCO_GL=osmesa "
            "before Python begins"
        )
