"""What a consumer made of an export, in the world's frame and units."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array
from terrain_forge.model import Mesh
from terrain_forge.paths import Deviation

MERGED = -1
"""Rock of a solid that the export does not name."""
BACKDROP = "horizon", "sky"
"""What exports call what lies beyond the border; no rays and no rocks are looked for in it."""
_ROCK = re.compile(r"(?:^|/)rock_(\d+)(?:$|_|/)")


def rock_of(name: str) -> int | None:
    """The id of the rock that a name or a part of a path tells, as `rock_<id>…`."""
    found = _ROCK.search(name)
    return int(found[1]) if found else None


def is_ground(name: str) -> bool:
    """Whether a shape of that name is ground."""
    return name.lower().startswith("ground")


class Body(NamedTuple):
    """A rock that can be pushed."""

    mass: float
    """[kg]."""
    inertia: Array
    """About the centre of mass in the rock's own axes [kg m²], shape [3, 3]."""
    position: Array
    """Centre of mass in the world frame [m], shape [3]."""
    rotation: Array
    """Matrix from the rock's axes to the world's, shape [3, 3]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Track:
    """A path as the consumer has it."""

    name: str
    """What the consumer calls it."""
    time: Array | None
    """Times of the samples [s], shape [samples]; None where there are places alone."""
    position: Array
    """Origins of base_link in the world frame [m], shape [samples, 3]."""
    quaternion: Array | None
    """Rotations (w, x, y, z) to the world frame, shape [samples, 4]; None where there are none."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Reading:
    """What a consumer made of an export; None stands for what it was not or could not be asked."""

    consumer: str
    """The consumer and its version."""
    heights: Array | None = None
    """Heights that the consumer itself found at the points [m], shape [points]."""
    points: Array | None = None
    """Where they were found, if not at the sample's points [m], shape [points, 2]."""
    hidden: NDArray[np.bool_] | None = None
    """Points of the sample at which the consumer cannot tell the ground from rocks, shape
    [points]."""
    ground: tuple[Mesh, ...] = ()
    """The ground's meshes, where the consumer does not answer for heights itself."""
    extent: tuple[float, float, float, float] | None = None
    """West, south, east, north edge of the ground [m]; by default those of its meshes."""
    quantum: float = 0.0
    """Step of the ground's heights [m], where they are whole numbers."""
    besides: float = 0.0
    """How far the export itself says that its ground is off [m], such as by resampling."""
    ground_limit: float | None = None
    """How far the ground may be off [m], where that is not by the usual limit, quantum and
    besides."""
    touched: SolidsOfRocks | None = None
    """Rocks as physics has them."""
    seen: SolidsOfRocks | None = None
    """Rocks as pictures have them."""
    rock_error: float = 0.0
    """How far the export's options allow a rock's outline to be off, as a part of its size."""
    drawn_level: int = 0
    """Level of detail by which rocks are drawn, at the coarsest, whatever the options."""
    close: bool = False
    """Whether rocks may be drawn by the close meshes of their shapes."""
    gravity: float | None = None
    """Acceleration along z [m/s²]."""
    bodies: Mapping[int, Body] | None = None
    """Dynamic rocks, by id."""
    tracks: tuple[Track, ...] | None = None
    """The paths."""
    replays: tuple[Deviation | None, ...] = ()
    """How far each path's replay, as the consumer interpolates it, leaves the path between its
    samples; None for a path without a replay."""
    balls: Array | None = None
    """Heights at which the sample's balls rest [m], shape [balls]."""
    findings: tuple[str, ...] | None = None
    """What the consumer complained of."""
    reasons: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    """Why an aspect is not carried, by its name."""


class SolidsOfRocks:
    """The vertices of the rocks that are looked at, as far as the consumer tells them apart.

    Args:
        rocks: Ids of these rocks.
    """

    def __init__(self, rocks: Collection[int]) -> None:
        self._wanted = frozenset(rocks)
        self._named: dict[int, int] = {}
        self._vertices: list[Array] = [np.zeros((0, 3))]
        self._solid: list[NDArray[np.int64]] = [np.zeros(0, np.int64)]
        self.rock: list[int] = []
        """Id of the rock that each solid is, MERGED where it has no name."""

    @property
    def vertices(self) -> Array:
        """Positions in the world frame [m], shape [vertices, 3]."""
        return np.concatenate(self._vertices)

    @property
    def solid(self) -> NDArray[np.int64]:
        """Which solid each vertex belongs to, shape [vertices]."""
        return np.concatenate(self._solid)

    def wants(self, rock: int) -> bool:
        """Whether this rock is looked at."""
        return rock in self._wanted

    def add(self, rock: int, vertices: Array) -> None:
        """Add a part of a rock that the export names; others than those looked at are left out."""
        if rock not in self._wanted:
            return
        if rock not in self._named:
            self._named[rock] = len(self.rock)
            self.rock.append(rock)
        self._append(vertices, np.full(len(vertices), self._named[rock]))

    def add_merged(self, vertices: Array, solid: NDArray[np.int64]) -> None:
        """Add solids without names; `solid` counts from 0."""
        first = len(self.rock)
        self.rock += [MERGED] * (int(solid.max(initial=-1)) + 1)
        self._append(vertices, first + solid)

    def _append(self, vertices: Array, solid: NDArray[np.int64]) -> None:
        self._vertices.append(np.asarray(vertices, np.float64))
        self._solid.append(solid.astype(np.int64))
