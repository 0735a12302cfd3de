"""What can be chosen for a Drake export."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Interval

from terrain_forge.base import NotNegative, Positive, Spec


@dataclass(frozen=True, kw_only=True)
class Options(Spec):
    """Options of the Drake export."""

    kind: Literal["drake"] = "drake"
    """The exporter, where the export's folder has another name."""
    individual_min_m: NotNegative = 0.5
    """Rocks of at least this exposed diameter are geometries of their own; smaller static ones are
    merged into one mesh per tile and population, since Drake's parser takes a time that grows with
    the square of their number."""
    outline_error: Annotated[float, Interval(ge=0, le=0.5)] = 0.03
    """Largest error of a merged rock's outline, as a fraction of its size: how coarse it may be."""
    tile_cells: Annotated[int, Interval(ge=16, le=1024)] = 256
    """Cells of the ground's grid per mesh, each way."""
    texture_pixels: Annotated[int, Interval(ge=1, le=8192)] = 1024
    """Pixels of the ground's textures along its longer side, all tiles together: as many for each
    node as that has room for, one at least."""
    surface: Literal["regolith", "bedrock"] = "regolith"
    """What the ground is: its friction is that of the world's body (docs/driving.md)."""
    friction: NotNegative | None = None
    """Coulomb friction of ground and static rocks; without it each has its own, by body and
    surface. Dynamic rocks keep what they were settled with."""
    dynamic_modulus_pa: Positive = 1.0e8
    """Hydroelastic modulus of dynamic rocks [Pa]: how hard they are. The ground and the static
    rocks are rigid."""
