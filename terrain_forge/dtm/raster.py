"""Reading rasters: what they are, and their heights in metres above the body's datum."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.bodies import Body
from terrain_forge.dtm.projection import ellipsoid
from terrain_forge.dtm.spec import RasterDtm
from terrain_forge.errors import DataError

Array = NDArray[np.float64]

_ISIS_SPECIAL = 1e30  # ISIS marks null and saturated pixels by values near -3.4e38


@dataclass(frozen=True, kw_only=True)
class Raster:
    """An open raster band with everything that turns its numbers into heights."""

    dataset: Any
    """The rasterio dataset."""
    path: Path
    """The file."""
    band: int
    """Band that holds the heights, from 1."""
    scale: float
    """Metres per unit."""
    offset: float
    """Height of the value 0 above the datum, or the distance from the centre of a radius product
    [m]."""
    reference_radius: float
    """What is taken off a radius product to make heights of it [m]; 0 for heights."""
    vertical_known: bool
    """Whether the file or the recipe says how its numbers become metres."""
    crs: str
    """WKT; empty if the raster is not georeferenced."""
    to_pixel: tuple[float, ...]
    """Affine from x, y (CRS, or metres from the raster's centre) to fractional sample indices;
    empty where neither the file nor the recipe tells."""
    nodata: float | None
    """The recipe's own nodata value."""

    @property
    def quantum(self) -> float | None:
        """Height step of one unit of an integer raster [m]."""
        return self.scale if np.dtype(self.dataset.dtypes[self.band - 1]).kind in "iu" else None

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of samples."""
        return self.dataset.height, self.dataset.width

    @property
    def middle(self) -> tuple[float, float]:
        """Coordinates x, y of the raster's middle."""
        rows, columns = self.shape
        a, b, c, d, e, f = self.to_pixel
        x, y = np.linalg.solve([[a, b], [d, e]], [(columns - 1) / 2 - c, (rows - 1) / 2 - f])
        return float(x), float(y)

    def read(self, rows: slice, columns: slice) -> tuple[Array, NDArray[np.bool_]]:
        """Heights above the datum [m] of a piece, and which of them are valid."""
        from rasterio.windows import Window as RasterWindow

        window = RasterWindow.from_slices(rows, columns)
        raw = self.dataset.read(self.band, window=window)
        valid = self.dataset.read_masks(self.band, window=window) > 0
        values = raw.astype(np.float64)
        valid &= np.isfinite(values) & (np.abs(values) < _ISIS_SPECIAL)
        if self.nodata is not None:
            valid &= values != self.nodata
        heights = values * self.scale + self.offset - self.reference_radius
        return np.where(valid, heights, 0.0), valid


def open_raster(spec: RasterDtm, *, body: Body, folder: Path) -> Raster:
    """Open the recipe's DTM.

    Raises:
        DataError: if the file is missing or no raster, or has no such band, or if the recipe must
        say
            where it lies or how high it is.
    """
    import rasterio

    path = folder / spec.source
    require_file(path, spec.source, ("dtm", "source"))
    try:
        dataset = _open(path)
    except rasterio.errors.RasterioError:
        hint = _label_hint(path)
        raise DataError(
            f"not a raster that GDAL opens: {spec.source}{hint}", key=("dtm", "source")
        ) from None
    if spec.band > dataset.count:
        raise DataError(
            f"band {spec.band} of {dataset.count} in {spec.source}", key=("dtm", "band")
        )
    crs, to_pixel = _georeference(dataset, spec)
    _require_body(crs, body, spec)
    scale, offset, known = _vertical(dataset, spec)
    return Raster(
        dataset=dataset,
        path=path,
        band=spec.band,
        scale=scale,
        offset=offset,
        reference_radius=_reference_radius(offset, crs, body),
        vertical_known=known,
        crs=crs,
        to_pixel=to_pixel,
        nodata=spec.nodata,
    )


def _require_body(crs: str, body: Body, spec: RasterDtm) -> None:
    if crs and abs(ellipsoid(crs)[0] / body.mean_radius - 1.0) > 0.05:
        found = ellipsoid(crs)[0] / 1e3
        raise DataError(
            f"{spec.source} lies on a body of {found:.0f} km radius, {body.name} has "
            f"{body.mean_radius / 1e3:.0f} km",
            key=("body",),
        )


def _open(path: Path) -> Any:
    """The rasterio dataset; a missing georeference is no cause for a warning here."""
    import rasterio

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        return rasterio.open(path)


def _label_hint(path: Path) -> str:
    label = next(
        (p for p in path.parent.glob(f"{path.stem}.*") if p.suffix.lower() == ".lbl"), None
    )
    return f" (it has a label: name {label.name})" if label and label != path else ""


def _georeference(dataset: Any, spec: RasterDtm) -> tuple[str, tuple[float, ...]]:
    """CRS and the affine from coordinates to sample indices, whose whole numbers are centres."""
    if dataset.crs is not None and not dataset.transform.is_identity:
        inverse = ~dataset.transform
        a, b, c, d, e, f = inverse[:6]
        return dataset.crs.to_wkt(), (a, b, c - 0.5, d, e, f - 0.5)
    if spec.extent_m is None:
        return "", ()
    width, height = spec.extent_m
    across, down = dataset.width, dataset.height
    if spec.pixel_is == "point":
        across, down = across - 1, down - 1
    middle_column, middle_row = (dataset.width - 1) / 2, (dataset.height - 1) / 2
    return "", (across / width, 0.0, middle_column, 0.0, -down / height, middle_row)


def _vertical(dataset: Any, spec: RasterDtm) -> tuple[float, float, bool]:
    """Metres per unit, height of the value 0, and whether anybody says so."""
    dtype = np.dtype(dataset.dtypes[spec.band - 1])
    scale = dataset.scales[spec.band - 1] if spec.height_scale is None else spec.height_scale
    offset = (
        dataset.offsets[spec.band - 1] if spec.height_offset_m is None else spec.height_offset_m
    )
    if spec.height_range_m is not None:
        if dtype.kind not in "iu":
            raise DataError(
                f"the heights of {spec.source} are {dtype}; a height range is for integers, "
                "use height_scale and height_offset_m",
                key=("dtm", "height_range_m"),
            )
        low, high = spec.height_range_m
        return (high - low) / float(np.iinfo(dtype).max), low, True
    declared = (scale, offset) != (1.0, 0.0) or spec.height_scale is not None
    return scale, offset, declared or dtype.kind != "u" or bool(dataset.units[spec.band - 1])


def _reference_radius(offset: float, crs: str, body: Body) -> float:
    """The datum's radius if the offset makes the values distances from the body's centre."""
    if abs(offset / body.mean_radius - 1.0) > 0.05:
        return 0.0
    return ellipsoid(crs)[0] if crs else body.mean_radius


def require_file(path: Path, name: str, key: tuple[str | int, ...]) -> None:
    """Refuse a path that leads to no file.

    Raises:
        DataError: says by `name` what is there instead.
    """
    if not path.is_file():
        problem = "is a folder, not a file" if path.is_dir() else "no such file"
        raise DataError(f"{problem}: {name}", key=key)


def files_of_raster(path: Path) -> list[Path]:
    """Files that belong to a raster besides the one that is opened, such as a label's image."""
    with _open(path) as dataset:
        return sorted(Path(name) for name in dataset.files if Path(name) != path)


def read_image(path: str, folder: Path, key: tuple[str | int, ...]) -> Array:
    """An image's first band as 0 to 1 (integers by their type's range), rows running north.

    Raises:
        DataError: if the file is missing, no image, or holds values that are not finite.
    """
    import rasterio

    from terrain_forge.frames import image_rows

    require_file(folder / path, path, key)
    try:
        with _open(folder / path) as dataset:
            values = dataset.read(1)
    except rasterio.errors.RasterioError:
        raise DataError(f"not an image: {path}", key=key) from None
    if values.dtype.kind in "iu":
        return np.asarray(image_rows(values / float(np.iinfo(values.dtype).max)))
    if not np.isfinite(values).all():
        raise DataError(f"{path} holds values that are not finite", key=key)
    return np.asarray(image_rows(values.astype(np.float64)))
