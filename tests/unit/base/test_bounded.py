"""No array is larger than the bytes that a file has for it."""

from __future__ import annotations

import io
import json
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest

from terrain_forge.base import (
    MAX_STATE,
    DataError,
    OutputError,
    read_arrays,
    read_bytes,
    read_json,
    read_lines,
    write_arrays,
)
from terrain_forge.model import World


def header(shape: tuple[int, ...]) -> bytes:
    text = str({"descr": "<f8", "fortran_order": False, "shape": shape}).ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text.encode()


def archive(path, content: bytes, method: int = zipfile.ZIP_STORED) -> None:
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("a.npy", content, method)


def test_what_is_saved_is_read(tmp_path):
    arrays = {"a": np.arange(6.0).reshape(2, 3), "b": np.array(7), "c": np.zeros((0, 3), "i4")}
    np.savez(tmp_path / "a.npz", **arrays)
    found = read_arrays(tmp_path / "a.npz")
    assert {*found} == {*arrays}
    assert all(np.array_equal(found[name], arrays[name]) for name in arrays)


def test_what_is_mapped_stays_in_the_file(tmp_path):
    """It begins where any kernel takes it, is read when it is looked at, and cannot be written."""
    arrays = {"a": np.arange(3e6).reshape(-1, 3), "bb": np.array(7), "c": np.zeros((0, 3), "i4")}
    arrays |= {f"d{n * 'd'}": np.arange(n, dtype="i2") for n in range(1, 40)}
    path = tmp_path / "a.npz"
    write_arrays(path, arrays)
    with np.load(path) as others:
        assert all(np.array_equal(others[name], arrays[name]) for name in arrays)
    found = read_arrays(path, mapped=True)
    assert {*found} == {*arrays}
    for name, array in found.items():
        assert type(array) is np.ndarray
        assert array.dtype == arrays[name].dtype
        assert np.array_equal(array, arrays[name])
        assert array.ctypes.data % 64 == 0 or not array.size
        assert not (array.size and array.flags.writeable)
    with path.open("r+b") as file:
        place = path.read_bytes().index(np.float64(2e6).tobytes())
        file.seek(place)
        file.write(np.float64(5.0).tobytes())
    assert found["a"].ravel()[2_000_000] == 5.0
    with pytest.raises(DataError, match="CRC"):
        read_arrays(path, mapped=True)


def test_what_cannot_be_mapped_is_read(tmp_path):
    arrays = {"a": np.arange(6.0).reshape(2, 3).T, "b": np.arange(5.0)}
    np.savez(tmp_path / "a.npz", **arrays)
    found = read_arrays(tmp_path / "a.npz", mapped=True)
    assert all(np.array_equal(found[name], arrays[name]) for name in arrays)


@pytest.mark.parametrize("shape", [(10**10, 10), (2**62, 4), (3,)])
def test_a_header_that_claims_more(tmp_path, shape):
    archive(tmp_path / "a.npz", header(shape) + bytes(16))
    with pytest.raises(DataError, match="not of the size it says"):
        read_arrays(tmp_path / "a.npz")


def test_a_bomb(tmp_path):
    archive(tmp_path / "a.npz", header((2**22,)) + bytes(2**25), zipfile.ZIP_DEFLATED)
    with pytest.raises(DataError, match="is compressed"):
        read_arrays(tmp_path / "a.npz")


def test_objects_are_not_unpacked(tmp_path):
    stream = io.BytesIO()
    np.save(stream, np.array([{}], object), allow_pickle=True)
    archive(tmp_path / "a.npz", stream.getvalue())
    with pytest.raises(DataError, match=r"not of the size|Object arrays"):
        read_arrays(tmp_path / "a.npz")


def leaves(plain, place=()):
    """Where the values of a JSON document stand."""
    if not isinstance(plain, dict | list) or not plain:
        yield place
        return
    for key, value in plain.items() if isinstance(plain, dict) else enumerate(plain):
        yield from leaves(value, (*place, key))


def swapped(plain, place, value):
    """A copy of a JSON document with another value at a place."""
    if not place:
        return value
    changed = plain.copy()
    changed[place[0]] = swapped(plain[place[0]], place[1:], value)
    return changed


@pytest.mark.parametrize("other", [{"a": 1}, [["x"]]], ids=["mapping", "list"])
def test_a_saved_world_holds_values_of_its_own_types(tmp_path, small_world, other):
    text = small_world.save(tmp_path)[0]
    plain = json.loads(text.read_text())
    places = [place for place in leaves(plain["world"]) if place[-1] != "record"]
    assert len(places) > 300
    for place in places[:: len(places) // 30]:
        found = {**plain, "world": swapped(plain["world"], place, other)}
        text.write_text(json.dumps(found))
        with pytest.raises(OutputError, match="no readable terrain-forge world") as caught:
            World.load(tmp_path)
        assert "\n" not in str(caught.value)


def test_a_world_of_nothing_readable(tmp_path):
    (tmp_path / "world").mkdir()
    (tmp_path / "world" / "arrays.npz").write_bytes(b"PK")
    for text in (
        '{"format": 7}',
        "[" * 100_000,
        "\0",
        "5",
        '{"format": 7, "world": {"record": []}}',
    ):
        (tmp_path / "world" / "world.json").write_text(text)
        with pytest.raises(OutputError, match="no readable terrain-forge world"):
            World.load(tmp_path)


@pytest.mark.parametrize("text", ["[" * 100_000, "{", "9" * 5000, "\ud800"])
def test_what_is_no_json_is_told_in_one_line(text, tmp_path):
    path = tmp_path / "state.json"
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    with pytest.raises(DataError, match=r"^state\.json"):
        read_json(path, path.name)
    path.write_text('{"a": [1]}', encoding="utf-8")
    assert read_json(path, path.name) == {"a": [1]}


def test_a_state_that_would_fill_the_memory_is_not_read(tmp_path):
    path = tmp_path / "state.json"
    with path.open("wb") as file:
        file.truncate(MAX_STATE + 1)
    with pytest.raises(DataError, match="at most 256 MiB"):
        read_json(path, path.name)


def test_a_table_is_read_line_by_line(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes("a,b\r\n1,ä\n".encode())
    assert [line.strip() for line in read_lines(path, "a.csv")] == ["a,b", "1,ä"]
    with path.open("wb") as file:
        file.truncate(2**33)
    with pytest.raises(DataError, match=r"a\.csv: a line has more than 10,000 characters"):
        list(read_lines(path, "a.csv"))


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="no such files here")
def test_no_more_is_read_than_a_file_says_it_has(tmp_path):
    (tmp_path / "a").write_bytes(b"four")
    assert read_bytes(tmp_path / "a", "a") == b"four"
    assert read_bytes(Path("/proc/self/status"), "status") == b""
