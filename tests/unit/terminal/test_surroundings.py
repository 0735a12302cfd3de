"""What surrounds a command: closed streams, odd locales, folders that cannot be written."""

from __future__ import annotations

import ctypes
import errno
import os
import shlex
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from terrain_forge.base import OutputError, StorageError
from terrain_forge.recipe import write_starter
from terrain_forge.terminal import require_preview
from tests.helpers.command_line import run

COMMAND = f"{shlex.quote(sys.executable)} -m terrain_forge sites"


@pytest.mark.parametrize("closed", ["2>&-", ">&-", ">&- 2>&-", "<&- >&- 2>&-"])
def test_a_closed_stream_changes_no_status(closed):
    done = subprocess.run(
        f"{COMMAND} {closed}", shell=True, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    wrong = COMMAND.replace("sites", "init --recipe none")
    assert subprocess.run(f"{wrong} {closed}", shell=True, check=False).returncode == 2


@pytest.mark.parametrize("command", ["sites", "init --recipe none", "--help"])
def test_a_reader_that_goes_changes_no_status(command):
    words = [*shlex.split(COMMAND)[:-1], *command.split()]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as shown:
        shown.stdout.close()
        complaints = shown.stderr.read().decode()
    assert shown.returncode == (2 if "none" in command else 0)
    assert complaints.count("\n") == (1 if "none" in command else 0)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is full")
def test_a_stream_that_takes_nothing_is_named():
    done = subprocess.run(
        f"{COMMAND} > /dev/full", shell=True, stderr=subprocess.PIPE, text=True, check=False
    )
    assert done.returncode == 3
    assert "No space left on device: 'standard output'" in done.stderr
    silent = subprocess.run(f"{COMMAND} x 2> /dev/full", shell=True, check=False)
    assert silent.returncode == 2


def test_a_current_folder_that_was_removed_is_told(tmp_path):
    recipe = write_starter(tmp_path / "kept")
    command = f"{COMMAND.replace('sites', 'build')} {shlex.quote(str(recipe))}"
    (tmp_path / "gone").mkdir()
    done = subprocess.run(
        f"rmdir ../gone; {command}",
        shell=True, cwd=tmp_path / "gone", capture_output=True, text=True, check=False,
    )  # fmt: skip
    told = "terrain-forge: the current folder was removed: change to another\n"
    assert (done.returncode, done.stderr) == (3, told)


def test_a_shell_that_asks_for_completion_is_answered():
    asked = {"_TERRAIN_FORGE_COMPLETE": "bash_complete", "COMP_WORDS": "x ch", "COMP_CWORD": "1"}
    done = subprocess.run(
        shlex.split(COMMAND)[:-1],
        env=os.environ | asked,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "plain,check\n", "")


def test_an_interrupt_before_a_command_begins_is_one_line(monkeypatch):
    monkeypatch.setattr(ctypes, "CDLL", lambda _: signal.raise_signal(signal.SIGINT))
    done = run("sites")
    assert (done.returncode, done.stdout) == (130, "")
    assert done.stderr == "interrupted, nothing was left behind\n"


_EARLY = """
import os, signal, sys
from importlib.abc import MetaPathFinder

class Interrupting(MetaPathFinder):
    def find_spec(self, name, *_):
        if name == "click":
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Interrupting())
signal.signal(signal.SIGINT, signal.default_int_handler)
from terrain_forge.__main__ import run
run()
"""


def test_an_interrupt_before_the_command_line_is_there_has_no_traceback():
    done = subprocess.run([sys.executable, "-c", _EARLY], capture_output=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGINT, b"", b"")


@pytest.mark.parametrize("words", ["Unable to allocate 7 GiB", ""])
def test_no_more_memory_is_the_systems_fault(monkeypatch, words):
    def refuse(*_):
        raise MemoryError(words)

    monkeypatch.setattr("terrain_forge.dtm.place_lines", refuse)
    done = run("sites")
    assert done.returncode == 3
    told = f"terrain-forge: the system gives no more memory: {words or 'none is left'}\n"
    assert done.stderr == told


@pytest.mark.parametrize(
    "command",
    [
        *("validate loop", "export loop --only sdf", "record loop", "build hello.yaml -o loop/in"),
        *("cut loop --centre 0,0 --size 1,1", "illumination hello.yaml -o loop"),
        *("worlds hello.yaml -o loop", "build hello.yaml -o loop"),
    ],
)
def test_links_that_lead_in_a_circle_are_told(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_starter(tmp_path)
    Path("loop").symlink_to("loop")
    done = run(*command.split())
    assert done.returncode == 2
    assert done.complaints[-1].endswith("its symbolic links lead in a circle")
    assert Path("loop").is_symlink()
    assert run("check", "loop").stderr == "terrain-forge: no such file: loop\n"


def test_a_locale_without_a_letter_is_told_in_one_line(tmp_path):
    plain = {"PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "LC_ALL": "C"}
    command = [sys.executable, "-m", "terrain_forge", "init", os.fsencode(tmp_path / "Mös")]
    done = subprocess.run(
        command, env={**os.environ, **plain}, capture_output=True, text=True, check=False
    )
    assert "Traceback" not in done.stderr
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "Mös" / "hello.yaml").is_file()


def test_init_takes_a_dtm_that_is_the_same_and_no_other(tmp_path):
    write_starter(tmp_path)
    assert write_starter(tmp_path, "mars_ripples") == tmp_path / "mars_ripples.yaml"
    other = tmp_path / "other"
    other.mkdir()
    (other / "gale_floor_synthetic.tif").write_bytes(b"mine")
    with pytest.raises(OutputError, match="exists already: choose another folder"):
        write_starter(other)
    assert [path.name for path in other.iterdir()] == ["gale_floor_synthetic.tif"]


def test_a_folder_that_cannot_be_written_is_the_disks_fault(tmp_path, monkeypatch):
    def refuse(*_, **__):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    with monkeypatch.context() as patch:
        patch.setattr(shutil, "copyfile", refuse)
        with pytest.raises(StorageError, match="Read-only file system"):
            write_starter(tmp_path / "new")
    with monkeypatch.context() as patch:
        patch.setattr(os, "access", lambda path, how: False)
        with pytest.raises(StorageError, match="its folder is read-only"):
            require_preview(tmp_path / "x_preview.png")
    with pytest.raises(OutputError, match="is no folder"):
        write_starter(Path("/dev/null"))


def test_a_command_that_is_told_can_be_pasted(tmp_path):
    folder = tmp_path / "my & <b> world"
    told = run("init", folder).stdout
    assert shlex.split(told.partition("then run  ")[2])[-1] == str(folder / "hello.yaml")
