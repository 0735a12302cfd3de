"""A spiral."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Interval

from terrain_forge.base import Key
from terrain_forge.paths.curves import Curve
from terrain_forge.paths.named_shape import NamedShape, pair


@dataclass(frozen=True, kw_only=True)
class Spiral(NamedShape):
    """An Archimedean spiral, anticlockwise from near its centre outwards."""

    kind: Literal["spiral"] = "spiral"
    turns: Annotated[float, Interval(ge=1, le=1000)] = 3.0
    """Number of turns; the first begins half an arm's distance from the centre."""

    closed: ClassVar[bool] = False

    def outline(self, key: Key) -> Curve:  # noqa: ARG002
        """The spiral."""
        return self.smooth(
            pair(lambda t: t * np.cos(t), lambda t: t * np.sin(t)),
            pair(lambda t: np.cos(t) - t * np.sin(t), lambda t: np.sin(t) + t * np.cos(t)),
            (np.pi, np.pi + 2.0 * np.pi * self.turns),
        )
