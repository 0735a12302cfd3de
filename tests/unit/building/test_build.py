"""The whole job on tiny worlds: the output folder, one seed one world, what happens when things go
wrong."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import rasterio

from terrain_forge import World, load_recipe, plan, realise
from terrain_forge.base import ask_for_interrupt, listen_for_interrupts
from terrain_forge.recipe import RecipeFile
from tests.helpers.command_line import run
from tests.helpers.places import ROOT

TINY = """
schema: 1
name: tiny
seed: 5
body: mars
dtm:
  source: SAMPLES/gale_floor_synthetic.tif
  centre: {offset_m: [30, -20]}
  size_m: [16, 12]
  noise: keep
terrain: {spacing_m: 0.25, layers: [{kind: fractal}]}
rocks:
  library: {shapes: 3, seed: 3}
  populations:
    - {name: pebbles, size_frequency: {kind: golombek, k: 0.1}, diameter_m: [0.15, 0.5]}
    - {name: boulders, size_frequency: {kind: golombek, k: 0.3}, diameter_m: [0.5, 1.2]}
paths:
  - name: arc
    route: {kind: spline, points_m: [[-5, -2], [0, -3], [4, 1]]}
    speed_m_s: 0.5
    shake: {rms_deg: 0.2, cutoff_hz: 2}
"""


def recipe(folder, text=TINY):
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "tiny.yaml"
    path.write_text(text.replace("SAMPLES", str(ROOT / "dtm_samples")))
    return path


MINI = """
schema: 1
name: mini
body: moon
dtm: {kind: flat, size_m: [3, 2]}
horizon: {reach_m: 0}
terrain: {spacing_m: 0.25}
rocks: {library: {shapes: 1}, populations: []}
exports: [sdf, geotiff]
"""


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """A built tiny world."""
    folder = tmp_path_factory.mktemp("built")
    done = run("build", recipe(folder), "-o", folder / "out")
    assert done.returncode == 0, done.stderr
    return folder / "out"


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    file: RecipeFile = load_recipe(recipe(tmp_path_factory.mktemp("site")))
    return plan(file.recipe, folder=file.folder)


@pytest.fixture(scope="module")
def whole(site):
    """The world of the site."""
    return realise(site)


LAYOUT = """
manifest.json report.html preview.png timings.json world/world.json world/arrays.npz
world/shared.npz truth/surface.tif truth/surface_with_rocks.tif truth/rock_id.tif truth/rocks.csv
truth/size_frequency.json truth/size_frequency.png paths/arc.csv paths/arc.tum
sdf/world.sdf sdf/scene.sdf mjcf/world.xml mjcf/scene.xml usd/world.usda usd/scene.usda
validation/report.json
""".split()


def test_output_folder_is_whole(built):
    for name in LAYOUT:
        assert (built / name).is_file(), name
    assert list((built / "sdf" / "models").glob("*/model.config"))
    assert not [p for p in built.parent.iterdir() if p.name.startswith(".out")]


def test_manifest_names_every_file_and_no_place(built):
    manifest = json.loads((built / "manifest.json").read_text())
    files = {p.relative_to(built).as_posix() for p in built.rglob("*") if p.is_file()}
    assert set(manifest["outputs"]) == files - {"manifest.json", "timings.json"}
    assert manifest["seed"] == 5
    assert manifest["recipe"]["terrain"]["spacing_m"] == 0.25
    for name in ("manifest.json", "world/world.json", "validation/report.json", "report.html"):
        text = (built / name).read_text()
        assert str(built.parent) not in text, name
        assert str(ROOT) not in text, name
    assert list(manifest["inputs"]) == ["gale_floor_synthetic.tif"]


def test_saved_world_is_the_built_one(built, whole):
    loaded, fresh = World.load(built), whole
    assert loaded.site.dtm == fresh.site.dtm
    for name in ("ground", "appearance", "library", "field", "neighbours", "trajectories", "rover"):
        assert getattr(loaded, name) == getattr(fresh, name), name
    assert loaded == fresh


def test_truth_agrees_with_the_world(built):
    world = World.load(built)
    with rasterio.open(built / "truth" / "surface.tif") as file:
        surface, place = file.read(1), file.transform
        assert file.crs is not None
    assert np.array_equal(surface[::-1], world.ground.elevation)
    assert (place.c, place.f) == (-8.125, 6.125)
    with (built / "truth" / "rocks.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["id"]) for row in rows] == world.field.id.tolist()
    assert np.allclose([float(r["diameter_m"]) for r in rows], world.field.diameter, atol=1e-6)
    assert np.allclose(
        [float(r["mass_kg"]) for r in rows],
        [float(r["volume_m3"]) * world.site.body.rock_density for r in rows],
        rtol=1e-6,
    )


def digest(folder):
    names = sorted(p for p in folder.rglob("*") if p.is_file() and p.name != "timings.json")
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in names}


def test_another_seed_another_world(site, whole):
    other = realise(site.replace(seed=6))
    assert not np.array_equal(other.ground.elevation, whole.ground.elevation)
    assert len(other.field) != len(whole.field) or other.field != whole.field


def test_populations_do_not_disturb_each_other(site, whole):
    """Without the boulders, the pebbles keep ids, sizes, shapes; only those that one hit have
    moved."""
    from terrain_forge.recipe import recipe_json

    recipe_ = site.recipe
    fewer = recipe_.rocks.__class__(
        library=recipe_.rocks.library, populations=recipe_.rocks.populations[:1]
    )
    changed = recipe_.__class__(**{**vars(recipe_), "rocks": fewer})
    alone = realise(site.replace(recipe_json=recipe_json(changed), largest_rock=0.5)).field
    both = whole.field
    pebbles = both.select(both.population == 0)
    assert np.array_equal(alone.id, pebbles.id)
    assert np.array_equal(alone.diameter, pebbles.diameter)
    assert np.array_equal(alone.prototype, pebbles.prototype)
    still = np.all(alone.position[:, :2] == pebbles.position[:, :2], axis=1)
    assert 0.5 < still.mean() < 1.0


@pytest.mark.slow
def test_export_and_validate_a_built_folder(built, tmp_path):
    import shutil

    out = tmp_path / "copy"
    shutil.copytree(built, out)
    before = digest(out)
    shutil.rmtree(out / "usd")
    done = run("export", out, "--only", "usd")
    assert done.returncode == 0, done.stderr
    assert digest(out) == before
    (out / "validation" / "report.json").unlink()
    done = run("validate", out, "--quick")
    assert done.returncode == 0, done.stderr
    assert digest(out) == before
    done = run("export", out, "--only", "blend")
    assert done.returncode == 2
    assert "mjcf, rover, sdf, usd" in done.stderr
    assert digest(out) == before


def test_second_build_replaces_ours_and_refuses_others(built, tmp_path):
    path = recipe(tmp_path, MINI)
    out = tmp_path / "out"
    out.mkdir()
    (out / "mine.txt").write_text("precious")
    done = run("build", path, "-o", out)
    assert (done.returncode, (out / "mine.txt").read_text()) == (2, "precious")
    assert "not a terrain-forge world" in done.stderr
    (out / "mine.txt").unlink()
    assert run("build", path, "-o", out, "--only", "geotiff").returncode == 0
    assert run("build", path, "-o", out, "--only", "geotiff", "--seed", "6").returncode == 0
    assert json.loads((out / "manifest.json").read_text())["seed"] == 6
    assert not (out / "sdf").exists()
    assert run("build", path, "-o", built.parent / "tiny.yaml").returncode == 2
    done = run("build", path, "-o", "/proc/none/out")
    assert (done.returncode, done.stderr.count("\n")) == (3, 1)


@pytest.fixture
def heeded():
    """Children heed Ctrl-C and the terminal's end, which tests in the background may ignore."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    hangup = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGINT, before)
    signal.signal(signal.SIGHUP, hangup)


@pytest.mark.usefixtures("heeded")
@pytest.mark.parametrize(
    "number",
    [
        signal.SIGINT,
        *(pytest.param(n, marks=pytest.mark.slow) for n in (signal.SIGHUP, signal.SIGKILL)),
    ],
)
def test_interruption_leaves_nothing_half(tmp_path, number):
    path = recipe(tmp_path / "work", MINI)
    out = tmp_path / "work" / "out"
    process = subprocess.Popen(
        [sys.executable, "-m", "terrain_forge", "build", path, "-o", out],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    deadline = time.monotonic() + 60
    while not (out.parent / ".out.terrain-forge" / "out").exists():
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.005)
    process.send_signal(number)
    _, message = process.communicate()
    assert not out.exists()
    if number != signal.SIGKILL:
        assert process.returncode == 130
        assert "Traceback" not in message
        assert [p.name for p in out.parent.iterdir()] == ["tiny.yaml"]
        return
    assert run("build", path, "-o", out, "--only", "geotiff").returncode == 0
    assert sorted(p.name for p in out.parent.iterdir()) == ["out", "tiny.yaml"]


def test_a_dropped_interrupt_is_told_at_the_next_stage(monkeypatch):
    """Python drops what a finaliser raises."""

    class Finalised:
        def __del__(self):
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(0.05)

    dropped = []
    monkeypatch.setattr(sys, "unraisablehook", dropped.append)
    with listen_for_interrupts():
        ask_for_interrupt()
        Finalised()
        assert len(dropped) == 1
        with pytest.raises(KeyboardInterrupt):
            ask_for_interrupt()
    ask_for_interrupt()


def test_wrong_input_leaves_nothing(tmp_path):
    path = recipe(tmp_path, TINY.replace("spacing_m", "spacing"))
    done = run("build", path, "-o", tmp_path / "out")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert f"{path}:11: terrain.spacing: unknown key 'spacing'" in done.stderr
    assert [p.name for p in tmp_path.iterdir()] == ["tiny.yaml"]
    for command in ("export", "validate", "view"):
        more = ["--only", "usd"] if command == "export" else []
        done = run(command, tmp_path, *more)
        assert done.returncode == 2
        assert "not a terrain-forge world" in done.stderr


def test_check_and_init(tmp_path):
    done = run("check", recipe(tmp_path))
    assert done.returncode == 0, done.stderr
    for word in ("GTiff", "posting", "65 × 49 nodes", "rocks", "arc: ", "cost", "sun  "):
        assert word in done.stdout
    done = run("check", ROOT / "dtm_samples" / "moon_mare_synthetic.tif")
    assert "posting      2 m" in done.stdout
    first = tmp_path / "first"
    assert run("init", first).returncode == 0
    assert sorted(p.name for p in first.iterdir()) == ["gale_floor_synthetic.tif", "hello.yaml"]
    assert run("check", first / "hello.yaml").returncode == 0
    assert run("init", first).returncode == 2
    (first / "hello.yaml").unlink()
    (first / "hello.yaml").symlink_to(tmp_path / "elsewhere.yaml")
    done = run("init", first)
    assert (done.returncode, "hello.yaml exists already" in done.stderr) == (2, True)
    assert not (tmp_path / "elsewhere.yaml").exists()


def test_help_and_version():
    for command in ([], ["build"], ["check"], ["export"], ["validate"], ["view"], ["init"]):
        done = run(*command, "--help")
        assert done.returncode == 0
        assert "Usage: terrain-forge" in done.stdout
    assert run("--version").stdout.startswith("terrain-forge, version")
    assert run("bild").returncode == 2
