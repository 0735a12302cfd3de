"""Maps against a world: closed forms of the landing site's score, and files of every kind."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest
import rasterio
from scipy.spatial.transform import Rotation

from terrain_forge.base import DataError, OutputError
from terrain_forge.evaluation import (
    MapPoints,
    ScoreOptions,
    find_system,
    map_rows,
    read_map,
    score_map,
    site_grid,
)
from terrain_forge.evaluation.map_tables import kept_maps, score_maps, write_maps
from terrain_forge.report import evaluate
from tests.helpers import worlds
from tests.helpers.command_line import run
from tests.helpers.recordings import write_recording

AREA = (-3.0, -2.25, 3.0, 2.25)


@pytest.fixture(scope="module")
def world():
    return worlds.world()


@pytest.fixture(scope="module")
def grid(world):
    return site_grid(world, area=AREA)


def _whole(grid, lift=0.0):
    """The grid as a map that knows all."""
    rows, columns = grid.rock.shape
    east = grid.area[0] + grid.cell * (np.arange(columns) + 0.5)
    north = grid.area[1] + grid.cell * (np.arange(rows) + 0.5)
    x, y = np.meshgrid(east, north)
    position = np.stack([x, y, grid.height + lift], axis=-1).reshape(-1, 3)
    return MapPoints(name="whole", position=position, rock=grid.rock.ravel())


def test_true_cells_are_means_of_ground_and_rocks(world, grid):
    assert grid.rock.shape == (30, 40)
    assert 0 < grid.rock.sum() < grid.rock.size / 2
    within = 0.15 * (np.arange(4) + 0.5) / 4
    free = np.argwhere(~grid.rock)[::37]
    for row, column in free:
        x, y = np.meshgrid(AREA[0] + 0.15 * column + within, AREA[1] + 0.15 * row + within)
        assert grid.height[row, column] == pytest.approx(
            world.ground.height_at(x, y).mean(), abs=1e-5
        )
    for place, height in zip(world.field.position, world.field.height, strict=True):
        column, row = np.floor((place[:2] - AREA[:2]) / 0.15).astype(int)
        if 0 <= row < 30 and 0 <= column < 40:
            assert grid.rock[row, column]
            assert height > 0.0


def test_a_map_that_knows_all_has_all_points(world, grid):
    score = score_map(world, _whole(grid), grid)
    assert (score.mapped, score.right, score.f1) == (1.0, 1.0, 1.0)
    assert score.challenge == (300.0, 300.0)
    assert score.cell_errors.most == 0.0
    assert score_map(world, _whole(grid, 0.049), grid).right == 1.0
    off = score_map(world, _whole(grid, 0.051), grid)
    assert off.right == 0.0
    assert off.bias == pytest.approx(0.051, abs=0.01)


def test_what_was_not_mapped_is_wrong_and_flags_are_judged_by_f1(world, grid):
    whole = _whole(grid)
    west = whole.position[:, 0] < 0.0
    half = MapPoints(name="half", position=whole.position[west], rock=whole.rock[west])
    score = score_map(world, half, grid)
    assert score.mapped == score.right == 0.5
    there = int((whole.rock & west).sum())
    recall = there / int(whole.rock.sum())
    assert (score.precision, score.recall) == (1.0, pytest.approx(recall))
    assert score.f1 == pytest.approx(2 * recall / (1 + recall))
    blind = MapPoints(name="blind", position=whole.position, rock=np.zeros(len(west), bool))
    assert (score_map(world, blind, grid).f1, score_map(world, blind, grid).precision) == (0, None)
    plain = MapPoints(name="plain", position=whole.position)
    assert score_map(world, plain, grid).f1 is None
    assert map_rows([score_map(world, plain, grid)])[1][-1] == ""


def test_points_over_rocks_say_nothing_of_the_ground(world, grid):
    whole = _whole(grid)
    lifted = whole.position + np.where(grid.rock.ravel(), 5.0, 0.0)[:, None] * (0, 0, 1)
    score = score_map(world, MapPoints(name="m", position=lifted), grid)
    assert score.vertical.most < 0.03
    assert score.on_rocks == score.rocks == grid.rock.sum()
    assert score.right == pytest.approx(1.0 - grid.rock.mean())


def test_a_systems_map_is_laid_as_its_trajectory_was(world, grid, tmp_path, caplog):
    motion = np.eye(4)
    motion[:3, :3] = 1.25 * Rotation.from_euler("xyz", [0.1, 0.2, 2.0]).as_matrix()
    motion[:3, 3] = 3.0, -4.0, 5.0
    back = np.linalg.inv(motion)
    own = _whole(grid).moved(back)
    np.save(tmp_path / "own.npy", np.column_stack([own.position, own.rock]))
    told = [{"system": "mine", "score": {"alignment": motion.ravel().tolist()}},
            {"system": "lost", "score": None}]  # fmt: skip
    (tmp_path / "evaluation.json").write_text(json.dumps(told))
    given = {"evaluated": tmp_path, "area": AREA}
    (score,) = score_maps(world, [f"mine={tmp_path}/own.npy"], **given)
    assert (score.name, score.right, score.f1) == ("mine: own", 1.0, 1.0)
    with pytest.raises(DataError, match=r"lost has no score here.*there are: mine"):
        score_maps(world, [f"lost={tmp_path}/own.npy"], **given)
    (other,) = score_maps(world, [f"lost={tmp_path}/own.npy", f"mine={tmp_path}/own.npy"], **given)
    assert other == score  # one that cannot be laid does not stop the others
    assert "a map is not scored: " in caplog.text
    assert "lost has no score here" in caplog.text
    with pytest.raises(DataError, match="must be west, south, east, north within the site"):
        score_maps(world, [f"{tmp_path}/own.npy"], area=(0, 0, 1e4, 1))
    with pytest.raises(DataError, match="cells of 0 m"):
        score_maps(world, [f"{tmp_path}/own.npy"], cell=0.0)


def _ply(path, table, form):
    kinds = [("x", "f8"), ("y", "f8"), ("n", "u1"), ("z", "f4"), ("rock", "u1")]
    properties = "property double x\nproperty double y\nproperty uchar n\nproperty float z\n"
    head = f"ply\nformat {form} 1.0\nelement vertex {len(table)}\n{properties}property uchar rock\n"
    rows = [(x, y, 7, z, r) for x, y, z, r in table]
    content = "".join(" ".join(map(repr, map(float, row))) + "\n" for row in rows).encode()
    if form != "ascii":
        order = "<" if "little" in form else ">"
        kind = np.dtype([(name, order + kind) for name, kind in kinds])
        content = np.array(rows, kind).tobytes()
    path.write_bytes(head.encode() + b"end_header\n" + content)


def _pcd(path, table, form):
    head = (
        "VERSION .7\nFIELDS x y z rgb rock\nSIZE 4 4 4 1 1\nTYPE F F F U U\nCOUNT 1 1 1 3 1\n"
        f"WIDTH {len(table)}\nHEIGHT 1\nPOINTS {len(table)}\nDATA {form}\n"
    )
    rows = [(x, y, z, 1, 2, 3, r) for x, y, z, r in table]
    content = "".join(" ".join(map(repr, map(float, row))) + "\n" for row in rows).encode()
    if form == "binary":
        names = [*((n, "<f4") for n in "xyz"), *((n, "u1") for n in ("r", "g", "b", "rock"))]
        content = np.array(rows, names).tobytes()
    path.write_bytes(head.encode() + content)


def test_files_of_every_kind_say_the_same(tmp_path):
    table = np.array(
        [[0.5, 1.5, 2.25, 1], [1.5, 1.5, -3.5, 0], [0.5, 0.5, 4.0, 0], [1.5, 0.5, 0.5, 1]]
    )
    np.save(tmp_path / "a.npy", table)
    square = np.vstack([table[:2], table[2:]]).reshape(2, 2, 4)
    square[0, 1, 2] = -np.inf  # as the challenge's maps have cells that were not mapped
    np.save(tmp_path / "square.npy", square)
    (tmp_path / "t.csv").write_text("x,y,z,rock\n" + "".join(
        ",".join(map(str, row)) + "\n" for row in table.tolist()))  # fmt: skip
    for form in ("ascii", "binary_little_endian", "binary_big_endian"):
        _ply(tmp_path / f"{form}.ply", table, form)
    for form in ("ascii", "binary"):
        _pcd(tmp_path / f"{form}.pcd", table, form)
    transform = rasterio.transform.from_origin(0.0, 2.0, 1.0, 1.0)
    with rasterio.open(tmp_path / "g.tif", "w", width=2, height=2, count=2, dtype="float32",
                       transform=transform) as raster:  # fmt: skip
        raster.write(table[:, 2].reshape(2, 2), 1)
        raster.write(table[:, 3].reshape(2, 2), 2)
    files = [p for p in sorted(tmp_path.iterdir()) if p.name != "square.npy"]
    assert len(files) == 8
    for file in files:
        found = read_map(file)
        np.testing.assert_allclose(found.position, table[:, :3], err_msg=file.name)
        assert found.rock.tolist() == [True, False, False, True], file.name
    assert len(read_map(tmp_path / "square.npy").position) == 3


def test_a_raster_of_scaled_numbers_has_heights_in_metres(tmp_path):
    transform = rasterio.transform.from_origin(0.0, 2.0, 1.0, 1.0)
    with rasterio.open(tmp_path / "g.tif", "w", width=2, height=2, count=2, dtype="int16",
                       nodata=999, transform=transform) as raster:  # fmt: skip
        raster.write(np.array([[150, 999], [-20, 0]]), 1)
        raster.write(np.array([[999, 1], [0, 1]]), 2)
        raster.scales, raster.offsets = (0.01, 1.0), (10.0, 0.0)
    found = read_map(tmp_path / "g.tif")
    np.testing.assert_allclose(found.position[:, 2], (11.5, 9.8, 10.0))
    assert found.rock.tolist() == [False, False, True]


WORLD = "+proj=tmerc +lat_0=0 +lon_0=20 +R=1737400"
DEGREE = np.pi * 1737400.0 / 180.0


@pytest.mark.parametrize(
    ("crs", "west", "north", "step"),
    [
        ("+proj=longlat +R=1737400", 20.0 - 1.0 / DEGREE, 2.0 / DEGREE, 1.0 / DEGREE),
        ("+proj=eqc +lon_0=0 +R=1737400", 20.0 * DEGREE - 1.0, 2.0, 1.0),
        (WORLD, -1.0, 2.0, 1.0),
        ('LOCAL_CS["map",UNIT["metre",1]]', -1.0, 2.0, 1.0),
        (None, -1.0, 2.0, 1.0),
    ],
)
def test_a_raster_lies_where_its_crs_says(tmp_path, crs, west, north, step):
    """Two pixels of a metre each way, whose middle is 1 m north of the world's."""
    transform = rasterio.transform.from_origin(west, north, step, step)
    with rasterio.open(tmp_path / "g.tif", "w", width=2, height=2, count=1, dtype="float32",
                       transform=transform, crs=crs) as raster:  # fmt: skip
        raster.write(np.arange(4.0).reshape(1, 2, 2))
    found = read_map(tmp_path / "g.tif", crs=rasterio.CRS.from_string(WORLD).to_wkt()).position
    np.testing.assert_allclose(found[:, 0], (-0.5, 0.5, -0.5, 0.5), atol=1e-4)
    np.testing.assert_allclose(found[:, 1], (1.5, 1.5, 0.5, 0.5), atol=1e-4)
    np.testing.assert_allclose(found[:, 2], range(4))


def test_a_raster_of_another_body_is_no_map(world, tmp_path):
    transform = rasterio.transform.from_origin(-3.0, 2.25, 0.15, 0.15)
    with rasterio.open(tmp_path / "g.tif", "w", width=40, height=30, count=1, dtype="float32",
                       transform=transform, crs="EPSG:32633") as raster:  # fmt: skip
        raster.write(np.zeros((1, 30, 40)))
    placed = world.replace(site=world.site.replace(crs=rasterio.CRS.from_string(WORLD).to_wkt()))
    with pytest.raises(DataError, match="body of 6378 km radius, the world on one of 1737 km"):
        score_maps(placed, [f"{tmp_path}/g.tif"], area=AREA)


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("a.obj", b"", r"must end in .ply, .pcd"),
        ("a.ply", b"plx", "is no PLY"),
        ("a.ply", b"ply\nformat binary_little_endian 1.0\nelement vertex 9\nproperty float x\n"
                  b"property float y\nproperty float z\nend_header\n123", "ends before its 9"),
        ("b.ply", b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n",
                  "have no y, only x"),
        ("c.ply", b"ply\nformat ascii 1.0\nelement vertex 1\nproperty list uchar int x\n"
                  b"end_header\n", "is no number"),
        ("a.pcd", b"FIELDS x\nSIZE 4\nTYPE F\nPOINTS 1\nDATA binary_compressed\n",
                  "must be ascii or"),
        ("b.pcd", b"FIELDS x y z q\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 9999999\nPOINTS 1\n"
                  b"DATA ascii\n1 2 3 4\n", "a point has 10,000,002 numbers"),
        ("a.txt", b"1 2 3\n1 2\n", r"a.txt:2: 2 numbers, the first row 3"),
        ("b.txt", b"1 2 3\n1 2 x\n", r"b.txt:2: '1 2 x', must be numbers"),
        ("c.csv", b"x;y;z\n1;2;3\n", r"c.csv:2: '1;2;3', must be numbers"),
        ("c.txt", b"1 2 3 4 5\n", "has shape 1 x 5"),
        ("d.txt", b"nan 2 3\n", "holds no point"),
        ("a.npy", b"no", "a.npy"),
        ("a.tif", b"no", "a.tif"),
    ],
)  # fmt: skip
def test_what_is_no_map_is_refused(tmp_path, name, content, told):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(DataError, match=told):
        read_map(tmp_path / name)


@pytest.mark.parametrize("at", [100, 107])
def test_counts_of_a_las_beyond_its_file_are_refused(tmp_path, monkeypatch, at):
    laspy = pytest.importorskip("laspy")
    cloud = laspy.create()
    cloud.x = cloud.y = cloud.z = np.arange(5.0)
    cloud.write(tmp_path / "a.las")
    assert read_map(tmp_path / "a.las").position[:, 1] == pytest.approx(np.arange(5.0))
    monkeypatch.setattr("terrain_forge.evaluation.map_files.PATIENCE", (1.0, 1e6))
    content = bytearray((tmp_path / "a.las").read_bytes())
    content[at : at + 4] = b"\xff" * 4
    (tmp_path / "a.las").write_bytes(content)
    with pytest.raises(DataError, match=r"a\.las: laspy cannot read it|a\.las: is damaged"):
        read_map(tmp_path / "a.las")


def test_a_laz_that_ends_its_reader_is_refused(tmp_path):
    """A table of chunks that says it has four billion: the reader of LAZ aborts its process."""
    laspy = pytest.importorskip("laspy")
    cloud = laspy.create()
    cloud.x = cloud.y = cloud.z = np.arange(5000.0)
    cloud.write(tmp_path / "a.laz")
    assert len(read_map(tmp_path / "a.laz").position) == 5000
    content = bytearray((tmp_path / "a.laz").read_bytes())
    place = int.from_bytes(content[96:100], "little")
    table = int.from_bytes(content[place : place + 8], "little")
    content[table + 4 : table + 8] = b"\xff" * 4
    (tmp_path / "a.laz").write_bytes(content)
    with pytest.raises(DataError, match=r"a\.laz: laspy cannot read it"):
        read_map(tmp_path / "a.laz")


def test_a_raster_of_too_many_pixels_is_refused_unread(tmp_path):
    profile = {"driver": "GTiff", "dtype": "float32", "tiled": True, "SPARSE_OK": True}
    profile["transform"] = rasterio.Affine(0.1, 0, 0, 0, -0.1, 0)
    with rasterio.open(tmp_path / "a.tif", "w", width=9000, height=9000, count=1, **profile):
        pass
    with pytest.raises(DataError, match="9,000 x 9,000 pixels, at most"):
        read_map(tmp_path / "a.tif")


def test_the_command_scores_maps_of_a_built_world(world, grid, tmp_path):
    world.save(tmp_path / "out")
    whole = _whole(grid)
    np.save(tmp_path / "whole.npy", np.column_stack([whole.position, whole.rock]))
    area = ",".join(map(str, AREA))
    done = run("evaluate", tmp_path / "out", "--map", tmp_path / "whole.npy", f"--area={area}",
               "-o", tmp_path / "told")  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[1].split()[-2:] == ["300.0", "300.0"]
    told = json.loads((tmp_path / "told/maps.json").read_text())
    assert (told[0]["right"], told[0]["f1"]) == (1.0, 1.0)
    assert not (tmp_path / "out/dataset").exists()
    done = run("evaluate", tmp_path / "out", "--map", tmp_path / "none.npy",
               "--map", tmp_path / "whole.npy", f"--area={area}")  # fmt: skip
    assert (done.returncode, "none.npy" in done.stderr) == (2, True)
    assert len(done.stdout.splitlines()) == 2, "the other one is scored"
    done = run("evaluate", tmp_path / "out", "--map", tmp_path / "whole.npy", "--area=1,2")
    assert (done.returncode, "must be 4 numbers" in done.stderr) == (2, True)


def test_scores_of_other_maps_areas_and_cells_stay(world, grid, tmp_path):
    whole = _whole(grid)
    one, other = (score_map(world, dataclasses.replace(whole, name=n), grid) for n in "ab")
    assert write_maps([one, other], tmp_path)
    assert [kept.name for kept in kept_maps(tmp_path, [one])] == ["b"]
    finer = dataclasses.replace(one, cell=0.5 * one.cell)
    assert [kept.name for kept in kept_maps(tmp_path, [finer])] == ["a", "b"]
    (tmp_path / "maps.json").write_text("mine")
    with pytest.raises(OutputError, match="--force begins it anew"):
        kept_maps(tmp_path, [one])
    assert kept_maps(tmp_path, [one], force=True) == []


def test_the_command_scores_poses_of_kittis_format_with_stamps(tmp_path):
    time = 100.0 + np.arange(5.0)
    place = np.column_stack([np.arange(5.0), 0.0 * time, 0.0 * time])
    lines = [f"{t} {x} {y} {z} 0 0 0 1" for t, (x, y, z) in zip(time, place.tolist(), strict=True)]
    (tmp_path / "truth.tum").write_text("\n".join(lines) + "\n")
    rows = [f"1 0 0 {x} 0 1 0 {y} 0 0 1 {z}" for x, y, z in place[1:4].tolist()]
    (tmp_path / "mine.txt").write_text("\n".join(rows) + "\n")
    (tmp_path / "stamps.txt").write_text("101\n102\n103\n")
    words = ["evaluate", "--truth", tmp_path / "truth.tum", "--estimate", tmp_path / "mine.txt"]
    done = run(*words, "--stamps", tmp_path / "stamps.txt", "--set", "align=none")
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[1].split()[:3] == ["mine", "50", "0"]
    assert "must be 8" in run(*words).stderr
    words[2] = tmp_path / "poses.txt"
    rows = [f"1 0 0 {x} 0 1 0 {y + 10} 0 0 1 {z}" for x, y, z in place[1:4].tolist()]
    words[2].write_text("# of each frame\n" + "\n".join(rows) + "\n")
    done = run(*words, "--stamps", tmp_path / "stamps.txt", "--set", "align=none")
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[1].split()[:3] == ["mine", "100", "10"]


def test_a_system_may_make_a_map_which_is_kept_and_scored(world, tmp_path):
    out = tmp_path / "out"
    world.save(out)
    write_recording(out / "dataset")
    whole = _whole(site_grid(world))
    np.save(tmp_path / "whole.npy", np.column_stack([whole.position - (1.0, 2.0, 3.0), whole.rock]))
    (tmp_path / "mine.py").write_text(
        "import shutil, sys\n"
        "rows = [line.split() for line in open(f'{sys.argv[1]}/truth/cam0.tum')]\n"
        "with open(sys.argv[2], 'w') as file:\n"  # in a frame of its own, 1, 2, 3 m off
        "    for time, x, y, z, *turn in rows:\n"
        "        place = [float(x) - 1.0, float(y) - 2.0, float(z) - 3.0]\n"
        "        file.write(' '.join([time, *map(str, place), *turn]) + '\\n')\n"
        f"shutil.copy('{tmp_path}/whole.npy', 'last_map.npy')\n"
    )
    for name, pattern in (("mine", "last_*.npy"), ("none", "cloud.ply")):
        (tmp_path / f"{name}.yaml").write_text(
            f'command: "{{python}} {tmp_path}/mine.py {{input}} {{output}}"\n'
            f"frame: cam0\nmap: {pattern}\n"
        )
    systems = [find_system(str(tmp_path / f"{name}.yaml")) for name in ("mine", "none")]
    results = evaluate(out, systems, runs=2, options=ScoreOptions(align="all"))
    slam = out / "dataset" / "slam"
    assert results[1].run.map == slam / "mine_2" / "map.npy"
    assert results[1].run.map.is_file()
    assert [one.run.status for one in results] == ["done"] * 4
    assert results[2].run.why == "wrote no map (cloud.ply)"
    told = json.loads((slam / "maps.json").read_text())
    assert [one["name"] for one in told] == ["mine 1", "mine 2"]
    assert [one["right"] for one in told] == [1.0, 1.0]
