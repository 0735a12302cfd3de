"""Rasters at an address, of which a window is read, from a server that misbehaves."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rasterio

from terrain_forge.base import DataError
from terrain_forge.dtm import RasterDtm, at_hand, fetch_product, still_to_fetch, survey
from terrain_forge.dtm.places import places
from terrain_forge.dtm.products import table
from terrain_forge.dtm.spec import Centre
from terrain_forge.model import MARS, MOON
from tests.helpers.web import File, hirise
from tests.unit.dtm.test_dtm import from_origin, write_raster

GALE = places()["gale"]
DTM = hirise(GALE.product, lonlat=GALE.lonlat_deg)


def cog(path, **options):
    """A raster of 1500 × 1200 posts in tiles."""
    write_raster(path, shape=(1500, 1200), transform=from_origin(5e3, -272e3, 1.0, 1.0))
    with rasterio.open(path) as plain:
        profile = {**plain.profile, "tiled": True, "blockxsize": 128, "blockysize": 128}
        values = plain.read()
    with rasterio.open(path, "w", **{**profile, **options}) as tiled:
        tiled.write(values)
    return path


CENTRES = [Centre(offset_m=(100.0, -50.0)), Centre(crs=(5400.0, -272700.0))]


@pytest.mark.parametrize("centre", CENTRES, ids=["offset", "crs"])
def test_a_remote_raster_is_read_by_window_and_kept(web, tmp_path, centre, monkeypatch):
    path = cog(tmp_path / "big.tif", compress="deflate")
    url = web.put("/data/big.tif", path.read_bytes())
    wish = RasterDtm(url=url, size_m=(60.0, 40.0), noise="keep", centre=centre)
    here = at_hand(wish, body=MARS)
    remote = survey(here, body=MARS, folder=tmp_path, heights=None)
    local = survey(
        replace(wish, url=None, source="big.tif"), body=MARS, folder=tmp_path, heights=None
    )
    assert remote.crs == local.crs
    assert remote.datum_height == local.datum_height
    assert np.array_equal(remote.dtm.heights, local.dtm.heights)
    taken = sum(
        int(last) - int(first) + 1
        for _, asked in web.asked
        for first, _, last in [asked.removeprefix("bytes=").partition("-")]
        if last
    )
    assert taken < 0.7 * path.stat().st_size

    monkeypatch.setenv("TERRAIN_FORGE_OFFLINE", "1")
    assert at_hand(wish, body=MARS) == here
    with pytest.raises(DataError, match=r"OFFLINE is set: .* fetch RECIPE"):
        at_hand(replace(wish, size_m=(60.0, 44.0)), body=MARS)


def test_parts_of_one_address_are_parts_of_one_file(web, tmp_path):
    """Told by the server's tag, or where it has none by the part's own hash."""
    path = cog(tmp_path / "big.tif")
    wish = RasterDtm(url=web.put("/big.tif", path.read_bytes()), size_m=(60.0, 40.0), noise="keep")
    other = replace(wish, size_m=(60.0, 44.0))
    part = Path(at_hand(wish, body=MARS).source)
    with rasterio.open(path, "r+") as file:
        file.write(file.read(1) + 1.0, 1)
    changed = path.read_bytes()
    message = f"{wish.url} is another file .* delete {part.parent}/big-[0-9a-f]{{8}}-\\*$"
    web.put("/big.tif", File(data=changed, tag='"two"'))
    with pytest.raises(DataError, match=message) as caught:
        at_hand(other, body=MARS)
    part.unlink()
    web.put("/big.tif", File(data=changed, tag=""))
    with pytest.raises(DataError, match=message):
        at_hand(wish, body=MARS)
    assert not part.exists()
    for old in part.parent.glob(str(caught.value).rpartition("/")[2]):
        old.unlink()
    part.write_bytes(Path(at_hand(wish, body=MARS).source).read_bytes()[:-1])
    for use in (at_hand, lambda *a, **k: list(still_to_fetch(*a, **k))):
        with pytest.raises(DataError, match=f"{part} is not as .* then terrain-forge fetch RECIPE"):
            use(wish, body=MARS)


def test_a_window_across_the_seam_of_a_whole_body(web, tmp_path):
    degrees = from_origin(-180.0, 90.0, 0.25, 0.25)
    path = write_raster(
        tmp_path / "globe.tif", shape=(720, 1440), crs="+proj=longlat +R=3396190",
        transform=degrees, change=lambda heights: 100.0 * np.sin(heights),
    )  # fmt: skip
    centre = Centre(lonlat_deg=(179.9, 10.0))
    wish = RasterDtm(
        url=web.put("/globe.tif", path.read_bytes()),
        size_m=(60e3, 60e3),
        centre=centre,
        noise="keep",
    )
    remote = survey(at_hand(wish, body=MARS), body=MARS, folder=tmp_path, heights=None)
    local = survey(
        replace(wish, url=None, source="globe.tif"), body=MARS, folder=tmp_path, heights=None
    )
    assert remote.datum_height == pytest.approx(local.datum_height, abs=1e-9)
    assert remote.lonlat == local.lonlat


@pytest.mark.parametrize(
    ("file", "message"),
    [
        (File(status=404), "says 404"),
        (File(data=b"x" * 1000), "cannot be read by window.*only GeoTIFF and JPEG 2000"),
        (File(data=DTM), "only GeoTIFF and JPEG 2000"),
        (File(data=DTM, ranges=False), "does not send pieces of files"),
        (File(moved_to="file:///etc/passwd"), "file:///etc/passwd"),
    ],
    ids=["404", "junk", "PDS", "no pieces", "file"],
)
def test_remote_rasters_that_cannot_serve(web, tmp_path, file, message):
    url = web.put("/bad.tif", file)
    with pytest.raises(DataError, match=message):
        at_hand(RasterDtm(url=url, size_m=(60.0, 40.0), noise="keep"), body=MARS)
    assert not list((tmp_path / "cache").rglob("*.tif"))


def test_a_remote_raster_that_breaks_changes_or_is_too_large(web, tmp_path, monkeypatch):
    data = cog(tmp_path / "big.tif").read_bytes()
    cut = web.put("/cut.tif", data[: len(data) // 3])
    wish = RasterDtm(url=cut, size_m=(60.0, 40.0), noise="keep")
    with pytest.raises(DataError, match="broke off while it was read"):
        at_hand(wish, body=MARS)
    monkeypatch.setattr("terrain_forge.dtm.window.MOST", 1000)
    whole = web.put("/whole.tif", data)
    with pytest.raises(DataError, match=r"the site needs \d+ kB of .*at most"):
        at_hand(replace(wish, url=whole), body=MARS)
    with pytest.raises(DataError, match="lies on a body of 3396 km"):
        at_hand(replace(wish, url=whole), body=MOON)


def test_a_remote_raster_that_changes_while_it_is_read(web, tmp_path):
    data = cog(tmp_path / "big.tif").read_bytes()
    wish = RasterDtm(url=web.put("/calm.tif", data), size_m=(60.0, 40.0), noise="keep")
    at_hand(wish, body=MARS)
    file = File(data=data, lasts=len(web.asked) - 1, then=File(data=data, tag='"two"'))
    with pytest.raises(DataError, match="changed while it was read"):
        at_hand(replace(wish, url=web.put("/other.tif", file)), body=MARS)
    assert not list((tmp_path / "cache").rglob("other*"))


@pytest.mark.slow
@pytest.mark.parametrize("requests", [1, 3])
def test_a_server_that_hangs_while_a_part_is_read(web, tmp_path, monkeypatch, requests):
    monkeypatch.setattr("terrain_forge.dtm.window.TIMEOUT", (0.2, 0.2))
    file = File(data=cog(tmp_path / "a.tif").read_bytes(), lasts=requests, then=File(hangs=True))
    wish = RasterDtm(url=web.put("/hangs.tif", file), size_m=(60.0, 40.0), noise="keep")
    with pytest.raises(DataError, match=r"cannot be read by window|broke off while it was read"):
        at_hand(wish, body=MARS)
    assert not list((tmp_path / "cache").rglob("*.tif"))


def test_large_products_are_read_by_window_or_from_the_whole_file(web, tmp_path, monkeypatch):
    path = cog(tmp_path / "mosaic.tif")
    url = web.put("/mosaic.tif", path.read_bytes())
    product = replace(table()["MOLA_463m"], url=url, shape=(1500, 1200))
    monkeypatch.setitem(table(), product.name, product)
    wish = RasterDtm(product="MOLA_463m", size_m=(60.0, 40.0), noise="keep")
    first = at_hand(wish, body=MARS)
    data = (tmp_path / "cache" / "dtm" / first.name).read_bytes()
    (tmp_path / "cache" / "dtm" / first.name).unlink()
    (tmp_path / "cache" / "dtm" / f"{first.name}.json").unlink()
    whole = fetch_product("MOLA_463m")
    monkeypatch.setenv("TERRAIN_FORGE_OFFLINE", "1")
    assert at_hand(wish, body=MARS) == first
    assert (tmp_path / "cache" / "dtm" / first.name).read_bytes() == data
    assert whole.read_bytes() == path.read_bytes()
    monkeypatch.setitem(table(), product.name, replace(product, shape=(1500, 1201)))
    whole.with_name(f"{whole.name}.json").unlink()
    with pytest.raises(DataError, match="has 1500 × 1200 samples, not 1500 × 1201"):
        fetch_product("MOLA_463m")
