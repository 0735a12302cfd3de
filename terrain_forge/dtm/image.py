"""Reading pictures: which way up they lie, which bands are colours, how bright their pixels are."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, DataError, Key, image_rows, reading, require_file
from terrain_forge.dtm.raster import open_dataset

MAX_PIXELS = 2**26
"""Pixels of an image."""
_ORIENTATION = 0x0112  # the tag of EXIF
_ASKEW = 1e-4
"""Slope of rows and columns to a file's axes up to which they count as along them."""
_TRANSPARENT = "PNG", "GIF"
"""Formats whose value of no data is a transparent colour."""


class Turn(NamedTuple):
    """How a file's pixels become rows that run south and columns that run east, in this order."""

    transposed: bool = False
    """Rows and columns change places."""
    mirrored: bool = False
    """Columns then run the other way."""
    upturned: bool = False
    """Rows then run the other way."""

    def apply(self, values: NDArray[Any]) -> NDArray[Any]:
        """Pixels of a file, shape [rows, columns], turned."""
        turned = values.T if self.transposed else values
        return turned[:: -1 if self.upturned else 1, :: -1 if self.mirrored else 1]


_TURNS = {
    2: Turn(mirrored=True),
    3: Turn(mirrored=True, upturned=True),
    4: Turn(upturned=True),
    5: Turn(transposed=True),
    6: Turn(transposed=True, mirrored=True),
    7: Turn(transposed=True, mirrored=True, upturned=True),
    8: Turn(transposed=True, upturned=True),
}
"""By the orientation of EXIF; 1 is upright."""


def read_image(path: str, folder: Path, key: Key) -> Array:
    """How bright an image is, 0 to 1, rows running north.

    Integers are divided by the largest that their bits can hold. A palette's colours take the place
    of its indices. Of colours the luma is taken, 0.2126 R + 0.7152 G + 0.0722 B (ITU-R BT.709), of
    any other bands the first one; transparency is not looked at. It lies as the file's georeference
    says, else as its EXIF says.

    Raises:
        DataError: if the file is missing, no image, lies askew, or holds values that are not finite
            or no data.
    """
    import rasterio

    require_file(folder / path, path, key)
    with reading(path, key=key):
        try:
            dataset = open_dataset(folder / path)
        except rasterio.errors.RasterioError:
            raise DataError(f"not an image: {path}", key=key) from None
        with dataset:
            values = _brightness(dataset, path, key)
            values = turn_of(dataset, path, key).apply(values)
    if not np.isfinite(values).all():
        raise DataError(f"{path} holds values that are not finite", key=key)
    return np.asarray(image_rows(values))


def turn_of(dataset: Any, path: str, key: Key) -> Turn:
    """How a file's georeference, or else its EXIF, says that its pixels are to be turned.

    Raises:
        DataError: if it lies askew.
    """
    if dataset.transform.is_identity:
        return _exif_turn(dataset)
    a, b, _, d, e, _ = dataset.transform[:6]
    transposed = abs(a) + abs(e) < abs(b) + abs(d)
    if transposed:
        a, b, d, e = b, a, e, d
    if not a * e or abs(b) > _ASKEW * abs(e) or abs(d) > _ASKEW * abs(a):
        raise DataError(
            f"{path} lies askew by its georeference; rows and columns along its axes are allowed: "
            "warp it so (gdalwarp does)",
            key=key,
        )
    return Turn(transposed, mirrored=a < 0.0, upturned=e > 0.0)


def bands_of(dataset: Any, otherwise: list[int]) -> list[int]:
    """Numbers of the bands that say that they are red, green and blue, of a palette its one.

    `otherwise` where not all of these are there.
    """
    from rasterio.enums import ColorInterp

    kinds, wanted = dataset.colorinterp, (ColorInterp.red, ColorInterp.green, ColorInterp.blue)
    if kinds[0] == ColorInterp.palette:
        return [1]
    return [kinds.index(kind) + 1 for kind in wanted] if {*wanted} <= {*kinds} else otherwise


def read_bands(dataset: Any, bands: list[int], window: Any = None) -> Array:
    """Pixels of bands, shape [bands, rows, columns]; of a palette its red, green and blue.

    Integers are divided by the largest that their bits can hold.
    """
    from rasterio.enums import ColorInterp

    values = dataset.read(bands, window=window)
    if dataset.colorinterp[bands[0] - 1] == ColorInterp.palette:
        colours = np.zeros((3, 256**values.dtype.itemsize), np.uint8)
        for index, rgba in dataset.colormap(1).items():
            colours[:, index] = rgba[:3]
        return np.asarray(colours[:, values[0]] / 255.0)
    if values.dtype.kind not in "iu":
        return np.asarray(values, np.float64)
    bits = dataset.tags(bands[0], ns="IMAGE_STRUCTURE").get("NBITS")
    return np.asarray(values / float(2 ** int(bits) - 1 if bits else np.iinfo(values.dtype).max))


def _exif_turn(dataset: Any) -> Turn:
    """How the file's EXIF, which GDAL does not follow, says that its pixels are to be turned."""
    from PIL import Image

    try:
        with Image.open(dataset.name, formats=("JPEG", "PNG", "TIFF", "WEBP")) as picture:
            return _TURNS.get(picture.getexif().get(_ORIENTATION, 1), Turn())
    except Exception:  # other formats have none, and GDAL reads what Pillow stumbles over
        return Turn()


def _brightness(dataset: Any, path: str, key: Key) -> Array:
    """Brightness of a dataset's pixels, 0 to 1 if they are integers."""
    if dataset.width * dataset.height > MAX_PIXELS:
        raise DataError(f"{dataset.width} × {dataset.height} pixels, at most {MAX_PIXELS:,}")
    bands = bands_of(dataset, [1])
    _require_data(dataset, bands, path, key)
    values = read_bands(dataset, bands)
    return _luma(values) if len(values) == 3 else np.asarray(values[0])


def _require_data(dataset: Any, bands: list[int], path: str, key: Key) -> None:
    """Refuse pixels that the file declares to be no data; transparency is not looked at."""
    from rasterio.enums import MaskFlags

    for band in bands:
        flags, value = dataset.mask_flag_enums[band - 1], dataset.nodatavals[band - 1]
        if MaskFlags.alpha in flags or (value is not None and dataset.driver in _TRANSPARENT):
            continue
        missing = int((dataset.read_masks(band) == 0).sum())
        if missing:
            mark = "its mask" if value is None else f"its nodata value {value:g}"
            raise DataError(
                f"{path} has no data on {missing} of {dataset.width * dataset.height} pixels, by "
                f"{mark}: fill them, or take that mark out of the file if they are values",
                key=key,
            )


def _luma(rgb: Array) -> Array:
    """Luma of red, green and blue, of shape [3, …]; grey ones keep their value exactly."""
    red, green, blue = rgb
    result: Array = green + 0.2126 * (red - green) + 0.0722 * (blue - green)
    return result
