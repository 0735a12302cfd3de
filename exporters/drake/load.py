"""What a world asks of Drake's parser, and when that is too much."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from terrain_forge.base import ExportError
from terrain_forge.geometry import level_of_detail, merge_rocks
from terrain_forge.model import RockField, World

from .options import Options
from .rocks import is_single

SECONDS_PER_FACE, MB_PER_FACE = 20e-6, 1.6e-3
"""Time [s] and memory [MB] for each triangle that is rigid, from the file to a plant that is ready:
measured with Drake 1.51, 14 to 26 µs and 1.6 to 1.7 kB of 0.2 to 1 million."""
SECONDS_PER_PAIR = 2e-6
"""Time per pair of static rocks of their own [s], as each is compared with all before it: 31 s
besides those for the triangles of 4,000."""
SECONDS_PER_BODY = 5e-3
"""Time per dynamic rock [s]."""
MOST_SECONDS, MOST_MB = 300.0, 8192.0
"""What parsing may take."""
WORTH_SAYING_SECONDS = 20.0
"""From what on parsing is a loss to be told [s]."""
_SAMPLE = 400
"""Merged rocks by which the faces of all are estimated: how much of each is above the ground."""
_FEWER_ROCKS, _COARSER = (2000, 500, 0), (0.05, 0.1, 0.2)
"""What is tried for an advice: rocks of their own, and errors of the others' outlines."""
_NODES_ADVICE = "choose a smaller size_m or a larger spacing_m"


@dataclass(frozen=True, kw_only=True)
class Load:
    """What Drake's parser takes."""

    faces: int
    """Triangles of the ground and of static rocks that can be touched."""
    single: int
    """Static rocks of their own."""
    dynamic: int
    """Dynamic rocks."""

    @property
    def seconds(self) -> float:
        """Time [s]."""
        bodies = SECONDS_PER_BODY * self.dynamic
        return SECONDS_PER_FACE * self.faces + SECONDS_PER_PAIR * self.single**2 + bodies

    @property
    def megabytes(self) -> float:
        """Memory [MB]."""
        return MB_PER_FACE * self.faces

    @property
    def bearable(self) -> bool:
        """Whether it is allowed."""
        return self.seconds <= MOST_SECONDS and self.megabytes <= MOST_MB

    def __str__(self) -> str:
        """What is loaded and what that takes, as words of a sentence."""
        return (
            f"{self.faces:,} triangles, {self.single:,} static rocks of their own and "
            f"{self.dynamic:,} dynamic ones, some {self.seconds:.0f} s and "
            f"{self.megabytes / 1024:.1f} GB"
        )


def check_capacity(options: Options, *, nodes: float, rocks: float) -> None:
    """Refuse, before the world is made, what Drake's parser would sit over for long.

    Raises:
        ExportError: if the ground is too large, or rocks of their own too many.
    """
    load = Load(faces=int(2 * nodes), single=0, dynamic=0)
    if load.bearable and options.individual_min_m == 0.0:  # else the number is known only later
        load = Load(faces=load.faces, single=int(rocks), dynamic=0)
        if not load.bearable:
            raise ExportError(
                f"Drake's parser would load {load} ({_allowed()}); a larger individual_min_m "
                "merges the smaller ones",
                key=("individual_min_m",),
            )
    if not load.bearable:
        raise ExportError(
            f"Drake's parser would take {load.seconds:.0f} s and {load.megabytes / 1024:.0f} GB "
            f"for a ground of {nodes / 1e6:.1f} M nodes ({_allowed()}); {_NODES_ADVICE}"
        )


def require_parsable(world: World, options: Options) -> None:
    """Refuse a world over which Drake's parser would sit for long.

    Raises:
        ExportError: if it would; says what to choose instead.
    """
    load = parsing(world, options)
    if not load.bearable:
        raise ExportError(
            f"Drake's parser would load {load} ({_allowed()}); {_advice(world, options)}"
        )


def parsing_losses(world: World, options: Options) -> list[str]:
    """What parsing takes, where that is much."""
    load = parsing(world, options)
    if load.seconds <= WORTH_SAYING_SECONDS:
        return []
    return [
        f"Drake's parser loads {load}; a larger individual_min_m or outline_error, a smaller "
        "size_m or fewer dynamic rocks make it less."
    ]


def parsing(world: World, options: Options) -> Load:
    """What Drake's parser takes for a world."""
    fixed = world.field.select(~world.field.dynamic)
    large = is_single(fixed, options)
    faces = 2 * (world.ground.shape[0] - 1) * (world.ground.shape[1] - 1)
    finest = np.array([len(p.meshes[0].faces) for p in world.library.prototypes], np.int64)
    faces += int(finest[fixed.prototype[large & fixed.collides]].sum())
    faces += _merged_faces(world, fixed.select(~large & fixed.collides), options.outline_error)
    return Load(faces=faces, single=int(large.sum()), dynamic=len(world.field) - len(fixed))


def _merged_faces(world: World, rocks: RockField, tolerance: float) -> int:
    """About how many triangles of merged rocks are left above the ground."""
    if not len(rocks):
        return 0
    rows = np.unique(np.linspace(0, len(rocks) - 1, _SAMPLE).astype(np.int64))
    shapes = [p.meshes[level_of_detail(p, tolerance)] for p in world.library.prototypes]
    _, faces = merge_rocks(rocks.select(rows), shapes, world.ground)
    return round(len(faces) * len(rocks) / len(rows))


def _advice(world: World, options: Options) -> str:
    """Options by which the world can be loaded, or what to change in the recipe."""
    for other in _other_options(world, options):
        load = parsing(world, other)
        if load.bearable:
            changed = [
                f"{name}: {getattr(other, name):g}"
                for name in ("individual_min_m", "outline_error")
                if getattr(other, name) != getattr(options, name)
            ]
            return f"{' and '.join(changed)} would be {load}"
    if SECONDS_PER_BODY * int(world.field.dynamic.sum()) > MOST_SECONDS / 2:
        return "make fewer rocks dynamic"
    return "choose a smaller size_m, or a larger collision_min_m or diameter_m of the populations"


def _other_options(world: World, options: Options) -> Iterator[Options]:
    """Options that ask less and less of the parser."""
    fixed = world.field.select(~world.field.dynamic & is_single(world.field, options))
    diameters = np.sort(fixed.diameter)[::-1]
    sizes = [options.individual_min_m]
    sizes += [float(diameters[n]) for n in _FEWER_ROCKS if n < len(diameters)]
    errors = [options.outline_error, *(e for e in _COARSER if e > options.outline_error)]
    for error in errors:
        for size in sizes:
            least = size if size == options.individual_min_m else np.ceil(size * 1e3 + 1.0) / 1e3
            yield replace(options, individual_min_m=float(least), outline_error=error)


def _allowed() -> str:
    return f"at most {MOST_SECONDS:.0f} s and {MOST_MB / 1024:.0f} GB are allowed"
