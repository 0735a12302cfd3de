"""Checks of the craters: as many as the law wants, of its sizes."""

from __future__ import annotations

import json
from pathlib import Path

from terrain_forge.model import Check, at_least, at_most
from terrain_forge.validation.inspection import BuiltFolder, Inspection

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
    counts = directory / "truth" / "crater_counts.json"
    if not counts.is_file():
        return []
    checks = []
    for layer in json.loads(counts.read_text(encoding="utf-8"))["layers"]:
        if "number" not in layer:
            continue
        title, number, sizes = f"craters {layer['name']}", layer["number"], layer["sizes"]
        if number["z"] is not None:
            note = f"{number['found']} craters, {number['expected']:.1f} expected"
            checks.append(
                at_most(f"{title}: number, deviation", abs(number["z"]), LIMIT_Z, note=note)
            )
        if sizes is not None:
            checks.append(
                at_least(
                    f"{title}: sizes, p-value", sizes["p_value"], LIMIT_P, note="Kolmogorov–Smirnov"
                )
            )
    return checks
