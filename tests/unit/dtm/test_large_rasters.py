"""Rasters that are larger than memory: only what a site needs of them is read."""

from __future__ import annotations

import hashlib
import resource
import subprocess
import sys

import pytest
import rasterio
from rasterio.transform import Affine
from rasterio.windows import Window as RasterWindow

from terrain_forge.making import plan as planned
from terrain_forge.recipe import Recipe, TerrainSpec, inputs
from tests.helpers.rasters import EQC, SPEC, plan, rough, words


def sparse(path, *, size, written, offset):
    """A tiled raster of metres of which only a piece was ever written."""
    with rasterio.open(
        path, "w", driver="GTiff", count=1, dtype="float32", crs=EQC, height=size, width=size,
        transform=Affine(1.0, 0.0, -0.5 * size, 0.0, -1.0, 0.5 * size), tiled=True,
        blockxsize=256, blockysize=256, SPARSE_OK=True, BIGTIFF="YES", nodata=0.0,
    ) as file:  # fmt: skip
        file.write(written, 1, window=RasterWindow(offset, offset, *written.shape[::-1]))


def test_a_dtm_of_forty_gigabytes_costs_its_crop(tmp_path):
    """A sparse file: what was never written takes no space, but would if it were read."""
    heights = 5.0 + rough((1024, 1024)).astype("float32")
    sparse(tmp_path / "dtm.tif", size=100_000, written=heights, offset=49_500)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    site, _ = plan(tmp_path)
    text = words(tmp_path)
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    assert site.dtm.heights.shape == (256, 256)
    assert grown < 400_000  # KiB, of 40 million
    assert "in the pieces looked at" in text


@pytest.mark.slow
def test_planning_on_a_huge_raster_needs_little(tmp_path):
    """160 GB of heights, planned after a small raster in a process of its own."""
    heights = 5.0 + rough((1024, 1024)).astype("float32")
    sparse(tmp_path / "huge.tif", size=200_000, written=heights, offset=99_488)
    sparse(tmp_path / "small.tif", size=1024, written=heights, offset=0)
    program = (
        "import resource, terrain_forge as tf\n"
        "from terrain_forge.dtm.spec import RasterDtm\n"
        "from terrain_forge.recipe.schema import TerrainSpec\n"
        "for name in ('small.tif', 'huge.tif'):\n"
        "    dtm = RasterDtm(source=name, size_m=(100.0, 60.0))\n"
        "    terrain = TerrainSpec(spacing_m=0.5)\n"
        "    tf.plan(tf.Recipe(name='a', body='mars', exports=(), dtm=dtm, terrain=terrain))\n"
        "    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    before, after = (int(line) for line in done.stdout.split())
    assert after - before < 250_000  # KiB


def test_large_inputs_are_told_by_a_part_of_them(tmp_path, monkeypatch):
    heights = 5.0 + rough((1024, 1024)).astype("float32")
    sparse(tmp_path / "dtm.tif", size=4096, written=heights, offset=1536)
    recipe = Recipe(
        name="part", body="mars", dtm=SPEC, terrain=TerrainSpec(spacing_m=1.0), exports=()
    )
    small = dict(planned(recipe, folder=tmp_path).inputs)["dtm.tif"]
    assert small == hashlib.sha256((tmp_path / "dtm.tif").read_bytes()).hexdigest()
    monkeypatch.setattr(inputs, "WHOLE_BYTES", 2**20)
    first = dict(planned(recipe, folder=tmp_path).inputs)["dtm.tif"]
    assert first.startswith("pieces:")
    assert dict(planned(recipe, folder=tmp_path).inputs)["dtm.tif"] == first
    with rasterio.open(tmp_path / "dtm.tif", "r+") as file:
        middle = RasterWindow(2048, 2048, 1, 1)
        file.write(file.read(1, window=middle) + 1.0, 1, window=middle)
    assert dict(planned(recipe, folder=tmp_path).inputs)["dtm.tif"] != first


def test_pieces_of_a_large_file_reach_from_end_to_end(tmp_path):
    path = tmp_path / "large.bin"
    with path.open("wb") as file:
        file.truncate(inputs.WHOLE_BYTES + 12_345)  # takes no space
    empty = inputs.fingerprint(path)
    for place in (0, path.stat().st_size - 1):
        with path.open("r+b") as file:
            file.seek(place)
            file.write(b"x")
        changed = inputs.fingerprint(path)
        assert changed != empty
        empty = changed
    assert inputs.fingerprint(path, used=b"1") != inputs.fingerprint(path)
