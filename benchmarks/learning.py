"""What `TerrainForge/Drive-v0` costs beside bare MuJoCo, and how fast worlds are made.

python benchmarks/learning.py              # steps of the environment
python benchmarks/learning.py --worlds 60  # worlds of 16 × 16 m at 0.1 m with rocks and MJCF
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import gymnasium
import mujoco
import numpy as np

import terrain_forge as tf
from terrain_forge.learning import DRIVE, DriveEnv

BLOCKS, REPEATS, ACTIONS = 5, 4, 30


def stepping(sight: str) -> tuple[float, float]:
    """Actions a second of processor time, and that over bare steps of the same model.

    Blocks of both take turns, from the same state under the same controls; of each block the best
    of some repeats counts, and the median of all blocks.
    """
    environment = gymnasium.make(DRIVE, sight=sight, disable_env_checker=True).unwrapped
    assert isinstance(environment, DriveEnv)
    random = np.random.default_rng(0)
    spent = np.full((BLOCKS, 2), np.inf)
    for block in range(BLOCKS):
        environment.reset(seed=block)
        model, data = environment.arena.model, environment.arena.data
        start, count = mujoco.MjData(model), round(0.1 / model.opt.timestep)
        mujoco.mj_copyData(start, model, data)
        actions = np.clip(random.normal((0.8, 0.0), 0.4, (ACTIONS, 2)), -1.0, 1.0)
        controls, angles = [], []
        for repeated in range(REPEATS):
            environment.reset(seed=block)
            begin = time.process_time()
            for action in actions:
                environment.step(action)
                if not repeated:
                    controls.append(data.ctrl.copy())
                    angles.append(data.act.copy())
            spent[block, 0] = min(spent[block, 0], time.process_time() - begin)
            mujoco.mj_copyData(data, model, start)
            begin = time.process_time()
            for control, angle in zip(controls, angles, strict=True):
                data.ctrl[:] = control
                mujoco.mj_step(model, data, count)
                data.act[:] = angle
            spent[block, 1] = min(spent[block, 1], time.process_time() - begin)
    rate, ratio = ACTIONS / spent[:, 0], spent[:, 1] / spent[:, 0]
    return float(np.median(rate)), float(np.median(ratio))


RECIPE = """
schema: 1
name: many
seed: 7
body: mars
dtm: {{source: {dtm}, size_m: [16, 16]}}
terrain:
  spacing_m: 0.1
  layers: [{{kind: fractal}}, {{kind: ripples, wavelength_m: 1.5}}]
rocks:
  library: {{shapes: 24, seed: 7}}
  populations:
    - {{name: stones, size_frequency: {{kind: golombek, k: 0.05}}, diameter_m: [0.1, 1.0]}}
rover: skid4
exports: [mjcf]
worlds: {{difficulty: {{}}}}
"""


def making(count: int) -> None:
    """Print what a world costs, alone and by two processes."""
    sample = Path(tf.__file__).parents[1] / "dtm_samples" / "gale_floor_synthetic.tif"
    with tempfile.TemporaryDirectory() as folder:
        recipe = Path(folder) / "many.yaml"
        recipe.write_text(RECIPE.format(dtm=sample), encoding="utf-8")
        tf.worlds(recipe, Path(folder) / "alone", count=2, workers=0)  # warm
        begin = time.process_time()
        made = tf.worlds(recipe, Path(folder) / "alone", count=2 + count, workers=0).made
        print(f"processor time of a world    {(time.process_time() - begin) / made:.3f} s")
        begin = time.perf_counter()
        made = tf.worlds(recipe, Path(folder) / "two", count=count, workers=2).made
        print(f"two processes                {made / (time.perf_counter() - begin):.1f} worlds/s")
        files = [path for path in (Path(folder) / "two").rglob("*") if path.is_file()]
        bytes_once = sum({f.stat().st_ino: f.stat().st_size for f in files}.values())
        print(f"bytes of a world             {bytes_once / made / 1e6:.2f} MB")


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--worlds", type=int, default=0)
    given = parser.parse_args()
    if given.worlds:
        making(given.worlds)
        return
    print("sight     actions/s   × bare MuJoCo")
    for sight in ("none", "heights", "depth"):
        rate, ratio = stepping(sight)
        print(f"{sight:<9} {rate:9.0f}   {ratio:.3f}")


if __name__ == "__main__":
    main()
