"""The table of all craters, truth/craters.csv, and their numbers against the laws."""

from __future__ import annotations

import json
from itertools import takewhile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, rectangle_distance
from terrain_forge.model import World
from terrain_forge.terrain import (
    CraterLayer,
    Craters,
    make_craters,
    mask_weight,
    population_of,
    shape_ground,
)
from terrain_forge.truth.statistics import clark_evans, count_band, deviation, kolmogorov_smirnov
from terrain_forge.truth.tables import columns_of, lonlat_columns
from terrain_forge.writers import Column, quoted, write_table


def write_craters(world: World, truth: Path) -> list[Path]:
    """Write `craters.csv` and `crater_counts.json` of a world whose recipe makes craters.

    Returns:
        The files; none where there is no layer of craters.
    """
    made = craters_of(world)
    if not made:
        return []
    table, counts = truth / "craters.csv", truth / "crater_counts.json"
    write_crater_table(world, made, table)
    layers = [_counts(world, layer, found) for layer, found in made]
    report = {"format": 1, "layers": layers}
    text = json.dumps(report, indent=1, ensure_ascii=False, allow_nan=False)
    counts.write_text(text + "\n", encoding="utf-8", newline="\n")
    return [table, counts]


def craters_of(world: World) -> list[tuple[CraterLayer, Craters]]:
    """The craters of each layer whose rim encloses a part of the window, the largest first."""
    area = world.ground.bounds
    made = []
    for layer in world.site.recipe.terrain.layers:
        if isinstance(layer, CraterLayer):
            craters = make_craters(layer, site=world.site, area=area)
            touching = rectangle_distance(craters.xy, area) < 0.5 * craters.diameter
            craters = craters.select(touching)
            made.append((layer, craters.select(np.lexsort((craters.id, -craters.diameter)))))
    return made


def write_crater_table(world: World, made: list[tuple[CraterLayer, Craters]], path: Path) -> None:
    """Write one row per crater whose rim encloses a part of the window, layer by layer.

    World frame, SI units; x, y is the centre, longitude (east, -180 to 180) and latitude follow
    where the site is georeferenced. id is hexadecimal and the same in every window. depth_m is that
    of the crater's own profile now, crest to floor; what lies upon it is not taken away.
    degradation is the part of the fresh depth that is lost, 0 to 1; wear is κt/D². inside is 1
    where the centre lies in the window, listed where the crater is the user's own. mask_weight is
    that of the layer's mask at the centre, 0 for a crater that was masked out to 1 for a whole one;
    of centres outside, at the nearest node of the window.
    """
    columns = {name: np.concatenate([getattr(c, name) for _, c in made]) for name in _TAKEN}
    layers = np.repeat([quoted(layer.name) for layer, _ in made], [len(c) for _, c in made])
    fresh, depth = columns["fresh_depth"], columns["depth"]
    xy, sizes = columns["xy"].reshape(-1, 2), (columns["diameter"], depth, fresh)
    weights = np.concatenate([_mask_weights(world, layer, c.xy) for layer, c in made])
    written = [
        Column(name="id", values=columns["id"], form="%016x"),
        Column(name="layer", values=layers.astype(object), form="%s"),
        *columns_of(("x_m", "y_m"), xy.T, "%.7f"),
        *columns_of(("diameter_m", "depth_m", "fresh_depth_m"), sizes, "%.7f"),
        Column(name="fresh_rim_m", values=columns["fresh_rim"], form="%.7f"),
        Column(name="age_ga", values=columns["age"], form="%.9g"),
        Column(name="degradation", values=1.0 - depth / fresh, form="%.7f"),
        Column(name="wear", values=columns["wear"], form="%.9g"),
        Column(name="inside", values=_inside(world, xy), form="%d"),
        Column(name="listed", values=columns["listed"], form="%d"),
        Column(name="mask_weight", values=weights, form="%.4f"),
        *lonlat_columns(world.site, xy),
    ]
    write_table(path, written)


_TAKEN = (*("id", "xy", "diameter", "depth", "fresh_depth", "fresh_rim", "age", "wear", "listed"),)


def _counts(world: World, layer: CraterLayer, craters: Craters) -> dict[str, Any]:
    """Numbers of a layer's random craters in the window, against its law."""
    own = craters.select(_inside(world, craters.xy) & ~craters.listed)
    population = population_of(layer, site=world.site)
    report: dict[str, Any] = {"name": layer.name, "listed": int(craters.listed.sum())}
    if population is None:
        return report
    west, south, east, north = world.ground.bounds
    area = (east - west) * (north - south)
    smallest, largest = population.diameters
    beyond = float(population.number(np.array([largest]))[0])

    def above(diameter: Array) -> Array:
        return area * (population.number(diameter) - beyond)

    edges = np.array([max(low, smallest) for _, low, _ in population.octaves[::-1]])
    wanted = above(edges)
    found = np.array([np.count_nonzero(own.diameter >= edge) for edge in edges])
    low, high = count_band(wanted, wanted)
    total = float(wanted[0])
    return {
        **report,
        "production": layer.production.kind if layer.production else None,
        "equilibrium": population.equilibrium,
        "age_ga": population.production.age_ga,
        "resurfaced": [
            {"age_ga": event.age_ga, "below_m": event.below_m}
            for event in getattr(layer.production, "resurfaced", ())
        ],
        "area_m2": area,
        "diameter_m": [smallest, largest],
        "number": {"expected": total, "found": len(own), "z": deviation(len(own), total, total)},
        "sizes": kolmogorov_smirnov(np.sort(own.diameter), above, total),
        "evenness": clark_evans(own.xy, area, 2.0 * (east - west + north - south)),
        "cumulative": {
            "diameter_m": edges.tolist(),
            "expected": wanted.tolist(),
            "found": found.tolist(),
            "low": low.tolist(),
            "high": high.tolist(),
        },
    }


def _mask_weights(world: World, layer: CraterLayer, xy: Array) -> Array:
    """Weights of a layer's mask at the nodes of the window nearest to some places."""
    if layer.mask is None or len(xy) == 0:
        return np.ones(len(xy))
    site, window = world.site, world.window
    before = tuple(takewhile(lambda other: other is not layer, site.recipe.terrain.layers))
    around = site.padded(window, layer.mask.reach(site))
    ground = shape_ground(site=site, window=around, layers=before)
    weight = mask_weight(
        layer.mask, site=site, window=around, elevation=ground.elevation.astype(np.float64)
    )
    low = np.array([window.column - around.column, window.row - around.row])
    node = np.rint((xy - np.array(ground.origin)) / site.spacing).astype(np.int64)
    column, row = np.clip(node, low, low + np.array([window.columns, window.rows])).T
    return np.asarray(weight[row, column])


def _inside(world: World, xy: Array) -> NDArray[np.bool_]:
    """Which places lie in the window."""
    west, south, east, north = world.ground.bounds
    return np.asarray(np.all((xy >= (west, south)) & (xy <= (east, north)), axis=1))
