"""Tiles that come through a store, from workers that do not see the site's folder."""

from __future__ import annotations

import pytest

import terrain_forge as tf
from terrain_forge.base import OutputError
from terrain_forge.tiling.exchange import Exchange
from tests.unit.tiling.conftest import write_recipe
from tests.unit.tiling.test_building import contents

fsspec = pytest.importorskip("fsspec")
distributed = pytest.importorskip("distributed")


@pytest.fixture
def site(recipe):
    """The planned recipe of the site."""
    return tf.load_recipe(recipe).recipe


@pytest.fixture
def store():
    """An empty store in this process's memory."""
    files = fsspec.filesystem("memory")
    yield files
    files.store.clear()


@pytest.fixture
def scheduler():
    """A cluster of one thread of this process."""
    options = {"n_workers": 1, "threads_per_worker": 1, "processes": False, "memory_limit": 0}
    with distributed.LocalCluster(**options, dashboard_address=":0") as cluster:
        yield cluster.scheduler_address


@pytest.mark.slow
def test_other_processes_make_the_same_bytes_and_leave_nothing(built, site, tmp_path):
    there = tmp_path / "store"
    there.mkdir()
    options = {"n_workers": 2, "threads_per_worker": 2, "memory_limit": 0}
    with distributed.LocalCluster(**options, dashboard_address=":0") as cluster:
        given = {"scheduler": cluster.scheduler_address, "exchange": there.as_uri()}
        result = tf.build(site, tmp_path / "six", **given)
    assert (result.tiles, result.made) == (6, 6)
    assert contents(tmp_path / "six") == contents(built)
    assert not list(there.iterdir())


@pytest.mark.slow
def test_a_tile_that_is_damaged_on_its_way_is_named_and_made_again(
    built, site, store, scheduler, tmp_path, monkeypatch
):
    put = Exchange.put

    def harm(self, file):
        put(self, file)
        if file.name == "4.tar":
            path = f"{self.url.removeprefix('memory:/')}-4.tar"
            content = bytearray(store.cat(path))
            content[len(content) // 2] ^= 1
            store.pipe(path, bytes(content))

    out, address = tmp_path / "six", "memory://tiles"
    with monkeypatch.context() as context:
        context.setattr(Exchange, "put", harm)
        with pytest.raises(OutputError, match=r"tiles/001/001: .*4\.tar is not what its worker"):
            tf.build(site, out, scheduler=scheduler, exchange=address)
    assert len(list(out.glob("tiles/*/*/tile.json"))) == 5
    assert not (out / "tiles/001/001").exists()
    assert not store.find("/tiles")
    result = tf.build(site, out, scheduler=scheduler, exchange=address)
    assert result.made == 1
    assert contents(out) == contents(built)


@pytest.mark.slow
def test_an_interrupted_build_goes_on(built, site, store, scheduler, tmp_path):
    out, address = tmp_path / "six", "memory://tiles"

    def interrupt(stage, share=None):
        if len(list(out.glob("tiles/*/*/tile.json"))) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt, match=r"^2 of 6 tiles are in .* goes on"):
        tf.build(site, out, scheduler=scheduler, exchange=address, progress=interrupt)
    assert not store.find("/tiles")
    result = tf.build(site, out, scheduler=scheduler, exchange=address)
    assert result.made == 4
    assert contents(out) == contents(built)


def test_a_store_that_cannot_be_used_is_told_before_any_tile(site, scheduler, tmp_path):
    for address, why in (("nosuch://tiles", "Protocol not known"), (f"file://{tmp_path}/no", "")):
        with pytest.raises(OutputError, match=rf"the exchange {address}/\S+ cannot be used: {why}"):
            tf.build(site, tmp_path / "six", scheduler=scheduler, exchange=address)
        assert not (tmp_path / "six").exists(), "another recipe may go there"


def test_an_exchange_is_for_sites_in_tiles(scheduler, tmp_path):
    recipe = tf.load_recipe(write_recipe(tmp_path, **{"tiles: {size_m: 20}": ""})).recipe
    with pytest.raises(OutputError, match="are for sites in tiles"):
        tf.build(recipe, tmp_path / "one", scheduler=scheduler, exchange="memory://tiles")
    with pytest.raises(OutputError, match="is for the workers of a --scheduler"):
        tf.build(recipe, tmp_path / "one", exchange="memory://tiles")
