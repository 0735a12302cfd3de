"""The output folder: whole or not at all, one writer, and nothing of a user's removed unsaid."""

from __future__ import annotations

import json
import os
import resource
import shutil
from pathlib import Path

import pytest

from terrain_forge.base import DataError, OutputError
from terrain_forge.building import (
    finish,
    folder_state,
    read_manifest,
    replacing,
    require_apart,
    require_ours,
    updating,
)
from terrain_forge.building import staging as staging_file
from terrain_forge.building.manifest import MARK, altered_files
from terrain_forge.validation import content_of
from tests.helpers.command_line import run
from tests.helpers.places import ROOT
from tests.helpers.staged import content, fill, names, write
from tests.unit.building.test_build import MINI

RECIPE = MINI.replace("sdf, ", "")


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """A recipe and its world."""
    folder = tmp_path_factory.mktemp("small")
    (folder / "mini.yaml").write_text(RECIPE)
    done = run("build", folder / "mini.yaml", "-o", folder / "out")
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture
def world(small, tmp_path):
    """A copy of the world, and its recipe beside it."""
    shutil.copytree(small / "out", tmp_path / "out")
    (tmp_path / "mini.yaml").write_text(RECIPE)
    return tmp_path / "out"


def build(out: Path, *more: object, recipe: Path | None = None):
    return run("build", recipe or out.parent / "mini.yaml", "-o", out, *more)


def test_an_assessment_holds_for_what_it_assessed(world):
    """Not for edited files or another version's; what is written anew is left out."""
    manifest = read_manifest(world)
    assert folder_state(world, manifest).intact
    assert not folder_state(world, {**manifest, "terrain_forge": "0"}).intact
    assert not folder_state(world, {**manifest, "versions": {}}).intact
    (world / "geotiff" / "elevation.tif").write_text("edited")
    assert not folder_state(world, manifest).intact
    assert folder_state(world, manifest, "geotiff/").intact
    (world / "validation" / "report.json").write_text("{}")
    assert not folder_state(world, manifest, "geotiff/").intact


def test_files_of_others_are_named_and_stay(world):
    (world / "notes.txt").write_text("precious")
    (world / "geotiff" / "mine.tif").write_text("precious")
    (world / "link").symlink_to(world.parent)
    (world / "empty").mkdir()
    done = build(world)
    assert done.returncode == 2
    assert "4 files that its manifest does not list: empty/, geotiff/mine.tif, link" in done.stderr
    assert done.stderr.count("\n") == 1
    assert (world / "notes.txt").read_text() == "precious"
    out = world.parent / "through"
    out.symlink_to(world)
    done = build(out, "--force", "--seed", 3)
    assert done.returncode == 0, done.stderr
    assert out.is_symlink()
    assert "removed from" in done.stdout
    assert "notes.txt" in done.stdout
    assert read_manifest(world)["seed"] == 3
    assert not (world / "notes.txt").exists()
    assert (world.parent / "mini.yaml").exists()


def test_a_file_that_was_edited_stays(tmp_path):
    target = tmp_path / "out"
    write(target, number=1)
    file = target / "sub" / "world.txt"
    os.utime(file)  # a file that was only touched is no hindrance
    assert require_ours(target) == ()
    file.write_text("edited")
    with pytest.raises(OutputError, match=r"1 file changed since it was built: sub/world\.txt"):
        write(target, number=2)
    assert file.read_text() == "edited"
    assert require_ours(target, force=True) == ("sub/world.txt",)


@pytest.mark.parametrize("force", [(), ("--force",)])
def test_the_recipe_and_its_inputs_stay(world, force):
    recipe = world / "mine.yaml"
    recipe.write_text(RECIPE)
    through = world.parent / "through"
    through.symlink_to(world)
    for path, out in ((recipe, world), (through / "mine.yaml", world), (recipe, through)):
        done = build(out, *force, recipe=path)
        assert (done.returncode, "mine.yaml lies in it" in done.stderr) == (2, True)
    recipe.unlink()
    dem = world / "geotiff" / "elevation.tif"  # the world's own file may not be its input either
    flat = "{kind: flat, size_m: [3, 2]}"
    text = RECIPE.replace(flat, f"{{source: {dem}, size_m: [2, 1], centre: {{offset_m: [0, 0]}}}}")
    (world.parent / "mini.yaml").write_text(text)
    done = build(world, *force)
    assert (done.returncode, "elevation.tif lies in it" in done.stderr) == (2, True)
    assert dem.exists()


def test_from_within_the_world(world, monkeypatch):
    (world / "mine.yaml").write_text(RECIPE)
    monkeypatch.chdir(world)
    assert run("build", "mine.yaml", "-o", "../out").returncode == 2
    assert run("build", "mine.yaml", "-o", ".").returncode == 2
    assert (world / "mine.yaml").read_text() == RECIPE


@pytest.mark.parametrize(
    "text",
    [
        '{"terrain_forge": 1}', "[]", "{", "1", "[" * 100_000, "\0",
        '{"terrain_forge": 1, "format": 2, "outputs": [], "varying": [], "exports": {}}',
        '{"terrain_forge": 1, "format": 2, "outputs": {"a": 1}, "varying": [], "exports": {}}',
        '{"terrain_forge": 1, "format": 2, "outputs": {"../a": ""}, "varying": [], "exports": {}}',
        '{"terrain_forge": 1, "format": 2, "outputs": {}, "varying": ["b/../../a"], "exports": {}}',
        '{"terrain_forge": 1, "format": 2, "outputs": {}, "varying": ["/a"], "exports": {}}',
    ],
)  # fmt: skip
def test_a_manifest_that_is_none_protects(tmp_path, text):
    out = tmp_path / "out"
    out.mkdir()
    (out / "manifest.json").write_text(text)
    (out / "a").write_text("precious")
    (tmp_path / "mini.yaml").write_text(RECIPE)
    for force in ((), ("--force",)):
        done = build(out, *force)
        assert (done.returncode, done.stderr.count("\n")) == (2, 1)
        assert names(out) == ["a", "manifest.json"]


def test_an_export_keeps_files_of_others(world):
    mine = world / "geotiff" / "mine.tif"
    mine.write_text("precious")
    (world / "notes.txt").write_text("precious")
    done = run("export", world, "--only", "geotiff")
    assert (done.returncode, "geotiff/mine.tif" in done.stderr) == (2, True)
    assert mine.exists()
    done = run("export", world, "--only", "geotiff", "--force")
    assert not mine.exists()
    assert done.returncode == 1  # the notes are no part of the world
    assert (world / "notes.txt").exists()
    assert "notes.txt" not in (world / "manifest.json").read_text()
    assert "notes.txt" in build(world).stderr


def test_a_validation_names_what_was_added_and_keeps_it(world):
    for name in ("drive_notes.txt", "report.txt"):
        (world / "validation" / name).write_text("precious")
    done = run("validate", world, "--quick")
    assert done.returncode == 1
    assert "failed: files: added: 2, limit 0 (validation/drive_notes.txt, valid" in done.stderr
    report = json.loads((world / "validation" / "report.json").read_text())
    failed = [check for check in report["checks"] if not check["passed"]]
    assert [(check["name"], check["figure"]) for check in failed] == [("files: added", 2.0)]
    assert (world / "validation" / "drive_notes.txt").exists()


def test_a_manifest_of_another_recipe_is_named(world):
    path = world / "manifest.json"
    manifest = json.loads(path.read_text())
    told = {**manifest, "seed": 5, "recipe": {**manifest["recipe"], "seed": 5}}
    path.write_text(json.dumps(told))
    done = run("validate", world, "--quick")
    assert done.returncode == 1
    assert "altered: 1, limit 0 (manifest.json: seed and recipe)" in done.stderr
    assert json.loads(path.read_text())["seed"] == manifest["seed"], "that of the saved world"


def test_an_edited_report_is_written_anew_only_by_force(world):
    report = world / "validation" / "report.json"
    for edited in (world / "report.html", report):
        edited.write_text(edited.read_text() + "\n")
        older = edited.read_bytes()
        for command in (("validate", world, "--quick"), ("export", world, "--only", "geotiff")):
            done = run(*command)
            told = f"1 file changed since it was built: {edited.relative_to(world)}; move"
            assert (done.returncode, told in done.stderr) == (2, True)
            assert edited.read_bytes() == older
        done = run("validate", world, "--quick", "--force")
        assert (done.returncode, f"removed from {world}: " in done.stderr) == (0, True)
        assert not altered_files(world, read_manifest(world))


def test_a_manifest_cannot_have_files_elsewhere_removed(world):
    precious = world.parent / "precious.txt"
    precious.write_text("precious")
    manifest = json.loads((world / "manifest.json").read_text())
    manifest["varying"] = ["validation/../../precious.txt", str(precious)]
    (world / "manifest.json").write_text(json.dumps(manifest))
    run("validate", world, "--quick")
    assert precious.exists()


def test_one_writer_at_a_time(tmp_path):
    target = tmp_path / "out"
    for _ in range(2):
        with replacing(target) as folder:
            with pytest.raises(OutputError, match="being written by another"), replacing(target):
                pass
            fill(folder, number=1)
        assert names(tmp_path) == ["out"]
    with updating(target):
        for writer in (replacing, updating):
            with pytest.raises(OutputError, match="being written by another"), writer(target):
                pass
    assert content(target) == "world 1\n"


def test_what_a_killed_build_left_is_cleared(tmp_path):
    left = tmp_path / ".out.terrain-forge"
    (left / "out" / "half").mkdir(parents=True)
    (left / "lock").write_bytes(MARK)
    write(tmp_path / "out", number=1)
    assert names(tmp_path) == ["out"]


@pytest.mark.parametrize("kind", ["folder", "lock", "link", "file"])
def test_a_folder_of_others_in_the_staging_place_stays(tmp_path, kind):
    """It is told from ours by what its lock holds; links are not followed."""
    target, home = tmp_path / "out", tmp_path / "home"
    write(target, number=1)
    for place in (target / ".terrain-forge", tmp_path / ".out.terrain-forge"):
        folder = home if kind == "link" else place
        if kind == "file":
            place.write_text("precious")
        else:
            folder.mkdir(exist_ok=True)
            (folder / "docs").mkdir(exist_ok=True)
            (folder / "docs" / "a").write_text("precious")
        if kind in ("lock", "link"):
            (folder / "lock").write_bytes(MARK if kind == "link" else b"mine")
        if kind == "link":
            place.symlink_to(home)
        before = sorted(tmp_path.rglob("*"))
        with pytest.raises(OutputError, match=r"in the way|does not list"):
            write(target, number=2)
        if place.parent == target:
            with pytest.raises(OutputError, match="in the way"), updating(target):
                pass
        assert sorted(tmp_path.rglob("*")) == before
        shutil.rmtree(place) if place.is_dir() and kind != "link" else place.unlink()


def test_only_the_staging_place_itself_is_passed_over(tmp_path):
    target = tmp_path / "out"
    write(target, number=1)
    (target / "sub" / "notes.terrain-forge").mkdir()
    (target / "sub" / "notes.terrain-forge" / "a").write_text("precious")
    with pytest.raises(OutputError, match=r"sub/notes\.terrain-forge/a"):
        write(target, number=2)


def test_an_edit_is_found_whatever_its_time_and_the_manifest_s(tmp_path):
    target = tmp_path / "out"
    write(target, number=1)
    file = target / "sub" / "world.txt"
    file.write_text("edited")
    os.utime(file, (0, 0))
    os.utime(target / "manifest.json")
    with pytest.raises(OutputError, match="changed since it was built"):
        write(target, number=2)
    fill_anew = tmp_path / "other"
    write(fill_anew, number=1)

    def late() -> None:
        with replacing(fill_anew) as folder:
            fill(folder, number=2)
            (fill_anew / "sub" / "world.txt").write_text("edited")
            os.utime(fill_anew / "sub" / "world.txt", (0, 0))

    with pytest.raises(OutputError, match="changed since it was built"):
        late()
    assert (fill_anew / "sub" / "world.txt").read_text() == "edited"


def test_a_forged_manifest_does_not_give_up_a_file(tmp_path):
    target = tmp_path / "out"
    write(target, number=1)
    (target / "notes.txt").write_text("precious")
    manifest = read_manifest(target)
    manifest["varying"] = ["notes.txt"]
    (target / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(OutputError, match=r"notes\.txt"):
        write(target, number=2)


@pytest.mark.parametrize("name", ["validation", "report.html", "manifest.json"])
def test_nothing_is_written_through_a_link(world, name):
    kept = world.parent / "kept"
    (world / name).rename(kept)
    (world / name).symlink_to(kept)
    before = kept.stat().st_mtime_ns
    done = run("validate", world, "--quick")
    assert (done.returncode, "is a link" in done.stderr) == (2, True)
    assert kept.stat().st_mtime_ns == before


@pytest.mark.parametrize("kind", ["file", "link", "edit"])
def test_an_export_does_not_take_the_place_of_others(world, kind):
    place = world / ("geotiff" if kind == "edit" else "mesh")
    if kind == "file":
        place.write_text("precious")
    elif kind == "link":
        place.symlink_to(world.parent)
    else:
        file = place / "elevation.tif"
        file.write_bytes(file.read_bytes() + b" ")
    done = run("export", world, "--only", place.name)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert place.name in done.stderr
    assert place.is_symlink() or place.is_file() or file.read_bytes()[-1:] == b" "


@pytest.mark.parametrize("name", ["a" * 300, "a" * 250, "ö" * 130, "/".join(["a" * 200] * 20)])
def test_a_name_that_no_folder_can_have(tmp_path, name):
    with pytest.raises(OutputError, match=r"^output folder .{1,21}…: \d+ bytes long, at most \d+$"):
        require_apart(tmp_path / name, ())
    require_apart(tmp_path / ("a" * 240), ())


def test_parents_go_where_nothing_came_of_it(tmp_path):
    with pytest.raises(ZeroDivisionError), replacing(tmp_path / "a" / "b" / "out"):
        raise ZeroDivisionError
    assert names(tmp_path) == []


def test_what_came_in_during_a_build_stays(tmp_path):
    target = tmp_path / "out"
    write(target, number=1)

    def late() -> None:
        with replacing(target) as folder:
            fill(folder, number=2)
            (target / "late.txt").write_text("precious")

    with pytest.raises(OutputError, match=r"late\.txt"):
        late()
    assert (target / "late.txt").read_text() == "precious"


def test_without_an_exchange_of_folders(tmp_path, monkeypatch):
    monkeypatch.setattr(staging_file.ctypes, "CDLL", lambda *_, **__: object())
    for number in (1, 2):
        write(tmp_path / "out", number=number)
        assert content(tmp_path / "out") == f"world {number}\n"
    assert names(tmp_path) == ["out"]


def test_a_mount_point_is_told():
    with pytest.raises(OutputError, match="mount point"):
        require_ours(Path("/proc"))


def test_a_limit_on_file_sizes_is_one_line(world, monkeypatch):
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")  # or Python's own are cut off too
    before = (world / "manifest.json").read_bytes()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    ends = []
    for limit in (0, 300, 3_000, 30_000, 300_000):
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
        try:
            done = build(world, "--seed", 4)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        ends.append((done.returncode, len(done.complaints), "too large" in done.stderr))
    assert ends == [(3, 1, True)] * 5, ends
    assert (world / "manifest.json").read_bytes() == before
    assert sorted(names(world.parent)) == ["mini.yaml", "out"]


@pytest.mark.parametrize("part", [{"losses": 3}, {"kind": None}, {"options": []}])
def test_a_manifest_with_odd_exports_is_none_of_ours(tmp_path, part):
    write(tmp_path / "out", number=0)
    path = tmp_path / "out" / "manifest.json"
    odd = {"geotiff": {"kind": "geotiff", "options": {}, "losses": [], **part}}
    path.write_text(json.dumps({**json.loads(path.read_text()), "exports": odd}))
    with pytest.raises(OutputError, match="not one of this version"):
        read_manifest(tmp_path / "out")


@pytest.mark.parametrize("text", ["{", "[]", '{"a": "\udcff'])
def test_damaged_files_of_a_world_are_named(tmp_path, text):
    (tmp_path / "report.json").write_text(text, encoding="utf-8", errors="surrogateescape")
    with pytest.raises(DataError, match=r"report\.json is damaged"):
        content_of(tmp_path / "report.json")


@pytest.mark.parametrize("command", ["build", "worlds"])
def test_an_address_is_no_folder(tmp_path, monkeypatch, command):
    """Such as fsspec and Dask take; nothing is made of it here."""
    monkeypatch.chdir(tmp_path)
    done = run(command, ROOT / "recipes/hello.yaml", "-o", "s3://bucket/a/b")
    assert done.returncode == 2
    assert "s3://bucket/a/b is an address" in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_folder_may_be_called_as_an_address_begins(tmp_path):
    (tmp_path / "s3:").mkdir()
    require_apart(tmp_path / "s3:/out", ())
    require_apart(tmp_path / "C:/out", ())


def test_added_and_edited_files_are_named_together_and_a_recording_as_one_thing(world):
    own = ("dataset.json", "mav0/a.csv", "slam/evaluation.csv", "slam/imu_1/imu.tum")
    for name in (*own, "written.csv", "mine/ate.txt", "slam/notes.txt"):
        (world / "dataset" / name).parent.mkdir(parents=True, exist_ok=True)
        (world / "dataset" / name).write_text("{}")
    (world / "dataset" / "written.csv").write_text("#size [bytes],file\n2,mav0/a.csv\n")
    (world / "notes.txt").write_text("precious")
    (world / "geotiff" / "elevation.tif").write_text("edited")
    done = build(world)
    assert done.returncode == 2
    recorded, mine = "dataset/ (5 files of a recording)", "dataset/mine/ate.txt, dataset/slam/notes"
    added = f"8 files that its manifest does not list: {recorded}, {mine}.txt, notes.txt"
    edited = "1 file changed since it was built: geotiff/elevation.tif"
    assert f"{world} holds {added}, and {edited}; move them away, or let --force" in done.stderr
    done = build(world, "--force")
    assert done.returncode == 0, done.stderr
    told = f"{recorded}, {mine}.txt, geotiff/elevation.tif, notes.txt"
    assert f"removed from {world}: {told}\n" in done.stdout
    assert not (world / "dataset").exists()


def left_whole(target: Path, gone: str = "[]") -> Path:
    """A world, and its changed copy as a killed process leaves it; returns the copy."""
    write(target, number=1)
    copy = target / ".terrain-forge" / "whole" / target.name
    copy.mkdir(parents=True)
    fill(copy, number=2)
    (copy.parent / "gone.json").write_text(gone)
    (copy.parents[1] / "lock").write_bytes(MARK)
    return copy


def home_of(folder: Path) -> Path:
    (folder / "home" / "sub").mkdir(parents=True)
    (folder / "home" / "sub" / "world.txt").write_text("precious")
    return folder / "home"


def test_a_copy_left_whole_takes_no_place_through_a_link(tmp_path):
    home, target = home_of(tmp_path), tmp_path / "out"
    left_whole(target)
    shutil.rmtree(target / "sub")
    (target / "sub").symlink_to(home / "sub")
    with pytest.raises(OutputError, match=r"out/sub is in the way"):
        finish(target)
    assert (home / "sub" / "world.txt").read_text() == "precious"
    (target / "sub").unlink()
    finish(target)
    assert content(target) == "world 2\n"


@pytest.mark.parametrize("name", ["old", "next", "whole", "whole/out"])
def test_no_part_of_a_staging_folder_is_a_link(tmp_path, name):
    home, target = home_of(tmp_path), tmp_path / "out"
    left_whole(target)
    place = target / ".terrain-forge" / name
    shutil.rmtree(place, ignore_errors=True)
    place.symlink_to(home)
    with updating(target):
        pass
    assert content(target) == ("world 2\n" if name in ("old", "next") else "world 1\n")
    assert [path.name for path in home.rglob("*")] == ["sub", "world.txt"]


@pytest.mark.parametrize("gone", ["", "[", "5", "[1]", "[" * 9000])
def test_a_damaged_list_of_what_is_to_go_is_told(tmp_path, gone):
    target = tmp_path / "out"
    copy = left_whole(target, gone)
    with pytest.raises(OutputError, match=r"whole is damaged: gone\.json .*; move it away"):
        finish(target)
    (copy.parent / "gone.json").unlink()
    os.mkfifo(copy.parent / "gone.json")
    with pytest.raises(OutputError, match=r"gone\.json"):
        finish(target)
    assert (target / "sub" / "world.txt").read_text() == "world 1\n"


def test_a_lock_that_is_a_pipe_is_a_user_s(tmp_path):
    target = tmp_path / "out"
    write(target, number=1)
    (target / ".terrain-forge").mkdir()
    os.mkfifo(target / ".terrain-forge" / "lock")
    with pytest.raises(OutputError, match="in the way"), updating(target):
        pass


def test_an_assessment_is_not_written_through_a_link_in_its_folder(world):
    """Not even where the manifest lists the link as the file that it leads to."""
    (mine := world.parent / "mine").write_bytes((world / "validation/report.json").read_bytes())
    (world / "validation/report.json").unlink()
    (world / "validation/report.json").symlink_to(mine)
    before = mine.stat()
    done = run("validate", world, "--quick")
    assert (done.returncode, "is a link" in done.stderr) == (2, True)
    assert (mine.stat().st_mtime_ns, mine.stat().st_nlink) == (before.st_mtime_ns, 1)
