"""Reading rasters: what they are, and their heights in metres above the body's datum."""

from __future__ import annotations

import operator
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, DataError, portable, reading, require_file
from terrain_forge.dtm.cut_off import is_cut_off
from terrain_forge.dtm.lattice import anchors, bilinear
from terrain_forge.dtm.misnamed import remedy
from terrain_forge.dtm.projection import (
    crs_of,
    datum_radii,
    datum_radius,
    ellipsoid,
    geographic_crs,
    local_crs,
    meridian_period,
    put_units_at_hand,
    transform,
)
from terrain_forge.dtm.spec import RasterDtm
from terrain_forge.dtm.vertical import Vertical, read_vertical, require_heights, require_no_sentinel
from terrain_forge.model import Body

DRIVERS = (
    *("GTiff", "ENVI", "ISIS3", "ISIS2", "PDS4", "PDS", "VICAR", "JP2OpenJPEG", "PNG", "JPEG"),
    *("AAIGrid", "GRASSASCIIGrid", "EHdr", "HFA", "netCDF", "GSBG", "GSAG", "GS7BG"),
    *("USGSDEM", "SRTMHGT", "DTED", "BT", "RRASTER", "SAGA", "XYZ", "BMP", "GIF", "WEBP", "TGA"),
)
"""GDAL's drivers that are used: those of formats whose data lie in the file or beside it.

Others, such as VRT, WMS and WCS, name files elsewhere or addresses in the network; so can HDF5, and
netCDF of version 4, which is HDF5 too."""
_HDF5 = b"\x89HDF\r\n\x1a\n"
_CLASSIC = b"CDF"
"""What netCDF begins with that is not HDF5."""
_NUMPY = b"\x93NUMPY", b"PK\x03\x04"
"""What NumPy's files begin with: arrays, and archives of them."""
MOST_SIDE, MOST_BLOCK = 2_000_000, 2**28
"""Samples a side of a raster, and bytes of a block, which is read whole for any sample of it."""
_BESIDE = ".ovr", ".msk"
"""Endings of files beside a raster that GDAL opens with whatever driver takes them."""
_TIFF = b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"
_OFFLINE = {"CPL_VSIL_CURL_ALLOWED_EXTENSIONS": "{none}", "GDAL_HTTP_PROXY": "127.0.0.1:1"}
"""Settings under which GDAL reaches no network."""
_EVERY = 8  # samples
_CLIFF = 5.0  # times the posting, 79°, between neighbours
_ISIS_SPECIAL = 1e30  # ISIS marks null and saturated pixels by values near -3.4e38


@dataclass(frozen=True, kw_only=True)
class Raster:
    """An open raster band with everything that turns its numbers into heights."""

    dataset: Any
    """The rasterio dataset."""
    body: Body
    """What it is a part of."""
    path: Path
    """The file."""
    band: int
    """Band that holds the heights, from 1."""
    vertical: Vertical
    """How its numbers become heights."""
    crs: str
    """WKT; empty if the raster is not georeferenced."""
    to_pixel: tuple[float, ...]
    """Affine from x, y (CRS, or metres from the raster's centre) to fractional sample indices;
    empty where neither the file nor the recipe tells."""
    nodata: float | None
    """The recipe's own nodata value."""
    nodata_range: tuple[float, float] | None
    """The recipe's own range of nodata values."""

    @property
    def quantum(self) -> float | None:
        """Step of which the heights are multiples [m]: of integers, and of rounded floats."""
        return self.vertical.quantum

    @property
    def source(self) -> str:
        """The file's name."""
        return self.path.name

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of samples."""
        return self.dataset.height, self.dataset.width

    @property
    def goes_round(self) -> bool:
        """Whether its columns go all around the body, so that the first follows the last."""
        period = meridian_period(self.crs) if self.crs else 0.0
        if not period:
            return False
        across, down = period * self.to_pixel[0], period * self.to_pixel[3]
        return bool(max(abs(abs(across) - self.shape[1]), abs(down)) < 0.01)

    @property
    def middle(self) -> tuple[float, float]:
        """Coordinates x, y of the raster's middle."""
        rows, columns = self.shape
        a, b, c, d, e, f = self.to_pixel
        x, y = portable.solve([[a, b], [d, e]], [(columns - 1) / 2 - c, (rows - 1) / 2 - f])
        return float(x), float(y)

    def read(
        self, rows: slice, columns: slice, *, strict: bool = True
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Heights above the datum [m] of a piece, and which of them are valid.

        Columns of a raster that goes round may lie beyond its edges.

        Raises:
            DataError: if strict, for values that look like an undeclared mark of no data or like no
            heights at all.
        """
        parts = [self._read_values(rows, span) for span in self.pieces(columns)]
        values, valid = (np.concatenate(part, axis=1) for part in zip(*parts, strict=True))
        heights = self.heights(values)
        heights -= self._datum_rise(rows, columns)
        heights[~valid] = 0.0
        if strict:
            known = values if valid.all() else values[valid]
            require_no_sentinel(known, self.source, cliff=self._cliff())
            require_heights(heights, self.source, self.body)
        return heights, valid

    def pieces(self, columns: slice) -> list[slice]:
        """Columns within the file that, side by side, are those that may lie beyond its edges."""
        width = self.shape[1]
        turns = range(columns.start // width, (columns.stop - 1) // width + 1)
        return [
            slice(max(columns.start - n * width, 0), min(columns.stop - n * width, width))
            for n in turns
        ]

    def _read_values(self, rows: slice, columns: slice) -> tuple[Array, NDArray[np.bool_]]:
        """The file's own numbers, and which of them are data."""
        from rasterio.windows import Window as RasterWindow

        window = RasterWindow.from_slices(rows, columns)
        values = self.dataset.read(self.band, window=window).astype(np.float64)
        return values, self.valid(values, self.dataset.read_masks(self.band, window=window))

    def _datum_rise(self, rows: slice, columns: slice) -> Array | float:
        """Radius of the ellipsoid at each sample above that at the raster's middle [m].

        0 unless the numbers are radii on a body that is no sphere. Exact at every eighth sample.
        """
        if self.is_round:
            return 0.0
        across, x_steps = anchors(columns.start, columns.stop - columns.start, _EVERY)
        down, y_steps = anchors(rows.start, rows.stop - rows.start, _EVERY)
        return bilinear(self.datum_rise_at(across, down), x_steps, y_steps)

    @property
    def is_round(self) -> bool:
        """Whether its numbers are heights, or radii on a body that is a sphere."""
        radii = self.vertical.reference_radius and self.crs
        return not radii or len(set(ellipsoid(self.crs))) == 1

    def datum_rise_at(
        self, across: NDArray[np.floating[Any]], down: NDArray[np.floating[Any]]
    ) -> Array:
        """Radius of the ellipsoid at columns and rows above that at the raster's middle [m]."""
        a, b, c, d, e, f = self.to_pixel
        column, row = np.meshgrid(across - c, down - f)
        (p, q), (r, s) = portable.inverse([[a, b], [d, e]])
        place = transform(
            self.crs, geographic_crs(self.crs), p * column + q * row, r * column + s * row
        )
        return datum_radii(self.crs, place[1]) - self.vertical.reference_radius

    def _cliff(self) -> float:
        """Difference of neighbours that no ground has [units of the file]."""
        steps = ground_steps(self)
        return _CLIFF * max(steps) / abs(self.vertical.scale) if steps else np.inf

    def valid(self, values: Array, mask: NDArray[np.uint8]) -> NDArray[np.bool_]:
        """Which values are data, by the file's mask, the recipe, and being finite."""
        valid = (mask > 0) & np.isfinite(values) & (np.abs(values) < _ISIS_SPECIAL)
        if self.nodata is not None:
            # A float32 file holds the nearest float32 to what the recipe writes.
            valid &= (values != self.nodata) & (values != float(np.float32(self.nodata)))
        if self.nodata_range is not None:
            low, high = self.nodata_range
            valid &= (values < low) | (values > high)
        return valid

    def heights(self, values: Array) -> Array:
        """Heights above the datum [m] of values of the file."""
        v = self.vertical
        return values * v.scale + (v.offset - v.reference_radius)


def open_raster(spec: RasterDtm, *, body: Body, folder: Path) -> Raster:
    """Open the recipe's DTM.

    Raises:
        DataError: if the file is missing or no raster, has no such band, lies on another body, or
            if the recipe says what cannot be of it.
    """
    import rasterio

    path = folder / spec.name
    require_file(path, spec.name, ("dtm", "source"))
    try:
        dataset = open_dataset(path)
    except rasterio.errors.RasterioError:
        raise DataError(
            f"not a raster that GDAL opens: {spec.name}{remedy(path)}; of its formats are read "
            f"{', '.join(DRIVERS)}",
            key=("dtm", "source"),
        ) from None
    return raster_of(dataset, spec, body=body, path=path)


def raster_of(
    dataset: Any, spec: RasterDtm, *, body: Body, path: Path, vertical: Vertical | None = None
) -> Raster:
    """The raster of an open dataset; where its numbers' meaning is not given, it is read.

    Raises:
        DataError: if it has no such band, is a single line, lies on another body, or if the recipe
            says what cannot be of it.
    """
    if spec.band > dataset.count:
        raise DataError(f"band {spec.band} of {dataset.count} in {spec.name}", key=("dtm", "band"))
    if spec.nodata_range is not None and spec.nodata_range[0] > spec.nodata_range[1]:
        low, high = spec.nodata_range
        raise DataError(f"{low:g} to {high:g}: the lower value first", key=("dtm", "nodata_range"))
    if min(dataset.shape) < 2:
        raise DataError(
            f"{spec.name} has {dataset.width} × {dataset.height} pixels, a terrain model needs at "
            "least 2 × 2",
            key=("dtm", "source"),
        )
    crs, to_pixel = _georeference(dataset, spec)
    _require_body(crs, body, spec)
    return Raster(
        dataset=dataset,
        body=body,
        path=path,
        band=spec.band,
        vertical=vertical or read_vertical(dataset, spec, _datum(dataset, crs, body), body),
        crs=crs,
        to_pixel=to_pixel,
        nodata=spec.nodata,
        nodata_range=spec.nodata_range,
    )


def ground_steps(raster: Raster) -> tuple[float, float] | None:
    """Distance of samples along columns and rows on the ground at the raster's middle [m]."""
    if not raster.to_pixel:
        return None
    a, b, _, d, e, _ = raster.to_pixel
    inverse = portable.inverse([[a, b], [d, e]])
    if not raster.crs:
        across, down = np.linalg.norm(inverse, axis=0)
        return float(across), float(down)
    x, y = raster.middle
    steps = np.array([x, y]) + np.stack([np.zeros(2), inverse[:, 0], inverse[:, 1]])
    geographic = geographic_crs(raster.crs)
    lon, lat = transform(raster.crs, geographic, steps[:, 0], steps[:, 1])
    local = local_crs(raster.crs, float(lon[0]), float(lat[0]))
    east, north = transform(geographic, local, lon, lat)
    across, down = np.hypot(east[1:] - east[0], north[1:] - north[0])
    return float(across), float(down)


def _datum(dataset: Any, crs: str, body: Body) -> float:
    """Radius of the datum at the raster's middle [m]."""
    if not crs:
        return body.mean_radius
    x, y = dataset.transform @ (0.5 * dataset.width, 0.5 * dataset.height)
    _, lat = transform(crs, geographic_crs(crs), np.array([x]), np.array([y]))
    return datum_radius(crs, float(lat[0]))


def _require_body(crs: str, body: Body, spec: RasterDtm) -> None:
    if crs and abs(ellipsoid(crs)[0] / body.mean_radius - 1.0) > 0.05:
        found = ellipsoid(crs)[0] / 1e3
        raise DataError(
            f"{spec.name} lies on a body of {found:.0f} km radius, {body.name} has "
            f"{body.mean_radius / 1e3:.0f} km",
            key=("body",),
        )


def open_dataset(path: Path) -> Any:
    """The rasterio dataset; a missing georeference is no cause for a warning here.

    Raises:
        RasterioError: if it is no raster of `DRIVERS`.
        DataError: if it names a file elsewhere, or is HDF5, which may, or cannot be read.
    """
    import rasterio

    _require_plain_company(path.absolute())
    put_units_at_hand()
    with warnings.catch_warnings(), rasterio.Env(**_OFFLINE):
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        # rasterio.open() takes one driver; the class that it opens takes several.
        dataset = rasterio.io.DatasetReader(str(path.absolute()), driver=_drivers_of(path))
        if complaint := _complaint(dataset, path):
            dataset.close()
            raise DataError(complaint)
    return dataset


def _drivers_of(path: Path) -> list[str]:
    """The drivers that may open a file.

    Raises:
        DataError: if it is HDF5, or cannot be read.
    """
    with path.open("rb") as file, reading(path.name):
        begin = file.read(len(_HDF5))
    if begin == _HDF5:
        raise DataError(
            f"{path.name} is HDF5 (or netCDF-4), which can name any other file as its data: make a "
            "GeoTIFF or classic netCDF of it, as by gdal_translate"
        )
    if begin.startswith(_NUMPY):  # beside a header it would be read as ENVI's data, its own too
        return ["GTiff"]
    classic = begin.startswith(_CLASSIC)
    return [name for name in DRIVERS if classic or name != "netCDF"]


def _complaint(dataset: Any, path: Path) -> str:
    """Why an open dataset is not read; nothing of another file has been asked for yet."""
    if overviews := dataset.tags(ns="OVERVIEWS").get("OVERVIEW_FILE"):
        return f"{path.name} names the file {overviews!r} as its overviews: remove OVERVIEW_FILE"
    if any("complex" in kind for kind in dataset.dtypes):
        return f"{path.name} holds complex numbers, which are no heights or pixels"
    if max(dataset.shape) > MOST_SIDE:
        size = f"{dataset.width:,} × {dataset.height:,}"
        return f"{path.name} has {size} samples, at most {MOST_SIDE:,} a side"
    sizes = [np.dtype(kind).itemsize for kind in dataset.dtypes]
    blocks = [rows * columns for rows, columns in dataset.block_shapes]
    if (most := max(map(operator.mul, blocks, sizes), default=0)) > MOST_BLOCK:
        return (
            f"{path.name} has blocks of {most / 2**20:,.0f} MiB, at most {MOST_BLOCK >> 20} MiB: "
            "cut it into smaller ones, as by gdal_translate -co TILED=YES"
        )
    if is_cut_off(dataset, path):
        return f"{path.name} is cut off: it ends before its last sample"
    folders = {path.absolute().parent.resolve(), path.resolve().parent}
    for name in dataset.files:
        if not any(Path(name).resolve().is_relative_to(folder) for folder in folders):
            return f"{path.name} names the file {name!r}, which must lie beside it"
    return ""


def _require_plain_company(path: Path) -> None:
    """Refuse files beside a raster, into which GDAL looks, that may lead it elsewhere or hang it.

    It looks for some of any raster's: a pipe of whatever name is refused.
    """
    stem = f"{path.stem}.".casefold()
    for beside in path.parent.glob("*"):
        if beside.is_fifo() or beside.is_char_device():
            raise DataError(f"{beside.name} beside {path.name} is no regular file")
        if not beside.name.casefold().startswith(stem) or not beside.exists() or beside.is_dir():
            continue
        if not beside.is_file():
            raise DataError(f"{beside.name} beside {path.name} is no regular file")
        if beside != path and beside.suffix.casefold() in _BESIDE:
            with beside.open("rb") as file:
                if file.read(4) not in _TIFF:
                    raise DataError(f"{beside.name} beside {path.name} is no TIFF: move it away")


def _georeference(dataset: Any, spec: RasterDtm) -> tuple[str, tuple[float, ...]]:
    """CRS and the affine from coordinates to sample indices, whose whole numbers are centres."""
    if dataset.crs is not None and not dataset.transform.is_identity:
        inverse = ~dataset.transform
        a, b, c, d, e, f = inverse[:6]
        return crs_of(dataset), (a, b, c - 0.5, d, e, f - 0.5)
    if spec.extent_m is None:
        return "", ()
    width, height = spec.extent_m
    across, down = dataset.width, dataset.height
    if spec.pixel_is == "point":
        across, down = across - 1, down - 1
    middle_column, middle_row = (dataset.width - 1) / 2, (dataset.height - 1) / 2
    return "", (across / width, 0.0, middle_column, 0.0, -down / height, middle_row)


def files_of_raster(path: Path) -> list[Path]:
    """Files that belong to a raster besides the one that is opened, such as a label's image."""
    with open_dataset(path) as dataset:
        return sorted(Path(name) for name in dataset.files if Path(name) != path)
