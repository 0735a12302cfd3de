"""The user's picture of the ground from above: read for a site, and looked up at its nodes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from annotated_types import MinLen
from numpy.typing import NDArray

from terrain_forge.base import (
    Array,
    DataError,
    Fraction,
    InputFile,
    Spec,
    linear_from_srgb,
    reading,
)
from terrain_forge.dtm import (
    Nodes,
    bands_of,
    crs_of,
    cubic,
    ellipsoid,
    node_places,
    open_dataset,
    patch_pixels,
    read_bands,
    turn_of,
    wrap_around,
)
from terrain_forge.model import Orthoimage, Site, Window
from terrain_forge.terrain.masks import require_shape

_STENCIL = 3
_SAMPLES = 257
"""Points each way at which a site is checked to lie within the picture."""
_KEY = ("terrain", "appearance", "orthoimage", "image")


@dataclass(frozen=True, kw_only=True)
class OrthoimageSpec(Spec):
    """A picture of the ground from above.

    Three bands or more are red, green and blue, in this order unless they name their colours, and
    so is a palette: the ground's colour. One band is brightness, over its own mean on the site, of
    the ground's colour. Integers are sRGB of their type's range if there are three bands,
    everything else is linear.
    """

    image: Annotated[str, MinLen(1), InputFile(kind="orthoimage")]
    """The file. If it is georeferenced it is laid where it belongs; otherwise it covers the whole
    site, whose shape it has, north up, its outer edges on the site's."""
    strength: Fraction = 1.0
    """How much of the picture's contrast is taken: 0 for none of it."""


def read_orthoimage(spec: OrthoimageSpec, *, name: str, site: Site, folder: Path) -> Orthoimage:
    """The piece of the picture that a site needs, averaged where it is finer than the grid.

    The world calls the file by `name`; the recipe's paths are relative to `folder`.

    Raises:
        DataError: if the file is no raster, lies on another body, does not show the whole
            site or covers it in another shape, or if the picture alone is georeferenced.
    """
    import rasterio

    with reading(spec.image, key=_KEY):
        try:
            dataset = open_dataset(folder / spec.image)
        except rasterio.errors.RasterioError:
            raise DataError(f"not an image: {spec.image}", key=_KEY) from None
        with dataset:
            whole = _place(dataset, name, site, spec.image)
            values, valid, placed = _read(dataset, whole, site, spec.image)
    column, row = (
        np.clip(np.rint(index), 0, length - 1).astype(np.int64)
        for index, length in zip(_sample(placed, site), valid.shape[::-1], strict=True)
    )
    inside = valid[row, column]
    if not inside.all():
        raise DataError(
            f"{spec.image} has no data on {1.0 - inside.mean():.0%} of the site", key=_KEY
        )
    mean = values[row, column].mean(axis=(0, 1))
    values = np.where(valid[..., None], values, mean)
    if values.shape[2] == 1:
        if not mean[0] > 0.0:
            raise DataError(f"{spec.image} is black all over the site", key=_KEY)
        values, mean = values / mean, np.ones(1)
    return placed.replace(albedo=mean + spec.strength * (values - mean))


def orthoimage_albedo(picture: Orthoimage, *, site: Site, window: Window) -> Array:
    """Linear albedo, or brightness, at the window's nodes, shape [rows, columns, 1 | 3]."""
    column, row = node_places(site, Nodes.of(window), picture).grid()
    bands = [
        cubic(picture.albedo[..., band].astype(np.float64), column=column, row=row)
        for band in range(picture.albedo.shape[2])
    ]
    return np.maximum(np.stack(bands, axis=-1), 0.0)


def _place(dataset: Any, name: str, site: Site, image: str) -> Orthoimage:
    """Where the whole picture lies; nothing of it is read yet."""
    crs, wrap = "", (0.0, 0.0)
    if dataset.crs is None or dataset.transform.is_identity:
        to_pixel = _over_site(dataset, site, image)
    else:
        if not site.georeferenced:
            raise DataError(f"{image} is georeferenced and the site is not", key=_KEY)
        crs, own = crs_of(dataset), site.body.mean_radius
        radius, _ = ellipsoid(crs)
        if abs(radius / own - 1.0) > 0.05:
            raise DataError(
                f"{image} lies on a body of {radius / 1e3:.0f} km radius, {site.body.name} has "
                f"{own / 1e3:.0f} km",
                key=_KEY,
            )
        a, b, c, d, e, f = (~dataset.transform)[:6]
        to_pixel = (a, b, c - 0.5, d, e, f - 0.5)
        middle = dataset.transform * (0.5 * dataset.width, 0.5 * dataset.height)
        wrap = wrap_around(crs, site.crs, middle[0])
    nothing = np.zeros((1, 1, 1), np.float32)
    return Orthoimage(path=name, albedo=nothing, to_pixel=to_pixel, crs=crs, wrap=wrap)


def _over_site(dataset: Any, site: Site, image: str) -> tuple[float, ...]:
    """Affine from a site's east and north [m] to pixels of a picture that covers it."""
    shape, turn = (dataset.height, dataset.width), turn_of(dataset, image, _KEY)
    high, wide = shape[::-1] if turn.transposed else shape
    require_shape(high, wide, image, site, _KEY)
    across = (-wide if turn.mirrored else wide) / site.size[0]
    down = (high if turn.upturned else -high) / site.size[1]
    column, row = (across, 0.0), (0.0, down)
    if turn.transposed:
        column, row = row, column
    return (*column, 0.5 * dataset.width - 0.5, *row, 0.5 * dataset.height - 0.5)


def _sample(picture: Orthoimage, site: Site) -> tuple[Array, Array]:
    """Pixel columns and rows of a grid of points over the site."""
    steps = np.linspace(-0.5, 0.5, _SAMPLES)
    east, north = np.meshgrid(steps * site.size[0], steps * site.size[1])
    return patch_pixels(picture, site.crs, east, north)


def _read(
    dataset: Any, whole: Orthoimage, site: Site, image: str
) -> tuple[Array, NDArray[np.bool_], Orthoimage]:
    """Linear values, which of them are data, and where they lie."""
    from rasterio.windows import Window as RasterWindow

    column, row = _sample(whole, site)
    ends, slack = (dataset.width, dataset.height), 0.5 + 1e-6
    low, high = np.array([[index.min(), index.max()] for index in (column, row)]).T
    if np.any(low < -slack) or np.any(high > np.array(ends) - 1 + slack):
        raise DataError(
            f"the site needs columns {column.min():.0f} to {column.max():.0f} and rows "
            f"{row.min():.0f} to {row.max():.0f} of {image}, which has {dataset.width} × "
            f"{dataset.height}",
            key=_KEY,
        )
    columns, rows = (
        slice(max(int(first) - _STENCIL, 0), min(int(last) + _STENCIL + 1, end))
        for first, last, end in zip(np.floor(low), np.ceil(high), ends, strict=True)
    )
    window = RasterWindow.from_slices(rows, columns)
    bands = bands_of(dataset, [1, 2, 3] if dataset.count >= 3 else [1])
    values = np.moveaxis(read_bands(dataset, bands, window), 0, -1)
    if values.shape[2] == 3 and np.dtype(dataset.dtypes[bands[0] - 1]).kind in "iu":
        values = linear_from_srgb(values)
    valid = (dataset.read_masks(bands, window=window) > 0).all(axis=0)
    valid &= np.isfinite(values).all(axis=2)
    # Whole pixels are averaged, so that detail finer than the grid does not turn into moiré.
    pixels = np.hypot(np.ptp(column), np.ptp(row)) / np.hypot(*site.size)
    step = max(int(pixels * site.spacing), 1)
    values, valid = _averaged(values, valid, step)
    a, b, c, d, e, f = whole.to_pixel
    half = 0.5 * (step - 1)
    shifted = a, b, c - columns.start - half, d, e, f - rows.start - half
    return values, valid, whole.replace(to_pixel=tuple(part / step for part in shifted))


def _averaged(
    values: Array, valid: NDArray[np.bool_], step: int
) -> tuple[Array, NDArray[np.bool_]]:
    """Means of the valid pixels in squares of so many pixels, and which squares have any."""
    rows, columns, bands = values.shape
    shape = -(-rows // step), -(-columns // step)
    beyond = (0, shape[0] * step - rows), (0, shape[1] * step - columns)
    blocks = (shape[0], step, shape[1], step)
    weight = np.pad(valid, beyond).reshape(blocks).sum(axis=(1, 3))
    known = np.pad(np.where(valid[..., None], values, 0.0), (*beyond, (0, 0)))
    total = known.reshape(*blocks, bands).sum(axis=(1, 3))
    return total / np.maximum(weight, 1)[..., None], weight > 0
