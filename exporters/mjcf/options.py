"""What a recipe can choose about the MJCF."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import Interval

from terrain_forge.base import Idle, NotNegative, Positive, Spec


@dataclass(frozen=True, kw_only=True)
class Options(Spec):
    """Options of the MJCF export; the defaults suit a wheeled rover of 10 to 1000 kg."""

    bytes_each: ClassVar[tuple[float, float]] = (4, 400)
    """About how many bytes it writes for each node of the ground and each rock."""
    timestep_s: Annotated[float, Interval(ge=1e-4, le=0.01)] = 0.002
    """Time step of the simulation."""
    surface: Literal["regolith", "bedrock"] = "regolith"
    """What the ground is: its friction is that of the world's body (docs/driving.md)."""
    friction: Positive | None = None
    """Coefficient of sliding friction between the rover and both ground and rocks; without it each
    has its own, by body and surface."""
    exact_scale: bool = False
    """Whether each rock gets its exact size. MuJoCo stores a mesh per size, so by default sizes are
    rounded to steps that change no rock by more than 1 %, which loads many times faster."""
    visual_min_m: NotNegative = 0.5
    """Rocks of at least this exposed diameter are drawn by their textured shapes, as all dynamic
    ones are; smaller ones by their collision hulls, since each geom more slows every step."""
    texture_pixels: Annotated[int, Interval(ge=1, le=8192)] = 1024
    """Pixels of the ground's textures along its longer side, all tiles together: as many for each
    node as that has room for, one at least."""
    horizon: bool = True
    """Whether what lies beyond the border is in it, out to the horizon; visual-only."""
    split_ground: bool = True
    """Whether the ground becomes small height fields under dynamic rocks that are wider than 4 of
    its cells. MuJoCo keeps 50 contacts with each field and drops the others, and a rock that lies
    flat on many cells of one field tips over."""
    sleep: bool = False
    """Whether to set MuJoCo's `sleep` flag: dynamic rocks that lie still then cost next to nothing
    of a step, not 25 µs each; only versions of MuJoCo that know it can load the files then."""

    def idle(self) -> Iterator[Idle]:
        """What has no effect beside other options."""
        if self.friction is not None:
            yield Idle("surface", "friction is given")
