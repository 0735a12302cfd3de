"""What was read of the DTM and the recipe's other input files when the site was planned."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Record, shaped
from terrain_forge.model.mesh import Mesh


@dataclass(frozen=True, kw_only=True, eq=False)
class DtmPatch(Record):
    """Heights of a DTM over a site and its context, holes filled, in the source's grid."""

    heights: NDArray[np.float64] = field(metadata=shaped("rows", "columns"))
    """Heights above the body's datum [m], shape [rows, columns], in the source's row order."""
    to_pixel: tuple[float, ...]
    """Affine (a, b, c, d, e, f): column = a·x + b·y + c, row = d·x + e·y + f, where x, y are source
    coordinates and whole numbers are sample centres."""
    crs: str
    """WKT of the source's CRS; empty where x, y are the site's own metres."""
    wrap: tuple[float, float]
    """Period of x where a meridian has several x (0 where not), and the x around which they are."""
    posting: float
    """Distance of the samples on the ground [m], the coarser of the two directions."""
    filled: int
    """Samples within the site that were holes."""
    repairs: tuple[str, ...] = ()
    """What was repaired and how, for the report."""
    planar_fraction: float = 0.0
    """Part of the samples in and around the site that lie in exact planes, as triangles that fill
    gaps of stereo images do, 0 to 1."""
    noise: float = 0.0
    """RMS noise that was found in the DTM and taken away [m]."""
    hidden: float = 0.0
    """Longest wavelength at which that noise hid the ground [m]; 0 without noise."""
    doubt: float = 0.0
    """RMS of noise that the DTM may have and that was left in it [m]; 0 if it has none."""
    doubtful: float = 1.0
    """Part of the DTM that may have it, 0 to 1."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FarHeights(Record):
    """Heights far around a site, coarse, in the grid of the raster that they were read from."""

    heights: NDArray[np.float32] = field(metadata=shaped("rows", "columns", dtype=np.float32))
    """Heights above the body's datum [m], shape [rows, columns], in the source's row order."""
    weight: NDArray[np.float32] = field(metadata=shaped("rows", "columns", dtype=np.float32))
    """How far they are to be followed, 0 to 1: they fade out where the raster ends, shape [rows,
    columns]."""
    to_pixel: tuple[float, ...]
    """Affine (a, b, c, d, e, f): column = a·x + b·y + c, row = d·x + e·y + f, where x, y are source
    coordinates and whole numbers are sample centres."""
    crs: str
    """WKT of the source's CRS; empty where x, y are the site's own metres."""
    wrap: tuple[float, float]
    """Period of x where a meridian has several x (0 where not), and the x around which they are."""
    reach: float
    """How far from the site's centre they go along the axes [m]."""
    posting: float
    """Distance of the samples on the ground [m]."""
    source: str
    """Name of the raster."""

    @property
    def mean(self) -> float:
        """Their mean, as far as they are to be followed [m]; of all where none is."""
        if not (total := float(self.weight.sum())):
            return float(self.heights.mean(dtype=np.float64))
        return float((self.heights * self.weight).sum(dtype=np.float64) / total)


@dataclass(frozen=True, kw_only=True, eq=False)
class Image(Record):
    """An image that a layer uses, read when the site was planned."""

    path: str
    """As the recipe writes it."""
    values: NDArray[np.float64] = field(metadata=shaped("rows", "columns"))
    """Brightness, 0 to 1 (`dtm.read_image`; floats as they are), rows run north."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Orthoimage(Record):
    """A picture of the ground from above, cut to the site when it was planned."""

    path: str
    """As the recipe writes it."""
    albedo: NDArray[np.float32] = field(
        metadata=shaped("rows", "columns", "bands", dtype=np.float32)
    )
    """Linear, in the source's row order, shape [rows, columns, 1 | 3]: one band tells brightness
    over its mean on the site, three bands tell colour, 0 to 1."""
    to_pixel: tuple[float, ...]
    """Affine (a, b, c, d, e, f): column = a·x + b·y + c, row = d·x + e·y + f, where x, y are source
    coordinates and whole numbers are pixel centres."""
    crs: str
    """WKT of the source's CRS; empty where x, y are the site's own metres."""
    wrap: tuple[float, float]
    """Period of x where a meridian has several x (0 where not), and the x around which they are."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Table(Record):
    """A table of numbers that the recipe names, read when the site was planned."""

    path: str
    """As the recipe writes it."""
    columns: tuple[str, ...]
    """Names of the columns."""
    values: NDArray[np.float64]
    """The numbers, shape [rows, columns]; NaN is refused."""

    def __post_init__(self) -> None:
        self.freeze("values", np.float64, ("rows", len(self.columns)))

    def column(self, name: str) -> NDArray[np.float64]:
        """Numbers of the column of that name, shape [rows]."""
        values: NDArray[np.float64] = self.values[:, self.columns.index(name)]
        return values


@dataclass(frozen=True, kw_only=True, eq=False)
class CustomMesh(Record):
    """A rock shape that the user brings, read and repaired when the site was planned."""

    path: str
    """As the recipe writes it."""
    mesh: Mesh
    """Closed, faces outward, in the file's axes and units."""
    repairs: tuple[str, ...]
    """What was repaired, for the report."""
