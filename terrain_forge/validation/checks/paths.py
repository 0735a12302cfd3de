"""Checks of all paths before anything drives: tilt, steps, and rocks that the rover cannot pass."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from terrain_forge.model import Check, Trajectory, World, at_most
from terrain_forge.paths import FARTHEST, Planned, Surroundings, highest_step, survey_paths
from terrain_forge.validation.inspection import BuiltFolder, Inspection

_MOST_NAMED = 3
"""Rocks that one check names."""


class Paths(Inspection):
    """What the paths ask of the rover."""

    kind = "paths"
    group = "paths"

    def __init__(self) -> None:
        self._figures: list[dict[str, Any]] = []

    def checks(self, built: BuiltFolder) -> list[Check]:
        """Tilt, steps and rocks of each path.

        The driven path and planned ones must keep the rover's limits. Others may be there for a
        camera or an actor alone: their figures have no limit.
        """
        world, recipe = built.world, built.world.site.recipe
        bound = {path.name for path in recipe.paths if isinstance(path.route, Planned)}
        bound.add(recipe.driven_path or "")
        paths, checks = {path.name: path for path in world.trajectories}, list[Check]()
        for name, met in survey_paths(world).items():
            checks += _checks(world, paths[name], met, bound=name in bound)
            self._figures.append(_figures(paths[name], met))
        return checks

    def report(self) -> dict[str, Any]:
        """The figures of each path."""
        return {"paths": self._figures}


def _checks(world: World, path: Trajectory, met: Surroundings, *, bound: bool) -> list[Check]:
    rover, title = world.rover, f"path {path.name}"
    rocks = [
        f"rock {rock} at ({x:.2f}, {y:.2f}) m, {height:.2f} m high, "
        f"after {_distance(path, met, pose):.1f} m"
        for rock, x, y, height, pose in met.met
    ]
    more = f" and {len(rocks) - _MOST_NAMED} more" if len(rocks) > _MOST_NAMED else ""
    note = "; ".join(rocks[:_MOST_NAMED]) + more
    tilt = math.degrees(rover.tilt_limit)
    return [
        at_most(f"{title}: rocks in its way", len(rocks), 0.0 if bound else None, note=note),
        at_most(f"{title}: largest tilt of the ground", math.degrees(met.tilt.max()),
                tilt if bound else None, unit="deg", note=_where(path, met, met.tilt)),
        at_most(f"{title}: largest step under a wheel", float(met.step.max()),
                highest_step(rover) if bound else None, unit="m",
                note=_where(path, met, met.step)),
        at_most(f"{title}: smallest gap to a rock", float(met.gap.min()), None, unit="m",
                note="none is nearer" if met.gap.min() == FARTHEST else
                _where(path, met, -met.gap)),
    ]  # fmt: skip


def _figures(path: Trajectory, met: Surroundings) -> dict[str, Any]:
    return {
        "path": path.name,
        "length_m": path.length,
        "duration_s": float(path.time[-1]),
        "spot_turns": len(path.spot_turns),
        "largest_tilt_deg": math.degrees(met.tilt.max()),
        "largest_step_m": float(met.step.max()),
        "smallest_gap_m": float(met.gap.min()),
        "rocks_in_its_way": [rock for rock, *_ in met.met],
    }


def _where(path: Trajectory, met: Surroundings, values: np.ndarray[Any, Any]) -> str:
    worst = int(np.argmax(values))
    x, y = path.position[met.sample[worst], :2]
    return f"at ({x:.2f}, {y:.2f}) m"


def _distance(path: Trajectory, met: Surroundings, pose: int) -> float:
    """Length of the path in the plane up to a pose [m]."""
    track = path.position[: met.sample[pose] + 1, :2]
    return float(np.linalg.norm(np.diff(track, axis=0), axis=1).sum())
