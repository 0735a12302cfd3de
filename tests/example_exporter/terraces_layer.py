"""A displacement layer: ground cut into terraces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import InputFile, Positive
from terrain_forge.model import Site, Window
from terrain_forge.terrain import Layer


@dataclass(frozen=True, kw_only=True)
class Terraces(Layer):
    """Steps that rise to the east; a node's height follows from its own coordinates alone."""

    kind: Literal["terraces"] = "terraces"
    width_m: Positive
    """Width of a step, west to east [m]."""
    rise_m: float
    """Rise from one step to the next [m]."""
    faults: Annotated[str, InputFile(kind="table", columns=("x_m", "rise_m"))] | None = None
    """CSV of faults: the ground east of `x_m` [m] is higher by `rise_m` [m]."""

    def relief(
        self, *, site: Site, window: Window, elevation: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Heights to add [m] at the window's nodes."""
        east, _ = site.axes(window)
        steps = np.floor((east - site.west) / self.width_m)
        heights = self.rise_m * steps
        if self.faults is not None:
            for x, rise in site.table(self.faults).values:
                heights += rise * (east > x)
        return np.broadcast_to(heights, elevation.shape)
