"""Friction that an export gives to a world's fixed surfaces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

from terrain_forge.model.body import Body


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


def world_friction(body: Body, options: FrictionOptions) -> Friction:
    """Friction that an export gives to the ground and the static rocks of a body."""
    if options.friction is not None:
        return Friction(ground=options.friction, rock=options.friction)
    ground = body.friction.bedrock if options.surface == "bedrock" else body.friction.regolith
    return Friction(ground=ground.coefficient, rock=body.friction.rock.coefficient)
