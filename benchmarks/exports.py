"""Measures the exporters: `python benchmarks/exports.py [-n RUNS] [PATTERN …]`.

Prints, for each job whose name holds one of the patterns (all by default), the median and range of
the wall time of warm runs (the first run compiles numba's kernels and is not counted), what the
files weigh, and by how much the export raised the peak memory of its process over that of the world
itself, with the first run's libraries. Each job runs in a process of its own. Beside the formats'
own writers it measures a bare copy of the bytes to the same disk. Nothing is asserted: read the
table.
"""

from __future__ import annotations

import shutil
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from run import jobs_alone, peak, spread

from terrain_forge.base import quaternion_from_rpy
from terrain_forge.dtm import FlatDtm
from terrain_forge.making import plan
from terrain_forge.model import RockField, World, exporter
from terrain_forge.pipeline import realise
from terrain_forge.recipe import Recipe, TerrainSpec
from terrain_forge.terrain import Fractal

SPACING = 0.25
GROUND = {"side": 2049, "rocks": 0}
FEW, SOME, MANY = ({"side": 1025, "rocks": rocks} for rocks in (20_000, 100_000, 1_000_000))
SEEN = {"collides": False}
"""Rocks visual only, which need no collider."""

JOBS: dict[str, tuple[dict[str, Any], str, dict[str, Any]]] = {
    "obj, ground of 2049²": (GROUND, "mesh", {"format": "obj"}),
    "stl, ground of 2049²": (GROUND, "mesh", {"format": "stl"}),
    "ply, ground of 2049²": (GROUND, "mesh", {"format": "ply"}),
    "glb, ground of 2049²": (GROUND, "glb", {}),
    "usd, ground of 2049²": (GROUND, "usd", {}),
    "mjcf, ground of 2049²": (GROUND, "mjcf", {}),
    "geotiff, ground of 2049²": (GROUND, "geotiff", {"products": ("elevation",)}),
    "usd, 100,000 instances": (SOME | SEEN, "usd", {}),
    "usd, 1,000,000 instances": (MANY | SEEN, "usd", {}),
    "usd, 20,000 convex colliders": (FEW, "usd", {"collider_min_m": 0.0}),
    "usd, 100,000 rocks": (SOME, "usd", {}),
    "usd, 1,000,000 rocks": (MANY, "usd", {}),
    "glb, 100,000 nodes": (SOME, "glb", {"instances_min_m": 0.0}),
    "glb, 1,000,000 nodes": (MANY, "glb", {"instances_min_m": 0.0}),
    "glb, 100,000 merged": (SOME, "glb", {"instances_min_m": 9.0}),
    "glb, 1,000,000 merged": (MANY, "glb", {"instances_min_m": 9.0}),
    "stl, 100,000 merged": (SOME, "mesh", {"format": "stl"}),
    "stl, 1,000,000 merged": (MANY, "mesh", {"format": "stl"}),
    "mjcf, 20,000 rocks": (FEW, "mjcf", {}),
    "mjcf, 100,000 rocks": (SOME, "mjcf", {}),
}


def main() -> None:
    """Run the jobs that are asked for and print the table."""
    head = f"{'job':<30}{'wall s':>20}{'copy s':>10}{'MB written':>12}{'MB of memory':>14}"
    for name, row in jobs_alone(JOBS, measure, head=head, runs=3):
        wall = spread(row["wall"], 2)
        print(
            f"{name:<30}{wall:>20}{row['copy']:>10.2f}{row['size']:>12.0f}{row['memory']:>14.0f}",
            flush=True,
        )


def measure(name: str, runs: int) -> dict[str, Any]:
    """Wall times [s], the time of a bare copy [s], size of the files and memory [MB] of a job."""
    made, kind, chosen = JOBS[name]
    world = made_world(**made)
    module = exporter(kind)
    options = module.Options(**chosen)
    before, wall = peak(), []
    for _ in range(runs + 1):
        with tempfile.TemporaryDirectory() as folder:
            since = time.perf_counter()
            module.export(world, Path(folder), options=options)
            wall.append(time.perf_counter() - since)
            memory = peak() - before
            files = [path for path in Path(folder).rglob("*") if path.is_file()]
            size = sum(path.stat().st_size for path in files)
            since = time.perf_counter()
            for path in files:
                shutil.copyfile(path, path.with_suffix(".copy"))
            copied = time.perf_counter() - since
    return {"wall": wall[1:], "copy": copied, "size": size / 1e6, "memory": memory}


def made_world(side: int, rocks: int, *, solid: bool = True) -> World:
    """A fractal ground of so many nodes each way, strewn with rocks that may overlap."""
    length = (side - 1) * SPACING
    recipe = Recipe(
        name="bench",
        seed=1,
        body="mars",
        dtm=FlatDtm(size_m=(length, length)),
        terrain=TerrainSpec(spacing_m=SPACING, layers=(Fractal(),)),
    )
    bare = realise(plan(recipe))
    return bare.replace(
        field=strewn(bare, rocks).replace(collides=np.full(rocks, solid)),
        appearance=bare.appearance.replace(rock_rgb=np.full((1, 3), 100)),
    )


def strewn(world: World, count: int) -> RockField:
    """Half buried rocks of 0.05 to 1 m, all over the ground."""
    random = np.random.default_rng(3)
    west, south, east, north = world.ground.bounds
    shapes = world.library.prototypes
    xy = random.uniform((west, south), (east, north), (count, 2))
    size = 0.05 * (1.0 - random.random(count) * (1.0 - 0.05**2)) ** -0.5
    prototype = random.integers(0, len(shapes), count)
    volume = np.array([shape.volume for shape in shapes])[prototype] * size**3
    return RockField(
        populations=("strewn",),
        id=np.arange(count),
        population=np.zeros(count),
        prototype=prototype,
        position=np.column_stack([xy, world.ground.height_at(xy[:, 0], xy[:, 1])]),
        quaternion=quaternion_from_rpy(random.uniform(-3.0, 3.0, (count, 3))),
        scale=size,
        diameter=size,
        height=0.5 * size,
        buried_fraction=np.full(count, 0.5),
        volume=volume,
        mass=volume * world.site.body.rock_density,
        dynamic=np.zeros(count),
        collides=np.ones(count),
    )


if __name__ == "__main__":
    main()
