"""The user's own rocks: placed as they are listed, before all others, and never moved."""

from __future__ import annotations

import numpy as np

from terrain_forge.base import Array, portable, stage_key
from terrain_forge.model import RockLibrary, Site, Table
from terrain_forge.rocks.populations import MAX_ROCKS, RockListSpec
from terrain_forge.rocks.scattering.candidates import Candidates
from terrain_forge.rocks.scattering.cells import BURIED, PROTOTYPE, YAW, Cells, addresses, draw
from terrain_forge.rocks.scattering.size_classes import shapes_of


def draw_list(
    spec: RockListSpec, *, index: int, number: int, site: Site, library: RockLibrary
) -> list[tuple[Candidates, Cells]]:
    """The rocks of a list; what its table does not give is drawn as for other rocks.

    They come in octaves of diameter, each with one cell, so that near ones are found fast.
    `index` is the list's among all populations, of which lists come last, `number` its own.
    """
    table = site.table(spec.file)
    count = len(table.values)
    key = stage_key(site.seed, f"rocks/{spec.name}")
    address = addresses(key, 0, 0, np.array([[count]]))
    shapes = shapes_of(spec.families, library, ("rocks", "lists", number))
    prototype = _column(table, "prototype")
    if prototype is None:
        prototype = shapes[(draw(address, PROTOTYPE) * len(shapes)).astype(np.int64)]
    yaw, buried = _column(table, "yaw_deg"), _column(table, "buried_fraction")
    shallow, deep = spec.buried_fraction
    drawn = Candidates(
        id=index * MAX_ROCKS + np.arange(count),
        population=np.full(count, index),
        address=address,
        xy=np.column_stack([table.column("x_m"), table.column("y_m")]),
        diameter=table.column("diameter_m"),
        prototype=prototype.astype(np.int64),
        yaw=2.0 * np.pi * draw(address, YAW) if yaw is None else np.radians(yaw),
        buried=shallow + (deep - shallow) * draw(address, BURIED) if buried is None else buried,
        dynamic=np.zeros(count, np.bool_),
    )
    octave = np.floor(portable.log2(drawn.diameter / drawn.diameter.min(initial=np.inf)))
    reach = np.array([prototype.reach for prototype in library.prototypes])
    found = []
    for n in np.unique(octave)[::-1]:
        part = Candidates(*(column[octave == n] for column in drawn))
        radius = float((reach[part.prototype] * part.diameter).max())
        bins = min(len(part.id) ** 0.5, min(site.size) / (2.0 * radius))
        split = max(int(bins), 1)
        found.append((part, Cells(radius=radius, columns=1, rows=1, side=site.size, split=split)))
    return found


def _column(table: Table, name: str) -> Array | None:
    """A table's column, or None where it has none of that name."""
    return table.column(name) if name in table.columns else None
