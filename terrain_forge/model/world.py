"""The hand-off types between the stages (docs/conventions.md: frames, units, surface)."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, fields
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrain_forge.base import Array, Record, compass_to_direction, matrix_from_quaternion, to_plain
from terrain_forge.model.mesh import Mesh
from terrain_forge.model.rover import Rover
from terrain_forge.model.site import Site, Window
from terrain_forge.model.trajectory import Trajectory


@dataclass(frozen=True, kw_only=True, eq=False)
class Heightfield(Record):
    """A grid of nodes; the surface triangulates it, cells cut south-west to north-east."""

    elevation: NDArray[np.float32]
    """Heights [m], shape [rows, columns]; rows run north, columns run east."""
    spacing: float
    """Distance of neighbouring nodes [m]."""
    origin: tuple[float, float]
    """East and north coordinate of node [0, 0] [m]."""

    def __post_init__(self) -> None:
        self.freeze("elevation", np.float32, ("rows", "columns"))

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of nodes."""
        return self.elevation.shape[0], self.elevation.shape[1]

    @property
    def east(self) -> Array:
        """East coordinates of the columns [m]."""
        return self.origin[0] + np.arange(self.shape[1], dtype=np.float64) * self.spacing

    @property
    def north(self) -> Array:
        """North coordinates of the rows [m]."""
        return self.origin[1] + np.arange(self.shape[0], dtype=np.float64) * self.spacing

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """West, south, east, north edge [m]."""
        west, south = self.origin
        rows, columns = self.shape
        return west, south, west + (columns - 1) * self.spacing, south + (rows - 1) * self.spacing

    def covers(self, east: ArrayLike, north: ArrayLike) -> NDArray[np.bool_]:
        """Which points lie on the grid (edges count, to a billionth of a cell)."""
        column = (np.asarray(east, np.float64) - self.origin[0]) / self.spacing
        row = (np.asarray(north, np.float64) - self.origin[1]) / self.spacing
        rows, columns = self.shape
        slack = 1e-9
        inside_east = (column >= -slack) & (column <= columns - 1 + slack)
        return inside_east & (row >= -slack) & (row <= rows - 1 + slack)

    def holds(self, points: Array, *, margin: float) -> bool:
        """Whether all points, shape [n, 2], lie at least `margin` [m] within the grid."""
        west, south, east, north = self.bounds
        low, high = np.array([west, south]) + margin, np.array([east, north]) - margin
        return bool(np.all((points >= low) & (points <= high)))

    def height_at(self, east: ArrayLike, north: ArrayLike) -> Array:
        """Height [m] of the triangulated surface under points of the grid [m].

        Raises:
            ValueError: if a point lies outside the grid.
        """
        if not np.all(self.covers(east, north)):
            raise ValueError(f"point outside the grid (west, south, east, north: {self.bounds})")
        column = (np.asarray(east, np.float64) - self.origin[0]) / self.spacing
        row = (np.asarray(north, np.float64) - self.origin[1]) / self.spacing
        rows, columns = self.shape
        i = np.clip(np.floor(column).astype(np.int64), 0, columns - 2)
        j = np.clip(np.floor(row).astype(np.int64), 0, rows - 2)
        u, v = column - i, row - j
        z = self.elevation
        sw, se = z[j, i].astype(np.float64), z[j, i + 1].astype(np.float64)
        nw, ne = z[j + 1, i].astype(np.float64), z[j + 1, i + 1].astype(np.float64)
        below = sw + u * (se - sw) + v * (ne - se)
        above = sw + v * (nw - sw) + u * (ne - nw)
        result: Array = np.where(u >= v, below, above)
        return result

    def cut(self, *, column: int, row: int, columns: int, rows: int) -> Heightfield:
        """The sub-grid that starts at node (column, row) and has so many cells each way."""
        origin = (self.origin[0] + column * self.spacing, self.origin[1] + row * self.spacing)
        nodes = self.elevation[row : row + rows + 1, column : column + columns + 1]
        return Heightfield(elevation=nodes, spacing=self.spacing, origin=origin)


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
    inertia: Array
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

    def __post_init__(self) -> None:
        self.freeze("inertia", np.float64, (3, 3))
        if not len(self.meshes) == len(self.uvs) == len(self.outline_errors):
            raise ValueError("RockPrototype: as many uvs and outline_errors as meshes")
        for uv, mesh in zip(self.uvs, self.meshes, strict=True):
            if uv.shape != (len(mesh.faces), 3, 2):
                raise ValueError(f"RockPrototype.uvs: shape {uv.shape}, expected a pair per corner")
            uv.setflags(write=False)


@dataclass(frozen=True, kw_only=True, eq=False)
class RockLibrary(Record):
    """The rock shapes that a world uses; many worlds can share one."""

    prototypes: tuple[RockPrototype, ...]
    """The shapes; rocks name them by index."""
    seed: int
    """The library's own seed."""
    texture: NDArray[np.uint8]
    """Brightness of a rock's surface, which tiles both ways and which a population's colour
    multiplies, linear, 0 to 255, rows run up, shape [rows, columns]."""

    def __post_init__(self) -> None:
        self.freeze("texture", np.uint8, ("rows", "columns"))

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
class RockField(Record):
    """The rocks of a world, one row each, ordered by id."""

    populations: tuple[str, ...]
    """Names of the populations; rocks name them by index."""
    id: NDArray[np.int32]
    """Unique within the site and the same in every window of it, shape [rocks]."""
    population: NDArray[np.int32]
    """Index into `populations`, shape [rocks]."""
    prototype: NDArray[np.int32]
    """Index into the library, shape [rocks]."""
    position: Array
    """Centre of mass in the world frame [m], shape [rocks, 3]."""
    quaternion: Array
    """Rotation (w, x, y, z) from the prototype's axes to the world's, shape [rocks, 4]."""
    scale: Array
    """Size in units of the prototype, shape [rocks]."""
    diameter: Array
    """Exposed plan diameter [m], shape [rocks]."""
    height: Array
    """Top of the rock above the ground's tangent plane at its centre [m], shape [rocks]."""
    buried_fraction: Array
    """Part of the rock's extent across the tangent plane that lies below it, 0 to 1, shape
    [rocks]."""
    volume: Array
    """Volume of the whole rock [m³], shape [rocks]."""
    mass: Array
    """Mass [kg], shape [rocks]."""
    dynamic: NDArray[np.bool_]
    """Which rocks lie on the ground as bodies that can be pushed; the others are fixed, shape
    [rocks]."""
    collides: NDArray[np.bool_]
    """Which rocks can be touched; the others are visual-only, shape [rocks]."""

    def __post_init__(self) -> None:
        for name in ("id", "population", "prototype"):
            self.freeze(name, np.int32, ("rocks",))
        self.freeze("position", np.float64, ("rocks", 3))
        self.freeze("quaternion", np.float64, ("rocks", 4))
        for name in ("scale", "diameter", "height", "buried_fraction", "volume", "mass"):
            self.freeze(name, np.float64, ("rocks",))
        for name in ("dynamic", "collides"):
            self.freeze(name, np.bool_, ("rocks",))

    def __len__(self) -> int:
        return len(self.id)

    def select(self, rows: NDArray[np.bool_] | NDArray[np.intp]) -> RockField:
        """The rocks of a mask or of an index array."""
        return self.replace(**{name: getattr(self, name)[rows] for name in ROCK_COLUMNS})


ROCK_COLUMNS = tuple(field.name for field in fields(RockField) if field.name != "populations")
"""Names of a rock field's arrays."""


@dataclass(frozen=True, kw_only=True, eq=False)
class GroundDetail(Record):
    """A tile of the ground close by, which repeats both ways: soil down to millimetres."""

    size: float
    """Side of the tile on the ground [m]; tiles are counted from the site's origin."""
    brightness: NDArray[np.uint8]
    """Linear factor on the ground's colour, `MIDDLE` for 1, rows run north, shape [side, side]."""
    normals: NDArray[np.uint8]
    """Unit normals towards east, north and away from the ground, -1 to 1 as 0 to 255, rows run
    north, shape [side, side, 3]."""

    MIDDLE: ClassVar[int] = 128

    def __post_init__(self) -> None:
        self.freeze("brightness", np.uint8, ("side", "side"))
        self.freeze("normals", np.uint8, (*self.brightness.shape, 3))


@dataclass(frozen=True, kw_only=True, eq=False)
class Appearance(Record):
    """What the ground and the rocks look like."""

    ground_rgb: NDArray[np.uint8]
    """sRGB colour of each node of the ground, rows run north, shape [rows, columns, 3]."""
    rock_rgb: NDArray[np.uint8]
    """sRGB colour of each population's rocks, shape [populations, 3]."""
    detail: GroundDetail | None = None
    """What the ground looks like close by; None where nobody made it."""

    def __post_init__(self) -> None:
        self.freeze("ground_rgb", np.uint8, ("rows", "columns", 3))
        self.freeze("rock_rgb", np.uint8, ("populations", 3))


@dataclass(frozen=True, kw_only=True, eq=False)
class Lighting(Record):
    """The Sun and the sky."""

    sun_azimuth: float
    """Where the Sun stands, clockwise from north [rad]."""
    sun_elevation: float
    """Height of the Sun above the horizon [rad]."""
    irradiance: float
    """Irradiance of a surface that faces the Sun [W/m²]."""
    sky_rgb: tuple[float, float, float]
    """Colour of the sky, linear 0 to 1."""

    @property
    def towards_sun(self) -> Array:
        """Unit vector (east, north, up) from the ground to the Sun."""
        return compass_to_direction(self.sun_azimuth, self.sun_elevation)


@dataclass(frozen=True, kw_only=True, eq=False)
class World(Record):
    """Everything that exporters, truth, pictures and validation need."""

    site: Site
    """The place."""
    window: Window
    """The part of the site that this world is."""
    ground: Heightfield
    """The bare ground."""
    appearance: Appearance
    """Colours."""
    library: RockLibrary
    """Rock shapes."""
    field: RockField
    """Rocks whose centre lies in the window."""
    neighbours: RockField
    """Rocks of the site whose centre lies outside the window but which reach into it."""
    trajectories: tuple[Trajectory, ...]
    """Paths on the ground."""
    rover: Rover
    """Who drives."""
    lighting: Lighting
    """Sun and sky."""
    unplaced: tuple[int, ...]
    """Rocks of each population that found no free place, counted over the rocks of this window."""

    def tiles(self, *, cells: int = 1024) -> Iterator[World]:
        """The world in tiles of at most `cells` cells each way, row by row from the south-west.

        Tiles share their border nodes; a rock belongs to the tile of its centre.
        """
        columns = range(0, self.window.columns, cells)
        rows = range(0, self.window.rows, cells)
        if len(columns) * len(rows) == 1:
            yield self
            return
        for row in rows:
            for column in columns:
                yield self._tile(column, row, cells)

    def _tile(self, column: int, row: int, cells: int) -> World:
        columns = min(cells, self.window.columns - column)
        rows = min(cells, self.window.rows - row)
        ground = self.ground.cut(column=column, row=row, columns=columns, rows=rows)
        everyone = merge(self.field, self.neighbours)
        own = owned(everyone, ground, self.ground.bounds) & np.isin(everyone.id, self.field.id)
        near = touches(everyone, ground, self.library) & ~own
        colours = self.appearance.ground_rgb[row : row + rows + 1, column : column + columns + 1]
        return self.replace(
            window=Window(
                column=self.window.column + column,
                row=self.window.row + row,
                columns=columns,
                rows=rows,
            ),
            ground=ground,
            appearance=self.appearance.replace(ground_rgb=colours),
            field=everyone.select(own),
            neighbours=everyone.select(near),
        )

    def save(self, directory: Path) -> list[Path]:
        """Store the world in `directory`/world; returns the files."""
        from terrain_forge.model.storage import save_world

        return save_world(self, Path(directory))

    @staticmethod
    def load(directory: Path | str) -> World:
        """The world of a built folder.

        Raises:
            OutputError: if the folder holds no world of this version.
        """
        from terrain_forge.model.storage import load_world

        return load_world(Path(directory))


def merge(one: RockField, other: RockField) -> RockField:
    """Both fields' rocks, ordered by id."""
    order = np.argsort(np.concatenate([one.id, other.id]), kind="stable")
    joined = {
        name: np.concatenate([getattr(one, name), getattr(other, name)])[order]
        for name in ROCK_COLUMNS
    }
    return one.replace(**joined)


Bounds = tuple[float, float, float, float]


def owned(field: RockField, part: Heightfield, whole: Bounds) -> NDArray[np.bool_]:
    """Which rocks belong to a part of the ground: those whose centre lies in it.

    Borders count to the part on their east and north, the outer ones of the whole to the last part.
    """
    west, south, east, north = part.bounds
    x, y = field.position[:, 0], field.position[:, 1]
    inside_east = (x >= west) & ((x < east) | (east >= whole[2]))
    result: NDArray[np.bool_] = inside_east & (y >= south) & ((y < north) | (north >= whole[3]))
    return result


def touches(field: RockField, part: Heightfield, library: RockLibrary) -> NDArray[np.bool_]:
    """Which rocks may reach into a part of the ground: those whose circle of reach does."""
    reaches = np.array([prototype.reach for prototype in library.prototypes])
    reach = reaches[field.prototype] * field.diameter
    west, south, east, north = part.bounds
    x, y = field.position[:, 0], field.position[:, 1]
    away_east = np.maximum(np.maximum(west - x, x - east), 0.0)
    away_north = np.maximum(np.maximum(south - y, y - north), 0.0)
    result: NDArray[np.bool_] = np.hypot(away_east, away_north) <= reach
    return result


def rotations(field: RockField) -> Array:
    """Rotation matrices of the rocks, shape [rocks, 3, 3]."""
    return matrix_from_quaternion(field.quaternion)
