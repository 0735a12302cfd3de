"""How a dynamic rock touches the ground: in one place, for settling, exporting and checking alike.

A rock that was settled with one set of contact parameters rolls away under another, so whoever
simulates a dynamic rock takes them from here.
"""

from __future__ import annotations

from dataclasses import dataclass

from terrain_forge.base import Record

SLIDING = 0.7
"""Coefficient of sliding friction with which rocks are settled."""
ROLLING = 0.05
"""Torsional and rolling friction of a dynamic rock, as a part of its diameter."""


@dataclass(frozen=True, kw_only=True, eq=False)
class DynamicContact(Record):
    """Contact parameters of a dynamic rock, in MuJoCo's terms."""

    condim: int
    """Dimensions of a contact: 6 for sliding, torsional and rolling friction."""
    sliding: float
    """Coefficient of sliding friction."""
    torsional: float
    """Torsional friction [m]."""
    rolling: float
    """Rolling friction [m]: what keeps a rock on edges that a real one would crush."""
    solref: tuple[float, float]
    """Time constant [s] and damping ratio of the contact."""
    impratio: float
    """Friction's stiffness over that of the normal force; an option of the whole model."""

    @property
    def friction(self) -> tuple[float, float, float]:
        """Sliding, torsional and rolling friction, as MuJoCo lists them."""
        return self.sliding, self.torsional, self.rolling


def dynamic_contact(diameter: float, *, sliding: float = SLIDING) -> DynamicContact:
    """Contact parameters of a dynamic rock of an exposed diameter [m]."""
    return DynamicContact(
        condim=6,
        sliding=sliding,
        torsional=ROLLING * diameter,
        rolling=ROLLING * diameter,
        solref=(0.02, 1.0),
        impratio=10.0,
    )
