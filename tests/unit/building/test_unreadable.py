"""Files of a world that cannot be read count as altered, and are named."""

from __future__ import annotations

import json

import pytest

from terrain_forge.building import altered_files, folder_state, hash_found, write_manifest
from tests.helpers import worlds


@pytest.fixture
def folder(tmp_path):
    """A folder of two files that its manifest lists, one of them a link to no file by now."""
    for name in ("a.txt", "b.txt"):
        (tmp_path / name).write_text(name)
    write_manifest(worlds.site(), tmp_path, exports=(), altered={})
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
    write_manifest(worlds.site(), folder, exports=(), altered=state.altered)
    assert json.loads((folder / "manifest.json").read_text()) == manifest
