"""Where a world lies: the Site, resolved once from the recipe, and windows of its lattice."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import DataError, NotNegative, Record, checked, portable, shaped
from terrain_forge.model.body import Body
from terrain_forge.model.heightfield import Heightfield
from terrain_forge.model.inputs import (
    CustomMesh,
    DtmPatch,
    FarHeights,
    Image,
    Orthoimage,
    Table,
)
from terrain_forge.model.plot import html, plot_site
from terrain_forge.model.route import Route
from terrain_forge.model.rover import Rover

if TYPE_CHECKING:
    from terrain_forge.recipe import Recipe


@dataclass(frozen=True, kw_only=True, eq=False)
class Window(Record):
    """A rectangle of lattice cells of one Site; its nodes are one more each way."""

    column: int
    """First cell, counted east from the site's western edge."""
    row: int
    """First cell, counted north from the site's southern edge."""
    columns: int
    """Cells from west to east."""
    rows: int
    """Cells from south to north."""

    def __post_init__(self) -> None:
        if min(self.columns, self.rows) < 1:
            raise ValueError(f"Window of {self.columns} × {self.rows} cells: at least 1 × 1")

    @checked
    def strips(self, most: int) -> Iterator[Window]:
        """The window in strips of at most so many rows of cells, which share border nodes."""
        for row in range(0, self.rows, most):
            yield self.replace(row=self.row + row, rows=min(most, self.rows - row))

    @checked
    def nodes_in(self, around: Window) -> tuple[slice, slice]:
        """Rows and columns of its nodes among those of a window that holds it."""
        row, column = self.row - around.row, self.column - around.column
        return slice(row, row + self.rows + 1), slice(column, column + self.columns + 1)


F = TypeVar("F", Image, Table)
HIGHEST_EXPONENT = 0.95
"""Hurst exponent up to which ground's may rise below its DTM."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Roughness(Record):
    """Self-affine roughness of the ground: RMS deviation ν(L) = deviation · (L / 1 m)^hurst.

    Shepard et al. 2001, doi:10.1029/2000JE001429. Below a joint the exponent may rise.
    """

    hurst: float
    """Hurst exponent, 0 to 1; at the joint and above where it rises."""
    deviation: float
    """RMS deviation at a baseline of 1 m [m]."""
    source: str
    """Where the figures come from, for the report."""
    exponent: tuple[float, float] | None = None
    """Exponent as it was fitted to the DTM, before it was weighed and limited, and its standard
    error."""
    rise: float = 0.0
    """Rise of the exponent in each octave below the joint."""
    joint: float = 0.0
    """Baseline below which the exponent rises [m]."""
    resolved: int = 1
    """Shortest baseline that the DTM resolves [posts]."""
    local: NDArray[np.float32] | None = field(
        default=None, metadata=shaped("rows", "columns", dtype=np.float32)
    )
    """RMS deviation at 1 m around each post of the DTM [m], shape [rows, columns] of the patch;
    None where nothing local is known."""
    grain: NDArray[np.float32] | None = field(
        default=None, metadata=shaped(2, "rows", "columns", dtype=np.float32)
    )
    """Cosine and sine of twice the angle, from the DTM's columns towards its rows, of the direction
    in which the ground around each post is roughest, times how much rougher than across it: the
    difference of the mean square increments over their sum. Shape [2, rows, columns]; None where
    the ground has no direction."""

    def exponent_over(self, baseline: float) -> float:
        """Exponent of the law at a baseline [m]."""
        return self.hurst + self.rise * min(self._octaves_below(baseline), self._rising)

    def deviation_over(self, baseline: float) -> float:
        """RMS deviation of the law over a baseline [m]."""
        lost = self._lost(baseline) - self._lost(1.0)
        return self.deviation * float(
            portable.power(baseline, self.hurst) * portable.power(0.5, lost)
        )

    @property
    def _rising(self) -> float:
        """Octaves for which the exponent rises."""
        return max(HIGHEST_EXPONENT - self.hurst, 0.0) / self.rise if self.rise else 0.0

    def _octaves_below(self, baseline: float) -> float:
        return max(float(portable.log2(self.joint / baseline)), 0.0) if self.rise else 0.0

    def _lost(self, baseline: float) -> float:
        """Octaves by which the rise makes the deviation less over a baseline."""
        below, rising = self._octaves_below(baseline), self._rising
        bent = min(below, rising)
        return self.rise * bent * (below - 0.5 * bent)


@dataclass(frozen=True, kw_only=True, eq=False)
class ExclusionZone(Record):
    """A circle that no rock above a clearance reaches into, such as a landing pad."""

    centre: tuple[float, float]
    """East and north [m]."""
    radius: float
    """Radius [m]."""
    clearance: float
    """Height above the ground that rocks within may have [m]; 0 for no rock at all."""


USUAL_CELLS = 1024
"""Cells of a tile each way where the recipe does not say."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Site(Record):
    """A place on a body with everything that must not depend on the window that is made of it.

    Its frame is ENU in true metres; the origin is the centre of the area at the datum height.
    """

    name: str
    """Name of the world."""
    seed: int
    """Root of all randomness."""
    body: Body
    """The planet or moon."""
    size: tuple[float, float]
    """Area, node to node, east and north [m]."""
    spacing: float
    """Distance of the ground's nodes [m]."""
    crs: str
    """WKT of the local CRS (transverse Mercator at the centre); empty where nothing is
    georeferenced."""
    lonlat: tuple[float, float] | None
    """Longitude and latitude of the origin [rad], where known."""
    datum_height: float
    """Height of world z = 0 above the body's datum [m]."""
    slope: tuple[float, float]
    """Rise per metre east and north of the plane that levelling takes away; (0, 0) if not
    levelled."""
    dtm: DtmPatch | None
    """The source heights with context around the area; None for a flat site."""
    roughness: Roughness
    """What the fractal layer continues."""
    largest_rock: float
    """Exposed diameter that no rock of the site exceeds [m]."""
    images: tuple[Image, ...]
    """Images that layers, the ground's colour and rocks use."""
    tables: tuple[Table, ...]
    """Tables that layers and rocks use."""
    meshes: tuple[CustomMesh, ...]
    """Rock shapes that the user brings."""
    surroundings: tuple[FarHeights, ...] = ()
    """Heights beyond the DTM's patch, out to the horizon, the finest first."""
    orthoimage: Orthoimage | None = None
    """What the ground's colour is taken from, where the user has a picture of it."""
    inputs: tuple[tuple[str, str], ...]
    """Input files: path as the recipe writes it (absolute ones: the name only), and
    `inputs.fingerprint`, the SHA-256 of all but the largest."""
    routes: tuple[Route, ...]
    """The recipe's routes, known before terrain and rocks."""
    custom_rover: Rover | None = None
    """The rover of the user's own file, read when the site was planned; None for one of ours."""
    exclusion_zones: tuple[ExclusionZone, ...] = ()
    """Circles free of rocks: those of the recipe, and the starts of routes without corridor."""
    recipe_json: str
    """The resolved recipe as canonical JSON, without absolute paths."""

    def __repr__(self) -> str:
        routes = ", ".join(route.name for route in self.routes) or "none"
        return (
            f"<Site {self.name!r}: {self.body.name}, {self.size[0]:g} × {self.size[1]:g} m at "
            f"{self.spacing:g} m, routes: {routes}, seed {self.seed}>"
        )

    def _repr_html_(self) -> str:
        return html(repr(self), self.size, lambda axes: plot_site(self, axes))

    @cached_property
    def recipe(self) -> Recipe:
        """The resolved recipe."""
        # A site reads its own recipe, here and below: the one import that goes up in the house.
        from terrain_forge.recipe import recipe_from_json

        return recipe_from_json(self.recipe_json)

    @checked
    def with_current_keys(self, file: Path) -> Site:
        """The site with keys of its recipe that were renamed since; warns, naming the file."""
        from terrain_forge.recipe import current_json

        current = current_json(self.recipe_json, file)
        return self if current == self.recipe_json else self.replace(recipe_json=current)

    @property
    def stated(self) -> dict[str, Any]:
        """What a manifest states of it."""
        return {
            "name": self.name,
            "seed": self.seed,
            "recipe": json.loads(self.recipe_json),
            "inputs": dict(self.inputs),
        }

    @checked
    def misstated(self, manifest: dict[str, Any]) -> list[str]:
        """Keys under which a manifest states something else than is true of it."""
        from terrain_forge.recipe import with_current_names

        told, true = with_current_names(manifest), with_current_names(self.stated)
        return [key for key in true if told.get(key) != true[key]]

    @property
    def west(self) -> float:
        """East coordinate of the western edge [m]."""
        return -0.5 * self.size[0]

    @property
    def south(self) -> float:
        """North coordinate of the southern edge [m]."""
        return -0.5 * self.size[1]

    @property
    def window(self) -> Window:
        """The whole site."""
        columns, rows = (round(length / self.spacing) for length in self.size)
        return Window(column=0, row=0, columns=columns, rows=rows)

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """West, south, east, north edge [m]."""
        return self.west, self.south, -self.west, -self.south

    @property
    def tile_side(self) -> float:
        """Side of its tiles, if it is made in tiles [m]."""
        tiles = self.recipe.tiles
        return tiles.size_m if tiles and tiles.size_m else USUAL_CELLS * self.spacing

    @property
    def georeferenced(self) -> bool:
        """Whether the site knows where on its body it lies."""
        return bool(self.crs)

    @checked
    def axes(self, window: Window) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """East coordinates of the window's node columns and north ones of its rows [m].

        Computed from the site's own lattice, so that every window has the same bits.
        """
        columns = window.column + np.arange(window.columns + 1, dtype=np.float64)
        rows = window.row + np.arange(window.rows + 1, dtype=np.float64)
        return self.west + columns * self.spacing, self.south + rows * self.spacing

    @checked
    def first_node(self, ground: Heightfield) -> tuple[int, int]:
        """Column and row of the site's nodes at which a part of its ground begins."""
        east, north = ground.origin
        return round((east - self.west) / self.spacing), round((north - self.south) / self.spacing)

    @checked
    def require_window(self, window: Window) -> None:
        """Refuse a window that does not lie in the site.

        Raises:
            DataError: tells its cells and the site's.
        """
        whole = self.window
        west, east = window.column, window.column + window.columns
        south, north = window.row, window.row + window.rows
        if min(west, south) < 0 or east > whole.columns or north > whole.rows:
            raise DataError(
                f"window of columns {west} to {east} and rows {south} to {north}: the site "
                f"{self.name!r} has columns 0 to {whole.columns} and rows 0 to {whole.rows}"
            )

    @checked
    def padded(self, window: Window, margin: NotNegative) -> Window:
        """The window grown by at least `margin` [m] on each side, as far as the site goes."""
        cells = int(np.ceil(margin / self.spacing))
        whole = self.window
        column, row = max(window.column - cells, 0), max(window.row - cells, 0)
        east = min(window.column + window.columns + cells, whole.columns)
        north = min(window.row + window.rows + cells, whole.rows)
        return Window(column=column, row=row, columns=east - column, rows=north - row)

    @checked
    def image(self, path: str) -> NDArray[np.float64]:
        """Values of the image that the recipe calls `path`.

        Raises:
            DataError: if it names none so.
        """
        return _named(self.images, path, "image").values

    @checked
    def table(self, path: str) -> Table:
        """The table that the recipe calls `path`.

        Raises:
            DataError: if it names none so.
        """
        return _named(self.tables, path, "table")


def _named(files: tuple[F, ...], path: str, what: str) -> F:
    for one in files:
        if one.path == path:
            return one
    named = ", ".join(one.path for one in files) or "none"
    raise DataError(f"the recipe names no {what} {path!r}, it has {named}")
