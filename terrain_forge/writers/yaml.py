"""Numbers as YAML's readers take them."""

from __future__ import annotations


def yaml_number(value: float) -> str:
    """A number that reads back as it is, with a point even before an exponent.

    YAML 1.1 takes 1e-05 for a word, and OpenCV 1 for no real number.
    """
    head, mark, power = repr(float(value)).partition("e")
    return f"{head if '.' in head or not head[-1].isdigit() else f'{head}.0'}{mark}{power}"
