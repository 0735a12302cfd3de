"""Which path is recorded."""

from __future__ import annotations

import pytest

from terrain_forge.base import RecipeError
from terrain_forge.recording.setting import named_path


def test_the_first_path_is_taken_where_none_is_named_alone() -> None:
    assert named_path(["arc", "loop"], None) == "arc"
    assert named_path(["arc", "loop"], "loop") == "loop"
    with pytest.raises(RecipeError, match=r"no path is called '', the world has: arc, loop"):
        named_path(["arc", "loop"], "")
