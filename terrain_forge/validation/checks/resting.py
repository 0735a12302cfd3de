"""Whether static rocks are embedded as they should: their feet below the ground, tops above."""

from __future__ import annotations

import numpy as np

from terrain_forge.base import Array, stage_key, uniforms
from terrain_forge.model import (
    Check,
    Heightfield,
    RockField,
    RockPrototype,
    World,
    at_most,
    rotations,
)
from terrain_forge.rocks import FOOT, edges
from terrain_forge.validation.inspection import BuiltFolder, Inspection

_ROCKS = 2000
_UPPER = 40
_GAP = 0.02
"""Part of its diameter by which a rock's foot may stand out of the ground."""
_LIMIT = 0.005
"""Part of the rocks that may do so all the same, where the ground is too rough for them."""


class Resting(Inspection):
    """Whether static rocks lie in the ground."""

    kind = "resting"
    group = "rocks"

    def checks(self, built: BuiltFolder) -> list[Check]:
        """Daylight and buried tops, where there are rocks."""
        return resting_checks(built.world) if len(built.world.field) else []


def resting_checks(world: World) -> list[Check]:
    """Daylight under static rocks, and tops below the ground, over a sample of the rocks.

    A rock shows no daylight where its foot, the cross-section at a twentieth of its extent, lies
    below the ground all around.
    """
    static = world.field.select(~world.field.dynamic)
    if len(static) > _ROCKS:
        drawn = uniforms(stage_key(world.site.seed, "resting"), _ROCKS)
        static = static.select(np.unique((drawn * len(static)).astype(np.intp)))
    foot, top = np.zeros(len(static)), np.ones(len(static))
    for number, prototype in enumerate(world.library.prototypes):
        rows = np.flatnonzero(static.prototype == number)
        foot[rows], top[rows] = foot_and_top(static.select(rows), prototype, world.ground)
    limit = float(max(1, round(_LIMIT * len(static))))
    return [
        at_most("rocks: daylight beneath", float(np.count_nonzero(foot > _GAP)), limit,
                note=f"of {len(static)}, by more than {_GAP:.0%} of the diameter"),
        at_most("rocks: tops below the ground", float(np.count_nonzero(top <= 0.0)), 0.0,
                note=f"of {len(static)}"),
    ]  # fmt: skip


def foot_and_top(
    field: RockField, prototype: RockPrototype, ground: Heightfield
) -> tuple[Array, Array]:
    """How rocks of one shape stand above the ground.

    Args:
        field: The rocks.
        prototype: Their shape.
        ground: The ground; points beside it do not count.

    Returns:
        foot: Largest height above the ground of the foot's outer corners, over the diameter; above
            0 there is daylight, shape [rocks].
        top: Largest height above the ground of the rock's upper vertices, over the diameter, shape
            [rocks].
    """
    from scipy.spatial import ConvexHull

    vertices = prototype.meshes[0].vertices
    level = vertices[:, 2].min() + FOOT * np.ptp(vertices[:, 2])
    ends = vertices[edges(prototype.meshes[0])]
    ends = ends[(ends[:, 0, 2] < level) != (ends[:, 1, 2] < level)]
    part = (level - ends[:, 0, 2]) / (ends[:, 1, 2] - ends[:, 0, 2])
    outline = ends[:, 0] + part[:, None] * (ends[:, 1] - ends[:, 0])
    loop = outline[ConvexHull(outline[:, :2]).vertices]  # hollows of the underside are hidden
    pose = rotations(field) * field.scale[:, None, None]
    feet = _above(ground, np.einsum("nij,pj->npi", pose, loop) + field.position[:, None])
    upper = vertices[np.argsort(vertices[:, 2])[-_UPPER:]]
    tops = _above(ground, np.einsum("nij,pj->npi", pose, upper) + field.position[:, None])
    return (
        np.nan_to_num(feet, nan=-np.inf).max(axis=1, initial=-np.inf) / field.diameter,
        np.nan_to_num(tops, nan=-np.inf).max(axis=1) / field.diameter,
    )


def _above(ground: Heightfield, points: Array) -> Array:
    """Height of points above the ground [m]; NaN beside it."""
    inside = ground.covers(points[..., 0], points[..., 1])
    above = np.full(inside.shape, np.nan)
    seen = points[inside]
    above[inside] = seen[:, 2] - ground.height_at(seen[:, 0], seen[:, 1])
    return above
