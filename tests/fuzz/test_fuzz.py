"""A short run of the fuzzers, and the inputs that once broke something."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.helpers.places import ROOT


def fuzz(*arguments: str, keep) -> str:
    """Run in a process of its own: this one may have threads, which no fork takes along."""
    command = [sys.executable, "-m", "tests.fuzz", *arguments, "--keep", str(keep)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{done.stdout}{done.stderr}"
    return done.stdout


@pytest.mark.slow
def test_what_once_broke_something_and_a_few_more(tmp_path):
    kinds = ("--kind", "recipes", "--kind", "files")
    found = fuzz("--corpus", "--inputs", "4", "--seed", "1", *kinds, "--builds", "0", keep=tmp_path)
    assert "0 findings" in found


@pytest.mark.slow
def test_some_more(tmp_path):
    """The same on each machine, however slow; time counts with `python -m tests.fuzz --timed`."""
    assert "0 findings" in fuzz("--inputs", "30", "--seed", "2", keep=tmp_path)
