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


def listed(folder, *lines):
    """A recording's folder with a list of these lines, beside a folder of a user's."""
    home = folder / "home"
    (home / "Documents").mkdir(parents=True)
    (home / "Documents" / "thesis").write_text("mine")
    dataset = folder / "dataset"
    dataset.mkdir()
    (dataset / WRITTEN).write_text("\n".join(("#size [bytes],file", *lines, "")), encoding="utf-8")
    return dataset, home / "Documents" / "thesis"


@pytest.mark.parametrize("line", ["0,x/Documents/", "4,x/Documents/thesis", "1,x/new/file"])
def test_what_is_listed_behind_a_link_stays(tmp_path, line):
    dataset, thesis = listed(tmp_path, line)
    (dataset / "x").symlink_to("../home")
    with pytest.raises(OutputError, match=r"dataset/x is a link"), Store(dataset) as store:
        store.clear()
    assert thesis.read_text() == "mine"


@pytest.mark.parametrize("name", ["./", ".", "", "/", "a/..", "../home/", "x//", "./x"])
def test_names_that_are_no_place_of_their_own_are_passed_over(tmp_path, name):
    dataset, thesis = listed(tmp_path, f"0,{name}")
    (dataset / "notes").write_text("mine")
    with Store(dataset) as store:
        store.clear()
    assert (dataset / "notes").read_text() == thesis.read_text() == "mine"


def test_nothing_is_written_through_links(tmp_path):
    dataset, thesis = listed(tmp_path)
    (dataset / "mav0").symlink_to(thesis.parent)
    (dataset / ".writing").symlink_to(thesis)
    with Store(dataset) as store:
        with pytest.raises(OutputError, match="mav0 is a link"):
            store.put("mav0/data.csv", b"ours")
        with pytest.raises(OutputError, match="mav0 is a link"):
            store.free_folder("mav0")
        store.put("a/data.csv", b"ours")
        store.settle()
    assert thesis.read_text() == "mine"
    assert [path.name for path in thesis.parent.iterdir()] == ["thesis"]
    (dataset / WRITTEN).rename(tmp_path / "list")
    (dataset / WRITTEN).symlink_to(tmp_path / "list")
    with pytest.raises(OutputError, match="is in the way"):
        Store(dataset)


def test_a_file_that_a_power_cut_has_shortened_is_not_held(tmp_path):
    with Store(tmp_path) as store:
        store.put("a.bin", b"ours")
    (tmp_path / "a.bin").write_bytes(b"")
    with Store(tmp_path) as store:
        assert not store.holds("a.bin")
        store.put("a.bin", b"ours")
        assert store.holds("a.bin")
