"""The size-frequency laws that are installed, and the largest rock that one expects."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Union

from terrain_forge.base import BY_KIND, parts, portable
from terrain_forge.rocks.laws.law import SizeLaw

if TYPE_CHECKING:
    SizeFrequency = SizeLaw
else:
    _LAWS = parts(SizeLaw, "terrain_forge.rocks.laws", "terrain_forge.size_laws")
    SizeFrequency = Annotated[Union[_LAWS], BY_KIND]  # noqa: UP007 (a tuple, not a list)

_RANGE = 1e-9, 1e6
"""Diameters [m] among which the largest rock is looked for."""


def largest_diameter(law: SizeLaw, area: float) -> float:
    """The diameter D [m] that one rock of an area [m²] is expected to exceed: N(>D) · area = 1.

    0 where less than one rock of any size is expected.
    """
    from scipy.optimize import brentq

    def surplus(log_diameter: float) -> Any:
        return law.cumulative_number(portable.exp(log_diameter)) * area - 1.0

    low, high = portable.log(_RANGE)
    if surplus(low) <= 0.0:
        return 0.0
    return float(portable.exp(brentq(surplus, low, high, xtol=1e-14)))
