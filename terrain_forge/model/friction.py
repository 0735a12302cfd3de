"""Friction of wheels on the surfaces of Mars and the Moon, as cited values.

A wheel with grousers does not slide on regolith, it shears it: the coefficient is the tangent of
the regolith's angle of internal friction. Cohesion adds to it and sinkage takes from it; neither
is modelled by a rigid contact. On bedrock and on rocks no measured coefficient of a rover's metal
wheel was found; those are assumptions, below rock on rock, 0.85 (Byerlee 1978,
doi:10.1007/BF00876528).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, Protocol

from terrain_forge.base import Record

Surface = Literal["regolith", "bedrock", "rock"]
"""What a wheel rolls on: loose ground, ground of solid rock, or a rock that lies on the ground."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfaceFriction(Record):
    """Sliding friction between a wheel and a surface."""

    body: str
    """The planet or moon, lower case."""
    surface: Surface
    """The surface."""
    coefficient: float
    """Coulomb coefficient that is used by default."""
    lowest: float
    """Lower end of the plausible range."""
    highest: float
    """Upper end of the plausible range."""
    source: str
    """Where it comes from; begins with `assumption` where nobody has measured it."""


def _sheared(
    body: str, low_deg: float, mean_deg: float, high_deg: float, source: str
) -> SurfaceFriction:
    low, mean, high = (round(math.tan(math.radians(a)), 2) for a in (low_deg, mean_deg, high_deg))
    return SurfaceFriction(
        body=body, surface="regolith", coefficient=mean, lowest=low, highest=high, source=source
    )


def _assumed(body: str, surface: Surface, coefficient: float) -> SurfaceFriction:
    return SurfaceFriction(
        body=body,
        surface=surface,
        coefficient=coefficient,
        lowest=0.6,
        highest=1.0,
        source="assumption: metal grousers on rock, below rock on rock (doi:10.1007/BF00876528)",
    )


FRICTIONS = (
    _sheared(
        "mars", 30.0, 33.5, 37.0,
        "friction angles 30° to 37° of trenches by the Mars Exploration Rovers' wheels, Sullivan "
        "et al. 2011, doi:10.1029/2010JE003625",
    ),
    _assumed("mars", "bedrock", 0.8),
    _assumed("mars", "rock", 0.7),
    _sheared(
        "moon", 24.0, 37.0, 47.0,
        "friction angles 24° to 47°, mean 37°, of boulder tracks, Hovland & Mitchell 1973 (NTRS "
        "19730039283)",
    ),
    _assumed("moon", "bedrock", 0.8),
    _assumed("moon", "rock", 0.7),
)  # fmt: skip
"""Every known pair of body and surface."""


def surface_friction(body: str, surface: Surface) -> SurfaceFriction:
    """Friction of wheels on a surface of a body.

    Raises:
        KeyError: if the table has no such pair.
    """
    found = {(f.body, f.surface): f for f in FRICTIONS}
    return found[body, surface]


@dataclass(frozen=True, kw_only=True)
class Friction:
    """Coefficients of sliding friction of a world's fixed surfaces."""

    ground: float
    """On the ground."""
    rock: float
    """On static rocks."""


class FrictionOptions(Protocol):
    """What an export's options say of friction."""

    @property
    def surface(self) -> Literal["regolith", "bedrock"]:
        """What the ground is."""

    @property
    def friction(self) -> float | None:
        """Coefficient of both ground and rocks, instead of the body's."""


def world_friction(body: str, options: FrictionOptions) -> Friction:
    """Friction that an export gives to the ground and the static rocks of a body."""
    if options.friction is not None:
        return Friction(ground=options.friction, rock=options.friction)
    return Friction(
        ground=surface_friction(body, options.surface).coefficient,
        rock=surface_friction(body, "rock").coefficient,
    )
