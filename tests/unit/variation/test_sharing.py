"""What worlds have alike is written once, and never taken for something else."""

from __future__ import annotations

import errno
import os
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest

from terrain_forge.base import read_arrays
from terrain_forge.model import SHARED_ARRAYS
from terrain_forge.variation.sharing import SharedArchive, share

SHAPES = {"a": np.arange(3000.0), "b": np.zeros((2, 3), np.uint8)}


def stored(folder: Path, arrays: dict[str, np.ndarray], pool: Path) -> dict[str, str]:
    """Store arrays as a world of a series does; returns the hashes that need no reading."""
    file = folder / SHARED_ARRAYS
    file.parent.mkdir(parents=True)
    pool.mkdir(exist_ok=True)
    archive = SharedArchive(pool)
    archive.write(file, arrays)
    hashes = {SHARED_ARRAYS: sha256(file.read_bytes()).hexdigest()}
    share(folder, hashes, pool)
    archive.keep(hashes)
    return archive.known


def test_what_the_last_world_had_is_linked(tmp_path):
    assert stored(tmp_path / "0", SHAPES, tmp_path / "pool") == {}
    again = {name: array.copy() for name, array in SHAPES.items()}
    for world in ("1", "2"):
        known = stored(tmp_path / world, again, tmp_path / "pool")
        file = tmp_path / world / SHARED_ARRAYS
        assert known == {SHARED_ARRAYS: sha256(file.read_bytes()).hexdigest()}
        assert file.samefile(tmp_path / "0" / SHARED_ARRAYS)


@pytest.mark.parametrize(
    "other",
    [
        {"a": SHAPES["a"] + 1.0, "b": SHAPES["b"]},
        {"a": SHAPES["a"].astype(np.float32), "b": SHAPES["b"]},
        {"a": SHAPES["a"] * np.where(SHAPES["a"] > 0.0, 1.0, -1.0), "b": SHAPES["b"]},
        {"a": SHAPES["a"], "b": np.asfortranarray(SHAPES["b"])},
        {"b": SHAPES["b"], "a": SHAPES["a"]},
        {"a": SHAPES["a"]},
    ],
)
def test_other_arrays_are_written(tmp_path, other):
    stored(tmp_path / "0", SHAPES, tmp_path / "pool")
    assert stored(tmp_path / "1", other, tmp_path / "pool") == {}
    found = read_arrays(tmp_path / "1" / SHARED_ARRAYS)
    assert [*found] == [*other]
    assert all(np.array_equal(found[name], other[name]) for name in other)


def test_a_pool_that_changed_meanwhile_is_not_trusted(tmp_path):
    pool = tmp_path / "pool"
    stored(tmp_path / "0", SHAPES, pool)
    (kept,) = pool.iterdir()
    kept.unlink()
    kept.write_bytes(b"of somebody else" * 1000)
    assert stored(tmp_path / "1", SHAPES, pool) == {}
    found = read_arrays(tmp_path / "1" / SHARED_ARRAYS)
    assert np.array_equal(found["a"], SHAPES["a"])
    assert stored(tmp_path / "2", SHAPES, pool)
    kept.unlink()
    assert stored(tmp_path / "3", SHAPES, pool) == {}


def test_another_pool_is_not_linked_to(tmp_path):
    stored(tmp_path / "0", SHAPES, tmp_path / "pool")
    assert stored(tmp_path / "1", SHAPES, tmp_path / "other") == {}


def test_a_damaged_file_of_the_pool_that_cannot_be_replaced_is_not_linked(tmp_path, monkeypatch):
    """Such as one that a power cut left, where the file system takes no more links."""
    pool = tmp_path / "pool"
    stored(tmp_path / "0", SHAPES, pool)
    (kept,) = pool.iterdir()
    kept.unlink()
    kept.write_bytes(b"cut short" * 1000)
    link = os.link

    def full(source, target):
        if Path(target).name.endswith("-shared"):
            raise OSError(errno.EMLINK, "Too many links")
        link(source, target)

    monkeypatch.setattr(os, "link", full)
    for world in ("1", "2"):
        assert stored(tmp_path / world, SHAPES, pool) == {}
        found = read_arrays(tmp_path / world / SHARED_ARRAYS)
        assert np.array_equal(found["a"], SHAPES["a"])
