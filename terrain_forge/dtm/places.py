"""Places by name: a product, and where in it the site lies."""

from __future__ import annotations

from dataclasses import dataclass, replace
from difflib import get_close_matches

from terrain_forge.base import RecipeError
from terrain_forge.dtm.products import SOUTH_POLE, find_product
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


_POLE = {
    "connecting_ridge": "Site01",
    "shackleton_rim": "Site04",
    "nobile_rim_1": "Site06",
    "nobile_rim_2": "DM2",
    "de_gerlache_rim": "Site11",
    "leibnitz_beta_plateau": "Site20",
    "malapert_massif": "Site23",
    "haworth": "Haworth",
    "shoemaker": "Shoemaker",
}
PLACES = {
    "jezero": Place(
        product="DTEEC_045994_1985_046060_1985_U01",
        lonlat_deg=(77.4508, 18.4447),
        what="Perseverance's landing place, 1 m",
    ),
    "gale": Place(
        product="DTEEC_023957_1755_024023_1755_U01",
        lonlat_deg=(137.4417, -4.5895),
        what="Curiosity's landing place, 1 m",
    ),
    "utopia": Place(
        product="DTEEC_069665_2055_069731_2055_A01",
        lonlat_deg=(109.925, 25.066),
        what="Zhurong's landing place, 1 m",
    ),
    "oxia_planum": Place(
        product="HRSC_MOLA_200m",
        lonlat_deg=(-24.632, 18.275),
        what="where Rosalind Franklin is to land; 200 m, so all that a rover meets is drawn",
    ),
    "apollo_11": Place(
        product="NAC_DTM_APOLLO11", lonlat_deg=(23.4730, 0.6742), what="Tranquillity Base"
    ),
    "apollo_12": Place(
        product="NAC_DTM_APOLLO12", lonlat_deg=(-23.4219, -3.0128), what="Surveyor 3's crater"
    ),
    "apollo_14": Place(
        product="NAC_DTM_APOLLO14", lonlat_deg=(-17.4719, -3.6459), what="Fra Mauro, Cone crater"
    ),
    "apollo_15": Place(
        product="NAC_DTM_APOLLO15", lonlat_deg=(3.6330, 26.1324), what="Hadley Rille"
    ),
    "apollo_17": Place(
        product="NAC_DTM_APOLLO17", lonlat_deg=(30.7723, 20.1911), what="Taurus-Littrow"
    ),
    **{
        name: Place(product=f"LOLA_5m_{code}", what=f"{SOUTH_POLE[code]}, south pole, 5 m")
        for name, code in _POLE.items()
    },
}
"""All of them."""


def find_place(name: str) -> Place:
    """The place of a name.

    Raises:
        RecipeError: if there is none.
    """
    if name not in PLACES:
        close = get_close_matches(name, PLACES, n=1)
        hint = f" (did you mean {close[0]}?)" if close else ""
        raise RecipeError(
            f"no place is called {name!r}{hint}; `terrain-forge sites` lists them",
            key=("dtm", "place"),
        )
    return PLACES[name]


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


def place_lines() -> list[str]:
    """A table of all places."""
    lines = [f"{'name':<22} {'body':<5} {'lon °E':>9} {'lat °N':>8}  {'product':<34} what is there"]
    for name, one in PLACES.items():
        lon, lat = one.lonlat_deg or ("", "its middle")
        body = find_product(one.product).body
        lines.append(f"{name:<22} {body:<5} {lon:>9} {lat:>8}  {one.product:<34} {one.what}")
    return lines
