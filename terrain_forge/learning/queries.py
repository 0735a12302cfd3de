"""Heights, normals, slopes and rocks of many worlds at once, for NumPy, PyTorch and JAX."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from terrain_forge.base import DataError, OutputError, checked, require_alike, require_kind
from terrain_forge.learning.requests import folders_of
from terrain_forge.model import World
from terrain_forge.truth import rock_rasters
from terrain_forge.variation import ORDER

_PYTHONS = (int, float, list, tuple)
_SHORT = ("torch.uint8", "torch.int8", "torch.int16")
"""Types of whole numbers that PyTorch takes no index of."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Grounds:
    """The grounds of worlds of one size and spacing, as arrays of one library.

    Points are `world`, whole numbers of any shape, and `east` and `north` [m] of the same shape, or
    of one that broadcasts, also lists and single numbers; what lies outside a world counts as its
    edge, and of NaN all is NaN, -1 as a rock's id. All is computed by the library that the arrays
    are of, on the device where they are. A world that is not there, what is no number, and shapes
    that do not go together are a DataError; of arrays of other libraries than NumPy, which may be
    on a device or not known yet, the numbers are not looked at.
    """

    elevation: Any
    """Heights of the bare ground [m], float32, shape [worlds, rows, columns]; rows run north."""
    top: Any
    """Heights of ground and rocks [m], as `elevation`."""
    rock: Any
    """Ids of the rocks on top, -1 for the ground, int32, as `elevation`."""
    origin: tuple[float, float]
    """East and north of the first node [m], of all worlds."""
    spacing: float
    """Distance of nodes [m]."""

    def __repr__(self) -> str:
        count, rows, columns = self.elevation.shape
        east, north = self.spacing * (columns - 1), self.spacing * (rows - 1)
        worlds = f"{count} world{'s' * (count != 1)}"
        return f"<Grounds: {worlds} of {east:g} × {north:g} m at {self.spacing:g} m>"

    @staticmethod
    @checked
    def of(worlds: World | Path | str | Iterable[World | Path | str]) -> Grounds:
        """The grounds of worlds, or of folders in which they were built, as NumPy's arrays.

        Args:
            worlds: Several, or one, or a folder of many worlds.

        Raises:
            OutputError: if they differ in size or spacing, or there are none.
            DataError: for another kind of argument.
        """
        if isinstance(worlds, Path | str) and (Path(worlds) / ORDER).is_file():
            worlds = folders_of(Path(worlds), None)
        elif isinstance(worlds, World | Path | str):
            worlds = (worlds,)
        loaded = [_world(one) for one in worlds]
        if not loaded:
            raise OutputError("no worlds: give some, or the folders in which they were built")
        kinds = {(one.ground.shape, one.ground.spacing, one.ground.origin) for one in loaded}
        if len(kinds) != 1:
            raise OutputError(f"worlds of one size and spacing, found {len(kinds)} different ones")
        rasters = [rock_rasters(one) for one in loaded]
        ground = loaded[0].ground
        return Grounds(
            elevation=np.stack([one.ground.elevation for one in loaded]),
            top=np.stack([top for top, _ in rasters]),
            rock=np.stack([rock for _, rock in rasters]),
            origin=ground.origin,
            spacing=ground.spacing,
        )

    @checked
    def to(self, take: Callable[[Any], Any]) -> Grounds:
        """The same as arrays of another library, which takes them by DLPack without a copy.

        Args:
            take: Such as `torch.from_dlpack`, `jax.dlpack.from_dlpack`, or, to another device,
                `lambda a: torch.from_dlpack(a).cuda()`.
        """
        # Frozen arrays cannot be given away by DLPack: these are our own.
        return Grounds(
            elevation=take(self.elevation),
            top=take(self.top),
            rock=take(self.rock),
            origin=self.origin,
            spacing=self.spacing,
        )

    def height_at(self, world: Any, east: Any, north: Any) -> Any:
        """Height [m] of the triangulated bare ground, as `Heightfield.height_at` has it."""
        corners, u, v = self._cell(world, east, north)
        sw, se, nw, ne = corners
        below = sw + u * (se - sw) + v * (ne - se)
        above = sw + v * (nw - sw) + u * (ne - nw)
        upper = _upper(u, v)
        return below + upper * (above - below)

    def rise_at(self, world: Any, east: Any, north: Any) -> tuple[Any, Any]:
        """Rise of the triangle under each point, per metre east and north."""
        (sw, se, nw, ne), u, v = self._cell(world, east, north)
        upper = _upper(u, v)
        rise_east = (1 - upper) * (se - sw) + upper * (ne - nw)
        rise_north = (1 - upper) * (ne - se) + upper * (nw - sw)
        return rise_east / self.spacing, rise_north / self.spacing

    def normal_at(self, world: Any, east: Any, north: Any) -> tuple[Any, Any, Any]:
        """Unit normal of the triangle under each point: towards east, north and up."""
        a, b = self.rise_at(world, east, north)
        up = (1.0 + a * a + b * b) ** -0.5
        return -a * up, -b * up, up

    def slope_at(self, world: Any, east: Any, north: Any) -> Any:
        """Tangent of the slope of the triangle under each point."""
        a, b = self.rise_at(world, east, north)
        return (a * a + b * b) ** 0.5

    def rock_at(self, world: Any, east: Any, north: Any) -> Any:
        """Id of the rock on top of the node nearest to each point, -1 for the ground."""
        world, row, column, nothing = self._nodes(world, east, north)
        rock = self.rock[world, row, column]
        known = _as(nothing == 0.0, rock)
        return known * rock + known - 1

    def top_at(self, world: Any, east: Any, north: Any) -> Any:
        """Height [m] of ground or rock at the node nearest to each point.

        Beside nodes it may be below `height_at`, which is of the ground at the point itself.
        """
        world, row, column, nothing = self._nodes(world, east, north)
        top = self.top[world, row, column]
        return top + _as(nothing, top)

    def _worlds(self, given: Any) -> Any:
        """Numbers of worlds, a list of Python's as an array of NumPy's.

        Raises:
            DataError: if there is no such world.
        """
        if _is_foreign(given):  # of bytes PyTorch would make a mask
            return given.long() if str(given.dtype) in _SHORT else given
        count = len(self.elevation)
        allowed = f"whole numbers from 0 to {count - 1} are allowed"
        try:
            numbers = np.asarray(given)
        except ValueError:
            raise DataError(f"worlds in rows of several lengths: {allowed}") from None
        if numbers.size and numbers.dtype.kind not in "iu":
            raise DataError(f"worlds of the type {numbers.dtype.name}: {allowed}")
        beyond = numbers[(numbers < 0) | (numbers >= count)]
        if beyond.size:
            raise DataError(f"world {beyond[0]}: {allowed}")
        return numbers.astype(np.int64) if isinstance(given, list | tuple) else given

    def _points(self, world: Any, east: Any, north: Any) -> tuple[Any, Any, Any]:
        """The same, numbers and lists of Python's as NumPy's.

        Raises:
            DataError: if they are no numbers, or of shapes that do not go together.
        """
        world, east, north = self._worlds(world), _number(east, "east"), _number(north, "north")
        require_alike(world=world, east=east, north=north)
        ground = self.elevation
        return _taken(world, self.rock), _taken(east, ground), _taken(north, ground)

    def _nodes(self, world: Any, east: Any, north: Any) -> tuple[Any, Any, Any, Any]:
        """World, row, column of the node nearest to each point, and 0, NaN where that is none."""
        rows, columns = self.elevation.shape[1:]
        world, east, north = self._points(world, east, north)
        column = ((east - self.origin[0]) / self.spacing + 0.5).clip(0, columns - 1)
        row = ((north - self.origin[1]) / self.spacing + 0.5).clip(0, rows - 1)
        return world, _whole(row, rows - 1), _whole(column, columns - 1), 0.0 * (row + column)

    def _cell(self, world: Any, east: Any, north: Any) -> tuple[tuple[Any, ...], Any, Any]:
        """Heights of the corners of the cell under each point, and where in it the point lies."""
        rows, columns = self.elevation.shape[1:]
        world, east, north = self._points(world, east, north)
        x = ((east - self.origin[0]) / self.spacing).clip(0, columns - 1)
        y = ((north - self.origin[1]) / self.spacing).clip(0, rows - 1)
        i, j = _whole(x, columns - 2), _whole(y, rows - 2)
        z = self.elevation
        corners = z[world, j, i], z[world, j, i + 1], z[world, j + 1, i], z[world, j + 1, i + 1]
        return corners, x - i, y - j


def _world(one: Any) -> World:
    """A world, or that of a folder."""
    if isinstance(one, World):
        return one
    if not isinstance(one, Path | str):
        raise DataError(f"a world or its folder is wanted, found a {type(one).__name__}")
    return World.load(one)


def _is_foreign(values: Any) -> bool:
    """Whether they are an array of another library than NumPy."""
    return hasattr(values, "dtype") and not isinstance(values, np.ndarray | np.generic)


def _number(values: Any, what: str) -> Any:
    """The same, numbers and lists of Python's as NumPy's.

    Raises:
        DataError: if they are no numbers.
    """
    if not _is_foreign(values):
        require_kind(values, ArrayLike, f"Grounds: {what}")
    return np.asarray(values, np.float64)[()] if isinstance(values, _PYTHONS) else values


def _taken(values: Any, beside: Any) -> Any:
    """NumPy's as PyTorch's beside a tensor, which computes with none of NumPy's."""
    if hasattr(beside, "new_tensor") and not _is_foreign(values):
        return beside.new_tensor(values)
    return values


def _whole(values: Any, most: int) -> Any:
    """Values that are not negative, rounded down to whole numbers up to one; 0 or that of NaN."""
    with np.errstate(invalid="ignore"):
        whole = values.long() if hasattr(values, "long") else values.astype("int32")
    return whole.clip(0, most)


def _upper(u: Any, v: Any) -> Any:
    """1 in the upper triangle of a cell and 0 in the lower one, NaN where a place is NaN."""
    return _as(v > u, u) + 0.0 * (u + v)


def _as(truth: Any, like: Any) -> Any:
    """Numbers, or 0 and 1 for false and true, of the type of other values."""
    return truth.to(like.dtype) if hasattr(truth, "to") else truth.astype(like.dtype)
