"""Dynamic rocks as free bodies, which touch the ground as they did when they were settled."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from terrain_forge.geometry import inertias
from terrain_forge.model import RockField, RockLibrary
from terrain_forge.rocks import dynamic_contact

from .options import Options
from .rocks import geom, hull_mesh, hull_name, hull_sizes, shape_mesh, shape_sizes
from .xml import element, numbers


def dynamic_rocks(library: RockLibrary, field: RockField, options: Options) -> Iterator[str]:
    """A body `rock_<id>` for each dynamic rock, with its shape and its hulls."""
    field = field.select(field.dynamic)
    # MuJoCo wants xx yy zz xy xz yz.
    six = inertias(field, library)[:, [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    sizes = zip(hull_sizes(field, options), shape_sizes(field, options), strict=True)
    for row, (hull_size, shape_size) in enumerate(sizes):
        rock, prototype = int(field.id[row]), int(field.prototype[row])
        look = f"shape_{field.population[row]}"
        touch = f' friction="{numbers(dynamic_contact(float(field.diameter[row])).friction)}"'
        parts = [
            element("freejoint", name=f"rock_{rock}"),
            element("inertial", pos=np.zeros(3), mass=field.mass[row], fullinertia=six[row]),
            geom(f"rock_{rock}_shape", look, shape_mesh(prototype, shape_size)),
        ]
        for part in range(len(library.prototypes[prototype].hulls)):
            mesh = hull_mesh(prototype, part, hull_size)
            parts.append(geom(hull_name(rock, part), "dynamic", mesh, touch))
        place = {"pos": field.position[row], "quat": field.quaternion[row]}
        yield element("body", parts, name=f"rock_{rock}", **place)
