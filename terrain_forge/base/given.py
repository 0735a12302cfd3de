"""Numbers that a Python user gives to a function."""

from __future__ import annotations

from numbers import Integral

import numpy as np
from numpy.typing import ArrayLike

from terrain_forge.base.arrays import Array
from terrain_forge.base.errors import DataError


def given_numbers(values: ArrayLike, what: str) -> Array:
    """Values in double precision, of any shape.

    Args:
        values: What is given.
        what: What it is, for the message.

    Raises:
        DataError: if they are no finite numbers.
    """
    try:
        numbers = np.asarray(values, np.float64)
    except (TypeError, ValueError):
        raise DataError(f"{what} must be numbers, in rows of one length") from None
    if not np.isfinite(numbers).all():
        raise DataError(f"{what} must be finite")
    return numbers


def require_measurement(number: int, count: int, whose: str) -> None:
    """Refuse what is not the number, from 0, of one of some measurements.

    Raises:
        DataError: says which there are.
    """
    whole = isinstance(number, Integral) and not isinstance(number, bool)
    if not whole or not 0 <= number < count:
        raise DataError(f"{whose} has no measurement {number}: 0 to {count - 1}")
