"""Numbers as decimal text in arrays of bytes, for the kernels that write text formats."""

from __future__ import annotations

import numpy as np

from terrain_forge.base import inner


@inner
def put_integer(text, at, number):  # type: ignore[no-untyped-def]
    """Write a positive integer in decimal; returns where the text goes on."""
    width = 1
    power = 10
    while number >= power:
        width += 1
        power *= 10
    for place in range(width):
        text[at + width - 1 - place] = 48 + number % 10
        number //= 10
    return at + width


@inner
def put_number(text, at, value, decimals, unit):  # type: ignore[no-untyped-def]
    """Write a number rounded to so many decimals (unit = 10**decimals), without trailing zeros."""
    scaled = np.int64(np.rint(abs(value) * unit))
    if value < 0 and scaled > 0:
        text[at] = 45
        at += 1
    whole = scaled // unit
    fraction = scaled - whole * unit
    at = put_integer(text, at, whole)
    if fraction == 0:
        return at
    while fraction % 10 == 0:
        fraction //= 10
        decimals -= 1
    text[at] = 46
    for place in range(decimals):
        text[at + decimals - place] = 48 + fraction % 10
        fraction //= 10
    return at + decimals + 1
