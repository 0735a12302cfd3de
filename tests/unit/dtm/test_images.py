"""Images over a site: which way up they lie, their colours, and what is no data in them."""

from __future__ import annotations

import numpy as np
import pytest
import rasterio
from PIL import Image as Picture
from rasterio.enums import ColorInterp
from rasterio.transform import Affine

from terrain_forge.base import DataError
from terrain_forge.dtm import read_image

PIXELS = np.arange(12, dtype=np.uint8).reshape(3, 4) * 20
"""As they lie on the ground, rows running south."""
TURNED = {
    1: PIXELS,
    2: PIXELS[:, ::-1],
    3: PIXELS[::-1, ::-1],
    4: PIXELS[::-1],
    5: PIXELS.T,
    6: PIXELS.T[::-1],
    7: PIXELS.T[::-1, ::-1],
    8: PIXELS.T[:, ::-1],
}
"""As a file of each orientation of EXIF stores them."""


def read(folder, name="a.tif"):
    """Pixels of an image, rows running south."""
    return read_image(name, folder, ("x",))[::-1] * 255


def write(path, values, transform, **others):
    """A GeoTIFF on the Moon."""
    with rasterio.open(
        path, "w", driver="GTiff", height=values.shape[-2], width=values.shape[-1],
        count=1 if values.ndim == 2 else len(values), dtype=values.dtype,
        crs="+proj=stere +lat_0=-90 +R=1737400", transform=transform, **others,
    ) as file:  # fmt: skip
        file.write(values if values.ndim == 3 else values[None])


@pytest.mark.parametrize("orientation", TURNED)
@pytest.mark.parametrize("ending", ["png", "tif", "webp", "jpg"])
def test_images_lie_as_their_exif_says(tmp_path, orientation, ending):
    exif = Picture.Exif()
    exif[0x0112] = orientation
    stored = np.kron(TURNED[orientation], np.ones((8, 8), np.uint8))
    how = {"jpg": {"quality": 98}, "webp": {"lossless": True}}.get(ending, {})
    Picture.fromarray(stored).save(tmp_path / f"a.{ending}", exif=exif, **how)
    found = read(tmp_path, f"a.{ending}")
    np.testing.assert_allclose(found, np.kron(PIXELS, np.ones((8, 8))), atol=3)


@pytest.mark.parametrize(
    ("stored", "transform"),
    [
        (PIXELS, Affine(2, 0, 50, 0, -3, 90)),
        (PIXELS[::-1], Affine(2, 0, 50, 0, 3, 90)),
        (PIXELS[:, ::-1], Affine(-2, 0, 50, 0, -3, 90)),
        (PIXELS.T, Affine(0, 2, 50, -3, 0, 90)),
        (PIXELS.T[::-1, ::-1], Affine(0, -2, 50, 3, 0, 90)),
        (PIXELS, Affine(2, 1e-5, 50, -1e-5, -3, 90)),
    ],
)
def test_images_lie_as_their_georeference_says(tmp_path, stored, transform):
    write(tmp_path / "a.tif", np.ascontiguousarray(stored), transform)
    np.testing.assert_array_equal(read(tmp_path), PIXELS)


def test_images_that_lie_askew_are_refused(tmp_path):
    write(tmp_path / "a.tif", PIXELS, Affine.rotation(10) * Affine.scale(2, -2))
    with pytest.raises(DataError, match=r"a.tif lies askew .* along its axes are allowed"):
        read(tmp_path)


def test_bands_count_by_the_colours_that_they_name(tmp_path):
    red = np.stack([0 * PIXELS, 0 * PIXELS, PIXELS])
    write(tmp_path / "a.tif", red, Affine(2, 0, 0, 0, -2, 0))
    with rasterio.open(tmp_path / "a.tif", "r+") as file:
        file.colorinterp = ColorInterp.blue, ColorInterp.green, ColorInterp.red
    np.testing.assert_allclose(read(tmp_path), 0.2126 * PIXELS)


def test_pixels_without_data_are_refused(tmp_path):
    north_up = Affine(2, 0, 0, 0, -2, 0)
    write(tmp_path / "a.tif", PIXELS, north_up, nodata=40)
    with pytest.raises(DataError, match=r"a.tif has no data on 1 of 12 pixels, .* value 40: fill"):
        read(tmp_path)
    write(tmp_path / "a.tif", PIXELS, north_up, nodata=41)
    np.testing.assert_array_equal(read(tmp_path), PIXELS)
    with (
        rasterio.Env(GDAL_TIFF_INTERNAL_MASK=True),
        rasterio.open(tmp_path / "b.tif", "w", driver="GTiff", height=3, width=4, count=1,
                      dtype="uint8", transform=north_up) as file,
    ):  # fmt: skip
        file.write(PIXELS[None])
        file.write_mask(np.where(PIXELS > 150, 0, 255).astype(np.uint8))
    with pytest.raises(DataError, match=r"b.tif has no data on 4 of 12 pixels, by its mask"):
        read(tmp_path, "b.tif")


def test_transparency_is_not_looked_at(tmp_path):
    clear = np.stack([PIXELS, np.where(PIXELS > 150, 0, 255).astype(np.uint8)], axis=-1)
    Picture.fromarray(clear, "LA").save(tmp_path / "a.png")
    np.testing.assert_array_equal(read(tmp_path, "a.png"), PIXELS)
    Picture.fromarray(PIXELS).save(tmp_path / "b.png", transparency=40)
    np.testing.assert_array_equal(read(tmp_path, "b.png"), PIXELS)
