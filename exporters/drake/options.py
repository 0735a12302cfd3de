"""What can be chosen for a Drake export, and what its parser would sit over for too long."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Interval

from terrain_forge.base import ExportError, Idle, NotNegative, Positive, Spec
from terrain_forge.geometry import level_of_detail, merge_rocks
from terrain_forge.model import RockField, World

from ..sdf.rocks import is_single

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
COARSENESS = 0.03, 0.06, 0.12
"""Errors of a merged rock's outline that are tried, the first that is bearable is taken."""
WORTH_SAYING = 20.0
"""From what on parsing is a loss to be told [s]."""
_SAMPLE = 400
"""Merged rocks by which the faces of all are estimated: how much of each is above the ground."""
_ALLOWED = f"at most {MOST_SECONDS:.0f} s and {MOST_MB / 1024:.0f} GB are allowed"
ADVICE = (
    "a larger individual_min_m or outline_error, a smaller size_m or fewer dynamic rocks make it "
    "less"
)


@dataclass(frozen=True, kw_only=True)
class Options(Spec):
    """Options of the Drake export."""

    bytes_each: ClassVar[tuple[float, float]] = (180, 700)
    """About how many bytes it writes for each node of the ground and each rock."""
    bytes_each_face: ClassVar[float] = 55
    """About how many more it writes for each triangle of a rock."""
    kind: Literal["drake"] = "drake"
    """The exporter, where the export's folder has another name."""
    individual_min_m: NotNegative = 0.5
    """Rocks of at least this exposed diameter are geometries of their own; smaller static ones are
    merged into one mesh per tile and population, since Drake's parser takes a time that grows with
    the square of their number."""
    outline_error: Annotated[float, Interval(ge=0, le=0.5)] | None = None
    """Largest error of a merged rock's outline, as a fraction of its size: how coarse it may be; by
    default 0.03, or the next of 0.06 and 0.12 with which Drake's parser takes the
    world."""
    tile_cells: Annotated[int, Interval(ge=16, le=1024)] = 256
    """Cells of the ground's grid per mesh, each way."""
    texture_pixels: Annotated[int, Interval(ge=1, le=8192)] = 1024
    """Pixels of the ground's textures along its longer side, all tiles together: as many for each
    node as that has room for, one at least."""
    surface: Literal["regolith", "bedrock"] = "regolith"
    """What the ground is: its friction is that of the world's body (docs/driving.md)."""
    friction: NotNegative | None = None
    """Coulomb friction of ground and static rocks; without it each has its own, by body and
    surface. Dynamic rocks keep what they were settled with."""
    dynamic_modulus_pa: Positive = 1.0e9
    """Hydroelastic modulus of dynamic rocks [Pa]: how hard they are. The ground and the static
    rocks are rigid."""

    def idle(self) -> Iterator[Idle]:
        """What has no effect beside other options."""
        if self.friction is not None:
            yield Idle("surface", "friction is given")

    def merged_error(self, world: World) -> float:
        """The error that outlines of a world's merged rocks may have."""
        tried = COARSENESS if self.outline_error is None else (self.outline_error,)
        return next((e for e in tried if parsing_load(world, self, e).bearable), tried[-1])


@dataclass(frozen=True, kw_only=True)
class Load:
    """What Drake's parser takes."""

    faces: int
    """Triangles of the ground and of static rocks that can be touched."""
    single: int = 0
    """Static rocks of their own."""
    dynamic: int = 0
    """Dynamic rocks."""

    @property
    def seconds(self) -> float:
        """Time [s]."""
        bodies = SECONDS_PER_BODY * self.dynamic
        return SECONDS_PER_FACE * self.faces + SECONDS_PER_PAIR * self.single**2 + bodies

    @property
    def bearable(self) -> bool:
        """Whether it is allowed."""
        return self.seconds <= MOST_SECONDS and MB_PER_FACE * self.faces <= MOST_MB

    def __str__(self) -> str:
        """What is loaded and what that takes, as words of a sentence."""
        return (
            f"{self.faces:,} triangles, {self.single:,} static rocks of their own and "
            f"{self.dynamic:,} dynamic ones, some {self.seconds:.0f} s and "
            f"{MB_PER_FACE * self.faces / 1024:.1f} GB"
        )


def check_capacity(options: Options, *, nodes: float, rocks: float) -> None:
    """Refuse, before the world is made, what Drake's parser would sit over for long.

    Raises:
        ExportError: if the ground is too large, or rocks of their own too many.
    """
    ground = Load(faces=int(2 * nodes))
    if not ground.bearable:
        raise ExportError(
            f"Drake's parser would load {ground} for a ground of {nodes / 1e6:.1f} M nodes "
            f"({_ALLOWED}); choose a smaller size_m or a larger spacing_m"
        )
    load = Load(faces=ground.faces, single=int(rocks))
    if options.individual_min_m == 0.0 and not load.bearable:  # else the number is not known yet
        raise ExportError(
            f"Drake's parser would load {load} ({_ALLOWED}); a larger individual_min_m merges the "
            "smaller ones",
            key=("individual_min_m",),
        )


def require_parsable(world: World, options: Options) -> Load:
    """What Drake's parser takes for a world.

    Raises:
        ExportError: if it would sit over it for long; says what to choose instead.
    """
    load = parsing_load(world, options, options.merged_error(world))
    if not load.bearable:
        raise ExportError(f"Drake's parser would load {load} ({_ALLOWED}); {ADVICE}")
    return load


def parsing_load(world: World, options: Options, error: float) -> Load:
    """What Drake's parser takes where outlines of merged rocks may have that error."""
    fixed = world.field.select(~world.field.dynamic)
    large = is_single(fixed, options.individual_min_m)
    faces = 2 * (world.ground.shape[0] - 1) * (world.ground.shape[1] - 1)
    finest = np.array([len(p.meshes[0].faces) for p in world.library.prototypes], np.int64)
    faces += int(finest[fixed.prototype[large & fixed.collides]].sum())
    faces += _merged_faces(world, fixed.select(~large & fixed.collides), error)
    return Load(faces=faces, single=int(large.sum()), dynamic=len(world.field) - len(fixed))


def _merged_faces(world: World, rocks: RockField, tolerance: float) -> int:
    """About how many triangles of merged rocks are left above the ground."""
    if not len(rocks):
        return 0
    rows = np.unique(np.linspace(0, len(rocks) - 1, _SAMPLE).astype(np.int64))
    shapes = [p.meshes[level_of_detail(p, tolerance)] for p in world.library.prototypes]
    _, faces = merge_rocks(rocks.select(rows), shapes, world.ground)
    return round(len(faces) * len(rocks) / len(rows))
