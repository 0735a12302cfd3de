"""The products of the export, and what their rasters say of themselves."""

from __future__ import annotations

from typing import Any, Literal

Product = Literal["elevation", "surface_with_rocks", "rock_id", "slope", "hillshade", "orthoimage"]
_DESCRIPTIONS = {
    "elevation": "height of the bare ground",
    "surface_with_rocks": "height of the highest surface, rocks included",
    "rock_id": "id of the rock on top, -1 where there is none",
    "slope": "slope of the bare ground",
    "hillshade": "bare ground lit by the Sun, no shadows",
    "orthoimage": "sRGB colour seen from above, unlit",
}
_UNITS = {"elevation": "m", "surface_with_rocks": "m", "slope": "degree"}
_NODATA = {"rock_id": -1}


def told_of(product: str, heights: str = "world") -> dict[str, Any]:
    """Description, unit and the value that means "nothing here", as `write_geotiff` takes them."""
    units, above = _UNITS.get(product, ""), ", above the datum"
    return {
        "description": _DESCRIPTIONS[product] + above * (units == "m" and heights == "datum"),
        "units": units,
        "nodata": _NODATA.get(product),
    }
