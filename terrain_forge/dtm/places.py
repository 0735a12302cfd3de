"""Places by name: a product, and where in it the site lies."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

from terrain_forge.base import RecipeError, hint_at
from terrain_forge.dtm.products import RULES, find_product, rows_of
from terrain_forge.dtm.spec import Centre, RasterDtm


@dataclass(frozen=True, kw_only=True)
class Place:
    """A place on a body."""

    product: str
    """Name of the product that shows it."""
    lonlat_deg: tuple[float, float] | None = None
    """Longitude (positive east) and latitude [degrees]; without it the product's middle."""
    what: str
    """What is there."""


def _place(row: dict[str, str]) -> Place:
    lonlat = (float(row["lon_deg"]), float(row["lat_deg"])) if row["lon_deg"] else None
    return Place(product=row["product"], lonlat_deg=lonlat, what=row["what"])


@cache
def places() -> dict[str, Place]:
    """The places of places.csv by name."""
    return {row["name"]: _place(row) for row in rows_of("places.csv")}


def find_place(name: str) -> Place:
    """The place of a name.

    Raises:
        RecipeError: if there is none.
    """
    if name not in places():
        raise RecipeError(
            f"no place is called {name!r}{hint_at(name, places())}; `terrain-forge sites` lists "
            "them",
            key=("dtm", "place"),
        )
    return places()[name]


def expanded(spec: RasterDtm) -> RasterDtm:
    """A spec whose place is written out as product and centre; any other as it is.

    Raises:
        RecipeError: unless the spec names its terrain model in one way.
    """
    ways = {way: getattr(spec, way) for way in ("source", "product", "place", "url")}
    given = [way for way, value in ways.items() if value is not None]
    if len(given) != 1:
        raise RecipeError(
            f"one of {', '.join(ways)}, found {' and '.join(given) or 'none'}", key=("dtm",)
        )
    if spec.place is None:
        return spec
    place = find_place(spec.place)
    centre = spec.centre
    if centre == RasterDtm.centre and place.lonlat_deg is not None:
        centre = Centre(lonlat_deg=place.lonlat_deg)
    return replace(spec, place=None, product=place.product, centre=centre)


def terrain_models() -> dict[str, str]:
    """What can be fetched by a name that is in a table, and what it is: places, then products."""
    known = {name: one.what for name, one in places().items()}
    return known | {row["name"]: row["what"] for row in rows_of("products.csv")}


def place_lines() -> list[str]:
    """A table of all places, and one of the products that follow no rule."""
    lines = [
        f"{'name':<22} {'body':<5} {'lon °E':>9} {'lat °N':>10}  {'product':<34} what is there"
    ]
    for name, one in places().items():
        lon, lat = one.lonlat_deg or ("", "its middle")
        body = find_product(one.product).body
        lines.append(f"{name:<22} {body:<5} {lon:>9} {lat:>10}  {one.product:<34} {one.what}")
    lines += ["", f"products: {RULES}, and"]
    return lines + [f"{r['name']:<22} {r['body']:<5} {r['what']}" for r in rows_of("products.csv")]
