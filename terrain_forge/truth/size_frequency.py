"""The proof that a world's rocks have the sizes, numbers and cover that were asked for."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import kolmogi, kolmogorov, pdtrik

from terrain_forge.rocks.corridor import corridor_area, in_corridor
from terrain_forge.rocks.size_frequency import SizeLaw
from terrain_forge.world import World

if TYPE_CHECKING:
    from terrain_forge.rocks.populations import PopulationSpec

Array = NDArray[np.float64]

CONFIDENCE = 0.95
"""Probability that a right sampler's curve lies within the band at any one diameter."""
SIGNIFICANCE = 0.05
"""Significance of the critical Kolmogorov–Smirnov distance."""
_POINTS = 65


def write_size_frequency(
    world: World, directory: Path, *, populations: Sequence[PopulationSpec] | None = None
) -> list[Path]:
    """Write size_frequency.json and size_frequency.png into `directory`; returns both."""
    from terrain_forge.truth.size_frequency_figure import write_figure

    proof = size_frequency(world, populations=populations)
    text, picture = directory / "size_frequency.json", directory / "size_frequency.png"
    text.write_text(json.dumps(proof, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    write_figure(proof, picture)
    return [text, picture]


def size_frequency(
    world: World, *, populations: Sequence[PopulationSpec] | None = None
) -> dict[str, Any]:
    """Wanted and realised rocks of each population and of all together.

    Area is that of the window without the paths' corridors, whose rocks are left out too. Diameters
    are exposed plan diameters [m]; cover is Σ π D²/4 over the area. For each population:

    - `count`: expected and found number, and z = (found - expected) / √expected (Poisson);
    - `cover`: expected and found, the standard deviation of a right sampler, z;
    - `kolmogorov_smirnov`: distance from the truncated law, its p-value and the distance that is
      critical at 5 %; null where there is no rock;
    - `clark_evans`: mean distance to the nearest rock over that of random points, with Donnelly's
      correction for edges, and z; null for less than two rocks. Rocks do not overlap, so dense
      populations lie a little more evenly than random points;
    - `curve`: number per m² and cover of rocks above each diameter, with the band that holds a
      right sampler at each diameter with a probability of 95 %;
    - `unplaced`: rocks of the window that found no free place.

    Rocks of populations that nobody asked for, such as rocks added by hand, stay out of it.

    Args:
        world: The world.
        populations: What was asked for; the recipe's by default.
    """
    if populations is None:
        populations = world.site.recipe.rocks.populations
    area = _window_area(world) - corridor_area(world.site, world.window)
    outside = ~in_corridor(world.site, world.field.position[:, :2])
    names = np.array(world.field.populations, dtype=object)[world.field.population]
    unplaced = dict(zip(world.field.populations, world.unplaced, strict=True))
    if area <= 0.0:  # corridors cover everything: there is nothing to prove
        populations = ()
    laws = [TruncatedLaw.of(spec, world) for spec in populations]
    proofs = [
        {
            "name": spec.name,
            "law": asdict(spec.size_frequency),
            **_proof(world, [law], outside & (names == spec.name), area),
            "unplaced": unplaced.get(spec.name, 0),
        }
        for spec, law in zip(populations, laws, strict=True)
    ]
    together = None
    if laws:
        mask = outside & np.isin(names, [spec.name for spec in populations])
        together = {**_proof(world, laws, mask, area), "unplaced": sum(world.unplaced)}
    return {
        "area_m2": area,
        "corridor_area_m2": _window_area(world) - area,
        "confidence": CONFIDENCE,
        "populations": proofs,
        "together": together,
    }


@dataclass(frozen=True, kw_only=True)
class TruncatedLaw:
    """A size law between two diameters; several of them add up."""

    law: SizeLaw
    """The law without limits."""
    smallest: float
    """Least diameter [m]."""
    largest: float
    """Largest diameter [m]."""

    @staticmethod
    def of(spec: PopulationSpec, world: World) -> TruncatedLaw:
        """The law of a population of a world."""
        east, north = world.site.size
        smallest, largest = spec.diameter_range(east * north)
        return TruncatedLaw(law=spec.size_frequency, smallest=smallest, largest=largest)

    def number_above(self, diameter: ArrayLike) -> Array:
        """Expected number of rocks above a diameter [m] per area [1/m²]."""
        limited = np.clip(diameter, self.smallest, self.largest)
        result: Array = self.law.cumulative_number(limited) - self.law.cumulative_number(
            self.largest
        )
        return result

    def cover_above(self, diameter: ArrayLike) -> Array:
        """Expected fraction of the area that rocks above a diameter [m] cover."""
        limited = np.clip(diameter, self.smallest, self.largest)
        result: Array = self.law.cumulative_area(limited) - self.law.cumulative_area(self.largest)
        return result

    def cover_variance_above(self, diameter: float, area: float) -> float:
        """Variance of that fraction over an area [m²]."""
        limited = float(np.clip(diameter, self.smallest, self.largest))
        return float(self.law.cover_variance(limited, self.largest, area))


def _window_area(world: World) -> float:
    cells = world.window.columns * world.window.rows
    return float(cells * world.ground.spacing**2)


def _proof(
    world: World, laws: Sequence[TruncatedLaw], mask: NDArray[np.bool_], area: float
) -> dict[str, Any]:
    """The comparison of some rocks with the sum of some laws."""
    diameters = np.sort(world.field.diameter[mask])
    smallest = min(law.smallest for law in laws)
    expected = float(sum(law.number_above(smallest) for law in laws)) * area
    cover = float(sum(law.cover_above(smallest) for law in laws))
    sd = float(np.sqrt(sum(law.cover_variance_above(smallest, area) for law in laws)))
    found_cover = float(np.sum(0.25 * np.pi * diameters**2) / area)
    return {
        "diameter_m": [smallest, max(law.largest for law in laws)],
        "count": {
            "wanted": expected,
            "realised": len(diameters),
            "z": _deviation(len(diameters), expected, float(np.sqrt(expected))),
        },
        "cover": {
            "wanted": cover,
            "realised": found_cover,
            "standard_deviation": sd,
            "z": _deviation(found_cover, cover, sd),
        },
        "kolmogorov_smirnov": _kolmogorov_smirnov(diameters, laws, smallest),
        "clark_evans": clark_evans(world.field.position[mask, :2], area, _perimeter(world)),
        "curve": _curve(diameters, laws, area),
    }


def _deviation(found: float, wanted: float, sd: float) -> float | None:
    """Deviation in standard deviations; None for a population of which no rock is expected."""
    return (found - wanted) / sd if sd > 0 else None


def _kolmogorov_smirnov(
    diameters: Array, laws: Sequence[TruncatedLaw], smallest: float
) -> dict[str, float] | None:
    """Largest distance of the found distribution (sorted diameters) from that of the laws.

    The p-value is the asymptotic one with Vrbik's correction for small samples (2018, Pioneer
    Journal of Theoretical and Applied Statistics 15); within 0.01 of the exact one from 5 rocks on.
    """
    count = len(diameters)
    total = float(sum(law.number_above(smallest) for law in laws))
    if count == 0 or total == 0.0:
        return None
    below = 1.0 - np.sum([law.number_above(diameters) for law in laws], axis=0) / total
    steps = np.arange(count + 1) / count
    distance = float(np.maximum(steps[1:] - below, below - steps[:-1]).max())
    root = np.sqrt(count)
    shift, stretch = 1 / (6 * root) - 1 / (4 * count), 1 + 1 / (4 * count)
    return {
        "distance": distance,
        "p_value": float(kolmogorov(distance * root * stretch + shift)),
        "critical_distance": float((kolmogi(SIGNIFICANCE) - shift) / (root * stretch)),
    }


def clark_evans(points: Array, area: float, perimeter: float) -> dict[str, float] | None:
    """Mean distance to the nearest neighbour over that of random points; above 1 is even.

    Clark & Evans 1954, doi:10.2307/1931034, with the edge correction of Donnelly 1978.

    Args:
        points: East and north [m], shape [points, 2].
        area: Area that holds them [m²].
        perimeter: Its perimeter [m].

    Returns:
        `ratio` and `z`; None for less than two points.
    """
    from scipy.spatial import cKDTree

    count = len(points)
    if count < 2:
        return None
    distances, _ = cKDTree(points).query(points, k=2)
    mean = float(distances[:, 1].mean())
    expected = 0.5 * np.sqrt(area / count) + (0.0514 + 0.041 / np.sqrt(count)) * perimeter / count
    variance = 0.0703 * area / count**2 + 0.037 * perimeter * np.sqrt(area / count**5)
    return {
        "ratio": float(mean / expected),
        "z": float((mean - expected) / np.sqrt(variance)),
    }


def _perimeter(world: World) -> float:
    return 2.0 * world.ground.spacing * (world.window.columns + world.window.rows)


def _curve(diameters: Array, laws: Sequence[TruncatedLaw], area: float) -> dict[str, list[float]]:
    """Wanted and found number per m² and cover above logarithmically spaced diameters."""
    ends = min(law.smallest for law in laws), max(law.largest for law in laws)
    at = np.geomspace(*ends, _POINTS)
    number = np.sum([law.number_above(at) for law in laws], axis=0)
    cover = np.sum([law.cover_above(at) for law in laws], axis=0)
    sd = np.sqrt([sum(law.cover_variance_above(d, area) for law in laws) for d in at.tolist()])
    tail = 0.5 * (1.0 - CONFIDENCE)
    # SciPy's inverse interpolates between counts; the quantile is the next whole one.
    low, high = (np.ceil(pdtrik(p, number * area)) / area for p in (tail, 1.0 - tail))
    deviation = 1.959964 * sd
    larger = len(diameters) - np.searchsorted(diameters, at)
    covered = np.concatenate([[0.0], np.cumsum(0.25 * np.pi * diameters[::-1] ** 2)])[larger]
    columns = {
        "diameter_m": at,
        "number_wanted": number,
        "number_low": low,
        "number_high": high,
        "number_realised": larger / area,
        "cover_wanted": cover,
        "cover_low": np.maximum(cover - deviation, 0.0),
        "cover_high": cover + deviation,
        "cover_realised": covered / area,
    }
    return {name: values.tolist() for name, values in columns.items()}
