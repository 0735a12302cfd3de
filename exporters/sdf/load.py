"""What a world's rocks ask of the parser, and when that is too much."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import ExportError
from terrain_forge.model import World

from .options import Options
from .rocks import is_single

PART_MB, PART_MS = 0.27, 0.8
"""Memory [MB] and time [ms] that libsdformat takes for each visual and each collision: it copies
the description of all that an element could hold. Measured with libsdformat 12, as below."""
BODY_MB, BODY_MS = 2.3, 9.0
"""The same for the model and link of a dynamic rock."""
MOST_MB = 8192.0
"""What loading may take [MB]."""
WORTH_SAYING_MB = 1024.0
"""From what on loading is a loss to be told [MB]."""
_ADVICE = "a larger individual_min_m merges more of them, or make fewer rocks dynamic"
STEP = 0.002
"""Time step of the physics [s]."""
SECONDS_PER_DYNAMIC = 1e-4
"""What a dynamic rock that lies on the ground takes of each step [s]: 21 ms for 221 of them, in
Fortress' physics with DART on one core."""


def check_capacity(options: Options, *, nodes: float, rocks: float) -> None:
    """Refuse, before the world is made, more rocks of their own than libsdformat loads.

    How many are above `individual_min_m` is known only then; if all are, they can be told now.

    Raises:
        ExportError: if there are too many; says what to choose instead.
    """
    del nodes
    megabytes = 2 * PART_MB * rocks  # each is seen and touched
    if options.individual_min_m == 0.0 and megabytes > MOST_MB:
        raise ExportError(
            f"some {rocks:,.0f} rocks are elements of their own: Gazebo's parser would take "
            f"{megabytes / 1024:.0f} GB to load them, at most {MOST_MB / 1024:.0f} GB are allowed; "
            "a larger individual_min_m merges the smaller ones",
            key=("individual_min_m",),
        )


def require_loadable(world: World, options: Options) -> None:
    """Refuse a world that libsdformat would fill the memory with.

    Raises:
        ExportError: if its rocks are too many elements; says what to choose instead.
    """
    megabytes, _ = loading(world, options)
    if megabytes > MOST_MB:
        raise ExportError(
            f"{_found(world, options)}: Gazebo's parser would take some {megabytes / 1024:.0f} GB "
            f"to load them, at most {MOST_MB / 1024:.0f} GB are allowed; {_ADVICE}"
        )


def loading_losses(world: World, options: Options) -> list[str]:
    """What loading takes, where that is much."""
    megabytes, seconds = loading(world, options)
    if megabytes <= WORTH_SAYING_MB:
        return []
    return [
        f"{_found(world, options)}: Gazebo's parser takes some {megabytes / 1024:.1f} GB and "
        f"{seconds:.0f} s to load them; {_ADVICE}"
    ]


def stepping_losses(world: World) -> list[str]:
    """What a step of the physics takes, where that is more than the step."""
    dynamic = int(world.field.dynamic.sum())
    if SECONDS_PER_DYNAMIC * dynamic <= STEP:
        return []
    return [
        f"{dynamic} dynamic rocks take DART about {1000 * SECONDS_PER_DYNAMIC * dynamic:.0f} ms "
        f"for each step of {1000 * STEP:g} ms: slower than real time; make fewer rocks dynamic."
    ]


def loading(world: World, options: Options) -> tuple[float, float]:
    """Memory [MB] and time [s] that libsdformat takes for the rocks that are not merged."""
    parts = _parts(world)[is_single(world.field, options)].sum()
    bodies = world.field.dynamic.sum()
    milliseconds = PART_MS * parts + BODY_MS * bodies
    return float(PART_MB * parts + BODY_MB * bodies), float(milliseconds / 1000.0)


def _parts(world: World) -> NDArray[np.int64]:
    """How many visuals and collisions each rock has of its own, shape [rocks]."""
    hulls = np.array([len(shape.hulls) for shape in world.library.prototypes], np.int64)
    field = world.field
    return 1 + np.where(field.collides, hulls[field.prototype], 0)


def _found(world: World, options: Options) -> str:
    single = int(is_single(world.field, options).sum())
    dynamic = int(world.field.dynamic.sum())
    return f"{single} rocks are elements of their own, {dynamic} of them dynamic"
