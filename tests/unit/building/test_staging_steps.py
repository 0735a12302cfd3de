"""The output folder when processes are killed, interrupted or refused by the disk at each step."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import shutil
import signal
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest

from terrain_forge.base import OutputError, StorageError, listen_for_interrupts, storing
from terrain_forge.building import (
    finish,
    read_manifest,
    replacing,
    require_ours,
    updating,
)
from terrain_forge.building import staging as staging_file
from terrain_forge.building.manifest import altered_files, foreign_files
from tests.helpers.staged import content, fill, names, write

EVENTS = {"open", "os.mkdir", "os.rename", "os.rmdir", "os.remove", "ctypes.dlsym", "os.scandir"}
STEPS = 200


@contextmanager
def child():
    """Run a block in a process of its own, and yield its status."""
    number = os.fork()
    status: list[int] = []
    if number:
        status.append(os.waitstatus_to_exitcode(os.waitpid(number, 0)[1]))
    yield status
    if not number:
        os._exit(0)


def at_step(step: int, act) -> None:
    """Act at the n-th step of this process in the file system."""
    seen = 0

    def hook(event: str, _: object) -> None:
        nonlocal seen
        if event in EVENTS:
            seen += 1
            if seen == step:
                act()

    sys.addaudithook(hook)


@pytest.mark.parametrize(
    ("exchange", "stride"),
    [
        (True, 17),
        (False, 13),
        pytest.param(False, 1, marks=pytest.mark.slow),
        pytest.param(True, 1, marks=pytest.mark.slow),
    ],
)
def test_killed_at_steps(tmp_path, monkeypatch, exchange, stride):
    if not exchange:
        monkeypatch.setattr(staging_file.ctypes, "CDLL", lambda *_, **__: object())
    target, statuses = tmp_path / "out", set()
    write(target, number=0)
    for step in range(1, STEPS, stride):
        with child() as status:
            if not status:
                at_step(step, lambda: os.kill(os.getpid(), signal.SIGKILL))
                write(target, number=step)
        statuses.update(status)
        if not exchange:  # then the world may be set aside, and the next writer brings it back
            with pytest.raises(ZeroDivisionError), replacing(target):
                raise ZeroDivisionError
        assert content(target) in ("world 0\n", f"world {step}\n")
        write(target, number=0)
        assert content(target) == "world 0\n"
        assert (names(tmp_path), names(target)) == (["out"], ["manifest.json", "sub"])
        if 0 in statuses:
            break
    assert statuses == {0, -signal.SIGKILL}


def change(target: Path, *, number: int) -> None:
    """Write anew what passes for an export and a report, beside a file that stays."""
    finish(target)
    manifest = json.loads((target / "manifest.json").read_text())
    with updating(target, anew=["sub"], foreign=["notes.txt"]) as folder:
        (folder / "report.html").write_text(f"report {number}\n")
        (folder / "sub" / "deep").mkdir(parents=True)
        for name in ("world.txt", f"deep/{number}.txt"):
            (folder / "sub" / name).write_text(f"world {number}\n")
        files = ("report.html", "kept.txt", "sub/world.txt", f"sub/deep/{number}.txt")
        manifest["outputs"] = {
            name: hashlib.sha256((folder / name).read_bytes()).hexdigest() for name in files
        }
        (folder / "manifest.json").write_text(json.dumps(manifest))


def make(target: Path) -> None:
    """A world of several files, one of which an update leaves as it is."""
    with replacing(target) as folder:
        fill(folder, number=0)
        (folder / "kept.txt").write_text("kept\n")
        manifest = json.loads((folder / "manifest.json").read_text())
        manifest["outputs"]["kept.txt"] = hashlib.sha256(b"kept\n").hexdigest()
        (folder / "manifest.json").write_text(json.dumps(manifest))
    change(target, number=0)


@pytest.fixture
def changed(tmp_path):
    """A world that was updated once."""
    make(tmp_path / "out")
    return tmp_path / "out"


@pytest.mark.slow
def test_an_update_is_killed_at_every_step(changed):
    """What comes next goes on from there: it takes no half-finished file for a user's."""
    target, statuses, mixed = changed, set(), 0
    kept = (target / "kept.txt").stat().st_ino
    for step in range(1, STEPS):
        with child() as status:
            if not status:
                at_step(step, lambda: os.kill(os.getpid(), signal.SIGKILL))
                change(target, number=step)
        statuses.update(status)
        assert require_ours(target) == ()
        if (target / ".terrain-forge" / "whole").exists():
            mixed += 1
            copy = target.parent / "copy" / "out"
            shutil.copytree(target, copy)
            write(copy, number=1)
            assert (names(copy.parent), content(copy)) == (["out"], "world 1\n")
            shutil.rmtree(copy.parent)
        change(target, number=0)
        manifest = read_manifest(target)
        assert not foreign_files(target, manifest)
        assert not altered_files(target, manifest)
        assert (target / "sub" / "deep" / "0.txt").read_text() == "world 0\n"
        assert (target / "kept.txt").stat().st_ino == kept
        if 0 in statuses:
            break
    assert statuses == {0, -signal.SIGKILL}
    assert mixed > 5


@pytest.mark.parametrize("stride", [23, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("act", [write, change])
def test_interrupted_at_steps(changed, act, stride):
    """The tidying itself is not interrupted."""
    step, statuses = 1 - stride, []
    while 0 not in statuses:
        step += stride
        with child() as status:
            if not status:
                signal.signal(signal.SIGINT, signal.default_int_handler)
                at_step(step, lambda: os.kill(os.getpid(), signal.SIGINT))
                try:
                    with listen_for_interrupts():
                        act(changed, number=step)
                except KeyboardInterrupt as error:
                    os._exit(131 if str(error) == f"{changed} is complete" else 130)
        statuses += status
        assert (names(changed.parent), ".terrain-forge" in names(changed)) == (["out"], False)
        done = (changed / "sub" / "world.txt").read_text() == f"world {step}\n"
        assert not altered_files(changed, read_manifest(changed))
        assert done == (status[0] in (0, 131))
    assert {*statuses} == {0, 130, 131}


@pytest.mark.parametrize("name", ["notes.txt", "report.html", "sub/world.txt", "sub/mine.txt"])
def test_what_a_user_puts_into_a_half_updated_world_stays(changed, name):
    with child() as status:
        if not status:
            moved: list[str] = []

            def killed(name: str, *arguments: object) -> None:
                if name == "os.rename" and "/whole/" in str(arguments[0]):
                    moved.append(name)
                    if len(moved) == 3:
                        os.kill(os.getpid(), signal.SIGKILL)

            sys.addaudithook(killed)
            change(changed, number=1)
    assert status == [-signal.SIGKILL]
    assert require_ours(changed) == ()
    (changed / name).write_text("precious")
    with pytest.raises(OutputError, match=name):
        write(changed, number=2)
    assert (changed / name).read_text() == "precious"
    finish(changed)
    assert (changed / name).read_text() == "precious"


@pytest.mark.parametrize("stride", [5, pytest.param(1, marks=pytest.mark.slow)])
def test_the_disk_is_full_at_steps(tmp_path, stride):
    target, ends = tmp_path / "out", set()
    write(target, number=0)

    came = []

    def full() -> None:
        came.append(True)
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    for step in range(1, STEPS, stride):
        with child() as status:
            if not status:
                at_step(step, full)
                try:
                    write(target, number=step)
                except StorageError as error:
                    os._exit(7 if "No space left" in str(error) else 8)
                except BaseException:
                    os._exit(9)
                os._exit(6 if came else 0)  # while clearing up, which goes on without
        ends.update(status)
        assert content(target) in ("world 0\n", f"world {step}\n")
        write(target, number=0)
        assert names(tmp_path) == ["out"]
        if 0 in ends:
            break
    assert ends <= {0, 6, 7}
    assert {0, 7} <= ends


def test_a_disk_that_takes_no_mark_keeps_no_empty_folder(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "pwrite", full)
    with pytest.raises(StorageError, match="No space left"):
        write(tmp_path / "out", number=1)
    assert names(tmp_path) == []


def test_racing_writers_end_with_one_whole_world(tmp_path):
    target = tmp_path / "out"
    for _ in range(2):
        numbers = []
        for number in range(4):
            pid = os.fork()
            if not pid:
                try:
                    write(target, number=number)
                    os._exit(0)
                except OutputError:
                    os._exit(2)
                except BaseException:
                    os._exit(9)
            numbers.append(pid)
        ends = [os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) for pid in numbers]
        assert set(ends) <= {0, 2}
        assert 0 in ends
        assert content(target).startswith("world")
        assert names(tmp_path) == ["out"]


def test_a_full_disk_that_a_library_tells_of_in_words(tmp_path):
    """OpenUSD cuts its file off then, after which the disk is not full any more."""
    told = "Failed writing usdc data: Error occurred writing file: No space left on device"
    for error, why in (
        (StorageError, r"w cannot be written: No space left on device$"),
        (RuntimeError, "no fault of the disk"),
    ):
        with pytest.raises(error, match=why), storing(tmp_path / "w", tmp_path):
            raise RuntimeError(told if error is StorageError else why)
