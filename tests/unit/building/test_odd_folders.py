"""Files of a world that cannot be read, and folders that somebody is in."""

from __future__ import annotations

import json

import pytest

from terrain_forge.base import OutputError
from terrain_forge.building import (
    altered_files,
    folder_state,
    hash_found,
    read_manifest,
    require_ours,
    write_manifest,
)
from tests.helpers import worlds


@pytest.fixture
def folder(tmp_path):
    """A folder of two files that its manifest lists, one of them a link to no file by now."""
    for name in ("a.txt", "b.txt"):
        (tmp_path / name).write_text(name)
    write_manifest(worlds.site(), tmp_path, exports=())
    (tmp_path / "b.txt").unlink()
    (tmp_path / "b.txt").symlink_to("/proc/self/mem")
    return tmp_path


def test_one_that_cannot_be_read_is_altered(folder):
    manifest = json.loads((folder / "manifest.json").read_text())
    assert altered_files(folder, manifest) == {"b.txt": manifest["outputs"]["b.txt"]}
    assert "Input/output error" in hash_found(folder / "b.txt")


def test_a_new_manifest_keeps_what_it_should_be(folder):
    manifest = json.loads((folder / "manifest.json").read_text())
    state = folder_state(folder, manifest)
    write_manifest(worlds.site(), folder, exports=(), known=state.altered)
    assert json.loads((folder / "manifest.json").read_text()) == manifest


@pytest.mark.parametrize("below", ["", "inner"])
def test_the_folder_that_one_is_in_is_not_replaced(tmp_path, monkeypatch, below):
    (tmp_path / "out" / below).mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "out" / below)
    with pytest.raises(OutputError, match="you are in it"):
        require_ours(tmp_path / "out")
    monkeypatch.chdir(tmp_path)
    require_ours(tmp_path / "new")


def test_a_manifest_that_cannot_be_read_is_no_fault_of_the_disk_that_is_written(folder):
    (folder / "manifest.json").unlink()
    (folder / "manifest.json").symlink_to("/proc/self/mem")
    with pytest.raises(OutputError, match=r"manifest\.json is damaged: not JSON"):
        read_manifest(folder)
