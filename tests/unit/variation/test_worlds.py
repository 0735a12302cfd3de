"""Many worlds of one recipe: the same bytes whoever makes them, killed or not; harder is harder."""

from __future__ import annotations

import csv
import json
import os
import shutil
import socket
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import terrain_forge as tf
from terrain_forge.building import holding, read_manifest
from terrain_forge.dtm import dtm_heights
from terrain_forge.model import exporter_names
from terrain_forge.pipeline import realise
from terrain_forge.variation import draw, drawing, make_grid, name_of, read_summary, worlds
from terrain_forge.variation.series import orders_of
from tests.helpers.command_line import run
from tests.helpers.places import ROOT
from tests.helpers.rasters import write_raster

RECIPE: dict[str, Any] = {
    "name": "many",
    "seed": 3,
    "body": "mars",
    "dtm": {"kind": "flat", "size_m": [8.0, 8.0]},
    "horizon": {"reach_m": 0},
    "terrain": {"spacing_m": 0.1, "layers": [{"kind": "fractal"}]},
    "rocks": {
        "library": {"shapes": 2},
        "populations": [
            {
                "name": "stones",
                "size_frequency": {"kind": "golombek", "k": 0.05},
                "diameter_m": [0.2, 0.8],
            }
        ],
    },
    "rover": "skid4",
    "exports": ["mjcf"],
    "worlds": {
        "count": 4,
        "difficulty": {},
        "vary": {"sun.elevation_deg": {"uniform": [10, 80]}},
    },
}


_SAMPLE = {
    "source": str(ROOT / "dtm_samples" / "gale_floor_synthetic.tif"),
    "size_m": [8.0, 8.0],
    "noise": "keep",
}


def recipe(folder: Path, change: Callable[[dict[str, Any]], object] | None = None) -> Path:
    plain = json.loads(json.dumps(RECIPE))
    if change:
        change(plain)
    path = folder / "many.yaml"
    path.write_text(json.dumps(plain), encoding="utf-8")
    return path


def contents(out: Path) -> dict[str, bytes]:
    """All files of all worlds; which of them are links to a shared one does not count."""
    files = (path for path in out.rglob("*") if path.is_file() and path.parent.name != "shared")
    return {path.relative_to(out).as_posix(): path.read_bytes() for path in files}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("worlds")
    return worlds(recipe(folder), folder / "out", workers=0).directory


@pytest.mark.slow
def test_a_dask_cluster_makes_the_same_bytes(made: Path, tmp_path: Path) -> None:
    """Two workers of a cluster that runs, given by its address; it runs on afterwards."""
    distributed: Any = pytest.importorskip("distributed")
    options = {"n_workers": 2, "threads_per_worker": 1, "memory_limit": 0}
    with distributed.LocalCluster(**options, dashboard_address=":0") as cluster:
        address = cluster.scheduler_address
        done = worlds(recipe(tmp_path), tmp_path / "out", scheduler=address)
        assert (done.made, done.failed) == (4, ())
        assert len(cluster.scheduler_info["workers"]) == 2
    assert contents(done.directory) == contents(made)


def test_a_scheduler_that_nobody_is_at_leaves_no_folder(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{taken.getsockname()[1]}"
        with pytest.raises(tf.OutputError, match=address):
            worlds(recipe(tmp_path), tmp_path / "out", scheduler=address)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("kind", exporter_names())
def test_any_format_is_made_with_what_the_series_chooses(kind: str, tmp_path: Path) -> None:
    path = recipe(tmp_path, lambda plain: plain.update(exports=[kind]))
    (order,) = orders_of(tf.load_recipe(path).recipe, None)
    order.options.refuse_idle()
    assert kind not in {"usd", "glb"} or order.options.texture_pixels == 256


@pytest.mark.slow
def test_a_killed_series_goes_on_to_the_same_bytes(made: Path, tmp_path: Path) -> None:
    path, out = recipe(tmp_path), tmp_path / "out"
    worlds(path, out, count=1, workers=0)
    (out / ".begun-00002-1").mkdir()  # as a kill leaves it
    (out / ".begun-00002-1" / "half").write_text("half")
    result = worlds(path, out, workers=2)
    assert (result.made, len(result.folders), result.failed) == (3, 4, ())
    assert contents(out) == contents(made)


def test_only_what_a_killed_one_left_is_cleared(made: Path, tmp_path: Path) -> None:
    out = shutil.copytree(made, tmp_path / "out")
    kept = (tmp_path / "home", out / ".begun-notes", out / "shared" / "notes.txt")
    for folder in kept[:2]:
        folder.mkdir()
        (folder / "file").write_text("mine")
    kept[2].write_text("mine")
    (out / ".begun-00001-1").symlink_to(tmp_path / "home")
    (out / ".begun-00002-1").mkdir()
    assert worlds(recipe(tmp_path), out, workers=0).made == 0
    assert not (out / ".begun-00002-1").exists()
    assert all(path.exists() for path in (*kept, out / ".begun-00001-1", kept[0] / "file"))


def test_what_is_shared_does_not_lie_behind_a_link(made: Path, tmp_path: Path) -> None:
    out = shutil.copytree(made, tmp_path / "out")
    (out / "shared").rename(tmp_path / "home")
    (out / "shared").symlink_to(tmp_path / "home")
    before = sorted((tmp_path / "home").iterdir())
    with pytest.raises(tf.OutputError, match="shared is a link"):
        worlds(recipe(tmp_path), out, workers=0)
    assert sorted((tmp_path / "home").iterdir()) == before


def test_what_was_cut_short_among_what_is_shared_is_not_taken(made: Path, tmp_path: Path) -> None:
    (tmp_path / "out" / "shared").mkdir(parents=True)
    for path in (made / "shared").iterdir():
        (tmp_path / "out" / "shared" / path.name).touch()  # as a power cut leaves it
    shutil.copyfile(made / "worlds.json", tmp_path / "out" / "worlds.json")
    assert contents(worlds(recipe(tmp_path), tmp_path / "out", workers=0).directory) == contents(
        made
    )


def test_a_world_is_on_the_disk_before_it_takes_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: set[int] = set()
    monkeypatch.setattr("os.fsync", lambda handle: synced.add(os.fstat(handle).st_ino))
    out = worlds(recipe(tmp_path), tmp_path / "out", count=1, workers=0).directory
    world = out / name_of(0)
    assert {path.stat().st_ino for path in (out, world, *world.rglob("*"))} <= synced


def test_an_interrupt_tells_what_is_there(tmp_path: Path) -> None:
    def interrupt(stage: str, share: float | None = None) -> None:
        if stage == "worlds" and share:
            raise KeyboardInterrupt

    told = "^1 of 4 worlds are in .*many: the same command goes on from there$"
    with pytest.raises(KeyboardInterrupt, match=told):
        worlds(recipe(tmp_path), tmp_path / "many", workers=0, progress=interrupt)
    table = (tmp_path / "many/worlds.csv").read_text(encoding="utf-8").splitlines()
    assert [row.partition(",")[0] for row in table] == ["world", "00000"]


def test_each_is_a_world_that_its_own_recipe_makes(made: Path, tmp_path: Path) -> None:
    folder = made / name_of(2)
    drawn = draw(tf.load_recipe(recipe(tmp_path)).recipe, 2, folder=tmp_path)
    assert drawn.site.recipe.worlds is None
    assert tf.World.load(folder) == tf.realise(drawn.site)
    assert read_manifest(folder)["recipe"]["seed"] == drawn.recipe.seed
    assert tf.validate(folder, every_consumer=False)


def test_what_is_alike_is_there_once(made: Path) -> None:
    one, other = (made / name_of(n) / "world" / "shared.npz" for n in (0, 3))
    assert one.samefile(other)
    ground = made / name_of(0) / "mjcf" / "assets" / "ground.bin"
    assert ground.stat().st_nlink == 1


def test_the_table_tells_what_was_drawn(made: Path) -> None:
    head, *rows = (made / "worlds.csv").read_text().splitlines()
    assert len(rows) == 4
    assert {"world", "difficulty", "sun.elevation_deg", "arrive"} <= {*head.split(",")}


def test_the_table_tells_what_was_drawn_beside_what_was_measured(tmp_path: Path) -> None:
    path = recipe(tmp_path, lambda p: p["worlds"].update(vary={"rocks": {"choice": [{}]}}))
    made = worlds(path, tmp_path / "out", count=1, workers=0)
    table = (made.directory / "worlds.csv").read_text(encoding="utf-8")
    (row,) = csv.DictReader(table.splitlines())
    assert (row["recipe.rocks"], row["rocks"]) == ("{}", "0")


def test_a_world_far_larger_than_a_terrain_model_is_refused_at_once(tmp_path: Path) -> None:
    def change(plain: dict[str, Any]) -> None:
        plain["dtm"] = {**_SAMPLE, "size_m": [1e8, 8.0]}
        plain["worlds"]["vary"] = {"dtm.centre": "anywhere"}

    with pytest.raises(tf.DataError, match="fits nowhere on the valid part"):
        worlds(recipe(tmp_path, change), tmp_path / "out")  # it took hours


def test_fewer_than_are_there_leave_the_others(made: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    shutil.copytree(made, out)
    (out / "20261128").mkdir()
    found = worlds(recipe(tmp_path), out, count=3)
    assert [path.name for path in found.folders] == [name_of(n) for n in range(3)]
    assert (found.made, found.more) == (0, 1)
    assert contents(out) == contents(made)
    done = run("worlds", tmp_path / "many.yaml", "-o", out, "--count", 1, "--workers", 0)
    assert "1 world, 0 made now" in done.stdout
    assert "; 3 more are there" in done.stdout


@pytest.mark.slow
def test_harder_worlds_are_arrived_in_less_often(tmp_path: Path) -> None:
    def graded(plain: dict[str, Any]) -> None:
        plain["dtm"]["size_m"] = [12.0, 12.0]
        plain["worlds"]["difficulty"] = {"level": [0.0, 1.0], "rock_cover": [0.002, 0.3]}
        del plain["worlds"]["vary"]

    out = make_grid(recipe(tmp_path, graded), tmp_path / "grid", shape=(3, 2))
    cells = json.loads((out / "grid.json").read_text())["worlds"]
    measured = np.array([cell["measured"]["arrive_straight"] for cell in cells]).reshape(3, 2)
    assert [cell["difficulty"] for cell in cells] == [0.0, 0.0, 0.5, 0.5, 1.0, 1.0]
    assert np.all(np.diff(measured.mean(axis=1)) < 0.0)
    world = tf.World.load(out)
    assert len(world.field) == sum(cell["measured"]["rocks"] for cell in cells)
    rows, columns = (n // m for n, m in zip(world.ground.shape, (3, 2), strict=True))
    assert np.all(world.ground.elevation[:: rows + 0] == 0.0)  # between all rows
    assert np.all(world.ground.elevation[:, ::columns] == 0.0)
    x, y, z = cells[3]["origin_m"]
    assert float(world.ground.height_at(x, y)) == pytest.approx(z, abs=1e-4)


@pytest.mark.filterwarnings("ignore:borders of 2 m")
def test_worlds_of_a_grid_look_and_feel_as_they_do_alone(tmp_path: Path) -> None:
    def painted(plain: dict[str, Any]) -> None:
        plain["dtm"]["size_m"] = [6.0, 5.0]
        plain["terrain"]["materials"] = [{"kind": "sand", "cover": 0.5, "patch_m": 2}]
        plain["worlds"] = {
            "difficulty": {"level": [0.7, 1.0]},
            "vary": {
                "terrain.materials.0.friction": {"choice": [0.2, 0.9]},
                "rocks.populations.stones.rgb": {"choice": [[1, 0, 0], [0, 1, 0]]},
            },
        }

    path = recipe(tmp_path, painted)
    out = make_grid(path, tmp_path / "grid", shape=(2, 2), border=2.0)
    cells = json.loads((out / "grid.json").read_text())["worlds"]
    scene, site = tf.World.load(out), tf.load_recipe(path).recipe
    looks = scene.appearance
    assert (out / "truth" / "material.tif").is_file()
    assert sorted(m.name for m in looks.materials) == ["ground", "sand", "sand-2"]
    assert sorted(scene.field.populations) == ["stones", "stones-2"]
    assert len({tuple(cell["drawn"]["rocks.populations.stones.rgb"]) for cell in cells}) == 2
    for number, cell in enumerate(cells):
        drawn = draw(site, number, folder=tmp_path, difficulty=cell["difficulty"])
        alone = realise(drawn.site)
        column, row = (
            round((cell["origin_m"][axis] - scene.ground.origin[axis]) / 0.1) - half
            for axis, half in ((0, 30), (1, 25))
        )
        part = np.s_[row : row + 51, column : column + 61]
        friction = np.array([m.friction for m in looks.materials])[looks.material[part]]
        wanted = np.array([m.friction for m in alone.appearance.materials])
        np.testing.assert_array_equal(friction, wanted[alone.appearance.material])
        np.testing.assert_array_equal(looks.ground_rgb[part], alone.appearance.ground_rgb)
        east, north = scene.field.position[:, 0], scene.field.position[:, 1]
        x, y, _ = cell["origin_m"]
        inside = (np.abs(east - x) <= 3.0) & (np.abs(north - y) <= 2.5)
        rgb = looks.rock_rgb[scene.field.population[inside]]
        assert len(rgb)
        assert (rgb == alone.appearance.rock_rgb[0]).all()


def test_what_a_scene_has_once_is_the_recipes_in_a_grid(tmp_path: Path) -> None:
    def varied(plain: dict[str, Any]) -> None:
        plain["dtm"]["size_m"] = [6.0, 5.0]
        plain["sun"] = {"elevation_deg": 33, "azimuth_deg": 10}
        plain["worlds"]["vary"] = {
            "rocks.library.seed": {"choice": [1, 2, 3]},
            "body": {"choice": ["moon"]},
            "dtm.size_m": {"choice": [[7, 5], [8, 5]]},
            "terrain.spacing_m": {"choice": [0.25]},
            "rover": {"choice": ["morpheus"]},
            "sun.elevation_deg": {"uniform": [40, 50]},
            "rocks.populations.0.density_kg_m3": {"uniform": [2000, 3000]},
        }

    with pytest.warns(
        tf.RecipeWarning, match="is the same in all of a grid, which has one"
    ) as told:
        out = make_grid(recipe(tmp_path, varied), tmp_path / "grid", shape=(1, 2))
    assert sum(issubclass(one.category, tf.RecipeWarning) for one in told) == 6
    world = tf.World.load(out)
    assert (world.site.body.name, world.rover.name) == ("mars", "skid4")
    assert world.lighting.sun_elevation == pytest.approx(np.radians(33))
    for cell in json.loads((out / "grid.json").read_text())["worlds"]:
        assert {*cell["drawn"]} >= {"rocks.populations.0.density_kg_m3"}
        assert not {*cell["drawn"]} & {"body", "rover", "dtm.size_m", "sun.elevation_deg"}


def test_a_grid_has_no_paths(tmp_path: Path) -> None:
    def with_path(plain: dict[str, Any]) -> None:
        plain["dtm"]["size_m"] = [4.0, 4.0]
        points = [[-1, -1], [1, 1]]
        plain["paths"] = [{"name": "way", "route": {"points_m": points}, "speed_m_s": 0.2}]
        plain["validate"] = {"drive": "way"}
        plain["dataset"] = {"path": "way"}
        plain["exports"] = {"usd": {"pebbles_min_m": 0.1}}
        plain["terrain"]["layers"][0]["mask"] = {"route": {"path": "way", "beyond_m": 1}}
        plain["worlds"]["vary"] = {"paths.way.speed_m_s": {"uniform": [0.1, 0.2]}}

    with pytest.warns(
        tf.RecipeWarning, match=r"paths\.way\.speed_m_s has no effect: a grid has no"
    ):
        out = make_grid(recipe(tmp_path, with_path), tmp_path / "grid", shape=(1, 1), border=6.0)
    assert not tf.World.load(out).trajectories


def test_worlds_that_differ_in_what_a_scene_has_once_are_refused(tmp_path: Path) -> None:
    def varied(plain: dict[str, Any]) -> None:
        grounds = [{"kind": "flat", "size_m": size} for size in ([8.0, 8.0], [6.0, 8.0])]
        plain["worlds"]["vary"] = {"dtm": {"choice": grounds}}

    with pytest.raises(tf.RecipeError, match=r"have one dtm\.size_m, found \[8\.0, 8\.0\] and \[6"):
        make_grid(recipe(tmp_path, varied), tmp_path / "out", shape=(3, 3))
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("make", [worlds, partial(make_grid, shape=(1, 1))])
def test_a_site_in_tiles_is_no_world_of_a_series(make: Any, tmp_path: Path) -> None:
    path = recipe(tmp_path, lambda plain: plain.update(tiles={"size_m": 4}))
    with pytest.raises(tf.RecipeError, match="worlds of a series are made whole: leave it out"):
        make(path, tmp_path / "many")
    assert not (tmp_path / "many").exists()


def test_places_lie_all_over_a_terrain_model(tmp_path: Path) -> None:
    def anywhere(plain: dict[str, Any]) -> None:
        plain["dtm"] = _SAMPLE
        plain["worlds"] = {"vary": {"dtm.centre": "anywhere"}}

    file = tf.load_recipe(recipe(tmp_path, anywhere))
    drawn = [draw(file.recipe, n, folder=tmp_path) for n in range(3)]
    places = {one.site.lonlat for one in drawn}
    assert len(places) == 3
    by_slope = replace(file.recipe, worlds=tf.WorldsSpec(difficulty=tf.DifficultySpec()))
    rms = []
    for level in (0.0, 0.5, 1.0):
        site = draw(by_slope, 0, folder=tmp_path, difficulty=level).site
        heights = dtm_heights(site=site, window=site.window)[::10, ::10]
        rms.append(np.hypot(*np.gradient(heights)).mean())
    assert np.all(np.diff(rms) > 0.0)


@pytest.mark.parametrize(
    ("kind", "given", "why"),
    [
        (np.uint8, {}, r"^the vertical scale of dtm\.tif \(uint8\) is unknown"),
        (np.float32, {"destair": True}, r"^the heights of dtm\.tif are float32 and not rounded"),
    ],
)
def test_what_is_wrong_at_any_place_is_told_at_the_first(
    kind: Any, given: dict[str, Any], why: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    heights = np.random.default_rng(1).uniform(0, 200, (64, 64)).astype(kind)
    write_raster(tmp_path, heights)

    def anywhere(plain: dict[str, Any]) -> None:
        plain["dtm"] = {"source": "dtm.tif", "size_m": [8, 8], **given}
        plain["worlds"] = {"vary": {"dtm.centre": "anywhere"}}

    tried: list[object] = []
    monkeypatch.setattr(
        drawing, "plan", lambda *all, **named: (tried.append(all), tf.plan(*all, **named))[1]
    )
    with pytest.raises(tf.DataError, match=why):
        worlds(recipe(tmp_path, anywhere), tmp_path / "out")
    assert len(tried) <= 1


def test_what_is_drawn_of_a_choices_parts_leaves_the_choice_as_it_is(tmp_path: Path) -> None:
    suns = [{"elevation_deg": 5.0, "azimuth_deg": 10.0}, {"elevation_deg": 50.0}]
    vary = {"sun": {"choice": suns}, "sun.elevation_deg": {"uniform": [20.0, 30.0]}}
    given = tf.load_recipe(recipe(tmp_path, lambda plain: plain["worlds"].update(vary=vary))).recipe
    for number in range(4):
        drawn = draw(given, number, folder=tmp_path)
        assert 20.0 < (drawn.recipe.sun.elevation_deg or 0.0) < 30.0
    assert given.worlds is not None
    sun = given.worlds.vary["sun"]
    assert isinstance(sun, tf.Variation)
    assert list(sun.choice or ()) == suns


def test_check_tells_what_differs(tmp_path: Path) -> None:
    def both(plain: dict[str, Any]) -> None:
        """Sizes that only together are sizes: the smallest is above the recipe's largest."""
        key = f"rocks.populations.{plain['rocks']['populations'][0]['name']}.diameter_m"
        plain["worlds"]["vary"] |= {
            f"{key}.0": {"uniform": [0.9, 1.0]},
            f"{key}.1": {"choice": [2.0]},
        }

    file = tf.load_recipe(recipe(tmp_path, both))
    (line,) = (line for line in tf.check(file.recipe) if line.startswith("worlds"))
    for told in ("4, each", "difficulty 0 to 1", "sun.elevation_deg uniform 10, 80", "choice 2"):
        assert told in line
    (line,) = (line for line in tf.check(file.recipe) if " each; 4: " in line)
    assert "cost" in line


@pytest.mark.parametrize(
    ("vary", "why"),
    [
        ({"rocks.populations.0.k": {"uniform": [0.1, 0.2]}}, "has no key 'k'"),
        ({"rocks.populations.3.name": {"choice": ["a"]}}, "has 1 members"),
        ({"sun.elevation_deg": {}}, "exactly one of"),
        ({"sun.elevation_deg": {"uniform": [1, 2], "choice": [3]}}, "uniform and choice"),
        ({"sun.elevation_deg": {"uniform": [100, 200]}}, "what is drawn cannot be"),
        ({"sun.elevation_deg": {"uniform": [10, 91]}}, "less than or equal to 90"),
        ({"body": {"choice": ["mars", "moon", "pluto"]}}, "'mars', 'mercury' or 'moon'"),
        ({"sun.elevation_deg": {"uniform": [60, 5]}}, "60 to 5: the smaller number first"),
        ({"rocks.library.seed": {"integers": [9, 3]}}, "9 to 3: the smaller number first"),
        ({"sun.elevation_deg": {"log_uniform": [60, 5]}}, "60 to 5: the smaller number first"),
        ({"sun.elevation_deg": {"normal": [10, 80]}}, r"unknown key 'normal'.*uniform\)?$"),
        ({"sun.elevation_deg": "anywhere"}, "only dtm.centre"),
        ({"dtm.centre": "anywhere"}, "no other places"),
        (
            {
                "rocks.populations.0.size_frequency.k": {"uniform": [0.01, 0.02]},
                "rocks.populations.stones.size_frequency.k": {"uniform": [0.1, 0.2]},
            },
            r"takes the place of what worlds\.vary\.rocks\.populations\.0\.size_frequency\.k draws",
        ),
        (
            {"sun.azimuth_deg": {"choice": [1]}, "sun": {"choice": [{"elevation_deg": 9}]}},
            r"takes the place of what worlds\.vary\.sun\.azimuth_deg draws: leave one out",
        ),
        (
            {"dtm.centre": "anywhere", "dtm.centre.offset_m.0": {"uniform": [0, 9]}},
            r"takes the place of what worlds\.vary\.dtm\.centre\.offset_m\.0 draws",
        ),
    ],
)
def test_a_wrong_wish_is_told_before_anything_is_written(
    tmp_path: Path, vary: dict[str, Any], why: str
) -> None:
    path = recipe(tmp_path, lambda plain: plain["worlds"].update(vary=vary))
    with pytest.raises(tf.RecipeError, match=why):
        worlds(path, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("shape", "why"),
    [
        ((300, 300), r"300 × 300 worlds is a scene of 1\.3e\+11 nodes, .* GB"),
        ((100_000, 100_000), "100,000 × 100,000 worlds: 1 to 100,000 in all"),
        ((0, 3), "0 × 3 worlds: 1 to"),
    ],
)
def test_a_scene_too_large_is_told_before_work_begins(
    tmp_path: Path, shape: tuple[int, int], why: str
) -> None:
    with pytest.raises(tf.OutputError, match=why):
        make_grid(
            recipe(tmp_path, lambda plain: plain["terrain"].update(spacing_m=0.01)),
            tmp_path / "out", shape=shape,
        )  # fmt: skip
    assert not (tmp_path / "out").exists()


def test_goals_lie_within_the_world(tmp_path: Path) -> None:
    path = recipe(tmp_path, lambda p: p.update(worlds={"arrival": {"distance_m": 5.7}}))
    with pytest.raises(
        tf.RecipeError, match=r"5\.7 m: at most 5\.657 m, half the diagonal"
    ) as told:
        worlds(path, tmp_path / "out")
    assert told.value.key == ("worlds", "arrival", "distance_m")
    with pytest.raises(tf.RecipeError, match="half the diagonal"):
        list(tf.check(path))
    with pytest.raises(tf.RecipeError, match="half the diagonal"):
        make_grid(path, tmp_path / "out", shape=(1, 1))
    assert not (tmp_path / "out").exists()


def test_worlds_of_another_recipe_are_left_alone(made: Path, tmp_path: Path) -> None:
    before = contents(made)
    other = recipe(tmp_path, lambda plain: plain.update(seed=4))
    with pytest.raises(tf.OutputError, match=r"another recipe \(seed: \d+, not 4\)"):
        worlds(other, made)
    steep = recipe(tmp_path, lambda plain: plain["terrain"].update(spacing_m=0.5))
    with pytest.raises(tf.OutputError, match=r"recipe \(terrain\.spacing_m: .*, not 0\.5\)"):
        worlds(steep, made)
    one = recipe(
        tmp_path, lambda plain: plain["worlds"].update(vary={"rocks.library.seed": {"choice": [1]}})
    )
    with pytest.raises(
        tf.OutputError, match=r"recipe \(worlds\.vary\.\S+: nothing, not .*\): choose"
    ):
        worlds(one, made)
    none = recipe(tmp_path, lambda plain: plain["worlds"].update(vary={}))
    with pytest.raises(
        tf.OutputError, match=r"recipe \(worlds\.vary\.\S+: .*, not nothing\): choose"
    ):
        worlds(none, made)
    (tmp_path / "damaged").mkdir()
    order = json.loads((made / "worlds.json").read_text())
    (tmp_path / "damaged/worlds.json").write_text(json.dumps(order | {"format": {}}))
    with pytest.raises(tf.OutputError, match="holds worlds of another format"):
        worlds(other, tmp_path / "damaged")
    with pytest.raises(
        tf.OutputError, match=r'other exports \(\["mjcf"\], not \["sdf"\]\): choose'
    ):
        worlds(recipe(tmp_path), made, only="sdf")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").write_text("dear")
    with pytest.raises(tf.OutputError, match=r"no worlds\.json"):
        worlds(other, tmp_path / "mine")
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["letter.txt"]
    with pytest.raises(tf.OutputError, match=r"letter\.txt is no folder"):
        worlds(other, tmp_path / "mine/letter.txt")
    assert contents(made) == before
    assert read_summary(made / name_of(1))["number"] == 1


def test_worlds_of_another_input_are_left_alone(tmp_path: Path) -> None:
    listed = tmp_path / "listed.csv"
    listed.write_text("x_m,y_m,diameter_m\n0,0,0.5\n", encoding="utf-8")
    rocks = {"lists": [{"name": "listed", "file": "listed.csv"}]}
    path = recipe(tmp_path, lambda plain: plain.update(rocks=rocks))
    worlds(path, tmp_path / "out", count=1, workers=0)
    listed.write_text("x_m,y_m,diameter_m\n1,1,0.5\n", encoding="utf-8")
    with pytest.raises(tf.OutputError, match=r"holds worlds of another listed\.csv: choose"):
        worlds(path, tmp_path / "out", count=2, workers=0)
    assert worlds(path, tmp_path / "out", count=1, workers=0).made == 0


@pytest.mark.slow
def test_inputs_that_only_some_worlds_have_are_looked_at(tmp_path: Path) -> None:
    def change(plain: dict[str, Any]) -> None:
        lists = [[{"name": "one", "file": f"{file}.csv"}] for file in "ab"]
        plain["worlds"] |= {"vary": {"rocks.lists": {"choice": lists}}}

    for file in "ab":
        (tmp_path / f"{file}.csv").write_text("x_m,y_m,diameter_m\n0,0,0.5\n", encoding="utf-8")
    path = recipe(tmp_path, change)
    worlds(path, tmp_path / "out", count=4, workers=0)
    first = read_summary(tmp_path / "out/00000")["drawn"]["rocks.lists"][0]["file"]
    (other,) = {"a.csv", "b.csv"} - {first}
    (tmp_path / other).write_text("x_m,y_m,diameter_m\n1,1,0.5\n", encoding="utf-8")
    with pytest.raises(tf.OutputError, match=f"holds worlds of another {other}: choose"):
        worlds(path, tmp_path / "out", count=5, workers=0)


@pytest.mark.slow
def test_no_process_makes_worlds_after_an_interrupt(tmp_path: Path) -> None:
    def interrupt(stage: str, share: float = 0.0) -> None:
        if stage == "worlds":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as caught:
        worlds(recipe(tmp_path), tmp_path / "out", count=8, workers=2, progress=interrupt)
    table = (tmp_path / "out/worlds.csv").read_text(encoding="utf-8").splitlines()
    assert len(table) - 1 == len([*(tmp_path / "out").glob("0*/drawn.json")])
    assert str(caught.value).startswith(f"{len(table) - 1} of 8 worlds")


def test_less_than_no_workers_are_refused(made: Path, tmp_path: Path) -> None:
    with pytest.raises(tf.DataError, match=r"worlds: workers must be .* found -1"):
        worlds(recipe(tmp_path), tmp_path / "out", workers=-1)
    assert not (tmp_path / "out").exists()


def test_of_two_that_write_one_folder_the_second_is_told(made: Path, tmp_path: Path) -> None:
    """Whatever the first has written by then: nothing but its lock, or worlds of another recipe."""
    other = recipe(tmp_path, lambda plain: plain.update(seed=4))
    for out in (tmp_path / "new", made):
        with holding(out), pytest.raises(tf.OutputError, match="written by another terrain-forge"):
            worlds(other, out)


def test_a_world_of_which_files_are_gone_is_named(made: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    shutil.copytree(made, out)
    for name in ("truth/rocks.csv", "manifest.json"):
        (out / name_of(1) / name).unlink()
        with pytest.raises(tf.OutputError, match=rf"{name_of(1)} is not .*{name}"):
            worlds(recipe(tmp_path), out)
    shutil.rmtree(out / name_of(1))
    assert worlds(recipe(tmp_path), out, workers=0).made == 1
    assert contents(out) == contents(made)


def test_rocks_without_a_place_are_told(made: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    shutil.copytree(made, out)
    assert all(read_summary(out / name_of(n))["measured"]["unplaced"] == 0 for n in range(4))
    assert "found no free place" not in run("worlds", recipe(tmp_path), "-o", out).stdout
    for number, lost in ((1, 2), (3, 1998)):
        summary = read_summary(out / name_of(number))
        summary["measured"]["unplaced"] = lost
        (out / name_of(number) / "drawn.json").write_text(json.dumps(summary))
    told = run("worlds", recipe(tmp_path), "-o", out).stdout
    assert "rocks        2,000 found no free place, in 2 of the worlds" in told
    assert "unplaced" in (out / "worlds.csv").read_text()


def test_the_command_tells_what_it_made_and_what_is_wrong(made: Path, tmp_path: Path) -> None:
    path = recipe(tmp_path)
    done = run("worlds", path, "-o", made, "--workers", 0)
    assert done.returncode == 0, done.stderr
    assert "4 worlds, 0 made now" in done.stdout
    arrive = [read_summary(made / name_of(n))["measured"]["arrive"] for n in range(4)]
    mean, low, high = np.mean(arrive), min(arrive), max(arrive)
    told = f"arrive       {mean:.1%} of all starts, {low:.1%} to {high:.1%} by world"
    assert told in done.stdout
    for grid in ("3by2", "0x4", "9" * 5000 + "x1"):
        assert "such as 5x8" in run("worlds", path, "--grid", grid).complaints[0]
    for option in (("--count", 3), ("--workers", 2), ("--scheduler", "local")):
        done = run("worlds", path, "--grid", "2x2", *option, "-o", tmp_path / "no")
        assert (done.returncode, len(done.complaints)) == (2, 1)
        assert f"{option[0]} has no effect beside --grid" in done.stderr
    done = run("worlds", path, "--border", 6, "-o", tmp_path / "no")
    assert "--border has no effect without --grid" in done.complaints[0]
    wrong = recipe(tmp_path, lambda plain: plain["worlds"].update(vary={"sun.tilt": {}}))
    done = run("worlds", wrong, "-o", tmp_path / "out")
    assert done.returncode == 2
    assert done.complaints == [done.complaints[0]]
    assert f"{wrong}:1" in done.complaints[0]


@pytest.mark.parametrize(
    "wrong",
    [
        *({"drawn": value} for value in ([], [1], 3, None)),
        *({"measured": value} for value in ({"arrive": [1]}, {"arrive": "all"}, [], None)),
        *({"difficulty": value} for value in ("0.5", [0.5], True)),
        {"seed": "one"},
    ],
)
def test_a_summary_of_other_kinds_of_values_is_none(wrong, tmp_path):
    told = {"number": 0, "seed": 1, "difficulty": 0.5, "measured": {"arrive": 1, "rocks": None}}
    (tmp_path / "drawn.json").write_text(json.dumps({**told, "drawn": {"a": [1]}}))
    assert read_summary(tmp_path)["drawn"] == {"a": [1]}
    (tmp_path / "drawn.json").write_text(json.dumps({**told, "drawn": {}, **wrong}))
    with pytest.raises(tf.OutputError, match=r"no readable drawn\.json"):
        read_summary(tmp_path)


@pytest.mark.parametrize(
    ("vary", "why"),
    [
        ({"seed": {"integers": [1, 9]}}, "worlds cannot differ in seed: each has one of its own"),
        ({"name": {"choice": ["a"]}}, "worlds cannot differ in name"),
        ({"exports": {"choice": [["mjcf"]]}}, "worlds cannot differ in exports: a series has the"),
        (
            {"rocks.populations.stones.diameter_m.0": {"uniform": [0.3, 0.9]}},
            r"what is drawn cannot be: rocks\.populations\[0\]\.diameter_m: smallest 0\.9 m",
        ),
        ({"rocks.populations.0.diameter_m": {"choice": [[0.2, 0.8], [2, 1]]}}, "smallest 2 m"),
    ],
)
def test_ends_that_no_world_can_have_are_refused_before_the_first(
    tmp_path: Path, vary: dict[str, Any], why: str
) -> None:
    path = recipe(tmp_path, lambda plain: plain["worlds"].update(vary=vary))
    for wrong in (lambda: worlds(path, tmp_path / "out"), lambda: list(tf.check(path))):
        with pytest.raises(tf.RecipeError, match=why) as told:
            wrong()
        assert told.value.key == ("worlds", "vary", *vary)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("changes", "key", "wish", "why"),
    [
        (
            {},
            "terrain.spacing_m",
            {"uniform": [0.1, 0.3]},
            r"dtm\.size_m: 8 m is not a whole number .* cells of 0\.3 m.* \(drawn: 0\.3\)$",
        ),
        (
            {},
            "terrain.spacing_m",
            {"uniform": [0.1, 0.2]},
            r"dtm.*: 8 m is .* \(drawn: 0\.1\d+\)$",
        ),
        (
            {"arrival": {"distance_m": 5.0}},
            "dtm.size_m",
            {"choice": [[8.0, 8.0], [4.0, 6.0]]},
            r"worlds\.arrival\.distance_m: 5 m: at most 3\.606 m.* \(drawn: \[4\.0, 6\.0\]\)$",
        ),
        (
            {"dtm": _SAMPLE, "difficulty": None},
            "dtm.centre",
            {"choice": [{"offset_m": [0, 0]}, {"offset_m": [5000, 0]}]},
            r'dtm\.centre: the site needs columns .* \(drawn: \{"offset_m": \[5000, 0\]\}\)$',
        ),
        ({"dtm": _SAMPLE}, "body", {"choice": ["mars", "moon"]}, r'body: .* \(drawn: "moon"\)$'),
    ],
)
def test_a_wrong_draw_is_told_at_its_own_key(
    tmp_path: Path, changes: dict[str, Any], key: str, wish: dict[str, Any], why: str
) -> None:
    def change(plain: dict[str, Any]) -> None:
        given = dict(changes)
        plain["dtm"] = given.pop("dtm", plain["dtm"])
        plain["worlds"] |= {"vary": {key: wish}, **given}

    path = recipe(tmp_path, change)
    for wrong in (lambda: worlds(path, tmp_path / "out"), lambda: list(tf.check(path))):
        with pytest.raises(tf.RecipeError, match=rf"^what is drawn cannot be: {why}") as told:
            wrong()
        assert told.value.key == ("worlds", "vary", key)
    assert not (tmp_path / "out").exists()


def test_what_a_difficulty_makes_wrong_is_not_told_of_a_draw(tmp_path: Path) -> None:
    def change(plain: dict[str, Any]) -> None:
        stones = plain["rocks"]["populations"][0]
        plain["rocks"]["populations"].append({**stones, "name": "more", "dynamic_m": [0.2, 0.8]})
        difficulty = {"level": 1.0, "rock_cover": [0.01, 0.4]}
        vary = {"rocks.populations.0.rgb": {"choice": [None]}}
        plain["worlds"] |= {"difficulty": difficulty, "vary": vary}

    with pytest.raises(tf.RecipeError, match=r"^in a world of difficulty 1: the rocks") as told:
        worlds(recipe(tmp_path, change), tmp_path / "out")
    assert told.value.key == ("rocks", "populations")


def test_what_is_wrong_without_a_draw_is_told_at_its_own_key(tmp_path: Path) -> None:
    path = recipe(tmp_path, lambda plain: plain["terrain"].update(spacing_m=0.3))
    with pytest.raises(tf.RecipeError, match="8 m is not a whole number") as told:
        worlds(path, tmp_path / "out")
    assert told.value.key == ("dtm", "size_m")


def test_what_another_key_may_set_right_is_not_refused(tmp_path: Path) -> None:
    vary = {
        "rocks.populations.0.diameter_m.0": {"uniform": [0.3, 0.9]},
        "rocks.populations.0.diameter_m.1": {"uniform": [1.0, 1.2]},
    }
    path = recipe(tmp_path, lambda plain: plain["worlds"].update(vary=vary))
    assert any("diameter_m.1 uniform" in line for line in tf.check(path))
