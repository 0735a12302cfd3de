"""The part of a remote raster that a site needs, read over the network and kept as a GeoTIFF."""

from __future__ import annotations

import json
import logging
import os
import re
from dataclasses import replace
from hashlib import sha256
from math import ceil
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import unquote, urlsplit

import numpy as np

from terrain_forge.base import DataError, Progress, silent, size_text
from terrain_forge.dtm.download import (
    TIMEOUT,
    Answer,
    ask,
    file_hash,
    kept,
    place_in_cache,
    read_record,
    write_record,
)
from terrain_forge.dtm.projection import local_crs
from terrain_forge.dtm.raster import Raster, raster_of
from terrain_forge.dtm.reading import samples_needed
from terrain_forge.dtm.site_survey import centre_lonlat
from terrain_forge.dtm.spec import Centre, RasterDtm
from terrain_forge.dtm.vertical import Vertical
from terrain_forge.model import Body

DRIVERS = ("GTiff", "JP2OpenJPEG")
"""GDAL's drivers that are used on remote files: no format of them names another file."""
MOST = 2**31
"""Bytes that are read of one file."""
_MARGIN = 4  # samples around what the site needs
_RAW = Vertical(scale=1.0, offset=0.0, reference_radius=0.0, known=True, unit="")
_KEY = ("dtm", "url")
_log = logging.getLogger(__name__)


def windowed(
    spec: RasterDtm,
    url: str,
    body: Body,
    *,
    licence: str,
    whole: Path | None,
    progress: Progress = silent,
) -> RasterDtm:
    """The spec with what its site needs of a remote raster as its source.

    Args:
        spec: The recipe's wishes.
        url: Address of the raster.
        body: What it is a part of.
        licence: On what terms it may be used.
        whole: Where the whole file may lie in the cache: it is then read instead.
        progress: Told when the network is used.

    Raises:
        DataError: if it cannot be had, or cannot serve.
    """
    path = window_path(spec, url)
    record = kept(path, "RECIPE")
    if record is None:
        path.parent.mkdir(parents=True, exist_ok=True)
        if whole is not None and (file := kept(whole, spec.name)):
            seen = {"tag": file["tag"], "size": file["bytes"]}
            _require_first_sight(url, seen)
            lonlat = _keep(spec, str(whole), spec.name, body, path)
        else:
            answer = ask(url, spec.name, wish="RECIPE")
            if not answer.in_pieces:
                raise DataError(
                    f"{urlsplit(url).hostname} does not send pieces of files: download "
                    f"{url} and name the file as dtm.source",
                    key=_KEY,
                )
            seen = {"tag": answer.tag, "size": answer.size}
            _require_first_sight(url, seen)
            told = f"the site's part of {size_text(answer.size)} at {urlsplit(answer.url).hostname}"
            _log.warning("reading %s: %s; %s", spec.name, told, licence)
            progress("download: the site's part", 0.0)
            lonlat = _over_network(spec, answer, body, path)
        _require_same(path, url)
        record = write_record(path, url=url, lonlat_deg=lonlat, **seen)
    lon, lat = record["lonlat_deg"]
    centre = Centre(lonlat_deg=(lon, lat))
    return replace(spec, product=None, url=None, source=str(path), centre=centre, band=1)


def window_path(spec: RasterDtm, url: str) -> Path:
    """Where the part is kept that a site needs of a remote raster."""
    centre = {name: value for name, value in vars(spec.centre).items() if value is not None}
    wish = json.dumps([url, spec.band, spec.size_m, centre])
    return place_in_cache(f"{_stem(url)}-{sha256(wish.encode()).hexdigest()[:16]}.tif")


def _stem(url: str) -> str:
    """What the names of all parts of a remote raster begin with."""
    plain = re.sub(r"[^\w-]+", "_", PurePosixPath(unquote(urlsplit(url).path)).stem)[:80]
    return f"{plain}-{sha256(url.encode()).hexdigest()[:8]}"


def _require_first_sight(url: str, seen: dict[str, Any]) -> None:
    """Refuse a file at the server that is not the one of which other parts are kept."""
    for record in place_in_cache("").glob(f"{_stem(url)}-*.tif.json"):
        known = read_record(record.with_suffix(""))
        told = [(known[fact], found) for fact, found in seen.items() if known.get(fact) and found]
        if any(before != now for before, now in told):
            raise _changed(url)


def _require_same(path: Path, url: str) -> None:
    """Refuse a part, newly read, that is not as it was when it was first fetched."""
    known = read_record(path).get("sha256")
    if known is not None and known != file_hash(path):
        path.unlink()
        raise _changed(url)


def _changed(url: str) -> DataError:
    return DataError(
        f"{url} is another file than it was when it was first fetched; to take the new one, "
        f"delete {place_in_cache(_stem(url))}-*",
        key=_KEY,
    )


def _over_network(spec: RasterDtm, answer: Answer, body: Body, path: Path) -> tuple[float, float]:
    import rasterio

    options = {
        "GDAL_DISABLE_READDIR_ON_OPEN": "EMPTY_DIR",
        "GDAL_HTTP_CONNECTTIMEOUT": ceil(TIMEOUT[0]),
        "GDAL_HTTP_LOW_SPEED_LIMIT": 1,  # byte per second
        "GDAL_HTTP_LOW_SPEED_TIME": ceil(TIMEOUT[1]),
        "GDAL_HTTP_MAX_RETRY": 2,
        "GDAL_HTTP_RETRY_DELAY": 1,
        "GDAL_HTTP_USERAGENT": "terrain-forge",
        "GDAL_HTTP_MULTIRANGE": "SERIAL",
        "GDAL_PAM_ENABLED": False,
        "CPL_VSIL_CURL_NON_CACHED": f"/vsicurl/{answer.url}",  # it may be another file next time
        "VSI_CACHE": True,
    }
    with rasterio.Env(**options):
        lonlat = _keep(spec, f"/vsicurl/{answer.url}", spec.name, body, path)
    again = ask(answer.url, spec.name, wish="RECIPE")
    if (again.tag, again.size) != (answer.tag, answer.size):
        path.unlink()
        raise DataError(f"{spec.name} changed while it was read: try again", key=_KEY)
    return lonlat


def _keep(spec: RasterDtm, file: str, name: str, body: Body, path: Path) -> tuple[float, float]:
    """Copy what the site needs; returns longitude and latitude of its centre [degrees]."""
    import rasterio

    try:
        dataset = rasterio.io.DatasetReader(file, driver=list(DRIVERS))
    except rasterio.errors.RasterioError as error:
        raise DataError(
            f"{name} cannot be read by window: {' '.join(str(error).split())[:200]}; of remote "
            f"files only GeoTIFF and JPEG 2000 are",
            key=_KEY,
        ) from None
    with dataset:
        raster = raster_of(dataset, spec, body=body, path=Path(file), vertical=_RAW)
        if not raster.crs:
            raise DataError(f"{name} is not georeferenced: download it", key=_KEY)
        lon, lat = centre_lonlat(raster, spec)
        crs = local_crs(raster.crs, lon, lat)
        rows, columns = samples_needed(raster, spec, crs, raster.to_pixel)
        rows = slice(max(rows.start - _MARGIN, 0), min(rows.stop + _MARGIN, raster.shape[0]))
        if not raster.goes_round:
            columns = slice(
                max(columns.start - _MARGIN, 0), min(columns.stop + _MARGIN, raster.shape[1])
            )
        _require_small(raster, rows, columns, name)
        try:
            _copy(raster, rows, columns, path)
        except rasterio.errors.RasterioError as error:
            why = " ".join(str(error.__cause__ or error).split())[:200]
            raise DataError(f"{name} broke off while it was read: {why}", key=_KEY) from None
    return lon, lat


def _require_small(raster: Raster, rows: slice, columns: slice, name: str) -> None:
    """Refuse what would take far more than the site needs: whole blocks are read."""
    down, across = raster.dataset.block_shapes[raster.band - 1]
    high = (rows.stop - 1) // down - rows.start // down + 1
    wide = (columns.stop - 1) // across - columns.start // across + 1
    item = np.dtype(raster.dataset.dtypes[raster.band - 1]).itemsize
    if (size := high * down * wide * across * item) > MOST:
        raise DataError(
            f"the site needs {size_text(size)} of {name}, at most {size_text(MOST)}: choose a "
            "smaller site, or download the file and name it as dtm.source",
            key=("dtm", "size_m"),
        )


def _copy(raster: Raster, rows: slice, columns: slice, path: Path) -> None:
    """Write samples as they are, with all that tells what they mean."""
    import rasterio
    from rasterio.windows import Window

    dataset, band = raster.dataset, raster.band

    def read(take: Any) -> Any:
        pieces = [Window.from_slices(rows, piece) for piece in raster.pieces(columns)]
        return np.concatenate([take(band, window=piece) for piece in pieces], axis=1)

    values = read(dataset.read)
    new = path.with_suffix(f".{os.getpid()}.new")
    with (
        rasterio.Env(GDAL_TIFF_INTERNAL_MASK=True),
        rasterio.open(
            new,
            "w",
            driver="GTiff",
            height=values.shape[0],
            width=values.shape[1],
            count=1,
            dtype=values.dtype,
            crs=dataset.crs,
            transform=dataset.transform @ rasterio.Affine.translation(columns.start, rows.start),
            nodata=dataset.nodatavals[band - 1],
        ) as copy,
    ):
        copy.write(values, 1)
        copy.scales, copy.offsets = (dataset.scales[band - 1],), (dataset.offsets[band - 1],)
        copy.units = (dataset.units[band - 1] or "",)
        if dataset.nodatavals[band - 1] is None and not (mask := read(dataset.read_masks)).all():
            copy.write_mask(mask)
    new.replace(path)
