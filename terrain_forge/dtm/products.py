"""Published terrain models by name: where they lie, what they must be, whose they are.

Those that follow no rule stand in products.csv; where rows and columns stand too, a file is a
mosaic of a whole body, of which only what a site needs is read. Addresses and rules are those that
users of the archives write down; none could be tried where this was written (docs/places.md).
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

from terrain_forge.base import RecipeError, hint_at

HIRISE = "https://hirise-pds.lpl.arizona.edu/PDS/DTM"
LROC = "https://pds.lroc.im-ldi.com/data/LRO-L-LROC-5-RDR-V1.0/LROLRC_2001/DATA/SDP/NAC_DTM"
FIRST_EXTENDED = 11000
"""Orbit from which HiRISE's observations are called ESP, not PSP."""
RULES = "HiRISE's such as DTEEC_045994_1985_046060_1985_U01, LROC's such as NAC_DTM_APOLLO15"
"""Products whose address follows from their name."""
_HIRISE = re.compile(r"DT[A-Z]{3}_(\d{6})_(\d{4})_(\d{6})_(\d{4})_[A-Z]\d\d")
_NAC = re.compile(r"NAC_DTM_([A-Z0-9]+)")


@dataclass(frozen=True, kw_only=True)
class Product:
    """A published terrain model."""

    name: str
    body: str
    url: str
    licence: str
    citation: str
    size: float | None = None
    """About how large it is [bytes]; None where that varies."""
    shape: tuple[int, int] | None = None
    """Rows and columns of a mosaic of a whole body, of which only a part is read."""
    height_scale: float | None = None
    """Metres per unit, where the file may not say."""


def find_product(name: str, *, also: Iterable[str] = ()) -> Product:
    """The product of a name; `also` are names that may have been meant.

    Raises:
        RecipeError: if there is none; says which there are.
    """
    if name in table():
        return table()[name]
    if found := _HIRISE.fullmatch(name):
        return Product(
            name=name,
            body="mars",
            url=f"{HIRISE}/{_folder(*found.groups())}/{name}.IMG",
            licence="public domain (NASA); credit NASA/JPL-Caltech/University of Arizona",
            citation="Kirk et al. 2008, doi:10.1029/2007JE003000",
        )
    if found := _NAC.fullmatch(name):
        return Product(
            name=name,
            body="moon",
            url=f"{LROC}/{found[1]}/{name}.TIF",
            licence="public domain (NASA); credit NASA/GSFC/Arizona State University",
            citation="Henriksen et al. 2017, doi:10.1016/j.icarus.2016.05.012",
        )
    raise RecipeError(
        f"no product is called {name!r}{hint_at(name, (*table(), *also))}; known are {RULES}, and "
        "those that `terrain-forge sites` lists",
        key=("dtm", "product"),
    )


def rows_of(name: str) -> list[dict[str, str]]:
    """The rows of one of our tables."""
    text = files("terrain_forge.dtm").joinpath(name).read_text(encoding="utf-8")
    return list(csv.DictReader(text.splitlines()))


@cache
def table() -> dict[str, Product]:
    """The products of products.csv by name."""
    return {row["name"]: _product(row) for row in rows_of("products.csv")}


def _product(row: dict[str, str]) -> Product:
    return Product(
        **{key: row[key] for key in ("name", "body", "url", "licence", "citation")},
        size=float(row["bytes"]) if row["bytes"] else None,
        shape=(int(row["rows"]), int(row["columns"])) if row["rows"] else None,
        height_scale=float(row["height_scale"]) if row["height_scale"] else None,
    )


def _folder(first: str, one: str, second: str, other: str) -> str:
    """A HiRISE DTM lies in the folder of its first image's orbit, a hundred together."""
    begin = int(first) // 100 * 100
    images = f"{_phase(first)}_{first}_{one}_{_phase(second)}_{second}_{other}"
    return f"{_phase(first)}/ORB_{begin:06d}_{begin + 99:06d}/{images}"


def _phase(orbit: str) -> str:
    return "PSP" if int(orbit) < FIRST_EXTENDED else "ESP"
