"""Tiles of workers that do not see the site's folder, by way of a store that fsspec can address.

    URL/terrain-forge-KEY-site.tar      the planned site, which each worker takes once
    URL/terrain-forge-KEY-NUMBER.tar    a tile: its worker puts it there whole, the client takes it

A tile is one file on its way: either it is there with the hash that its worker told, or it counts
as failed. Nothing but the site's own folder is ever read to know what is done.
"""

from __future__ import annotations

import platform
import shutil
import tarfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import lru_cache
from hashlib import sha256 as digest_of
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory, mkdtemp
from typing import Any
from weakref import finalize

from terrain_forge.base import OutputError, storing
from terrain_forge.recipe import sha256
from terrain_forge.tiling.joining import begin_site, sample_world
from terrain_forge.tiling.making import make_tile, placing
from terrain_forge.tiling.order import FOLDER, STAGING, TileOrder, load_order, write_planned

_SITE = "site.tar"


@dataclass(frozen=True, kw_only=True)
class Exchange:
    """A place in a store for the tiles of one site; what it does raises OutputError."""

    url: str
    """What the addresses of its files begin with."""

    def put(self, file: Path) -> None:
        """Leave a file there."""
        with self._opened() as (store, begin):
            store.put_file(str(file), f"{begin}-{file.name}")

    def get(self, file: Path) -> None:
        """Take a copy of the file of this name."""
        with self._opened() as (store, begin):
            store.get_file(f"{begin}-{file.name}", str(file))

    def remove(self, names: str = "*.tar") -> None:
        """Remove files."""
        with self._opened() as (store, begin):
            for path in store.glob(f"{begin}-{names}"):
                store.rm_file(path)

    @contextmanager
    def _opened(self) -> Iterator[tuple[Any, str]]:
        """The store, and what our paths in it begin with."""
        try:
            store, begin = import_module("fsspec").url_to_fs(self.url)
            store.invalidate_cache()
            yield store, begin
        except Exception as error:
            why = " ".join(str(error).split()) or type(error).__name__
            raise OutputError(f"the exchange {self.url} cannot be used: {why}") from error


@contextmanager
def exchanging(order: TileOrder, url: str) -> Iterator[Exchange]:
    """A place in a store with the planned site in it, which is removed in the end.

    Nothing is read or written in the site's own folder.

    Raises:
        OutputError: if the store cannot be used.
    """
    with TemporaryDirectory() as made:
        folder, packed = Path(made) / FOLDER, Path(made) / _SITE
        folder.mkdir()
        write_planned(order, folder)
        files = sorted(folder.iterdir())
        whose = f"{platform.node()} {order.out} {' '.join(map(sha256, files))}"
        key = digest_of(whose.encode()).hexdigest()[:16]
        exchange = Exchange(url=f"{url.rstrip('/')}/terrain-forge-{key}")
        with tarfile.open(packed, "w") as tar:
            for file in files:
                tar.add(file, f"{FOLDER}/{file.name}")
        exchange.remove()  # what a killed build has left
        exchange.put(packed)
    try:
        yield exchange
    finally:
        with suppress(OutputError):  # the site needs it no more
            exchange.remove()


def make_tile_away(exchange: Exchange, number: int) -> dict[str, Any]:
    """Make a tile in a folder of this process, and leave it in the exchange; returns its hash too.

    Raises:
        OutputError: if the exchange cannot be used.
        StorageError: if this machine's disk does not take it.
    """
    site = _site_here(exchange)  # whose folder is there as long as this is
    out, order = site.path, load_order(site.path)
    place, packed = order.folder(number), out / f"{number}.tar"
    (out / STAGING).mkdir(exist_ok=True)
    told = make_tile(str(out), number)
    try:
        with storing(packed, out), tarfile.open(packed, "w") as tar:
            tar.add(place, ".")
        exchange.put(packed)
        return {**told, "sha256": sha256(packed)}
    finally:  # a worker's disk need not hold the site
        packed.unlink(missing_ok=True)
        shutil.rmtree(place, ignore_errors=True)


class _Folder:
    """A folder of this process with the planned site, and what tiles share."""

    def __init__(self, exchange: Exchange) -> None:
        self.path = Path(mkdtemp(prefix="terrain-forge-"))
        finalize(self, shutil.rmtree, self.path, ignore_errors=True)
        with storing(self.path, self.path):
            exchange.get(self.path / _SITE)
            _unpack(self.path / _SITE, self.path)
            order = load_order(self.path)
            begin_site(order, sample_world(order))


_site_here = lru_cache(maxsize=1)(_Folder)


def take_tile(order: TileOrder, exchange: Exchange, number: int, wanted: str) -> None:
    """Move a tile from the exchange to its place, at once.

    Raises:
        OutputError: if it is not what its worker has put there.
        StorageError: if the disk does not take it.
    """
    with placing(order, number) as fresh:
        packed = fresh / f"{number}.tar"
        exchange.get(packed)
        if sha256(packed) != wanted:
            raise OutputError(f"{exchange.url}-{packed.name} is not what its worker left there")
        _unpack(packed, fresh)
    exchange.remove(packed.name)


def _unpack(packed: Path, folder: Path) -> None:
    with tarfile.open(packed) as tar:
        tar.extractall(folder, filter="data")
    packed.unlink()
