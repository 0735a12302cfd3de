"""Checks of the craters: as many as the law wants, of its sizes."""

from __future__ import annotations

from pathlib import Path

from terrain_forge.model import Check, at_least, at_most
from terrain_forge.validation.inspection import BuiltFolder, Inspection, read_json

LIMIT_Z = 3.29
"""Deviation of a number in standard deviations that 1 right world in 1000 exceeds."""
LIMIT_P = 0.001
"""Least p-value of the sizes."""


class Craters(Inspection):
    """Number and sizes of random craters."""

    kind = "craters"
    group = "craters"

    def checks(self, built: BuiltFolder) -> list[Check]:
        """Each layer's, as the truth has them."""
        return crater_checks(built.directory)


def crater_checks(directory: Path) -> list[Check]:
    """Number and sizes of each layer's random craters, as the built folder's truth has them."""
    checks = []
    for layer in read_json(directory / "truth" / "crater_counts.json").get("layers", ()):
        if "number" not in layer:
            continue
        title, number, sizes = f"craters {layer['name']}", layer["number"], layer["sizes"]
        if number["z"] is not None:
            note, off = f"{number['found']} craters, {number['expected']:.1f} expected", number["z"]
            checks.append(at_most(f"{title}: number, deviation", abs(off), LIMIT_Z, note=note))
        if sizes is not None:
            name, note = f"{title}: sizes, p-value", "Kolmogorov–Smirnov"
            checks.append(at_least(name, sizes["p_value"], LIMIT_P, note=note))
    return checks
