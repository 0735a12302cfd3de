"""Python in other processes: what lies in the current folder is not run."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from terrain_forge.base import python_words, run_tasks
from terrain_forge.validation import python_with

TRAPS = "random", "numpy", "numba", "json", "pickle", "tempfile", "types", "lazy_loader", "signal"


@pytest.fixture
def trap(tmp_path: Path, monkeypatch: Any) -> Iterator[Path]:
    """The current folder, with modules that leave a file where they run."""
    folder = tmp_path / "downloads"
    folder.mkdir()
    for name in TRAPS:
        text = f"open({str(tmp_path / 'run')!r}, 'a').write({name!r}); raise SystemExit(9)"
        (folder / f"{name}.py").write_text(text)
    monkeypatch.chdir(folder)
    yield folder
    assert not (tmp_path / "run").exists(), (tmp_path / "run").read_text()


def absolute(number: int) -> int:
    """What a task does here."""
    return abs(number)


@pytest.mark.usefixtures("trap")
def test_tasks_are_not_trapped() -> None:
    assert dict(run_tasks(absolute, [-1, 2], workers=1)) == {-1: 1, 2: 2}


@pytest.mark.slow
@pytest.mark.usefixtures("trap")
@pytest.mark.filterwarnings("ignore")
def test_nor_are_those_of_a_cluster(monkeypatch: Any) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setenv("PYTHONSAFEPATH", "")  # it is set for good, which goes with the test
    monkeypatch.delenv("PYTHONSAFEPATH")
    found = dict(run_tasks(absolute, [-1, 2], workers=1, scheduler="local"))
    assert found == {-1: 1, 2: 2}


@pytest.mark.usefixtures("trap")
def test_code_and_its_arguments_are_not_trapped() -> None:
    code = '"""A program."""\nfrom __future__ import annotations\nimport random\nprint(sys.argv[1])'
    done = subprocess.run([*python_words(code), "told"], capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("told\n", "")


def test_another_python_is_asked_alike(trap: Path, monkeypatch: Any) -> None:
    other = trap / "python"  # reached by another name, it is not ours
    other.symlink_to(sys.executable)
    monkeypatch.setenv("THEIRS", str(other))
    assert python_with("tomllib", "THEIRS") == other


@pytest.mark.usefixtures("trap")
def test_the_command_by_its_module_finds_its_own() -> None:
    for word in ("lazy_loader", "types", "signal"):  # Python itself looks there before we can
        Path(f"{word}.py").unlink()
    command = [sys.executable, "-m", "terrain_forge", "check", "missing.yaml"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, ""), done.stderr


def test_windows_is_refused_in_a_line() -> None:
    asked = "import sys; sys.platform = 'win32'; import terrain_forge"
    words = [sys.executable, "-c", asked]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].endswith("on Windows install it in WSL 2")
