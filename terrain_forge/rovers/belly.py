"""How high the body of a user's rover is above the ground at rest."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from terrain_forge.base import DataError, portable
from terrain_forge.rovers.assembly import Body
from terrain_forge.rovers.tread import outline

_TOUCHES = 0.05
"""Height over the smallest wheel's radius up to which a part rests on the ground: a caster, a
skid."""
_DRAGGED = 0.25
"""Height of what such a part is dragged over, as a part of its own."""


def measure_belly(bodies: Iterable[Body], *, radius: float, step_limit: float | None) -> float:
    """Free height under the body [m], by what collides of it, else by what is seen.

    A part that rests on the ground is dragged over what is a quarter as high as itself, where a
    ball is met at 60° from below; what is higher holds it.

    Args:
        bodies: What the body consists of, in base_link's frame.
        radius: Of the smallest wheel [m].
        step_limit: The recipe's word on what the rover goes over [m].

    Raises:
        DataError: if no part is above the ground and the recipe does not tell the step limit.
    """
    solids = [(body, pose, shape) for body in bodies for pose, shape in body.solids]
    spans = []
    for body, pose, shape in [one for one in solids if one[2].collides] or solids:
        placed = portable.product(body.placement, pose)
        heights = outline(shape, placed[:3, :3], placed[:3, 3])[:, 2]
        spans.append((float(np.min(heights)), float(np.max(heights)), body.name))
    above = [low for low, _, _ in spans if low > _TOUCHES * radius]
    dragged = [_DRAGGED * (high - low) for low, high, _ in spans if low <= _TOUCHES * radius]
    if above:
        return min(above + dragged)
    if step_limit is None:
        why = f"the lowest collider is {min(spans)[2]}" if spans else "the body has no shape"
        raise DataError(
            f"no part of the body is above the ground, {why}: its clearance is unknown; give "
            "rover.step_limit_m",
            key=("rover",),
        )
    return 0.0
