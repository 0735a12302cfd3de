"""The rocks of a world: their shapes, and where each lies."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from functools import cached_property
from hashlib import sha256
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import (
    Array,
    DataError,
    Record,
    Rows,
    checked,
    matrix_from_quaternion,
    rectangle_distance,
    shaped,
    to_plain,
)
from terrain_forge.model.heightfield import Bounds, Heightfield
from terrain_forge.model.mesh import Mesh, box_projection

CLOSE = -1
"""The level of detail of a shape's close mesh; its other levels count from 0."""
CLOSE_MIN_M = 0.25
"""Exposed diameter from which on a rock's close mesh shows from a metre [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RockPrototype(Record):
    """One rock shape: origin at its centre of mass, z up as it rests, mean axis 1 m."""

    family: str
    """Which generator made it."""
    meshes: tuple[Mesh, ...]
    """Watertight visual meshes, finest first (levels of detail); the first one is the rock's
    shape."""
    hulls: tuple[Mesh, ...]
    """Convex collision parts."""
    volume: float
    """Volume of the first mesh [m³]."""
    inertia: Array = field(metadata=shaped(3, 3))
    """Inertia tensor of the first mesh about its centre of mass for a density of 1 kg/m³, shape
    [3, 3]."""
    hull_excess: float
    """Volume of the hulls' union over the volume of the mesh, minus 1."""
    hull_distance: float
    """Hausdorff distance between the surface of the hulls' union and that of the first mesh [mean
    axes]."""
    uvs: tuple[Array, ...]
    """Texture coordinates of each mesh's face corners, in units of the library's tiling texture,
    each of shape [faces, 3, 2]; a seam lies between faces that disagree at a shared corner."""
    outline_errors: tuple[float, ...]
    """For each mesh, how far its outline is off the first one's, seen from any side, at most [mean
    axes]; 0 for the first."""
    reach: float
    """Over all tilts and burials that resting allows: the largest horizontal distance of any point
    of the rock from its centre of mass, as a fraction of the exposed diameter."""
    rise: float
    """Over the same tilts and burials: the largest height of the rock above the ground's tangent
    plane, as a fraction of the exposed diameter."""
    close: Mesh | None = None
    """The shape once more, finer than the first mesh, for pictures from a metre alone; None where
    the first mesh serves."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not len(self.meshes) == len(self.uvs) == len(self.outline_errors):
            raise ValueError("RockPrototype: as many uvs and outline_errors as meshes")
        for uv, mesh in zip(self.uvs, self.meshes, strict=True):
            if uv.shape != (len(mesh.faces), 3, 2):
                raise ValueError(f"RockPrototype.uvs: shape {uv.shape}, expected a pair per corner")
            uv.setflags(write=False)

    @checked
    def drawn(self, level: int) -> tuple[Mesh, Array]:
        """A level of detail, or with `CLOSE` the close mesh, and its texture coordinates.

        The latter are those of its faces' corners, shape [faces, 3, 2].

        Raises:
            DataError: for a level that it has not, and the close mesh of a shape without one.
        """
        if level in range(len(self.meshes)):
            return self.meshes[level], self.uvs[level]
        if level != CLOSE:
            raise DataError(f"RockPrototype: level {level}: 0 to {len(self.meshes) - 1}")
        if self.close is None:
            raise DataError(f"RockPrototype: a shape of family {self.family} has no close mesh")
        return self.close, box_projection(self.close)


@dataclass(frozen=True, kw_only=True, eq=False)
class RockLibrary(Record):
    """The rock shapes that a world uses; many worlds can share one."""

    prototypes: tuple[RockPrototype, ...]
    """The shapes; rocks name them by index."""
    seed: int
    """The library's own seed."""
    texture: NDArray[np.uint8] = field(metadata=shaped("rows", "columns", dtype=np.uint8))
    """Brightness of a rock's surface, which tiles both ways and which a population's colour
    multiplies, linear, 0 to 255, rows run up, shape [rows, columns]."""
    normals: NDArray[np.uint8] | None = field(
        default=None, metadata=shaped("rows", "columns", 3, dtype=np.uint8)
    )
    """Normals of the same relief towards u, v and outwards, -1 to 1 as 0 to 255, shape [rows,
    columns, 3]; None where the surface is smooth."""
    roughness: NDArray[np.uint8] | None = field(
        default=None, metadata=shaped("rows", "columns", dtype=np.uint8)
    )
    """How rough it shines, 0 to 255, shape [rows, columns]; None for matt throughout."""

    @cached_property
    def content_hash(self) -> str:
        """SHA-256 of all that the library holds, its stated errors too, hexadecimal."""
        arrays: dict[str, NDArray[Any]] = {}
        plain = json.dumps(to_plain(self, arrays), sort_keys=True)
        digest = sha256(plain.encode())
        for array in arrays.values():
            digest.update(array.tobytes())
        return digest.hexdigest()


@dataclass(frozen=True, kw_only=True, eq=False)
class RockField(Rows):
    """The rocks of a world, one row each, ordered by id.

    Fields that name a `column`, with the printf form of its numbers, are columns of rocks.csv.
    """

    populations: tuple[str, ...]
    """Names of the populations; rocks name them by index."""
    id: NDArray[np.int32] = field(metadata=shaped("rocks", dtype=np.int32))
    """Unique within the site and the same in every window of it, shape [rocks]."""
    population: NDArray[np.int32] = field(metadata=shaped("rocks", dtype=np.int32))
    """Index into `populations`, shape [rocks]."""
    prototype: NDArray[np.int32] = field(metadata=shaped("rocks", dtype=np.int32))
    """Index into the library, shape [rocks]."""
    position: Array = field(metadata=shaped("rocks", 3))
    """Centre of mass in the world frame [m], shape [rocks, 3]."""
    quaternion: Array = field(metadata=shaped("rocks", 4))
    """Rotation (w, x, y, z) from the prototype's axes to the world's, shape [rocks, 4]."""
    scale: Array = field(metadata=shaped("rocks"))
    """Size in units of the prototype, shape [rocks]."""
    diameter: Array = field(metadata=shaped("rocks", column="diameter_m", form="%.7f"))
    """Exposed plan diameter [m], shape [rocks]."""
    height: Array = field(metadata=shaped("rocks", column="height_m", form="%.7f"))
    """Top of the rock above the ground's tangent plane at its centre [m], shape [rocks]."""
    buried_fraction: Array = field(metadata=shaped("rocks", column="buried_fraction", form="%.7f"))
    """Part of the rock's extent across the tangent plane that lies below it, 0 to 1, shape
    [rocks]."""
    volume: Array = field(metadata=shaped("rocks", column="volume_m3", form="%.9g"))
    """Volume of the whole rock [m³], shape [rocks]."""
    mass: Array = field(metadata=shaped("rocks", column="mass_kg", form="%.9g"))
    """Mass [kg], shape [rocks]."""
    dynamic: NDArray[np.bool_] = field(metadata=shaped("rocks", dtype=np.bool_))
    """Which rocks lie on the ground as bodies that can be pushed; the others are fixed, shape
    [rocks]."""
    collides: NDArray[np.bool_] = field(metadata=shaped("rocks", dtype=np.bool_))
    """Which rocks can be touched; the others are visual-only, shape [rocks]."""


def merge(one: RockField, other: RockField) -> RockField:
    """Both fields' rocks, ordered by id."""
    both = one.joined(other)
    return both.select(np.argsort(both.id, kind="stable"))


def owned(field: RockField, part: Heightfield, whole: Bounds) -> NDArray[np.bool_]:
    """Which rocks belong to a part of the ground: those whose centre lies in it.

    Borders count to the part on their east and north, the outer ones of the whole to the last part.
    """
    west, south, east, north = part.bounds
    x, y = field.position[:, 0], field.position[:, 1]
    inside_east = (x >= west) & ((x < east) | (east >= whole[2]))
    return np.asarray(inside_east & (y >= south) & ((y < north) | (north >= whole[3])))


def touches(field: RockField, part: Heightfield, library: RockLibrary) -> NDArray[np.bool_]:
    """Which rocks may reach into a part of the ground: those whose circle of reach does."""
    reaches = np.array([prototype.reach for prototype in library.prototypes])
    reach = reaches[field.prototype] * field.diameter
    return np.asarray(rectangle_distance(field.position[:, :2], part.bounds) <= reach)


def rotations(field: RockField) -> Array:
    """Rotation matrices of the rocks, shape [rocks, 3, 3]."""
    return matrix_from_quaternion(field.quaternion)
