"""What values are of a type."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from typing_extensions import TypeAliasType

from terrain_forge.base.errors import DataError
from terrain_forge.base.given import is_of, require_kind

Numbers = TypeAliasType("Numbers", NDArray[np.float64])
"""As NumPy has its own `NDArray` since 2.5."""
Width = TypeAliasType("Width", float)


@pytest.mark.parametrize("kind", [NDArray[np.float64], Numbers, Numbers | None])
def test_an_alias_is_what_it_stands_for(kind):
    assert is_of(np.zeros(3), kind)
    assert not is_of(np.array(["x"]), kind)


def test_an_alias_inside_a_tuple_is_too():
    assert is_of((np.zeros(3), np.ones(2)), tuple[Numbers, ...])
    assert not is_of((np.zeros(3), "x"), tuple[Numbers, ...])


def test_an_alias_is_told_as_what_it_stands_for():
    with pytest.raises(DataError, match=r"^width must be a number, found 'x'$"):
        require_kind("x", Width, "width")
