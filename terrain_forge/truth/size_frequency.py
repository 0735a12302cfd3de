"""Size-frequency verification: whether a world's rocks are as many and as large as asked for."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, portable
from terrain_forge.model import RockLibrary, World
from terrain_forge.rocks import find_overlaps
from terrain_forge.truth.counts import ExpectedCounts, Sample
from terrain_forge.truth.rasters import rock_rasters
from terrain_forge.truth.statistics import (
    CONFIDENCE,
    NORMAL_QUANTILE,
    clark_evans,
    count_band,
    deviation,
    kolmogorov_smirnov,
)

if TYPE_CHECKING:
    from terrain_forge.rocks import PopulationSpec, RockListSpec, RocksSpec


_POINTS = 65


def write_size_frequency(
    world: World,
    directory: Path,
    *,
    rocks: RocksSpec | None = None,
    rock_id: NDArray[np.int32] | None = None,
    figure: bool = True,
) -> list[Path]:
    """Write size_frequency.json and, unless not wished, size_frequency.png; returns both.

    Arguments as of `size_frequency`.
    """
    verification = size_frequency(world, rocks=rocks, rock_id=rock_id)
    text, picture = directory / "size_frequency.json", directory / "size_frequency.png"
    text.write_text(json.dumps(verification, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    if not figure:
        return [text]
    from terrain_forge.truth.size_frequency_figure import write_figure

    write_figure(verification, picture)
    return [text, picture]


def size_frequency(
    world: World,
    *,
    rocks: RocksSpec | None = None,
    rock_id: NDArray[np.int32] | None = None,
) -> dict[str, Any]:
    """Expected and observed rocks of each population and of all together, and their shapes.

    Diameters are exposed plan diameters [m]; densities and covers are over `area_m2`, that of the
    window without corridors and exclusion zones, whose rocks are left out too; cover is Σ π D²/4.
    For each population:

    - `law`: its numbers; `extrapolated_below_m`, if it was fitted to larger rocks only than wanted;
    - `fit_to_counts`: how well a law that was fitted to counted rocks fits these (`p_value`,
      `counted_above` with Poisson errors) and how far it is extrapolated; null for other laws. It
      says nothing of the world's rocks, nor do the figures below of the counted ones;
    - `arrangement`, and `effective_area_m2`: the area on which the law alone gives that number;
    - `count`: expected and observed number, the standard deviation of a correct sampler, z;
    - `cover`: the same of the cover; `outline`, the part of the ground that is seen to be rock from
      above, counted at the ground's nodes, and `outline_error`, its standard error at most;
    - `kolmogorov_smirnov`: distance from the truncated law, its p-value and the distance that is
      critical at 5 %; null where there is no rock, and for populations together of which one is
      clustered, since then their shares are not the expected ones;
    - `clark_evans`: mean distance to the nearest rock over that of random points, with Donnelly's
      correction for edges, and z; null for less than two rocks. Rocks do not overlap, so dense
      Poisson populations lie a little more evenly than random points, all the more the denser;
    - `curve`: number per m² and cover of rocks above each diameter, with the band that holds a
      right sampler at each diameter with a probability of 95 %;
    - `dynamic`: rocks of the diameters that are to be dynamic, how many are, and how many found no
      rest and are fixed; null if none are to;
    - `burial`: mean buried part of the others' heights, expected and observed, its standard
      deviation, and how many lie `deeper` than any was asked to, since the ground falls away under
      them; null where there are none;
    - `visual_only`: rocks that nothing touches;
    - `unplaced`: rocks of the window that found no free place;
    - `unsupported`: rocks that are left out, since the ground falls away beneath them however deep
      they are buried: the observed number is smaller by them.

    `lists` has the rocks that the user listed one by one, which no law describes, and how many more
    of them lie `in_corridors` or exclusion zones, where they are left; `overlaps` the
    pairs of rocks whose plan outlines overlap, those between listed rocks apart; `shapes` the
    library (`shape_figures`). Rocks of other populations than the recipe's, such as rocks added by
    hand, are in the overlaps alone.

    Args:
        world: The world.
        rocks: What was asked for; the recipe's rocks by default.
        rock_id: The world's rock ids (`rock_rasters`), where they are known already.
    """
    rocks = rocks or world.site.recipe.rocks
    sample = Sample(world, rock_rasters(world)[1] if rock_id is None else rock_id)
    # Corridors may cover everything: then there is nothing to prove.
    populations = rocks.populations if sample.area > 0.0 else ()
    wanted = [ExpectedCounts.of(spec, world) for spec in populations]
    together = None
    if populations:
        names = [spec.name for spec in populations]
        together = {
            **_verification(sample, wanted, names),
            "unplaced": sum(world.unplaced),
            "unsupported": sum(world.unsupported_number),
        }
    scattered, listed = find_overlaps(world, lists=[spec.name for spec in rocks.lists])
    return {
        "area_m2": sample.area,
        "corridor_area_m2": sample.left_out,
        "confidence": CONFIDENCE,
        "populations": [
            _population(sample, spec, part) for spec, part in zip(populations, wanted, strict=True)
        ],
        "together": together,
        "lists": [_list(sample, spec) for spec in rocks.lists],
        "overlaps": {
            "pairs": len(scattered),
            "first": scattered[0] if scattered else None,
            "of_listed_rocks": len(listed),
        },
        "shapes": {
            **shape_figures(world.library),
            "hull_excess_limit": rocks.library.hull_excess,
            "hull_distance_limit": rocks.library.hull_distance,
        },
    }


def _population(sample: Sample, spec: PopulationSpec, wanted: ExpectedCounts) -> dict[str, Any]:
    field, law = sample.select([spec.name]), spec.size_frequency.told()
    known, (smallest, _) = spec.size_frequency.smallest_known, spec.diameters
    if known is not None and smallest < known:
        law = {**law, "extrapolated_below_m": known}
    dynamic, within = None, np.zeros(len(field), np.bool_)
    if spec.dynamic_m is not None:
        low, high = spec.dynamic_m
        within = (field.diameter >= low) & (field.diameter <= high)
        dynamic = {
            "expected": int(np.count_nonzero(within)),
            "dynamic": int(np.count_nonzero(field.dynamic)),
            "fixed": int(np.count_nonzero(within & ~field.dynamic)),
        }
    return {
        "name": spec.name,
        "law": law,
        "fit_to_counts": spec.size_frequency.fit_to_counts(*spec.diameters),
        "arrangement": spec.arrangement.kind,
        "effective_area_m2": wanted.expectation.area,
        **_verification(sample, [wanted], [spec.name]),
        "dynamic": dynamic,
        "burial": _burial(field.buried_fraction[~within], spec.buried_fraction),
        "visual_only": int(np.count_nonzero(~field.collides)),
        "unplaced": sample.unplaced.get(spec.name, 0),
        "unsupported": sample.unsupported.get(spec.name, 0),
    }


def _burial(buried: Array, asked: tuple[float, float]) -> dict[str, float] | None:
    """Mean of what some rocks are buried, which was drawn evenly between two parts."""
    if not len(buried):
        return None
    shallow, deep = asked
    return {
        "expected": 0.5 * (shallow + deep),
        "observed": float(buried.mean()),
        "standard_deviation": (deep - shallow) / float(np.sqrt(12.0 * len(buried))),
        "deeper": int(np.count_nonzero(buried > deep + 1e-3)),
    }


def _list(sample: Sample, spec: RockListSpec) -> dict[str, Any]:
    diameters = np.sort(sample.select([spec.name]).diameter)
    outline, error = sample.outline([spec.name])
    ends = [float(diameters[0]), float(diameters[-1])] if len(diameters) else [1.0, 1.0]
    at = portable.geomspace(ends[0], ends[1], _POINTS)
    larger, found = _found_above(diameters, at)
    return {
        "name": spec.name,
        "file": spec.file,
        "diameter_m": ends if len(diameters) else None,
        "count": {"observed": len(diameters)},
        "in_corridors": sample.in_corridors.get(spec.name, 0),
        "cover": {
            "observed": float(np.sum(0.25 * np.pi * diameters**2) / sample.area),
            "outline": outline,
            "outline_error": error,
        },
        "curve": {
            "diameter_m": at.tolist(),
            "number_observed": (larger / sample.area).tolist(),
            "cover_observed": (found / sample.area).tolist(),
        },
    }


def _verification(
    sample: Sample, wanted: Sequence[ExpectedCounts], names: Sequence[str]
) -> dict[str, Any]:
    """The comparison of the rocks of some populations with the sum of what they should be."""
    field = sample.select(names)
    diameters = np.sort(field.diameter)
    outline, outline_error = sample.outline(names)
    cover = float(np.sum(0.25 * np.pi * diameters**2))
    totals = compared_totals(wanted, sample.area, len(diameters), cover)
    totals["cover"] |= {"outline": outline, "outline_error": outline_error}
    number = totals["count"]["expected"]
    mixed = len(wanted) > 1 and any(part.expectation.area_variance > 0.0 for part in wanted)
    return {
        **totals,
        "kolmogorov_smirnov": None
        if mixed
        else kolmogorov_smirnov(
            diameters, lambda at: np.sum([part.number_above(at) for part in wanted], axis=0), number
        ),
        "clark_evans": clark_evans(field.position[:, :2], sample.area, sample.perimeter),
        "curve": _curve(diameters, wanted, sample.area),
    }


def compared_totals(
    wanted: Sequence[ExpectedCounts], area: float, count: int, cover: float
) -> dict[str, Any]:
    """How many rocks were found on an area [m²], and their sum of πD²/4 [m²], beside the laws'."""
    smallest = min(part.smallest for part in wanted)
    number, variance, covered, covered_variance = (
        float(values) for values in expected_above(wanted, np.array(smallest))
    )
    return {
        "diameter_m": [smallest, max(part.largest for part in wanted)],
        "count": {
            "expected": number,
            "observed": count,
            "standard_deviation": float(np.sqrt(variance)),
            "z": deviation(count, number, variance),
        },
        "cover": {
            "expected": covered / area,
            "observed": cover / area,
            "standard_deviation": float(np.sqrt(covered_variance)) / area,
            "z": deviation(cover, covered, covered_variance),
        },
    }


def expected_above(wanted: Sequence[ExpectedCounts], at: Array) -> list[Array]:
    """Expected number above diameters and its variance, then summed πD²/4 [m²] and its variance."""
    kind = ExpectedCounts
    numbers = kind.number_above, kind.number_variance_above
    areas = kind.area_above, kind.area_variance_above
    return [np.sum([one(part, at) for part in wanted], axis=0) for one in (*numbers, *areas)]


def _curve(
    diameters: Array, wanted: Sequence[ExpectedCounts], area: float
) -> dict[str, list[float]]:
    """Expected and observed number per m² and cover above logarithmically spaced diameters."""
    ends = min(part.smallest for part in wanted), max(part.largest for part in wanted)
    at = portable.geomspace(*ends, _POINTS)
    return curve_columns(at, wanted, area, *_found_above(diameters, at))


def curve_columns(
    at: Array, wanted: Sequence[ExpectedCounts], area: float, larger: Array, found: Array
) -> dict[str, list[float]]:
    """Expected number per m² and cover above diameters, and what was `larger` and its πD²/4."""
    number, variance, covered, covered_variance = expected_above(wanted, at)
    low, high = count_band(number, variance)
    spread = NORMAL_QUANTILE * np.sqrt(covered_variance)
    columns = {
        "diameter_m": at,
        "number_expected": number / area,
        "number_low": low / area,
        "number_high": high / area,
        "number_observed": larger / area,
        "cover_expected": covered / area,
        "cover_low": np.maximum(covered - spread, 0.0) / area,
        "cover_high": (covered + spread) / area,
        "cover_observed": found / area,
    }
    return {name: values.tolist() for name, values in columns.items()}


def _found_above(diameters: Array, at: Array) -> tuple[NDArray[Any], Array]:
    """How many of some ascending diameters lie above each of others, and their sum of πD²/4."""
    larger = len(diameters) - np.searchsorted(diameters, at)
    sums = np.concatenate([[0.0], np.cumsum(0.25 * np.pi * diameters[::-1] ** 2)])
    return larger, sums[larger]


def shape_figures(library: RockLibrary) -> dict[str, Any]:
    """Figures of each shape, and the worst of all.

    - `hull_excess`: summed volume of the collision parts over the volume of the shape, minus 1;
    - `hull_distance`: Hausdorff distance between the surface of the parts' union and the shape's,
      over its mean axis;
    - `outline_errors`: for each level of detail, how far its outline is off the finest one's from
      any side, over the mean axis;
    - `watertight`: whether all its meshes and collision parts are closed and face outward.
    """
    shapes = [
        {
            "family": prototype.family,
            "axes": np.ptp(prototype.meshes[0].vertices, axis=0).tolist(),
            "faces": [len(mesh.faces) for mesh in prototype.meshes],
            "collision_parts": len(prototype.hulls),
            "collision_vertices": sum(len(hull.vertices) for hull in prototype.hulls),
            "hull_excess": prototype.hull_excess,
            "hull_distance": prototype.hull_distance,
            "outline_errors": list(prototype.outline_errors),
            "watertight": all(mesh.is_closed for mesh in (*prototype.meshes, *prototype.hulls)),
        }
        for prototype in library.prototypes
    ]
    return {
        "count": len(shapes),
        "watertight": sum(shape["watertight"] for shape in shapes),
        "largest_hull_excess": max((shape["hull_excess"] for shape in shapes), default=0.0),
        "largest_hull_distance": max((shape["hull_distance"] for shape in shapes), default=0.0),
        "largest_outline_error": max(
            (error for shape in shapes for error in shape["outline_errors"]), default=0.0
        ),
        "shapes": shapes,
    }
