"""Learn to drive around rocks by PPO of Stable-Baselines3, from nothing; held-out worlds judge it.

    pip install 'terrain-forge[learning]' stable-baselines3
    terrain-forge worlds benchmarks/drive_worlds.yaml -o drive-worlds
    python benchmarks/train_drive.py drive-worlds --steps 1000000

Two thirds of the worlds are trained on; on the others the policy and a controller that drives
straight at the goal have the same missions.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import gymnasium
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import SubprocVecEnv

DRIVE = "terrain_forge.learning:TerrainForge/Drive-v0"


def straight(seen):
    """Speed and turn rate towards the goal."""
    bearing = np.arctan2(seen["proprioception"][1], seen["proprioception"][2])
    turn = np.clip(2.0 * bearing, -1.0, 1.0)
    return np.array([1.0 - min(abs(bearing), 0.9), turn], np.float32)


def train(options, *, steps, seed):
    """A policy after so many steps."""
    environments = make_vec_env(
        DRIVE, n_envs=8, seed=seed, vec_env_cls=SubprocVecEnv, env_kwargs=options
    )
    policy = PPO(
        "MultiInputPolicy", environments, n_steps=512, batch_size=512, n_epochs=5, ent_coef=0.003,
        policy_kwargs={"log_std_init": -0.7}, seed=seed, verbose=1,
    )  # fmt: skip
    policy.learn(steps)
    environments.close()
    return policy


def judge(act, options, missions):
    """Whether each mission arrived, and its return."""
    environment, found = gymnasium.make(DRIVE, **options), []
    for seed in range(10_000, 10_000 + missions):
        seen, _ = environment.reset(seed=seed)
        total, over = 0.0, False
        while not over:
            seen, reward, ended, late, told = environment.step(act(seen))
            total, over = total + reward, ended or late
        found.append((told["arrived"], total))
    return np.array(found, float).T


def main() -> None:
    """Train, judge, and print figures with their standard errors."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("worlds", type=Path)
    parser.add_argument("--steps", type=int, default=1_000_000)
    parser.add_argument("--missions", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    torch.set_num_threads(1)  # the environments have the others
    there = len(list(given.worlds.glob("*/drawn.json")))
    options = {"worlds": str(given.worlds), "distance_m": 6.0}
    held_out = {**options, "numbers": range(there * 2 // 3, there)}
    policy = train(
        {**options, "numbers": range(there * 2 // 3)}, steps=given.steps, seed=given.seed
    )
    policy.save(given.worlds / f"policy-{given.seed}.zip")
    before = judge(straight, held_out, given.missions)
    after = judge(
        lambda seen: policy.predict(seen, deterministic=True)[0], held_out, given.missions
    )
    for name, (arrived, total) in {"straight": before, "learned": after}.items():
        print(f"{name:9} {_figure(arrived)} arrive, return {total.mean():.2f}")
    print(f"gain      {_figure(after[0] - before[0])}")


def _figure(values):
    return f"{values.mean():.3f} ± {values.std() / np.sqrt(len(values)):.3f}"


if __name__ == "__main__":
    main()
