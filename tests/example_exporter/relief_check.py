"""A check: whether the ground has any relief."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from terrain_forge.model import Check, at_least
from terrain_forge.validation import BuiltFolder, Inspection


class Relief(Inspection):
    """The range of heights."""

    kind = "relief"
    group = "ground"

    def checks(self, built: BuiltFolder) -> Iterator[Check]:
        """At least a centimetre."""
        relief = float(np.ptp(built.world.ground.elevation))
        yield at_least("ground: relief", relief, 0.01, unit="m")
