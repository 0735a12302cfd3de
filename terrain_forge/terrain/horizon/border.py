"""A ground along its border, which is all that the land beyond goes on from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array
from terrain_forge.model import Appearance, Bounds, Heightfield


@dataclass(frozen=True, kw_only=True, eq=False)
class Border:
    """A whole ground, or strips of one that nobody holds whole: in the south, east, north, west.

    A strip has all nodes of its side, both corners among them, and some cells of depth.
    """

    sides: tuple[Heightfield, Heightfield, Heightfield, Heightfield]
    """The strips; the same ground four times where it is whole."""
    looks: tuple[Appearance, Appearance, Appearance, Appearance]
    """The strips' colours and materials."""
    lowest: float
    """Lowest height of all of the ground [m]."""
    highest: float
    """Highest height of all of the ground [m]."""

    @classmethod
    def of(cls, ground: Heightfield, looks: Appearance) -> Border:
        """That of a ground which is held whole."""
        return cls(
            sides=(ground, ground, ground, ground),
            looks=(looks, looks, looks, looks),
            lowest=float(ground.elevation.min()),
            highest=float(ground.elevation.max()),
        )

    @property
    def spacing(self) -> float:
        """Distance of neighbouring nodes [m]."""
        return self.sides[0].spacing

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the ground's nodes."""
        return self.sides[3].shape[0], self.sides[0].shape[1]

    @property
    def east(self) -> Array:
        """East coordinates of the columns [m]."""
        return self.sides[0].east

    @property
    def north(self) -> Array:
        """North coordinates of the rows [m]."""
        return self.sides[3].north

    @property
    def bounds(self) -> Bounds:
        """West, south, east, north edge [m]."""
        south, east, north, west = (side.bounds for side in self.sides)
        return west[0], south[1], east[2], north[3]

    @property
    def different_looks(self) -> tuple[Appearance, ...]:
        """The strips' colours and materials, each once."""
        return tuple({id(looks): looks for looks in self.looks}.values())

    def heights(self) -> NDArray[np.float32]:
        """Heights of the border's nodes, counter-clockwise from the south-west [m]."""
        return border_values([side.elevation for side in self.sides])

    def colours(self) -> NDArray[np.uint8]:
        """Colours (sRGB) of the border's nodes, in that order, shape [nodes, 3]."""
        return border_values([looks.ground_rgb for looks in self.looks])

    def material(self) -> NDArray[np.uint8] | None:
        """Materials of the border's nodes, in that order; None where all is the first."""
        grids = [looks.material for looks in self.looks]
        known = [grid for grid in grids if grid is not None]
        return border_values(known) if len(known) == len(grids) else None

    def normals(self) -> Array:
        """Unit normals at the border's nodes, as the renderer takes them, shape [nodes, 3]."""
        z = [side.elevation for side in self.sides]
        strips = ((z[0][:2], 0), (z[1][:, -2:].T, 1), (z[2][-2:], 1), (z[3][:, :2].T, 0))
        slopes = []
        for number, (strip, own) in enumerate(strips):
            both = np.gradient(strip.astype(np.float64), self.spacing)
            across, along = (part[own] for part in both)
            east, north = (along, across) if number % 2 == 0 else (across, along)
            side = np.column_stack([-east, -north, np.ones(len(east))])
            slopes.append(side[:-1] if number < 2 else side[:0:-1])
        normals = np.concatenate(slopes)
        return np.asarray(normals / np.sqrt((normals * normals).sum(axis=1, keepdims=True)))

    def covers(self, east: Array, north: Array) -> NDArray[np.bool_]:
        """Which points lie on the ground, edges among it."""
        west, south, far_east, far_north = self.bounds
        return (east >= west) & (east <= far_east) & (north >= south) & (north <= far_north)

    def height_at(self, east: Array, north: Array) -> Array:
        """Heights [m] at points; deeper than a strip goes, those of its inner edge."""
        west, south, far_east, far_north = self.bounds
        near = np.argmin([north - south, far_east - east, far_north - north, east - west], axis=0)
        heights = np.empty(near.shape)
        for number, side in enumerate(self.sides):
            here = near == number
            low_x, low_y, high_x, high_y = side.bounds
            heights[here] = side.height_at(
                np.clip(east[here], low_x, high_x), np.clip(north[here], low_y, high_y)
            )
        return heights


def border_values(grids: list[NDArray[Any]]) -> NDArray[Any]:
    """Values at the border's nodes of four strips, counter-clockwise from the south-west."""
    south, east, north, west = grids
    return np.concatenate([south[0, :-1], east[:-1, -1], north[-1, :0:-1], west[:0:-1, 0]])


def joined_strips(
    parts: list[tuple[Heightfield, Appearance]], *, along: int
) -> tuple[Heightfield, Appearance]:
    """Parts of a strip that share their end nodes as one, along rows (0) or columns (1)."""

    def whole(grid_of: Callable[[tuple[Heightfield, Appearance]], Any]) -> Any:
        grids = [grid_of(part) for part in parts]
        if any(grid is None for grid in grids):
            return None
        keep = [grids[0], *(np.delete(grid, 0, axis=along) for grid in grids[1:])]
        return np.concatenate(keep, axis=along)

    ground, looks = parts[0]
    return ground.replace(elevation=whole(lambda part: part[0].elevation)), looks.replace(
        ground_rgb=whole(lambda part: part[1].ground_rgb),
        material=whole(lambda part: part[1].material),
        drift=None,
    )
