"""Files that are written whole."""

import pytest

from terrain_forge.base import OutputError, write_whole


def test_a_folder_where_a_file_goes_is_named_and_stays(tmp_path):
    (tmp_path / "table.csv").mkdir()
    with pytest.raises(OutputError, match=r"table\.csv is a folder, where a file goes: move"):
        write_whole(tmp_path / "table.csv", "a,b\n")
    assert [path.name for path in tmp_path.iterdir()] == ["table.csv"]
    (tmp_path / "link").symlink_to("table.csv")
    assert not write_whole(tmp_path / "link", "a,b\n").is_symlink()
