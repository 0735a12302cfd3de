"""A horizontal figure of eight."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from terrain_forge.base import Key
from terrain_forge.paths.curves import Curve
from terrain_forge.paths.named_shape import NamedShape, pair


@dataclass(frozen=True, kw_only=True)
class FigureEight(NamedShape):
    """A horizontal eight (Gerono's lemniscate), from its crossing towards the north-east first."""

    kind: Literal["figure_eight"] = "figure_eight"

    def outline(self, key: Key) -> Curve:  # noqa: ARG002
        """The lemniscate."""
        return self.smooth(
            pair(np.sin, lambda t: 0.5 * np.sin(2.0 * t)),
            pair(np.cos, lambda t: np.cos(2.0 * t)),
        )
