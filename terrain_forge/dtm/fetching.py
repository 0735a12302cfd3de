"""Terrain models that a recipe names by product, place or address, fetched and kept."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from terrain_forge.base import DataError, Progress, RecipeError, reading, silent, size_text
from terrain_forge.dtm.download import download, kept, place_in_cache
from terrain_forge.dtm.places import expanded, places
from terrain_forge.dtm.products import Product, find_product
from terrain_forge.dtm.raster import open_dataset, raster_of
from terrain_forge.dtm.spec import RasterDtm
from terrain_forge.dtm.window import window_path, windowed
from terrain_forge.model import BODIES, Body

_UNKNOWN = "its owner's terms hold"


def at_hand(spec: RasterDtm, *, body: Body, progress: Progress = silent) -> RasterDtm:
    """The spec with a file of this machine as its source, fetched where it is not there yet.

    Args:
        spec: The recipe's wishes.
        body: What it is a part of.
        progress: Called with the share that is there.

    Raises:
        RecipeError: for an unknown name, or one of another body.
        DataError: if it cannot be had, or is not what it should be.
        StorageError: if the disk does not take it.
    """
    spec = expanded(spec)
    if spec.source is not None:
        return spec
    if spec.url is not None:
        return windowed(spec, spec.url, body, licence=_UNKNOWN, whole=None, progress=progress)
    product = _product(spec, body)
    if product.height_scale and spec.height_scale is None and spec.height_range_m is None:
        spec = replace(spec, height_scale=product.height_scale, height_offset_m=0.0)
    if not product.shape:
        whole = fetch_product(product.name, progress=progress)
        return replace(spec, product=None, source=str(whole))
    terms, whole = product.licence, _path(product)
    return windowed(spec, product.url, body, licence=terms, whole=whole, progress=progress)


def whole_at_hand(spec: RasterDtm, *, body: Body) -> RasterDtm:
    """The spec with a file of this machine that holds all of its terrain model.

    Raises:
        RecipeError, DataError, StorageError: as `at_hand`, and where only a site's part is fetched.
    """
    spec = expanded(spec)
    if spec.source is None and (spec.url is not None or _product(spec, body).shape):
        raise RecipeError(
            f"of {spec.name} only a site's part is fetched, which has no other places: give a file "
            "as dtm.source",
            key=("dtm",),
        )
    return at_hand(spec, body=body)


def fetch_product(name: str, *, progress: Progress = silent) -> Path:
    """The whole file of a product, or of a place's product, from the cache or its server.

    Raises:
        RecipeError, DataError, StorageError: as `at_hand`.
    """
    product = find_product(places()[name].product if name in places() else name, also=places())
    if name in places() and product.shape:
        raise RecipeError(
            f"{name} lies in {product.name}, of which a build reads only the site's part: "
            f"terrain-forge fetch RECIPE, or {product.name} for all {size_text(product.size or 0)}"
        )
    path = _path(product)
    if kept(path, name) is None:
        check = partial(_require_product, product)
        download(product.url, path, name, licence=product.licence, check=check, progress=progress)
    return path


def still_to_fetch(spec: RasterDtm, *, body: Body) -> Iterator[str]:
    """Lines that say what a build would take from the network; none where all is at hand.

    Raises:
        RecipeError: for an unknown name, or one of another body.
    """
    spec = expanded(spec)
    if spec.source is not None:
        return
    product = None if spec.url else _product(spec, body)
    url = product.url if product else str(spec.url)
    by_window = product is None or product.shape
    path = _path(product) if product and not by_window else window_path(spec, url)
    if kept(path, "RECIPE" if by_window else spec.name):
        return
    size = (
        size_text(product.size)
        if product and product.size
        else "0.04 to 1 GB, which its server tells,"
    )
    what = f"the site's part of {size}" if by_window else size
    yield f"DTM {spec.name}"
    yield f"  not here     a build would download {what} from {urlsplit(url).hostname}"
    for key, value in (origin(vars(spec)) or {}).items():
        yield f"  {key:<12} {value}"


def origin(dtm: dict[str, Any]) -> dict[str, str] | None:
    """Where a terrain model comes from, on what terms, and what to cite; None for the user's own.

    Args:
        dtm: The recipe's `dtm` as plain data, its place written out.

    Raises:
        RecipeError: for an unknown name.
    """
    if url := dtm.get("url"):
        return {"url": url, "licence": _UNKNOWN, "citation": "as its owner asks"}
    if not dtm.get("product"):
        return None
    product = find_product(dtm["product"])
    return {"url": product.url, "licence": product.licence, "citation": product.citation}


def _path(product: Product) -> Path:
    return place_in_cache(urlsplit(product.url).path.rpartition("/")[2])


def _product(spec: RasterDtm, body: Body) -> Product:
    product = find_product(str(spec.product))
    if product.body != body.name:
        raise RecipeError(f"{product.name} is of body: {product.body}", key=("body",))
    return product


def _require_product(product: Product, path: Path) -> None:
    """Refuse a file that is not the product: its label, its grid, its size, its body.

    Raises:
        DataError: says what it is instead.
    """
    import rasterio

    with reading(product.name, key=("dtm",)):
        try:
            dataset = open_dataset(path)
        except rasterio.errors.RasterioError:
            with path.open("rb") as file:
                begin = file.read(40)
            raise DataError(f"{product.name} is no raster, it begins {begin!r}") from None
        with dataset:
            raster_of(dataset, RasterDtm(size_m=(1.0, 1.0)), body=BODIES[product.body], path=path)
            shape = dataset.height, dataset.width
            if product.shape not in (None, shape):
                rows, columns = product.shape or shape
                raise DataError(
                    f"{product.name} has {shape[0]} × {shape[1]} samples, not {rows} × {columns}"
                )
            if dataset.driver == "PDS":
                _require_label(product, path)
            dataset.read(1, window=((shape[0] - 1, shape[0]), (0, shape[1])))


def _require_label(product: Product, path: Path) -> None:
    """Refuse a PDS3 file of another product, or with fewer bytes than its label counts."""
    with path.open("rb") as file:
        text = file.read(2**16).decode("latin-1")
    label = dict(re.findall(r'^\s*(\w+)\s*=\s*"?([^"\s]+)', text, re.MULTILINE))
    if (found := label["PRODUCT_ID"]) != product.name:
        raise DataError(f"{product.name} calls itself {found} in its label")
    size, counted = path.stat().st_size, int(label["FILE_RECORDS"]) * int(label["RECORD_BYTES"])
    if size < counted:
        raise DataError(f"{product.name} has {size:,} bytes, its label counts {counted:,}")
