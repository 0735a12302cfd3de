"""What is done with a built site: checked, cut, looked at; refused where it is no world."""

from __future__ import annotations

import hashlib
import json
import shutil

import numpy as np
import pytest
import rasterio
from PIL import Image

import terrain_forge as tf
from terrain_forge import pipeline
from terrain_forge.base import OutputError
from tests.helpers import command_line as command
from tests.unit.tiling.conftest import write_recipe


@pytest.fixture
def copied(built, tmp_path):
    """A site of one's own."""
    shutil.copytree(built, tmp_path / "six")
    return tmp_path / "six"


def test_a_whole_site_is_valid(copied):
    assert pipeline.validate(copied)


@pytest.mark.parametrize(
    "name",
    [
        "tiles/001/002/geotiff/elevation.tif",
        "tiles/000/001/tile.json",
        "truth/size_frequency.json",
        "map.png",
        "report.html",
    ],
)
def test_a_damaged_file_is_found(copied, name):
    path = copied / name
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    assert not pipeline.validate(copied)
    damaged = json.loads((copied / "validation/report.json").read_text())["damaged"]
    assert f"{name} is damaged" in damaged


def test_a_page_that_is_missing_is_found_and_written_anew(copied, recipe, built):
    (copied / "report.html").unlink()
    assert not pipeline.validate(copied)
    told = json.loads((copied / "validation/report.json").read_text())["damaged"]
    assert told == ["report.html is missing"]
    assert tf.build(tf.load_recipe(recipe).recipe, copied, workers=0).passed
    assert (copied / "report.html").read_bytes() == (built / "report.html").read_bytes()


def test_each_damaged_tile_is_named_once_and_the_list_has_all(copied):
    """What one moves away is the tile's folder."""
    harmed = ["truth/size_frequency.json", "map.png"]
    for row in range(2):
        for column in range(3):
            names = sorted((copied / f"tiles/{row:03}/{column:03}").rglob("*.tif"))[:4]
            harmed += [path.relative_to(copied).as_posix() for path in names]
    for name in harmed:
        (copied / name).write_bytes(b"")
    (copied / "drive.txt").write_text("")
    done = command.run("validate", copied)
    assert done.returncode == 1
    report = json.loads((copied / "validation/report.json").read_text())
    assert {*report["damaged"]} == {f"{name} is damaged" for name in harmed} | {
        "drive.txt was added"
    }
    (told,) = [line for line in done.stderr.splitlines() if "failed: tiles" in line]
    for row in range(2):
        for column in range(3):
            assert told.count(f"tiles/{row:03}/{column:03}: 4 files") == 1
    for name in (*harmed[:2], "drive.txt"):
        assert told.count(f"; {name} ") == 1


def test_more_damaged_files_than_can_be_named_are_counted(copied):
    for number in range(25):
        (copied / f"{number:02}.txt").write_text("")
    assert not pipeline.validate(copied)
    report = json.loads((copied / "validation/report.json").read_text())
    assert len(report["damaged"]) == 25
    note = report["checks"][0]["note"]
    assert "19.txt was added; 5 more are in validation/report.json; move" in note
    assert "20.txt" not in note


def test_a_damaged_drive_is_one_of_the_damaged_files(copied):
    """Of a site that has none, its list says one."""
    content = b'{"checks": []}'
    manifest = json.loads((copied / "manifest.json").read_text())
    manifest["outputs"]["validation/drive.json"] = hashlib.sha256(content).hexdigest()
    (copied / "manifest.json").write_text(json.dumps(manifest))
    (copied / "validation").mkdir(exist_ok=True)
    (copied / "validation/drive.json").write_bytes(b"{")
    (copied / "map.png").write_bytes(b"")
    assert not pipeline.validate(copied)
    told = json.loads((copied / "validation/report.json").read_text())["damaged"]
    assert told == ["map.png is damaged", "validation/drive.json is damaged"]


def test_what_was_added_is_named_also_after_a_build(copied, recipe):
    added = "tiles/000/001/truth/zz.txt", "geotiff/added.tif", "top.txt"
    for name in added:
        (copied / name).write_text("x")
    for name in ("tiles/000/002/empty", "tiles/zz"):
        (copied / name).mkdir()
    (copied / "tiles/001/000/link").symlink_to("/")
    names = {*added, "tiles/000/002/empty/", "tiles/zz/", "tiles/001/000/link"}
    for again in (False, True):
        if again:
            tf.build(tf.load_recipe(recipe).recipe, copied, workers=0)
        assert not pipeline.validate(copied)
        told = json.loads((copied / "validation/report.json").read_text())["damaged"]
        assert {*told} == {f"{name} was added" for name in names}


def test_a_manifest_of_another_recipe_is_damaged(copied):
    path = copied / "manifest.json"
    path.write_text(path.read_text().replace('"seed": 7', '"seed": 8'))
    assert not pipeline.validate(copied)
    told = json.loads((copied / "validation/report.json").read_text())["damaged"]
    assert told == ["manifest.json is damaged (seed, recipe)"]


@pytest.mark.parametrize(
    "outputs",
    [
        {"../a": "0"},
        *(
            pytest.param(outputs, marks=pytest.mark.slow)
            for outputs in (None, 3, ["a"], {"a": 1}, {"/a": "0"})
        ),
    ],
)
def test_a_manifest_without_its_list_of_files_is_damaged(copied, recipe, outputs):
    path = copied / "manifest.json"
    whole = path.read_bytes()
    path.write_text(json.dumps({**json.loads(whole), "outputs": outputs}))
    with pytest.raises(tf.OutputError, match="it does not list the site's files"):
        pipeline.validate(copied)
    tf.build(tf.load_recipe(recipe).recipe, copied, workers=0)
    assert path.read_bytes() == whole


def test_an_empty_row_is_a_tile_that_is_missing(copied):
    for column in range(3):
        shutil.rmtree(copied / f"tiles/001/{column:03}")
    assert not pipeline.validate(copied)
    told = json.loads((copied / "validation/report.json").read_text())["damaged"]
    assert told == [f"tiles/001/{column:03}/tile.json is missing" for column in range(3)]


@pytest.mark.parametrize(
    "name",
    [
        "tiles/001/002/geotiff/overview.npz",
        "tiles/000/001/map.png",
        "site/routes.json",
        "tiles/000/000/truth/step.tif",
    ],
)
def test_a_build_names_a_damaged_file_that_it_wants(copied, recipe, name):
    if not (copied / name).exists():
        pytest.skip(f"this site has no {name}")
    (copied / name).write_bytes(b"PK\x03\x04\xff")
    done = command.run("build", recipe, "-o", copied, "--workers", 0)
    assert done.returncode == 2
    assert name in done.complaints[-1]


@pytest.mark.parametrize("content", ["3", '["a"]', "null"])
def test_routes_that_are_none_are_named(copied, recipe, content):
    (copied / "site/routes.json").write_text(content)
    done = command.run("build", recipe, "-o", copied, "--workers", 0)
    assert done.returncode == 2
    assert "site/routes.json is damaged" in done.complaints[-1]


def test_a_description_of_other_types_is_named(copied, tmp_path):
    path = copied / "site/site.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "dtm": "a"}))
    done = command.run("cut", copied, "--centre", "1,1", "--size", "4,4", "-o", tmp_path / "part")
    assert done.returncode == 2
    assert "damaged: " in done.complaints[-1]
    assert "Site.dtm: 'a'" in done.complaints[-1]


@pytest.mark.parametrize("text", ["\x1b[31m", "3", "{}"])
def test_a_description_whose_recipe_is_none_is_named(copied, text):
    path = copied / "site/site.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), "recipe_json": text}))
    with pytest.raises(tf.OutputError, match="site is damaged: "):
        pipeline.validate(copied)


def test_a_tile_that_says_something_else_of_itself_is_named(copied, recipe):
    path = copied / "tiles/000/001/tile.json"
    told = json.loads(path.read_text())
    for key, value in (("counts", {**told["counts"], "overlaps": "1"}), ("height_m", [0.0, 1.0])):
        path.write_text(json.dumps({**told, key: value}, indent=1))
        done = command.run("build", recipe, "-o", copied, "--workers", 0)
        assert done.returncode == 2
        assert "000/001/tile.json is damaged" in done.complaints[-1]


def test_a_list_of_tiles_that_is_no_text_is_damaged(copied):
    (copied / "site/tiles.csv").write_bytes(b"\xff\xfe")
    assert not pipeline.validate(copied)
    report = json.loads((copied / "validation/report.json").read_text())
    assert report["damaged"] == ["site/tiles.csv is damaged"]


@pytest.mark.slow
def test_a_build_judges_anew_what_it_made_anew(copied, recipe):
    (copied / "truth/size_frequency.json").write_text("{}")
    assert not pipeline.validate(copied)
    tf.build(tf.load_recipe(recipe).recipe, copied, workers=0)
    report = json.loads((copied / "validation/report.json").read_text())
    assert report["damaged"] == []
    assert [check["passed"] for check in report["checks"]] == [True, True]


@pytest.mark.slow
def test_a_missing_tile_is_found_and_made_anew(copied, recipe, built):
    shutil.rmtree(copied / "tiles/000/002")
    done = command.run("validate", copied)
    assert done.returncode == 1
    assert "tiles/000/002/tile.json is missing" in done.stderr
    path = copied / "tiles/000/001/geotiff/elevation.tif"
    path.write_bytes(path.read_bytes()[:-1])
    assert command.run("validate", copied).returncode == 1
    done = command.run("build", recipe, "-o", copied, "--workers", 0)
    assert done.returncode == 1
    assert "failed: tiles" in done.complaints[0], "what was not moved away stays damaged"
    shutil.rmtree(copied / "tiles/000/001")
    done = command.run("build", recipe, "-o", copied, "--workers", 0)
    assert (done.returncode, done.complaints) == (0, [])
    for path in (built / "tiles/000/002").rglob("*.*"):
        assert path.read_bytes() == (copied / path.relative_to(built)).read_bytes()


def test_a_part_becomes_a_world_of_its_own(built, whole, tmp_path):
    out = tmp_path / "part"
    place = "--centre", "1.1,2.5", "--size", "24.1,10"
    done = command.run("cut", built, *place, "--only", "mjcf", "-o", out)
    assert done.returncode == 0
    told = "24 × 10 m around 1,2.5, asked for 24.1 × 10 m around 1.1,2.5"
    assert f"whole cells of 0.25 m: {told}" in done.stdout
    world = tf.World.load(out)
    wanted = whole.tile(world.window, number=0)
    assert np.array_equal(world.ground.elevation, wanted.ground.elevation)
    assert np.array_equal(world.field.position, wanted.field.position)
    assert (out / "mjcf/scene.xml").is_file()
    with rasterio.open(out / "truth/rock_id.tif") as raster:
        seen = set(np.unique(raster.read(1)).tolist()) - {-1}
    assert len(wanted.neighbours) > 0
    assert seen <= set(world.field.id.tolist()), "as the exports have no others"


def test_drives_from_random_starts_are_refused(copied):
    done = command.run("validate", copied, "--drives", 2)
    assert done.returncode == 2
    assert "drive in a part that `terrain-forge cut` takes" in done.stderr


@pytest.mark.parametrize(
    ("kind", "option", "value"),
    [
        ("sdf", "flavour", "classic"),
        ("sdf", "ros_package", "true"),
        ("glb", "lights", "physical"),
        ("usd", "tile_cells", "48"),
    ],
)
def test_options_that_tiles_have_not_are_refused(recipe, kind, option, value):
    done = command.run("check", recipe, "--set", f"exports={{{kind}: {{{option}: {value}}}}}")
    assert done.returncode == 2
    assert f"exports.{kind}.{option}: has no effect on a site in tiles" in done.stderr


def test_check_tells_of_the_horizon(recipe):
    lines = command.run("check", recipe).stdout.splitlines()
    (told,) = [line for line in lines if "horizon  " in line]
    assert "heights read out to" in told


def test_a_part_beyond_the_site_is_refused(built, tmp_path):
    done = command.run("cut", built, "--centre", "20,0", "--size", "24,10", "-o", tmp_path / "out")
    assert done.returncode == 2
    assert "is not within the site, which reaches 25 m east" in done.stderr
    assert not (tmp_path / "out").exists()


def test_a_format_that_is_none_is_refused_before_a_part_is_made(built, tmp_path):
    place = "--centre", "0,0", "--size", "10,10"
    done = command.run("cut", built, *place, "--only", "glib", "-o", tmp_path / "out")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1, "no stage was begun"
    assert "did you mean 'glb'?" in done.stderr


@pytest.mark.parametrize("arguments", [("export", "--only", "glb"), ("record",), ("illumination",)])
def test_what_wants_a_world_points_to_cut(built, arguments):
    name, *more = arguments
    done = command.run(name, built, *more)
    assert done.returncode == 2
    assert "a site in tiles: `terrain-forge cut` makes a world" in done.stderr


def test_an_unfinished_site_says_so(copied):
    (copied / "manifest.json").unlink()
    with pytest.raises(OutputError, match="is not finished: the same build goes on"):
        pipeline.validate(copied)


def test_the_map_is_whole(built):
    with Image.open(built / "map.png") as picture:
        pixels = np.asarray(picture)
    assert pixels.shape == (160, 200, 3)
    assert pixels.min() > 0
    page = (built / "report.html").read_text()
    assert 'src="map.png"' in page
    assert "6 tiles" in page
    for action in ("touchmove", "pointercancel", 'id="in"', 'id="out"', 'class="wide"'):
        assert action in page


@pytest.mark.slow
def test_a_part_without_a_path_has_no_pebbles(tmp_path):
    """The recipe's options hold for a part, also where its format is named."""
    text = "exports: {usd: {pebbles_min_m: 0.1, collider_min_m: 0.3}}\n"
    text += "paths: [{name: p, speed_m_s: 0.5, route: {kind: spline, "
    text += "points_m: [[-20, -10], [20, 12]]}}]"
    path = write_recipe(tmp_path, exports="", **{"exports: []": text})
    site = tmp_path / "site"
    tf.build(tf.load_recipe(path).recipe, site, workers=0)
    for name, only in (("all", None), ("named", "usd")):
        done = tf.cut(site, tmp_path / name, centre=(0.0, 0.0), size=(12.0, 10.0), only=only)
        assert not done.world.trajectories
        assert done.exports[0].options["collider_min_m"] == 0.3
        assert not (tmp_path / name / "usd/assets/pebbles.usdc").exists()
    place = "--centre", "0,0", "--size", "12,10"
    said = command.run("cut", site, *place, "--only", "geotiff", "-o", tmp_path / "third").stdout
    assert "left out     paths that do not lie wholly in it: p, and with them what" in said


@pytest.mark.slow
def test_rocks_without_a_free_place_are_told(tmp_path):
    rows = [f"{x},{y},2.1" for x in np.arange(-7.5, 8, 2.5) for y in np.arange(-7.5, 8, 2.5)]
    (tmp_path / "list.csv").write_text("\n".join(["x_m,y_m,diameter_m", *rows]))
    path = write_recipe(
        tmp_path,
        exports="geotiff",
        **{
            "size_m: [50, 40]": "size_m: [20, 20]",
            "k: 0.08": "k: 0.3",
            "  populations:": "  lists: [{name: large, file: list.csv}]\n  populations:",
        },
    )
    with pytest.warns(tf.RecipeWarning, match="rocks found no free place, beside"):
        tf.build(path, tmp_path / "site", workers=0)
