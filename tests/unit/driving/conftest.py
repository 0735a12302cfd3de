"""A hill that several files drive over."""

import numpy as np
import pytest

from terrain_forge.rocks import overlapping_pairs
from tests.helpers import worlds
from tests.helpers.rovers import morpheus


def apart(world):
    """The hand-made world with only those of its rocks that lie apart and off the path, sunk in."""
    route = world.trajectories[0].position[:, None, :2]
    near = np.linalg.norm(route - world.field.position[:, :2], axis=-1).min(axis=0)
    clear = world.field.select(near > 0.8 + world.field.diameter)
    second = [b for _, b in overlapping_pairs(clear, world.library)]
    kept = clear.select(~np.isin(clear.id, second))
    sunk = kept.position - np.outer(0.1 * kept.diameter, (0.0, 0.0, 1.0))
    return world.replace(field=kept.replace(position=sunk))


@pytest.fixture(scope="module")
def hill():
    """Over the hand-made ground, along the part of its path that goes up most."""
    world = worlds.world(rover=morpheus())
    whole = world.trajectories[0]
    part = whole.time < 7.0
    arc = whole.replace(time=whole.time[part], position=whole.position[part], rpy=whole.rpy[part])
    return apart(world.replace(trajectories=(arc,)))
