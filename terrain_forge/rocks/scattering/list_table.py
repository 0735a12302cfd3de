"""What the table of a user's own rocks must hold."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import DataError, InputFile, Key
from terrain_forge.model import Table

ROCK_LIST = InputFile(
    kind="table",
    columns=("x_m", "y_m", "diameter_m"),
    optional=("yaw_deg", "buried_fraction", "prototype"),
)
"""Every list has the place east and north of the centre and the exposed plan diameter [m]; it may
have the turn anticlockwise [degrees], the buried part of the height, and the index of the shape in
the library."""
SMALLEST = 1e-3
"""Diameter of the smallest rock that a list may give [m]."""
DEEPEST = 0.5
"""Largest buried part that a list may give."""


def check_list(table: Table, *, size: tuple[float, float], shapes: int, key: Key) -> None:
    """Refuse listed rocks that cannot lie on a site.

    Args:
        table: the list.
        size: the site, east and north [m].
        shapes: how many shapes the library has.
        key: where in the recipe the file is named.

    Raises:
        DataError: names the first rock that is wrong, counted from 1, and what is allowed.
    """
    limits = {
        "x_m": (-0.5 * size[0], 0.5 * size[0]),
        "y_m": (-0.5 * size[1], 0.5 * size[1]),
        "diameter_m": (SMALLEST, 0.5 * min(size)),
        "yaw_deg": (-360.0, 360.0),
        "buried_fraction": (0.0, DEEPEST),
        "prototype": (0.0, shapes - 1.0),
    }
    for name in table.columns:
        low, high = limits[name]
        values = table.column(name)
        _require((values >= low) & (values <= high), table, name, f"{low:g} to {high:g}", key)
    if "prototype" in table.columns:
        values = table.column("prototype")
        _require(values == np.floor(values), table, "prototype", "whole numbers", key)


def _require(good: NDArray[np.bool_], table: Table, name: str, allowed: str, key: Key) -> None:
    if not good.all():
        row = int(np.argmin(good))
        value = float(table.column(name)[row])
        raise DataError(
            f"{table.path}: {name} of rock {row + 1} is {value:g}, allowed: {allowed}", key=key
        )
