"""Rocks counted tile by tile, and the size-frequency verification of all tiles together.

Counts are exact. Sizes are counted in classes between diameters that are the same in each tile, so
the Kolmogorov–Smirnov distance is that at their ends: less than that of single rocks by the part of
the rocks in one class at most, which is told.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, portable
from terrain_forge.model import Site, World
from terrain_forge.rocks import Expectation, PopulationSpec, find_overlaps
from terrain_forge.truth.counts import ExpectedCounts, Sample
from terrain_forge.truth.size_frequency import compared_totals, curve_columns
from terrain_forge.truth.statistics import CONFIDENCE, SIGNIFICANCE, smirnov

_POINTS, _FINER = 65, 8
"""Diameters of a curve, and classes between neighbours of them."""
_MISSING = "unplaced", "unsupported"
"""What is told of rocks that are not there."""
Counts = dict[str, Any]


def class_edges(spec: PopulationSpec) -> Array:
    """The diameters [m] between which a population's rocks are counted, ascending."""
    return portable.geomspace(*spec.diameters, (_POINTS - 1) * _FINER + 1)


def count_rocks(world: World, rock_id: NDArray[np.int32]) -> Counts:
    """What the verification needs of a part of a site, as JSON."""
    rocks, sample = world.site.recipe.rocks, Sample(world, rock_id)
    scattered, _ = find_overlaps(world, lists=[spec.name for spec in rocks.lists])
    own = set(world.field.id.tolist())
    return {
        "area_m2": sample.area,
        "left_out_m2": sample.left_out,
        "overlaps": sum(low in own for low, _ in scattered),
        "populations": [_count(world, sample, spec) for spec in rocks.populations],
        "lists": [len(sample.select([spec.name])) for spec in rocks.lists],
    }


def _count(world: World, sample: Sample, spec: PopulationSpec) -> Counts:
    field, edges = sample.select([spec.name]), class_edges(spec)
    expectation = ExpectedCounts.of(spec, world).expectation
    parts: defaultdict[float, float] = defaultdict(float)
    for area, largest in expectation.parts:
        parts[largest] += area
    index = np.clip(np.searchsorted(edges, field.diameter, side="right") - 1, 0, len(edges) - 2)
    areas = 0.25 * np.pi * field.diameter**2
    return {
        "number": len(field),
        "cover_m2": np.bincount(index // _FINER, areas, minlength=_POINTS - 1).tolist(),
        "nodes": sample.nodes([spec.name]),
        "classes": np.bincount(index, minlength=len(edges) - 1).tolist(),
        "parts": sorted([area, largest] for largest, area in parts.items()),
        "area_variance": expectation.area_variance,
        "dynamic": int(np.count_nonzero(field.dynamic)),
        "visual_only": int(np.count_nonzero(~field.collides)),
        "unplaced": sample.unplaced.get(spec.name, 0),
        "unsupported": sample.unsupported.get(spec.name, 0),
    }


def write_merged(site: Site, counts: Iterable[Counts], directory: Path) -> dict[str, Any]:
    """Write size_frequency.json and its picture for a site counted in parts; returns the first."""
    from terrain_forge.truth.size_frequency_figure import write_figure

    merged = merge_counts(site, counts)
    directory.mkdir(parents=True, exist_ok=True)
    text = json.dumps(merged, indent=1, allow_nan=False) + "\n"
    (directory / "size_frequency.json").write_text(text, encoding="utf-8")
    write_figure(merged, directory / "size_frequency.png")
    return merged


def merge_counts(site: Site, counts: Iterable[Counts]) -> dict[str, Any]:
    """The verification of all parts of a site together, as `size_frequency` has it of a world.

    Evenness, burial and the shapes are not in it. Of clustered populations the variance is the sum
    of the parts', as if no cluster lay across a border.
    """
    specs, lists = site.recipe.rocks.populations, site.recipe.rocks.lists
    area = left_out = 0.0
    overlaps, listed = 0, np.zeros(len(lists), np.int64)
    sums = [_Sum(spec) for spec in specs]
    for part in counts:
        area += part["area_m2"]
        left_out += part["left_out_m2"]
        overlaps += part["overlaps"]
        listed += np.array(part["lists"], np.int64)
        for one, found in zip(sums, part["populations"], strict=True):
            one.add(found)
    shown = [one for one in sums if area > 0.0]
    cell = site.spacing**2
    return {
        "area_m2": area,
        "corridor_area_m2": left_out,
        "confidence": CONFIDENCE,
        "populations": [one.told(area, cell) for one in shown],
        "together": _together(shown, area, cell) if shown else None,
        "lists": [],
        "listed": {spec.name: int(n) for spec, n in zip(lists, listed, strict=True)},
        "overlaps": {"pairs": overlaps},
    }


class _Sum:
    """The rocks of a population while its parts are added."""

    def __init__(self, spec: PopulationSpec) -> None:
        self.spec, self.edges = spec, class_edges(spec)
        self.classes = np.zeros(len(self.edges) - 1, np.int64)
        self.cover = np.zeros(_POINTS - 1)
        self.whole: defaultdict[str, int] = defaultdict(int)
        self._parts: defaultdict[float, float] = defaultdict(float)
        self._variance = 0.0

    def add(self, found: Counts) -> None:
        self.classes += np.array(found["classes"], np.int64)
        self.cover += np.array(found["cover_m2"])
        for name in ("number", "nodes", "dynamic", "visual_only", *_MISSING):
            self.whole[name] += found[name]
        for area, largest in found["parts"]:
            self._parts[largest] += area
        self._variance += found["area_variance"]

    @property
    def wanted(self) -> ExpectedCounts:
        """What there should be of it."""
        parts = tuple(sorted((area, largest) for largest, area in self._parts.items()))
        return ExpectedCounts(
            law=self.spec.size_frequency,
            smallest=self.spec.diameters[0],
            expectation=Expectation(parts=parts, area_variance=self._variance),
        )

    def above(self) -> tuple[Array, Array]:
        """Rocks above each diameter of a curve, and the sum of their πD²/4 [m²]."""
        number = np.append(np.cumsum(self.classes[::-1])[::-1], 0)[::_FINER]
        return number, np.append(np.cumsum(self.cover[::-1])[::-1], 0.0)

    def told(self, area: float, cell: float) -> dict[str, Any]:
        law = self.spec.size_frequency
        return {
            "name": self.spec.name,
            "law": law.told(),
            "fit_to_counts": law.fit_to_counts(*self.spec.diameters),
            "arrangement": self.spec.arrangement.kind,
            "effective_area_m2": self.wanted.expectation.area,
            **_compared(area, cell, [self]),
            "dynamic": self.whole["dynamic"],
            "visual_only": self.whole["visual_only"],
            **{name: self.whole[name] for name in _MISSING},
        }


def _together(sums: Sequence[_Sum], area: float, cell: float) -> dict[str, Any]:
    return {
        **_compared(area, cell, sums),
        **{name: sum(one.whole[name] for one in sums) for name in _MISSING},
    }


def _compared(area: float, cell: float, sums: Sequence[_Sum]) -> dict[str, Any]:
    """Rocks of some populations against the sum of what they should be."""
    wanted = [one.wanted for one in sums]
    count, nodes = (sum(one.whole[name] for one in sums) for name in ("number", "nodes"))
    totals = compared_totals(wanted, area, count, float(sum(one.cover.sum() for one in sums)))
    totals["cover"] |= {
        "outline": nodes * cell / area,
        "outline_error": float(np.sqrt(nodes)) * cell / area,
    }
    (smallest, _), number = totals["diameter_m"], totals["count"]["expected"]
    at = sums[0].edges[::_FINER] if len(sums) == 1 else None
    if at is None:
        at = portable.geomspace(smallest, max(float(s.edges[-1]) for s in sums), _POINTS)
    larger = np.sum([_at(at, one, 0) for one in sums], axis=0)
    found = np.sum([_at(at, one, 1) for one in sums], axis=0)
    return {
        **totals,
        "kolmogorov_smirnov": _distance(sums[0], number) if len(sums) == 1 else None,
        "curve": curve_columns(at, wanted, area, larger, found),
    }


def _at(at: Array, one: _Sum, quantity: int) -> Array:
    """Number or area of a population's rocks above diameters, from those of its own curve."""
    own = one.edges[::_FINER]
    values = one.above()[quantity].astype(np.float64)
    return np.asarray(np.interp(at, own, values, left=values[0], right=0.0))


def _distance(one: _Sum, total: float) -> dict[str, float] | None:
    """Largest distance from the law at the classes' ends; None where no rock is or should be."""
    count = one.whole["number"]
    if count == 0 or total <= 0.0:
        return None
    below = np.cumsum(one.classes) / count
    law = 1.0 - one.wanted.number_above(one.edges[1:]) / total
    return {
        **smirnov(float(np.abs(below - law).max()), count),
        "largest_class": float(one.classes.max() / count),
        "significance": SIGNIFICANCE,
    }
