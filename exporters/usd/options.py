"""What can be chosen for a USD export."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import Interval

from terrain_forge.base import Idle, NearPath, NotNegative, Positive, Spec


@dataclass(frozen=True, kw_only=True)
class Options(Spec):
    """Options of the USD export."""

    bytes_each: ClassVar[tuple[float, float]] = (40, 700)
    """About how many bytes it writes for each node of the ground and each rock."""
    bytes_each_texel: ClassVar[float] = 2.3
    """About how many it writes for each pixel of the picture that is the ground's detail."""
    whole_only: ClassVar[tuple[str, ...]] = ("tile_cells",)
    """Which a site in tiles has not."""
    kind: Literal["usd"] = "usd"
    """The exporter, where the export's folder has another name."""
    collider_min_m: NotNegative = 0.5
    """Rocks of at least this exposed diameter get a convex collider of their own; the smaller ones
    share one static collider mesh per tile."""
    outline_error: Annotated[float, Interval(ge=0, le=0.5)] = 0.02
    """Largest error of a smaller rock's outline, drawn and touched, as a fraction of its size: how
    coarse it may be; with 0 each is the finest mesh of its shape."""
    tile_cells: Annotated[int, Interval(ge=16, le=4096)] = 512
    """Cells of the ground's grid per mesh and payload, each way."""
    texture_pixels: Annotated[int, Interval(ge=1, le=8192)] = 1024
    """Pixels of the ground's textures along its longer side, all tiles together: as many for each
    node as that has room for, one at least."""
    horizon: bool = True
    """Whether what lies beyond the border is in it, out to the horizon; visual-only."""
    lights: Literal["display", "physical"] = "display"
    """How bright Sun and sky are: `display` opens well exposed, `physical` is as in nature, which
    wants a viewer whose exposure can be set."""
    pebbles_min_m: NotNegative = 0.0
    """Smallest pebbles that lie near the paths, for pictures alone [m]; 0 for none. Their number is
    what the law of the recipe's smallest rocks gives on down to there."""
    pebbles_within_m: Positive = 2.0
    """How far from a path they lie, at most [m]."""
    close_within_m: NearPath = 0.0
    """How far from a path ground and rocks are drawn as a camera at 1 m asks for, at most [m]; 0
    for none: the ground by pictures of its own with pixels of 4 mm, or as fine as 2**24 of them
    reach, rocks of at least 0.25 m by the finer meshes of their shapes. Of a site in tiles each
    tile has as many pixels."""
    surface: Literal["regolith", "bedrock"] = "regolith"
    """What the ground is: its friction is that of the world's body (docs/driving.md)."""
    friction: NotNegative | None = None
    """Coulomb friction of ground and static rocks; without it each has its own, by body and
    surface. Dynamic rocks keep what they were settled with."""

    def idle(self) -> Iterator[Idle]:
        """What has no effect beside other options."""
        if self.pebbles_min_m == 0.0:
            yield Idle("pebbles_within_m", "there are no pebbles; give pebbles_min_m")
        if self.friction is not None:
            yield Idle("surface", "friction is given")


def prepare(options: Options) -> None:
    """Load OpenUSD, before other threads run."""
    del options
    from pxr import Usd  # noqa: F401
