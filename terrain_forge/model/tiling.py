"""A site cut into tiles that are made one by one: which windows they are, and what was made."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from terrain_forge.model.site import Site, Window

if TYPE_CHECKING:
    from terrain_forge.model.rocks import RockPrototype
    from terrain_forge.model.world import Tile, World

_FINEST = 2.0**-14
"""What coordinates within tiles are rounded to [m]."""
_DIGITS = 2**23
"""Whole numbers up to this and a half between them are exact in 32 bits."""


@dataclass(frozen=True, kw_only=True)
class TileGrid:
    """How a site is cut: rows of tiles from the south-west, the last ones smaller or not."""

    columns: int
    """Cells of the site from west to east."""
    rows: int
    """Cells of the site from south to north."""
    cells: int
    """Cells of a tile each way."""

    @staticmethod
    def of(site: Site, cells: int) -> TileGrid:
        """The tiles of a site."""
        return TileGrid(columns=site.window.columns, rows=site.window.rows, cells=cells)

    def __len__(self) -> int:
        return self.across * self.up

    @property
    def across(self) -> int:
        """Tiles from west to east."""
        return -(-self.columns // self.cells)

    @property
    def up(self) -> int:
        """Tiles from south to north."""
        return -(-self.rows // self.cells)

    def place(self, number: int) -> tuple[int, int]:
        """Row and column of a tile."""
        return divmod(number, self.across)

    def nodes(self, window: Window) -> tuple[int, int]:
        """Columns and rows of nodes that a tile has for itself: not those of the next ones."""
        return (
            window.columns + (window.column + window.columns == self.columns),
            window.rows + (window.row + window.rows == self.rows),
        )

    def folder(self, number: int) -> str:
        """Where a tile's files lie in the site's folder."""
        row, column = self.place(number)
        return f"tiles/{row:03}/{column:03}"

    def window(self, number: int) -> Window:
        """The cells of a tile."""
        row, column = self.place(number)
        west, south = column * self.cells, row * self.cells
        return Window(
            column=west,
            row=south,
            columns=min(self.cells, self.columns - west),
            rows=min(self.cells, self.rows - south),
        )

    @property
    def usual_nodes(self) -> int:
        """Nodes of most tiles along a side; pictures of all tiles are as fine as theirs."""
        return min(self.cells, max(self.columns, self.rows)) + 1

    def step(self, spacing: float) -> float:
        """What coordinates are rounded to in meshes [m], a power of two.

        So a tile's place and a coordinate within it add up to the same number from either side of a
        border, and 32 bits hold the latter.
        """
        step = _FINEST
        while step * _DIGITS < self.cells * spacing:
            step *= 2.0
        return step


@dataclass(frozen=True, kw_only=True)
class BuiltTile:
    """A tile whose files are there."""

    number: int
    """Its place among the tiles."""
    row: int
    """Counted from the south."""
    column: int
    """Counted from the west."""
    window: Window
    """Its cells."""
    folder: str
    """Its export's folder, relative to that of the whole site's export."""
    height: tuple[float, float]
    """Its ground's lowest and highest node [m]."""
    rocks: int
    """How many rocks it has."""
    figures: dict[str, Any]
    """What its exporter told of it, as JSON."""
    statistics: dict[str, list[dict[str, str]]]
    """GDAL's tags of the statistics of each band of the GeoTIFFs in its folder, by their names."""

    @property
    def place(self) -> str:
        """Row and column, as names of files and parts have them."""
        return f"{self.row:03}_{self.column:03}"


@dataclass(frozen=True, kw_only=True)
class TiledSite:
    """A site whose tiles are all there, for what brings them together."""

    site: Site
    """The place."""
    grid: TileGrid
    """How it is cut."""
    world: World
    """The world of a corner of it, for what all tiles share: shapes, colours, light."""
    tiles: tuple[BuiltTile, ...]
    """Its tiles in their order."""
    near_paths: Callable[[float], Iterator[tuple[BuiltTile, Tile]]]
    """The tiles that lie no farther than so far from a path [m], each made anew, with all paths;
    none for 0."""

    @property
    def shapes(self) -> tuple[RockPrototype, ...]:
        """The shapes of its rocks; none where it has no rocks."""
        return self.world.library.prototypes if any(tile.rocks for tile in self.tiles) else ()
