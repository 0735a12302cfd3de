"""A circle or an ellipse."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from annotated_types import Interval

from terrain_forge.base import Key
from terrain_forge.paths.curves import Curve
from terrain_forge.paths.named_shape import NamedShape, pair


@dataclass(frozen=True, kw_only=True)
class Loop(NamedShape):
    """A circle or an ellipse, anticlockwise from its eastern end."""

    kind: Literal["loop"] = "loop"
    aspect: Annotated[float, Interval(ge=0.1, le=1)] = 1.0
    """Its y axis over its x axis."""

    def outline(self, key: Key) -> Curve:  # noqa: ARG002
        """The ellipse."""
        b = self.aspect
        return self.smooth(
            pair(np.cos, lambda t: b * np.sin(t)),
            pair(lambda t: -np.sin(t), lambda t: b * np.cos(t)),
        )
