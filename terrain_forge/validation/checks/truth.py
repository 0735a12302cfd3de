"""Whether craters are as many and as large as the law wants, and rasters hold what rays meet."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, mix, stage_key, uniforms
from terrain_forge.dtm import open_dataset
from terrain_forge.model import Check, World, at_least, at_most, merge
from terrain_forge.scene import GROUND, open_scene
from terrain_forge.validation.inspection import BuiltFolder, Inspection, content_of
from terrain_forge.validation.measures import ground_limit

_CLEARANCE = 1.0
_GRAZING = 0.002
"""Part of the nodes at which ray and raster may name different rocks: a ray of 32 bits that grazes
an outline falls to either side."""
LIMIT_Z = 3.29
"""Deviation of a number in standard deviations that 1 right world in 1000 exceeds."""
LIMIT_P = 0.001
"""Least p-value of the sizes."""


class TopSurface(Inspection):
    """The truth's rasters against rays."""

    kind = "top surface"
    group = "truth"

    def checks(self, built: BuiltFolder) -> list[Check]:
        """Compare surface_with_rocks.tif and rock_id.tif with vertical rays at random nodes.

        Half of the nodes are drawn from those with a rock on top. Rays meet the rocks' finest
        meshes and the triangulated ground in Embree, which shares nothing with the code that made
        the rasters. Heights are compared where both name the same rock.
        """
        world, truth = built.world, built.directory / "truth"
        files = truth / "surface_with_rocks.tif", truth / "rock_id.tif"
        if not all(file.is_file() for file in files):
            return []
        top, rock_id = _read_raster(files[0]), _read_raster(files[1]).astype(np.int32)
        rows, columns = _draw_nodes(world, rock_id, built.spec.points)
        height, owner = _look_down(world, rows, columns)
        same = owner == rock_id[rows, columns]
        off = np.abs(height - top[rows, columns])[same]
        limit_off = ground_limit(world.ground)
        doubted = np.flatnonzero(same)[off > limit_off]
        off[off > limit_off] = _off_beside(world, rows[doubted], columns[doubted], top)
        differing = float(np.count_nonzero(~same))
        limit = float(max(1, round(_GRAZING * len(rows))))
        return [
            at_most("truth: top surface", float(off.max(initial=0.0)), limit_off,
                    unit="m", note=f"largest difference in height from rays at {len(rows)} nodes"),
            at_most("truth: rock ids", differing, limit,
                    note="nodes at which a ray meets another rock"),
        ]  # fmt: skip


def _read_raster(path: Path) -> NDArray[np.float64]:
    """A raster's values, rows running north."""
    with open_dataset(path) as raster:
        return np.asarray(raster.read(1)[::-1], np.float64)


def _draw_nodes(
    world: World, rock_id: NDArray[np.int32], points: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns of random nodes, the first half of them with a rock on top if there is.

    None lies on the border, where a ray may pass the ground.
    """
    key, inner = stage_key(world.site.seed, "top surface"), rock_id[1:-1, 1:-1]
    rocky = np.flatnonzero(inner.ravel() != GROUND)
    half = points // 2 if len(rocky) else 0
    chosen = rocky[(uniforms(np.uint64(mix(key, 0)), half) * len(rocky)).astype(np.intp)]
    anywhere = (uniforms(np.uint64(mix(key, 1)), points - half) * inner.size).astype(np.intp)
    rows, columns = np.unravel_index(np.concatenate([chosen, anywhere]), inner.shape)
    return rows + 1, columns + 1


def _off_beside(
    world: World, rows: NDArray[np.intp], columns: NDArray[np.intp], top: Array
) -> Array:
    """How far heights are outside of what rays meet around nodes [m].

    Embree's coordinates are float32: on the face of a rock that is all but upright, their last
    digit is a difference of a millimetre in height.
    """
    if not len(rows):
        return np.zeros(0)
    reach = 2.0 * float(np.spacing(np.float32(np.abs(world.ground.bounds).max())))
    moves = ((0.0, 0.0), (reach, 0.0), (-reach, 0.0), (0.0, reach), (0.0, -reach))
    met = np.array([_look_down(world, rows, columns, move)[0] for move in moves])
    found = top[rows, columns]
    off = np.maximum(met.min(axis=0) - found, found - met.max(axis=0))
    return np.asarray(np.maximum(off, 0.0))


def _look_down(
    world: World,
    rows: NDArray[np.intp],
    columns: NDArray[np.intp],
    move: tuple[float, float] = (0.0, 0.0),
) -> tuple[Array, NDArray[np.int32]]:
    """Height [m] and rock id (-1 for the ground) of what vertical rays meet beside nodes."""
    rocks = merge(world.field, world.neighbours)
    with open_scene(world) as scene:
        largest = float(rocks.diameter.max(initial=0.0))
        above = float(world.ground.elevation.max()) + 2.0 * largest + _CLEARANCE
        at = world.ground.east[columns] + move[0], world.ground.north[rows] + move[1]
        start = np.column_stack([*at, np.full(len(rows), above)])
        hits = scene.cast(start, np.array([0.0, 0.0, -1.0]))
        ids = np.append(rocks.id, np.int32(GROUND))
    height = above - hits.distance.astype(np.float64)
    return height, np.where(hits.rock > GROUND, ids[np.maximum(hits.rock, GROUND)], hits.rock)


class Craters(Inspection):
    """Number and sizes of random craters."""

    kind = "craters"
    group = "craters"

    def checks(self, built: BuiltFolder) -> Iterator[Check]:
        """Each layer's, as the truth has them."""
        counts = content_of(built.directory / "truth" / "crater_counts.json")
        for layer in counts.get("layers", ()):
            if "number" not in layer:
                continue
            title, number, sizes = f"craters {layer['name']}", layer["number"], layer["sizes"]
            if number["z"] is not None:
                name, off = f"{title}: number, deviation", abs(number["z"])
                note = f"{number['found']} craters, {number['expected']:.1f} expected"
                yield at_most(name, off, LIMIT_Z, note=note)
            if sizes is not None:
                name, note = f"{title}: sizes, p-value", "Kolmogorov–Smirnov"
                yield at_least(name, sizes["p_value"], LIMIT_P, note=note)
