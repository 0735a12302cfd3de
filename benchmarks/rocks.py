"""Measures the stages that make rocks: `python benchmarks/rocks.py [-n RUNS] [PATTERN …]`.

Prints, for each job whose name holds one of the patterns (all by default), the median and range of
the wall time of warm runs (the first run compiles numba's kernels and is not counted) and the peak
memory of the process that ran it, after a line that describes the machine. Each job runs in a
process of its own. Nothing is asserted: read the table.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from run import jobs_alone, peak, spread, timed

from terrain_forge.dtm import FlatDtm
from terrain_forge.making import plan
from terrain_forge.model import Heightfield, RockField, RockLibrary, Site
from terrain_forge.recipe import Recipe, TerrainSpec
from terrain_forge.rocks import (
    Clustered,
    Golombek,
    LibrarySpec,
    PopulationSpec,
    RocksSpec,
    Scattered,
    embed,
    make_library,
    overlapping_pairs,
    rock_margin,
    scatter,
    settle,
)
from terrain_forge.terrain import Fractal, shape_ground


class Place:
    """A square site with one population, and what its rocks are made of."""

    def __init__(self, side: float, population: PopulationSpec, spacing: float = 0.5) -> None:
        self.population = population.with_diameters(side**2)
        recipe = Recipe(
            name="bench",
            seed=1,
            body="mars",
            dtm=FlatDtm(size_m=(side, side)),
            terrain=TerrainSpec(spacing_m=spacing, layers=(Fractal(),)),
            rocks=RocksSpec(populations=(population,)),
        )
        self.site: Site = plan(recipe)
        self.library: RockLibrary = make_library(LibrarySpec())

    def scatter(self) -> Scattered:
        """The rocks in plan."""
        return scatter(
            site=self.site,
            populations=(self.population,),
            library=self.library,
            window=self.site.window,
        )

    @cache  # noqa: B019
    def ground(self) -> Heightfield:
        """Fractal ground under all of them."""
        around = rock_margin(site=self.site, populations=(self.population,), library=self.library)
        window = self.site.padded(self.site.window, around)
        return shape_ground(site=self.site, window=window, layers=(Fractal(),))

    def embed(self, scattered: Scattered) -> RockField:
        """The rocks on the ground."""
        return embed(
            scattered=scattered, library=self.library, ground=self.ground(), density=[2900.0]
        )

    def settle(self, field: RockField) -> RockField:
        """The dynamic rocks settled by physics."""
        return settle(rocks=field, library=self.library, ground=self.ground(), gravity=3.711)


def rocks(k: float, smallest: float, **others: Any) -> PopulationSpec:
    """A Golombek population from a smallest diameter [m] on."""
    law = Golombek(k=k)
    return PopulationSpec(name="rocks", size_frequency=law, diameter_m=(smallest, None), **others)


def placing(place: Place) -> tuple[Callable[[], object], str]:
    """Scattering alone."""
    return place.scatter, f"{len(place.scatter()):,} rocks"


def embedding(place: Place) -> tuple[Callable[[], object], str]:
    """Resting alone."""
    scattered = place.scatter()
    place.ground()
    return lambda: place.embed(scattered), f"{len(scattered):,} rocks"


def overlapping(place: Place) -> tuple[Callable[[], object], str]:
    """The test of all plan outlines."""
    field = place.embed(place.scatter())
    found = overlapping_pairs(field, place.library)
    return lambda: overlapping_pairs(field, place.library), f"{len(found)} of {len(field):,} rocks"


def settling(place: Place, count: int = 100) -> tuple[Callable[[], object], str]:
    """Settling of some dynamic rocks."""
    field = place.embed(place.scatter())
    chosen = np.flatnonzero(field.dynamic)[:count]
    dynamic = field.replace(dynamic=np.isin(np.arange(len(field)), chosen))
    stayed = int(np.count_nonzero(place.settle(dynamic).dynamic))
    return lambda: place.settle(dynamic), f"{stayed} of {len(chosen)} stay"


def making(spec: LibrarySpec) -> tuple[Callable[[], object], str]:
    """A library of shapes."""
    library = make_library(spec)
    parts = sum(len(prototype.hulls) for prototype in library.prototypes)
    return lambda: make_library(spec), f"{len(library.prototypes)} shapes, {parts} parts"


CLUSTERS = Clustered(clusters_per_m2=0.002, radius_m=6.0)
JOBS: dict[str, Callable[[], tuple[Callable[[], object], str]]] = {
    "scatter 240k on 1 km², k 0.05": lambda: placing(Place(1000.0, rocks(0.05, 0.2))),
    "scatter 1M on 1 km², k 0.05": lambda: placing(Place(1000.0, rocks(0.05, 0.1005))),
    "scatter 420k on 300 m, k 0.3": lambda: placing(Place(300.0, rocks(0.3, 0.1))),
    "scatter 240k on 1 km² in clusters": lambda: placing(
        Place(1000.0, rocks(0.05, 0.2, arrangement=CLUSTERS))
    ),
    "embed 240k": lambda: embedding(Place(1000.0, rocks(0.05, 0.2))),
    "embed 1M": lambda: embedding(Place(1000.0, rocks(0.05, 0.1005))),
    "overlap test 240k": lambda: overlapping(Place(1000.0, rocks(0.05, 0.2))),
    "overlap test 420k, k 0.3": lambda: overlapping(Place(300.0, rocks(0.3, 0.1))),
    "settle 100 dynamic rocks": lambda: settling(
        Place(100.0, rocks(0.05, 0.2, dynamic_m=(0.2, 0.4)), spacing=0.1)
    ),
    "library of 24 mild shapes": lambda: making(LibrarySpec()),
    "library of 24, another seed": lambda: making(replace(LibrarySpec(), seed=5)),
}


def main() -> None:
    """Run the jobs and print the table."""
    head = f"{'job':<36}{'what':>24}{'wall s':>24}{'peak MB':>10}"
    for name, found in jobs_alone(JOBS, measure, head=head, runs=5):
        times = spread(found["wall"], 3)
        print(f"{name:<36}{found['what']:>24}{times:>24}{found['peak']:>10.0f}")


def measure(name: str, runs: int) -> dict[str, Any]:
    """Wall times [s] of a job's runs and the peak memory [MB] of this process."""
    task, what = JOBS[name]()
    wall, _ = timed(task, runs)
    return {"what": what, "wall": wall, "peak": peak()}


if __name__ == "__main__":
    main()
