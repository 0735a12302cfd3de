"""Whether a built world's rocks lie apart, are whole, and have the sizes that were asked for."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from terrain_forge.model import Check, World, at_least, at_most
from terrain_forge.rocks import find_overlaps
from terrain_forge.truth import shape_figures
from terrain_forge.validation.inspection import BuiltFolder, Inspection

SIGNIFICANCE = 0.001
"""A correct sampler's rocks fall below this p-value once in a thousand worlds."""
UNPLACED_LIMIT = 0.001
"""Part of the rocks that may find no free place."""


class Rocks(Inspection):
    """Rocks apart from each other, all placed, whole, and of the sizes asked for."""

    kind = "rocks"
    group = "rocks"

    def checks(self, built: BuiltFolder) -> list[Check]:
        """Of all rocks, and of the truth's verification where there is one."""
        world = built.world
        verification = _read(built.directory / "truth" / "size_frequency.json")
        return [
            *_place_checks(world, [part["name"] for part in verification.get("lists", ())]),
            *_size_checks(verification),
            *_shape_checks(world, verification.get("shapes", {})),
        ]


def _read(verification: Path) -> dict[str, Any]:
    """The truth bundle's verification, empty where there is none."""
    if not verification.is_file():
        return {}
    content: dict[str, Any] = json.loads(verification.read_text(encoding="utf-8"))
    return content


def _place_checks(world: World, lists: list[str]) -> list[Check]:
    """No two rocks overlap but listed ones, and all have found a place."""
    count, unplaced = len(world.field), sum(world.unplaced)
    overlaps = find_overlaps(world, lists=lists)
    note = f"pairs of {count} rocks, seen from above"
    if overlaps.scattered:
        note += f"; first: {overlaps.scattered[0][0]}, {overlaps.scattered[0][1]}"
    if overlaps.listed:
        note += f"; besides {len(overlaps.listed)} of listed rocks"
    limit = float(max(math.ceil(UNPLACED_LIMIT * (count + unplaced)), 1))
    return [
        at_most("rocks: overlaps", float(len(overlaps.scattered)), 0.0, note=note),
        at_most("rocks: without a free place", float(unplaced), limit, note=f"besides {count}"),
    ]


def _size_checks(verification: dict[str, Any]) -> list[Check]:
    """Kolmogorov–Smirnov p-values of the populations, as the truth bundle has them."""
    return [
        at_least(
            f"rocks: sizes of {population['name']}",
            population["kolmogorov_smirnov"]["p_value"],
            SIGNIFICANCE,
            note=f"p-value of the size law, {population['count']['observed']} rocks",
        )
        for population in verification.get("populations", ())
        if population["kolmogorov_smirnov"]
    ]


def _shape_checks(world: World, wanted: dict[str, Any]) -> list[Check]:
    """The library's meshes are closed, and its collision parts as near as the recipe asks."""
    if not len(world.field):
        return []
    found = shape_figures(world.library)
    return [
        at_most("shapes: open meshes", float(found["count"] - found["watertight"]), 0.0,
                note=f"of {found['count']} shapes, all levels of detail and collision parts"),
        at_most("shapes: collision volume in excess", found["largest_hull_excess"],
                wanted.get("hull_excess_limit"), note="largest, as a part of the shape's volume"),
        at_most("shapes: collision surface off", found["largest_hull_distance"],
                wanted.get("hull_distance_limit"),
                note="largest distance, as a part of the shape's mean axis"),
        at_most("shapes: outlines of coarse levels off", found["largest_outline_error"], None,
                note="largest distance, as a part of the shape's mean axis"),
    ]  # fmt: skip
