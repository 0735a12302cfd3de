"""Speed of pictures: a stereo pair 1280 × 720 with Sun shadow, depth, normals and ids, 20k rocks.

Prints wall and processor seconds of a pair in one channel and in three, of the first one too, which
finds what the ground sees of the sky, and of the bare rays: those from the camera, cast alone. The
mark is the pair as it is recorded, with depth and ids: metered, with flare, blur and chip, and
compressed as PNG; its first one makes ready what the rest share.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from itertools import count
from pathlib import Path

import numpy as np
from run import timed

from terrain_forge.making import plan
from terrain_forge.model import StereoSensor, World
from terrain_forge.pipeline import realise
from terrain_forge.recipe import load_recipe
from terrain_forge.sensors import Scenery, Setting, motion_of_path, take_exposure, travelled
from terrain_forge.sensors.instruments.stereo import StereoFrames

ROUNDS = 5
WIDTH, HEIGHT, FOCAL, BASELINE, TIME = 1280, 720, 763.0, 0.12, 30.0
RECIPE = Path(__file__).with_name("build_1025.yaml")


def main() -> None:
    """Time all of them."""
    world = _world()
    motion = motion_of_path(world.trajectories[0])
    with Scenery(world, motion) as scenery:
        setting = Setting(world=world, motion=motion, scenery=scenery, gravity=3.711, seed=1)
        print(f"{WIDTH} × {HEIGHT}, {len(world.field)} rocks, {world.ground.shape[0]}² nodes")
        left, right, turn = _eyes(setting)
        directions = _rays().reshape(-1, 3) @ turn.T
        for eye in (left, right):
            scenery.scene.cast(eye, directions, coherent=True)  # compiles
        _print("bare rays of a pair", partial(_cast, scenery, (left, right), directions))
        _print("first pair", partial(_pair, setting, False), rounds=1)
        _print("pair, one channel", partial(_pair, setting, False))
        _print("pair, three channels", partial(_pair, setting, True))
        eyes = StereoFrames(_sensor(), setting)
        numbers = count(round(TIME * eyes.sensor.rate_hz))
        _print("first recorded pair", lambda: eyes.measure(next(numbers)), rounds=1)
        _print("recorded pair", lambda: eyes.measure(next(numbers)))


def _world() -> World:
    """The mark of the main job."""
    read = load_recipe(RECIPE)
    return realise(plan(read.recipe, folder=RECIPE.parent))


@cache
def _rays() -> np.ndarray:
    """Those of a lens, which a recording makes once."""
    x = (np.arange(WIDTH) + 0.5 - 0.5 * WIDTH) / FOCAL
    y = (np.arange(HEIGHT) + 0.5 - 0.5 * HEIGHT) / FOCAL
    rays = np.stack(np.broadcast_arrays(x[None, :], y[:, None], 1.0), axis=-1)
    return (rays / np.linalg.norm(rays, axis=-1, keepdims=True)).astype(np.float32)


def _eyes(setting: Setting) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Places of both eyes and their optical frame, on a mast that looks down by 12 degrees."""
    state = setting.motion.base.at(TIME)
    down = np.radians(12.0)
    ahead = np.array([np.cos(down), 0.0, -np.sin(down)])
    optical = np.stack([[0.0, -1.0, 0.0], np.cross(ahead, [0.0, -1.0, 0.0]), ahead], axis=-1)
    turn = state.rotation[0]
    left = state.position[0] + turn @ [0.3, 0.5 * BASELINE, 1.2]
    return left, left - turn @ [0.0, BASELINE, 0.0], turn @ optical


def _sensor() -> StereoSensor:
    """The pair on the rover's mast."""
    return StereoSensor(
        name="stereo",
        width_px=WIDTH,
        height_px=HEIGHT,
        focal_px=(FOCAL, FOCAL),
        baseline_m=BASELINE,
        position_m=(0.3, 0.0, 1.2),
        rpy_deg=(0.0, 12.0, 0.0),
        channels=("depth", "instance"),
    )


def _cast(scenery: Scenery, eyes: tuple[np.ndarray, ...], directions: np.ndarray) -> None:
    for eye in eyes:
        scenery.scene.cast(eye, directions, coherent=True)


def _pair(setting: Setting, colour: bool) -> None:
    left, right, turn = _eyes(setting)
    behind = float(travelled(setting.motion, TIME))
    for eye in (left, right):
        take_exposure(
            setting,
            rays=_rays(),
            position=eye,
            rotation=turn,
            time=TIME,
            colour=colour,
            tracks_behind=behind,
        )


def _print(name: str, job: Callable[[], object], rounds: int = ROUNDS) -> None:
    walls, works = timed(job, rounds)
    print(f"{name:<24}{min(walls):8.3f} s wall{min(works):8.3f} s of processors")


if __name__ == "__main__":
    main()
