"""What can be chosen for a GeoTIFF export."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import MinLen

from terrain_forge.base import RecipeError, Spec

Product = Literal["elevation", "surface_with_rocks", "rock_id", "slope", "hillshade", "orthoimage"]


@dataclass(frozen=True, kw_only=True)
class Options(Spec):
    """Options of the GeoTIFF export."""

    kind: Literal["geotiff"] = "geotiff"
    """The exporter, where the export's folder has another name."""
    products: Annotated[tuple[Product, ...], MinLen(1)] = (
        *("elevation", "surface_with_rocks", "rock_id"),
        *("slope", "hillshade", "orthoimage"),
    )
    """The rasters to write, each into a file of its name: heights of the bare ground; heights of
    the highest surface, rocks included; id of the rock on top, -1 where there is none; slope of the
    bare ground in degrees; the bare ground lit by the recipe's Sun, without shadows; colours of
    ground and rocks as seen from above."""
    heights: Literal["world", "datum"] = "world"
    """`world` writes z of the world; `datum` heights above the body's datum: the datum height and
    the plane that levelling took away are added."""
    cloud_optimized: bool = False
    """Write cloud-optimised GeoTIFFs (COG), with blocks and overviews."""

    def __post_init__(self) -> None:
        for number, product in enumerate(self.products):
            if product in self.products[:number]:
                raise RecipeError(f"{product} is named twice", key=("products",))
