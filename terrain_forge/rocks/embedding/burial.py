"""How deep rocks lie where rough ground demands more of some of them than was drawn.

If such a rock were only sunk further, the mean would rise with the roughness. So a population's
range is shared out anew: a rock that needs more takes of the upper part of the range, and others
keep off what it takes. Which of them need more is told by each rock's surroundings alone: it is
looked at in other places around its own, of whose pattern its own is any one by chance. Where the
ground is alike, its own need is then any one of the needs found, whatever these are, and the
depths of all rocks are as even over their range as if none had needed more.
"""

from __future__ import annotations

import math

import numpy as np

from terrain_forge.base import Array, inner
from terrain_forge.model import Site
from terrain_forge.rocks.populations import RockListSpec

PATTERN = 4
"""Places in a row of the square pattern in which a rock is looked at."""
PITCH = 0.5
"""Distance of neighbouring places of it, in diameters."""
SPARSE_PATTERN = 2
"""Places in a row, over the same square, for a rock as small as the ground's cells: it has a few
plane triangles under it wherever it lies, and most rocks are such ones."""


def burial_ranges(site: Site) -> Array:
    """What the burial of each population and list was drawn from, shape [groups, 2].

    NaN where a list's table has it.
    """
    found = []
    for group in site.recipe.rocks.groups:
        columns = site.table(group.file).columns if isinstance(group, RockListSpec) else ()
        given = "buried_fraction" in columns
        found.append((math.nan, math.nan) if given else group.buried_fraction)
    return np.array(found).reshape(-1, 2)


@inner
def shared_out(needs, own, wanted, shallow, deep):  # type: ignore[no-untyped-def]
    """The burial of one of several rocks that share out an even range among them, each its n-th.

    The neediest is served first: evenly from all of the range that it can take. The next takes what
    is left of that and of what it can take besides, and so on. What the range lacks for the
    neediest is taken off what is next below, so that the mean stays.

    Args:
        needs: Least burial of each rock, from the largest, shape [rocks].
        own: Which of them is asked for.
        wanted: What was drawn for it, evenly from the range.
        shallow: Where the range begins.
        deep: Where it ends, above `shallow`.
    """
    share, span = 1.0 / len(needs), deep - shallow
    kept, thinned = np.empty(own + 1), np.empty(own + 1)
    left, above = 0.0, deep
    for n in range(own + 1):
        need = min(needs[n], deep)
        gap = (above - need) / span
        left, above = left + gap, need
        thinned[n] = min(max(left / gap, 0.0), 1.0) if gap > 0.0 else 1.0
        kept[n] = max(1.0 - share / left, 0.0) if left > 0.0 else 0.0
        if n < own:
            left -= share
    least = max(needs[own], shallow)
    part = (wanted - shallow) / span
    rest = part * left if left >= share else left - (1.0 - part) * share
    density = 1.0 / span
    for n in range(own, -1, -1):
        upper = min(needs[n - 1], deep) if n else deep
        here = density * thinned[n]
        if rest <= 0.0 or least >= deep:
            break
        if here * (upper - least) >= rest:
            return least + rest / here
        rest -= here * (upper - least)
        least = upper
        density *= kept[n - 1] if n else 1.0
    return least
