"""How wheels touch the ground and the rocks: friction, softness, and whose word counts.

MuJoCo takes all parameters of a contact from the geom of the higher priority. The surface has it,
so that each surface has its own friction, whatever rolls on it; a dynamic rock goes before both,
since it stays in place only with the parameters that it was settled with. The softness comes from
the convergence test (docs/driving.md).
"""

from __future__ import annotations

SURFACE_PRIORITY, DYNAMIC_PRIORITY = 2, 3
"""Priorities of contacts: above those that a rover's wheels may have."""
SOLREF = (0.04, 1.0)
"""Time constant [s] and damping ratio of a contact with what is fixed."""
SOLIMP = (0.9, 0.95, 0.001)
"""Impedance at first touch and at depth, and that depth [m]."""


def sliding(coefficient: float) -> tuple[float, float, float]:
    """Sliding, torsional and rolling friction as MuJoCo lists them; contacts use the first."""
    return coefficient, 0.005, 0.0001
