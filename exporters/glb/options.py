"""What can be chosen for a GLB export."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import Interval

from terrain_forge.base import Idle, NearPath, NotNegative, Positive, Spec


@dataclass(frozen=True, kw_only=True)
class Options(Spec):
    """Options of the GLB export."""

    bytes_each: ClassVar[tuple[float, float]] = (67, 2000)
    """About how many bytes it writes for each node of the ground and each rock."""
    bytes_each_texel: ClassVar[float] = 2.3
    """About how many it writes for each pixel of the picture that is the ground's detail."""
    whole_only: ClassVar[tuple[str, ...]] = (
        *("finest_min_m", "tile_cells", "soil_normals"),
        *("lights", "sun_lux"),
    )
    """Which a site in tiles has not."""
    kind: Literal["glb"] = "glb"
    """The exporter, where the export's folder has another name."""
    instances_min_m: NotNegative = 0.1
    """Rocks of at least this exposed diameter are nodes of their own, which share their shapes'
    meshes; smaller ones are merged into one mesh per tile and population, since viewers slow down
    with the number of nodes."""
    finest_min_m: NotNegative = 0.25
    """Rocks of at least this exposed diameter have their shapes' finest meshes."""
    close_within_m: NearPath = 0.0
    """How far from a path ground and rocks are drawn as a camera at 1 m asks for, at most [m]; 0
    for none: the ground by pictures of its own with pixels of 4 mm, or as fine as 2**24 of them
    reach, rocks of at least 0.25 m by the finer meshes of their shapes. Of a site in tiles each
    tile has as many pixels."""
    outline_error: Annotated[float, Interval(ge=0, le=0.5)] = 0.03
    """Largest error of a smaller rock's outline, as a fraction of its size: how coarse it may
    be."""
    tile_cells: Annotated[int, Interval(ge=16, le=4096)] = 512
    """Cells of the ground's grid per mesh, each way."""
    texture_pixels: Annotated[int, Interval(ge=1, le=8192)] = 1024
    """Pixels of the ground's textures along its longer side, all tiles together: as many for each
    node as that has room for, one at least."""
    soil_normals: bool = True
    """Whether the ground has the normal map of its soil, which sites in tiles never have; without
    it viewers that lay all maps of a material alike show none, rather than one that is stretched
    over the ground."""
    horizon: bool = True
    """Whether what lies beyond the border is in it, out to the horizon; visual-only."""
    lights: Literal["display", "physical"] = "display"
    """How bright Sun and sky are: `display` opens well exposed, `physical` is as in nature, which
    wants a viewer whose exposure can be set."""
    sun_lux: Positive | None = None
    """Illuminance of the Sun [lx], instead of what `lights` says: of `physical` it is 98 lm/W
    times what gets through the air of the Sun's irradiance."""
    pebbles_min_m: NotNegative = 0.0
    """Smallest pebbles that lie near the paths, for pictures alone [m]; 0 for none. They are in
    `pebbles.glb` beside the world's file, of a site in tiles in `pebbles_ROW_COLUMN.glb`, as many
    as the law of the recipe's smallest rocks gives on down to there."""
    pebbles_within_m: Positive = 2.0
    """How far from a path they lie, at most [m]."""

    def idle(self) -> Iterator[Idle]:
        """What has no effect beside other options."""
        if self.pebbles_min_m == 0.0:
            yield Idle("pebbles_within_m", "there are no pebbles; give pebbles_min_m")
