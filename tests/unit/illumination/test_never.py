"""What is never lit is never lit: far from the map's middle, between azimuths, beside holes."""

from __future__ import annotations

import json

import numpy as np
import pytest
import rasterio
from rasterio.transform import from_origin

import terrain_forge as tf
from terrain_forge.base import DataError
from terrain_forge.illumination import Source, Wish, illuminate
from terrain_forge.making import plan
from tests.helpers.rasters import rough

_POSTING, _SIDE = 500.0, 200
_CRS = "+proj=stere +lat_0=-90 +lon_0=0 +k=1 +x_0=0 +y_0=0 +R=1737400 +units=m +no_defs"


def lit(folder, heights, **wish):
    """Maps of a DTM about the Moon's south pole, north up, and what the table says."""
    half = 0.5 * _POSTING * _SIDE
    with rasterio.open(
        folder / "pole.tif", "w", driver="GTiff", height=_SIDE, width=_SIDE, count=1,
        dtype="float32", transform=from_origin(-half, half, _POSTING, _POSTING), crs=_CRS,
        nodata=-32768.0,
    ) as file:  # fmt: skip
        file.write(heights.astype(np.float32), 1)
    (folder / "pole.yaml").write_text(
        "name: pole\nbody: moon\ndtm: {source: pole.tif, size_m: [2000, 2000]}\n"
        "terrain: {spacing_m: 100}\nsun: {elevation_deg: 2}\n"
    )
    file = tf.load_recipe(folder / "pole.yaml")
    site, out = plan(file.recipe, folder=folder), folder / "light"
    lines = illuminate(
        site, Source(dtm=file.recipe.dtm, folder=folder), out, Wish(**wish), force=True
    )
    maps = {}
    for path in out.glob("*.tif"):
        with rasterio.open(path) as made:
            maps[path.stem] = made.read(masked=True)
    return maps, json.loads((out / "illumination.json").read_text()), lines


@pytest.fixture
def hills():
    z = rough((_SIDE, _SIDE))
    return 900.0 * z / z.std()


@pytest.mark.slow
def test_no_place_is_never_lit_that_a_later_sun_shines_on(hills, tmp_path):
    """A moment of winter seen in 8 azimuths must not contradict a whole year."""
    size = {"size": (80e3, 80e3), "spacing": 4000.0}
    winter = {"begin": "2030-04-01", "end": "2030-04-02", "step": "1d"}
    never = lit(tmp_path, hills, **size, **winter, azimuths=8)[0]["never_lit"][0]
    year = {"begin": "2030-01-01", "end": "2031-01-01", "step": "1d"}
    hours = lit(tmp_path, hills, **size, **year, azimuths=366)[0]["sunlight_hours"][0]
    assert 0.05 < never.mean() < 0.9
    assert not np.any((hours > 0.0) & (never == 1))
    assert np.mean((hours == 0.0) & (never == 0)) < 0.05, "what no year lights is mostly told"


def test_nothing_is_told_where_the_dtm_has_a_hole(hills, tmp_path):
    hills[104:120, 80:100] = -32768.0
    wish = {"begin": "2030-08-01", "end": "2030-08-15", "step": "1d", "azimuths": 16}
    maps, told, lines = lit(tmp_path, hills, size=(30e3, 30e3), spacing=1000.0, **wish)
    assert sorted(maps) == [
        "earth_hours", "horizon", "never_lit", "sun_seen", "sunlight_hours"
    ]  # fmt: skip
    gone = maps["never_lit"].mask[0]
    assert 0.05 < gone.mean() < 0.5
    for name, bands in maps.items():
        assert (bands.mask == gone).all(), name
    hours = maps["sunlight_hours"].compressed()
    assert told["mean_sunlight_hours"] == pytest.approx(hours.mean(), rel=1e-5)
    assert told["never_lit_share"] == pytest.approx(maps["never_lit"].compressed().mean())
    assert f"{hours.mean():.4g} h of" in lines[1]
    never = maps["never_lit"].compressed() == 1
    assert 0.0 < never.mean() < np.mean(hours == 0.0), "other days light what these do not"


def test_a_map_all_in_a_hole_is_refused(hills, tmp_path):
    middle = hills[94:106, 94:106].copy()
    hills[80:120, 80:120] = -32768.0
    hills[94:106, 94:106] = middle
    wish = {"begin": "2030-08-01", "end": "2030-08-02", "step": "1d", "azimuths": 8}
    with pytest.raises(DataError, match="no height anywhere on the map"):
        lit(tmp_path, hills, size=(12e3, 12e3), spacing=12e3, **wish)
