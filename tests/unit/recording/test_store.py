"""The list of a recording's files, when it is damaged."""

from __future__ import annotations

import os

import pytest

from terrain_forge.base import MAX_STATE, OutputError
from terrain_forge.recording.store import WRITTEN, Store


def test_sizes_that_are_none_are_passed_over(tmp_path):
    lines = "#size [bytes],file", "3,a.bin", f"{'9' * 5000},b.bin", "²,c.bin", "4"
    (tmp_path / WRITTEN).write_text("\n".join(lines), encoding="utf-8")
    assert Store(tmp_path).size == 3


def test_a_list_that_is_none_is_in_the_way(tmp_path):
    path = tmp_path / WRITTEN
    with path.open("wb") as file:
        file.truncate(MAX_STATE + 1)
    with pytest.raises(OutputError, match="is in the way"):
        Store(tmp_path)
    path.unlink()
    os.mkfifo(path)
    with pytest.raises(OutputError, match="is in the way"):
        Store(tmp_path)
