"""A site in tiles: the same as one world, resumed, refused."""

from __future__ import annotations

import csv
import errno
import json
import os
import re
import shutil
import signal
from contextlib import suppress
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import rasterio
from pxr import Usd, UsdGeom

import terrain_forge as tf
from terrain_forge.base import OutputError, RecipeError, StorageError
from terrain_forge.building.manifest import LOCK, MARK
from terrain_forge.model import RockLibrary
from terrain_forge.rocks import LibrarySpec, find_library
from terrain_forge.tiling.making import make_tile, placing
from terrain_forge.tiling.order import PLANNED, STAGING, load_order
from terrain_forge.truth import rock_rasters
from terrain_forge.truth.traversability import write_traversability
from tests.helpers import command_line as command
from tests.unit.tiling.conftest import write_recipe


def contents(out: Path) -> dict[str, str]:
    """Hashes of a site's files but those of how long it took."""
    return {
        path.relative_to(out).as_posix(): sha256(path.read_bytes()).hexdigest()
        for path in out.rglob("*")
        if path.is_file() and path.name != "timings.json"
    }


def rocks_in(out: Path) -> list[dict[str, str]]:
    tables = sorted(out.glob("tiles/*/*/truth/rocks.csv"))
    assert len(tables) == 6
    return [row for path in tables for row in csv.DictReader(path.read_text().splitlines())]


@pytest.mark.slow
def test_rasters_of_all_tiles_are_those_of_one_world(built, whole):
    for name, wanted in (
        ("elevation", whole.ground.elevation),
        ("surface_with_rocks", rock_rasters(whole)[0]),
        ("rock_id", rock_rasters(whole)[1]),
    ):
        with rasterio.open(built / "geotiff" / f"{name}.vrt") as raster:
            assert np.array_equal(raster.read(1)[::-1], wanted)
            with rasterio.open(built / f"tiles/000/000/geotiff/{name}.tif") as tile:
                assert tile.crs == raster.crs
                assert tile.shape == (80, 80)
            assert raster.xy(raster.height - 1, 0) == pytest.approx((-25.0, -20.0))


def test_the_whole_rasters_say_of_themselves_what_their_tiles_do(built):
    names = [path.stem for path in (built / "geotiff").glob("*.vrt")]
    assert len(names) == 6
    for name in names:
        with (
            rasterio.open(built / f"tiles/000/001/geotiff/{name}.tif") as tile,
            rasterio.open(built / f"geotiff/{name}.vrt") as whole,
            rasterio.open(built / f"geotiff/{name}_overview.tif") as overview,
        ):
            assert tile.descriptions[0]
            for raster in (whole, overview):
                for told in ("descriptions", "units", "nodata", "colorinterp", "dtypes"):
                    assert getattr(raster, told) == getattr(tile, told), (name, told)
                ours = {k: v for k, v in tile.tags().items() if k.startswith("TERRAIN_FORGE_")}
                assert ours["TERRAIN_FORGE_SITE"] == "six"
                assert ours.items() <= raster.tags().items()


def test_virtual_rasters_hold_the_statistics_of_their_bands(built):
    """Or GDAL writes them into the VRT and beside each tile when QGIS shows it."""
    paths = sorted(built.glob("*/*.vrt"))
    assert len(paths) > 10
    for path in paths:
        with rasterio.open(path) as raster:
            for band, values in enumerate(raster.read(masked=True), start=1):
                told = {key: float(value) for key, value in raster.tags(band).items()}
                assert told["STATISTICS_MINIMUM"] == values.min()
                assert told["STATISTICS_MAXIMUM"] == values.max()
                assert told["STATISTICS_MEAN"] == pytest.approx(values.mean(dtype=float))
                assert told["STATISTICS_STDDEV"] == pytest.approx(values.std(dtype=float))
                share = 100.0 * values.count() / values.size
                assert told["STATISTICS_VALID_PERCENT"] == pytest.approx(share)


def test_traversability_of_all_tiles_is_that_of_one_world(built, whole, tmp_path):
    write_traversability(whole, tmp_path)
    for name in ("slope", "step", "cost"):
        with rasterio.open(tmp_path / f"{name}.tif") as raster:
            wanted = raster.read(1)[::-1]
        assert len(np.unique(wanted)) > 100
        for path in sorted(built.glob(f"tiles/*/*/truth/{name}.tif")):
            row, column = (int(part) for part in path.parts[-4:-2])
            with rasterio.open(path) as raster:
                found = raster.read(1)[::-1]
            here = wanted[80 * row :, 80 * column :]
            assert np.array_equal(found, here[: found.shape[0], : found.shape[1]])


def test_materials_of_all_tiles_are_those_of_one_world(built, whole):
    wanted = whole.appearance.material
    assert 0.2 < (wanted == 1).mean() < 0.6
    for path in sorted(built.glob("tiles/*/*/truth/material.tif")):
        row, column = (int(part) for part in path.parts[-4:-2])
        with rasterio.open(path) as raster:
            found = raster.read(1)[::-1]
            assert "sand" in raster.tags().values()
        here = wanted[80 * row :, 80 * column :]
        assert np.array_equal(found, here[: found.shape[0], : found.shape[1]])
    stage = Usd.Stage.Open(str(next(built.glob("tiles/000/000/usd/ground_full.usdc"))))
    parts = [prim for prim in stage.Traverse() if prim.IsA(UsdGeom.Subset)]
    sand = [UsdGeom.Subset(one) for one in parts if one.GetName().startswith("material")]
    faces = [len(one.GetIndicesAttr().Get()) for one in sand]
    assert faces == [2 * (wanted[:80, :80] == 1).sum()]


def test_normals_do_not_know_of_tiles(built, whole):
    """Slopes come from neighbouring nodes, which for a border's lie in the next tile."""
    from terrain_forge.geometry import grid_normals

    up = grid_normals(whole.ground, whole.ground).reshape(*whole.ground.shape, 3)[..., 2]
    with rasterio.open(built / "geotiff/slope.vrt") as raster:
        assert np.allclose(raster.read(1)[::-1], np.degrees(np.arccos(up)), atol=0.05)


def test_each_rock_is_in_one_tile(built, whole):
    rocks = rocks_in(built)
    assert sorted(int(rock["id"]) for rock in rocks) == whole.field.id.tolist()
    heights = {int(rock["id"]): rock["z_m"] for rock in rocks}
    assert [heights[n] for n in whole.field.id.tolist()] == [
        f"{z:.7f}" for z in whole.field.position[:, 2]
    ]


def test_counts_are_those_of_the_whole(built, whole):
    from terrain_forge.truth.size_frequency import size_frequency

    merged = json.loads((built / "truth/size_frequency.json").read_text())
    one = size_frequency(whole)
    mine, wanted = merged["populations"][0], one["populations"][0]
    assert mine["count"] == pytest.approx(wanted["count"])
    assert mine["cover"] == pytest.approx(wanted["cover"])
    assert merged["overlaps"]["pairs"] == one["overlaps"]["pairs"] == 0
    apart = wanted["kolmogorov_smirnov"]["distance"] - mine["kolmogorov_smirnov"]["distance"]
    assert 0.0 <= apart <= mine["kolmogorov_smirnov"]["largest_class"]


def test_order_and_workers_change_no_byte_and_a_build_goes_on(built, recipe, tmp_path):
    out = tmp_path / "six"
    shutil.copytree(built, out)
    for path in ("manifest.json", "geotiff", "tiles/001/002"):
        place = out / path
        shutil.rmtree(place) if place.is_dir() else place.unlink()
    (out / ".terrain-forge").mkdir()
    (out / ".terrain-forge/lock").write_bytes(b"a terrain-forge is or was at work here\n")
    (out / ".terrain-forge/3-host-1").mkdir()
    (out / ".terrain-forge/3-host-1/half").write_text("of a killed worker")
    (out / "notes.txt").write_text("a user's")
    result = tf.build(tf.load_recipe(recipe).recipe, out, workers=1)
    assert (result.tiles, result.made) == (6, 1)
    assert (out / "notes.txt").read_text() == "a user's"
    (out / "notes.txt").unlink()
    assert contents(out) == contents(built)


@pytest.mark.slow
def test_a_dask_cluster_that_loses_a_worker_makes_the_same_bytes(built, recipe, tmp_path):
    distributed = pytest.importorskip("distributed")
    out, killed = tmp_path / "six", list[int]()
    options = {"n_workers": 2, "threads_per_worker": 1, "memory_limit": 0}
    with distributed.LocalCluster(**options, dashboard_address=":0") as cluster:

        def kill(stage, share=None):
            """One of the workers, once the first tile is there; the cluster starts another."""
            if not killed and list(out.glob("tiles/*/*/tile.json")):
                killed.append(next(iter(cluster.workers.values())).pid)
                os.kill(killed[0], signal.SIGKILL)

        given = tf.load_recipe(recipe).recipe
        result = tf.build(given, out, scheduler=cluster.scheduler_address, progress=kill)
    assert killed
    assert result.made == 6
    assert contents(out) == contents(built)


def test_a_worker_whose_build_has_ended_leaves_nothing_in_the_way(built, recipe, tmp_path):
    out = tmp_path / "six"
    shutil.copytree(built, out)
    shutil.rmtree(out / "tiles/001/001")
    with pytest.raises(StorageError, match="No such file"):
        make_tile(str(out), 4)
    assert not (out / STAGING).exists()
    (out / STAGING).mkdir()
    with suppress(StorageError), placing(load_order(out), 4) as fresh:
        (out / STAGING).rename(tmp_path / "gone")  # the build ends
        (fresh / "glb").mkdir(parents=True)
    assert not (out / STAGING).exists()
    assert not (out / "tiles/001/001").exists()
    result = tf.build(tf.load_recipe(recipe).recipe, out, workers=0)
    assert result.made == 1
    assert contents(out) == contents(built)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"seed: 7": "seed: 8"}, r"another recipe \(seed: 7, not 8\)"),
        ({"size_m: 20": "size_m: 10"}, "holds tiles of 80 cells, this recipe makes tiles of 40"),
        ({"[geotiff, usd, glb, sdf]": "[usd]"}, "other exports"),
    ],
)
def test_tiles_of_another_recipe_stay(built, tmp_path, changes, message):
    before = contents(built)
    recipe = tf.load_recipe(write_recipe(tmp_path, **changes)).recipe
    with pytest.raises(OutputError, match=message):
        tf.build(recipe, built)
    assert contents(built) == before


def test_tiles_whose_order_was_damaged_stay(built, tmp_path):
    recipe = tf.load_recipe(write_recipe(tmp_path)).recipe
    order = json.loads((built / "site/order.json").read_text())
    order["exports"] = [{"Wolder": "usd"}, 3]
    (tmp_path / "out/site").mkdir(parents=True)
    (tmp_path / "out/site/order.json").write_text(json.dumps(order))
    with pytest.raises(OutputError, match=r"tiles with other exports: \?, 3, not "):
        tf.build(recipe, tmp_path / "out")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"size_m: 20": "size_m: 20.1"}, "20.1 m is not a whole number"),
        ({"size_m: 20": "size_m: 1"}, "tiles of 1 m are smaller than the ground that a rock"),
        ({"[geotiff, usd, glb, sdf]": "[mjcf]"}, "mjcf is not written tile by tile"),
        (
            {"tiles:": "validate: {drives: 3}\ntiles:"},
            "from random starts are for one world",
        ),
    ],
)
def test_what_cannot_be_is_told_before_anything_is_written(tmp_path, changes, message):
    recipe = tf.load_recipe(write_recipe(tmp_path, **changes)).recipe
    with pytest.raises(RecipeError, match=message):
        list(tf.check(recipe))
    with pytest.raises(RecipeError, match=message):
        tf.build(recipe, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_check_makes_no_library_of_a_thousand_shapes(tmp_path, monkeypatch):
    asked: list[int] = []

    def noted(spec: LibrarySpec, **more: Any) -> RockLibrary:
        asked.append(spec.shapes)
        return find_library(replace(spec, shapes=1), **more)

    recipe = tf.load_recipe(write_recipe(tmp_path, **{"shapes: 4": "shapes: 1000"})).recipe
    assert recipe.rocks.library.shapes == 1000
    monkeypatch.setattr("terrain_forge.tiling.order.find_library", noted)
    list(tf.check(recipe))
    assert asked == [64]


def test_a_folder_of_others_is_left_alone(recipe, tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/thesis.txt").write_text("years")
    with pytest.raises(OutputError, match="not a terrain-forge world"):
        tf.build(tf.load_recipe(recipe).recipe, tmp_path / "mine")
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["thesis.txt"]


def test_a_site_is_begun_wholly_or_not_at_all(recipe, tmp_path, monkeypatch):
    def full(*given: object) -> None:
        raise OSError(errno.EFBIG, os.strerror(errno.EFBIG))

    made, out = tf.load_recipe(recipe).recipe, tmp_path / "new/six"
    monkeypatch.setattr("terrain_forge.tiling.order.write_through", full)
    with pytest.raises(StorageError, match=f"{out} cannot be written: File too large"):
        tf.build(made, out)
    assert not (tmp_path / "new").exists()
    monkeypatch.undo()
    left = out / ".terrain-forge"  # as one leaves it that is killed while it writes the order
    (left / "site").mkdir(parents=True)
    (left / "site/site.json").write_text("{")
    (left / LOCK).write_bytes(MARK)
    monkeypatch.setattr("terrain_forge.tiling.building.begin_site", full)
    with pytest.raises(StorageError, match="File too large"):
        tf.build(made, out)
    assert sorted(path.name for path in (out / "site").iterdir()) == sorted(PLANNED)
    assert [path.name for path in out.iterdir()] == ["site"]


@pytest.mark.parametrize("name", ["geotiff/slope.vrt", "truth", "report.html", "tiles/001"])
@pytest.mark.parametrize("pipe", [False, True])
def test_links_and_pipes_are_not_written_to(built, recipe, tmp_path, name, pipe):
    out = shutil.copytree(built, tmp_path / "six")
    mine = tmp_path / "mine"
    mine.write_text("precious")
    shutil.rmtree(out / name) if (out / name).is_dir() else (out / name).unlink()
    os.mkfifo(out / name) if pipe else (out / name).symlink_to(mine)
    for done in (command.run("build", recipe, "-o", out), command.run("validate", out)):
        assert done.returncode == 2
        assert f"{out / name} is {'no regular file' if pipe else 'a link'}" in done.complaints[-1]
    assert mine.read_text() == "precious"


@pytest.mark.slow
def test_tiles_that_fail_are_named_and_the_others_whole(built, recipe, tmp_path):
    out = tmp_path / "six"
    shutil.copytree(built, out)
    shutil.rmtree(out / "tiles/001")
    (out / "tiles/001").write_text("where a folder should be")
    with pytest.raises(StorageError, match=r"3 tiles failed twice, tiles/001/000, tiles/001/001"):
        tf.build(tf.load_recipe(recipe).recipe, out, workers=0)
    assert (out / "tiles/001").read_text() == "where a folder should be"
    assert (out / "tiles/000/000/tile.json").is_file()


def test_workers_are_for_tiles(tmp_path):
    path = write_recipe(tmp_path, **{"tiles: {size_m: 20}": ""})
    done = command.run("build", path, "-o", tmp_path / "out", "--workers", 2)
    assert done.returncode == 2
    assert "for sites in tiles: add `tiles: {}`" in done.stderr


def test_a_tile_without_its_list_is_named_and_left(built, recipe, tmp_path):
    out = shutil.copytree(built, tmp_path / "six")
    (out / "tiles/000/001/tile.json").unlink()
    before = contents(out)
    with pytest.raises(OutputError, match=r"tiles/000/001 has no tile\.json.*: move it away"):
        tf.build(tf.load_recipe(recipe).recipe, out, workers=0)
    assert contents(out) == before


@pytest.mark.slow
def test_a_site_that_was_begun_when_fewer_versions_were_told_goes_on(built, recipe, tmp_path):
    out = shutil.copytree(built, tmp_path / "six")
    order = json.loads((out / "site/order.json").read_text())
    assert {"rasterio", "pillow", "usd-core"} <= {*order["made_by"]}
    del order["made_by"]["rasterio"]
    (out / "site/order.json").write_text(json.dumps(order))
    assert tf.build(tf.load_recipe(recipe).recipe, out, workers=0).made == 0
    order["made_by"]["pillow"] = "1.0"
    (out / "site/order.json").write_text(json.dumps(order))
    with pytest.raises(OutputError, match=r"was begun by .*pillow 1\.0, .*this is "):
        tf.build(tf.load_recipe(recipe).recipe, out, workers=0)


def test_truth_of_all_tiles_is_one_raster_each(built, whole):
    names = {path.stem for path in (built / "truth").glob("*.vrt")}
    assert {"surface_with_rocks", "rock_id", "material"} <= names
    assert names == {path.stem for path in (built / "tiles/000/000/truth").glob("*.tif")}
    top, ids = rock_rasters(whole)
    wanted = {"surface_with_rocks": top, "rock_id": ids, "material": whole.appearance.material}
    table = csv.DictReader((built / "truth/materials.csv").read_text().splitlines())
    shares = {row["name"]: float(row["share"]) for row in table}
    for name in sorted(names):
        with (
            rasterio.open(built / f"truth/{name}.vrt") as raster,
            rasterio.open(built / f"tiles/001/002/truth/{name}.tif") as tile,
        ):
            for told in ("descriptions", "units", "nodata", "colorinterp", "dtypes", "crs"):
                assert getattr(raster, told) == getattr(tile, told), (name, told)
            if name == "material":
                assert raster.colormap(1)[1] == tile.colormap(1)[1]
                vrt = ElementTree.parse(built / "truth/material.vrt")
                assert [one.text for one in vrt.iter("Category")] == list(shares)
                assert len(list(vrt.iter("Entry"))) == len(shares)
            if name in wanted:
                assert np.array_equal(raster.read(1)[::-1], wanted[name])
    assert shares["sand"] == pytest.approx((wanted["material"] == 1).mean(), abs=2e-6)
    assert sum(shares.values()) == pytest.approx(1.0, abs=1e-5)


def test_check_says_how_large_a_site_of_small_tiles_becomes(built, recipe):
    told = next(line for line in tf.check(recipe) if line.startswith("cost"))
    size = sum(path.stat().st_size for path in built.rglob("*") if path.is_file())
    expected = 1e9 * float(re.search(r"(\S+) GB on disk", told)[1])
    assert 1 / 1.5 < expected / size < 1.5
