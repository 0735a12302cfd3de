"""Learn to drive around rocks by an evolution strategy in NumPy; held-out worlds judge it.

    terrain-forge worlds benchmarks/drive_worlds.yaml -o drive-worlds
    python benchmarks/train_drive.py drive-worlds --minutes 6

The policy adds to a controller that drives straight at the goal what rises left and right of it in
the height scan, by 28 weights; it begins as that controller. The evolution strategy is OpenAI's
(Salimans et al. 2017, arXiv:1703.03864) with mirrored noise; each pair drives the same missions.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import time
from functools import partial
from pathlib import Path

import gymnasium
import numpy as np

DRIVE = "terrain_forge.learning:TerrainForge/Drive-v0"
SIDES = (slice(4, 6), slice(5, 7), slice(6, 9))
SIZE = 3 * 3 * len(SIDES) + 1
NOISE, RATE, PAIRS, MISSIONS = 0.25, 0.2, 10, 2
_environments: dict[tuple[str, tuple[int, ...]], gymnasium.Env] = {}


def rises(seen):
    """How much the ground rises in 3 bands ahead and 3 to each side: to the left, to the right."""
    bands = 2.0 * np.maximum(seen["heights"][3:12].reshape(3, 3, 9).max(axis=1) - 0.12, 0.0)
    left, right = (
        np.stack([one[:, s].max(axis=1) for s in SIDES]) for one in (bands, bands[:, ::-1])
    )
    return left.ravel(), right.ravel()


def straight(seen):
    """Speed and turn rate towards the goal."""
    bearing = np.arctan2(seen["proprioception"][1], seen["proprioception"][2])
    return np.array([1.0 - min(abs(bearing), 0.9), np.clip(2.0 * bearing, -1.0, 1.0)])


def act(weights, seen):
    """The policy's action, which does alike to the left and the right; None drives straight."""
    action = straight(seen)
    if weights is not None:
        left, right = rises(seen)
        towards = 1.0 if seen["proprioception"][1] >= 0.0 else -1.0
        aside, slower, around = weights[:-1].reshape(3, -1)
        turn = aside @ (left - right) + towards * (around @ (left + right))
        action = action + np.array([slower @ (left + right) + weights[-1] * abs(turn), turn])
    return np.clip(action, -1.0, 1.0).astype(np.float32)


def drive(weights, seed, *, worlds, numbers):
    """Return of one mission, and whether it arrived."""
    key = (worlds, numbers)
    if key not in _environments:
        given = {"worlds": worlds, "numbers": numbers, "distance_m": 6.0}
        _environments[key] = gymnasium.make(DRIVE, disable_env_checker=True, **given)
    environment = _environments[key]
    seen, told = environment.reset(seed=seed)
    total, over = 0.0, False
    while not over:
        seen, reward, ended, late, told = environment.step(act(weights, seen))
        total += reward
        over = ended or late
    return total, bool(told["arrived"])


def _task(job, *, worlds, numbers):
    weights, seeds = job
    return [drive(weights, seed, worlds=worlds, numbers=numbers) for seed in seeds]


def train(worlds, numbers, *, minutes, processes, seed, start=None, note=print):
    """Weights after so many minutes, and what each generation reached."""
    random = np.random.default_rng(seed)
    weights = np.zeros(SIZE) if start is None else np.load(start)  # zeros drive straight
    begin, log = time.time(), []
    first, second = np.zeros(SIZE), np.zeros(SIZE)
    task = partial(_task, worlds=worlds, numbers=numbers)
    with multiprocessing.get_context("spawn").Pool(processes) as pool:
        while time.time() - begin < 60.0 * minutes:
            noise = random.standard_normal((PAIRS, SIZE))
            seeds = random.integers(2**31, size=(PAIRS, MISSIONS)).tolist()
            jobs = [
                (weights + sign * NOISE * one, given)
                for one, given in zip(noise, seeds, strict=True)
                for sign in (1.0, -1.0)
            ]
            found = [np.array([r for r, _ in drives]).mean() for drives in pool.map(task, jobs, 1)]
            differences = np.array(found).reshape(-1, 2) @ (1.0, -1.0)
            scale = np.abs(differences).mean() + 1e-9
            gradient = (np.clip(differences / scale, -2.0, 2.0) @ noise) / PAIRS / 2.0
            step = len(log) + 1
            first = 0.9 * first + 0.1 * gradient
            second = 0.99 * second + 0.01 * gradient**2
            weights = weights + RATE * (first / (1 - 0.9**step)) / (
                np.sqrt(second / (1 - 0.99**step)) + 1e-8
            )
            log.append(float(np.mean(found)))
            if step % 5 == 0:
                note(f"{time.time() - begin:5.0f} s  generation {step}  {np.mean(log[-5:]):.2f}")
    return weights, log


def judge(weights, worlds, numbers, *, missions, processes):
    """Whether each of many missions on held-out worlds arrived, and its return."""
    task = partial(_task, worlds=worlds, numbers=numbers)
    jobs = [(weights, [seed]) for seed in range(10_000, 10_000 + missions)]
    with multiprocessing.get_context("spawn").Pool(processes) as pool:
        found = [drives[0] for drives in pool.map(task, jobs, 4)]
    return np.array([arrived for _, arrived in found]), np.array([total for total, _ in found])


def main() -> None:
    """Train, judge, and print figures with their spread."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("worlds", type=Path)
    parser.add_argument("--minutes", type=float, default=6.0)
    parser.add_argument("--missions", type=int, default=200)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--start", type=Path, help="policy-N.npy to go on from")
    parser.add_argument("--seeds", type=int, default=1, help="trainings, each of another seed")
    given = parser.parse_args()
    worlds, there = str(given.worlds), len(list(given.worlds.glob("*/drawn.json")))
    training, held_out = tuple(range(0, there * 2 // 3)), tuple(range(there * 2 // 3, there))
    common = {"missions": given.missions, "processes": given.processes}
    before = judge(None, worlds, held_out, **common)
    figures = {"straight": _figures(*before)}
    print("straight", figures["straight"])
    for seed in range(given.seeds):
        weights, log = train(
            worlds,
            training,
            minutes=given.minutes,
            processes=given.processes,
            seed=seed,
            start=given.start,
        )
        after = judge(weights, worlds, held_out, **common)
        better = (after[0].astype(float) - before[0]).mean()
        error = (after[0].astype(float) - before[0]).std() / np.sqrt(given.missions)
        figures[f"learned {seed}"] = {
            **_figures(*after), "generations": len(log), "gain": float(better),
            "gain_error": float(error),
        }  # fmt: skip
        print(f"learned {seed}", figures[f"learned {seed}"])
        np.save(given.worlds / f"policy-{seed}.npy", weights)
    print(json.dumps(figures, indent=1))


def _figures(arrived, total):
    return {
        "arrive": float(arrived.mean()),
        "error": float(arrived.std() / np.sqrt(len(arrived))),
        "return": float(total.mean()),
    }


if __name__ == "__main__":
    main()
