"""What can be chosen for a mesh export."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Interval

from terrain_forge.base import Idle, NotNegative, RecipeError, Spec


@dataclass(frozen=True, kw_only=True)
class Options(Spec):
    """Options of the mesh export."""

    kind: Literal["mesh"] = "mesh"
    """The exporter, where the export's folder has another name."""
    format: Literal["ply", "stl", "obj"] = "ply"
    """`ply` has a colour per vertex, in binary; `stl`, binary too, is triangles alone and twice as
    large, since they share no vertices; `obj` has textures, normals and names, and is text, four
    times as large."""
    tiles: Literal["merged", "tiled"] = "merged"
    """`merged` writes one file, as ray casters want it; `tiled` one per tile."""
    tile_cells: Annotated[int, Interval(ge=16, le=4096)] = 256
    """Cells of the ground's grid per tile, each way; with `rocks: merged` rocks are joined by such
    tiles within one file too."""
    rocks: Literal["merged", "objects", "none"] = "merged"
    """`merged` joins a tile's rocks, without their faces that lie wholly under the ground;
    `objects` keeps each whole rock as an object of its own, `rock_ID`, with its texture (`obj`
    alone); `none` leaves the bare ground."""
    finest_min_m: NotNegative = 0.25
    """Rocks of at least this exposed diameter are their shapes' finest meshes."""
    outline_error: Annotated[float, Interval(ge=0, le=0.5)] = 0.03
    """Largest error of a smaller merged rock's outline, as a fraction of its size: how coarse it
    may be; with 0 each is the finest mesh of its shape."""
    texture_pixels: Annotated[int, Interval(ge=1, le=8192)] = 1024
    """Pixels of the ground's textures along its longer side, all tiles together: as many for each
    node as that has room for, one at least (`obj` alone)."""

    @property
    def bytes_each(self) -> tuple[float, float]:
        """About how many bytes it writes for each node of the ground and each rock."""
        return {"ply": (54, 5500), "stl": (132, 13000), "obj": (263, 17000)}[self.format]

    def idle(self) -> Iterator[Idle]:
        """What has no effect beside other options."""
        if self.format != "obj":
            yield Idle("texture_pixels", f"{self.format} has no textures", refused=True)
        if self.rocks != "merged":
            for name in ("finest_min_m", "outline_error"):
                yield Idle(name, f"it is for rocks: merged, here {self.rocks}", refused=True)
        if self.rocks != "merged" and self.tiles == "merged":
            why = "there are no tiles; choose tiles: tiled, or rocks: merged"
            yield Idle("tile_cells", why, refused=True)

    def __post_init__(self) -> None:
        if self.rocks == "objects" and self.format != "obj":
            raise RecipeError(
                f"{self.format} has no objects; choose format: obj, or rocks: merged",
                key=("rocks",),
            )
        self.refuse_idle()
