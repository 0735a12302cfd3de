"""Published terrain models by name: where they lie, what they must be, whose they are.

Rules and names are those of the archives' own file lists; none could be downloaded where this was
written (docs/places.md tells what is known of each).
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from difflib import get_close_matches

from terrain_forge.base import RecipeError

HIRISE = "https://hirise-pds.lpl.arizona.edu/PDS/DTM"
LOLA_5M = "https://pgda.gsfc.nasa.gov/data/LOLA_5mpp"
LROC = "https://pds.lroc.im-ldi.com/data/LRO-L-LROC-5-RDR-V1.0/LROLRC_2001/DATA/SDP/NAC_DTM"
USGS = "https://planetarymaps.usgs.gov/mosaic"
FIRST_EXTENDED = 11000
"""Orbit from which HiRISE's observations are called ESP, not PSP."""
_FREE = "public domain (NASA); credit asked for"
_BARKER = "Barker et al. 2021, doi:10.1016/j.pss.2020.105119"
_LOLA = "Smith et al. 2017, doi:10.1016/j.icarus.2016.06.006"

SOUTH_POLE = {
    "Site01": "Connecting ridge",
    "Site04": "Shackleton rim",
    "Site06": "Nobile rim 1",
    "Site07": "Peak near Shackleton",
    "Site11": "de Gerlache rim",
    "Site20": "Leibnitz beta plateau",
    "Site20v2": "Leibnitz beta plateau, extended",
    "Site23": "Malapert massif",
    "Site42": "de Gerlache-Kocher massif",
    "Haworth": "Haworth",
    "Shoemaker": "Shoemaker",
    "DM1": "Amundsen rim",
    "DM2": "Nobile rim 2",
    "SL2": "de Gerlache rim",
    "SL3": "Connecting ridge, extension",
    "NPA": "Cabeus exterior wall 1",
    "NPB": "Amundsen 1",
    "NPC": "Idel'son L crater 1",
    "NPD": "Malapert crater 1",
    "LM1": "Shackleton rim B",
    **{f"LM{n}": f"Shoemaker rim {letter}" for n, letter in zip("234568", "ABCDEF", strict=True)},
    "LM7": "Faustini rim A",
}
"""The sites of the lunar south pole that LOLA's team made maps of 5 m of, by their code."""


@dataclass(frozen=True, kw_only=True)
class Product:
    """A published terrain model."""

    name: str
    body: str
    url: str
    licence: str
    citation: str
    size: float | None = None
    """About how large it is [bytes]; None where that varies and is not known."""
    shape: tuple[int, int] | None = None
    """Rows and columns that it must have; None where these vary."""
    by_window: bool = False
    """Whether only what a site needs is read of it: it is too large to be kept whole."""
    height_scale: float | None = None
    """Metres per unit, where the file may not say."""


GLOBAL = (
    Product(
        name="MOLA_463m",
        body="mars",
        url=f"{USGS}/Mars_MGS_MOLA_DEM_mosaic_global_463m.tif",
        licence=_FREE,
        citation="Smith et al. 2001, doi:10.1029/2000JE001364",
        size=2.12e9,
        shape=(23040, 46080),
        by_window=True,
    ),
    Product(
        name="HRSC_MOLA_200m",
        body="mars",
        url=f"{USGS}/Mars/HRSC_MOLA_Blend/Mars_HRSC_MOLA_BlendDEM_Global_200mp_v2.tif",
        licence="free to use with credit to ESA/DLR/FU Berlin, NASA and USGS",
        citation="Fergason, Hare and Laura 2018, HRSC and MOLA blended DEM at 200 m v2, USGS",
        size=11.38e9,
        shape=(53347, 106694),
        by_window=True,
    ),
    Product(
        name="LOLA_118m",
        body="moon",
        url=f"{USGS}/Lunar_LRO_LOLA_Global_LDEM_118m_Mar2014.tif",
        licence=_FREE,
        citation=_LOLA,
        size=8.49e9,
        shape=(46080, 92160),
        by_window=True,
        height_scale=0.5,
    ),
    Product(
        name="LOLA_Kaguya_59m",
        body="moon",
        url=f"{USGS}/LolaKaguya_Topo/Lunar_LRO_LOLAKaguya_DEMmerge_60N60S_512ppd.tif",
        licence="free to use with credit to NASA and JAXA",
        citation="Barker et al. 2016, doi:10.1016/j.icarus.2015.07.039",
        size=22.65e9,
        shape=(61440, 184320),
        by_window=True,
        height_scale=0.5,
    ),
)
"""Mosaics of whole bodies."""

_HIRISE = re.compile(r"DT[A-Z]{3}_(\d{6})_(\d{4})_(\d{6})_(\d{4})_[A-Z]\d\d")
_LOLA_5M = re.compile(r"LOLA_5m_(\w+)")
_NAC = re.compile(r"NAC_DTM_([A-Z0-9]+)")


def find_product(name: str) -> Product:
    """The product of a name.

    Raises:
        RecipeError: if there is none; says which there are.
    """
    for one in GLOBAL:
        if one.name == name:
            return one
    if found := _HIRISE.fullmatch(name):
        return _hirise(name, *found.groups())
    if (found := _LOLA_5M.fullmatch(name)) and found[1] in SOUTH_POLE:
        return Product(
            name=name,
            body="moon",
            url=f"{LOLA_5M}/{found[1]}/{found[1]}_final_adj_5mpp_surf.tif",
            licence=_FREE,
            citation=_BARKER,
        )
    if found := _NAC.fullmatch(name):
        return Product(
            name=name,
            body="moon",
            url=f"{LROC}/{found[1]}/{name}.TIF",
            licence="public domain (NASA); credit NASA/GSFC/Arizona State University",
            citation="Henriksen et al. 2017, doi:10.1016/j.icarus.2016.05.012",
        )
    known = [one.name for one in GLOBAL] + [f"LOLA_5m_{code}" for code in SOUTH_POLE]
    close = get_close_matches(name, known, n=1)
    hint = f" (did you mean {close[0]}?)" if close else ""
    raise RecipeError(
        f"no product is called {name!r}{hint}; known are HiRISE's such as "
        "DTEEC_045994_1985_046060_1985_U01, LROC's such as NAC_DTM_APOLLO15, LOLA_5m_ with a code "
        f"such as Site01 or Haworth, {', '.join(one.name for one in GLOBAL)}",
        key=("dtm", "product"),
    )


def _hirise(name: str, *numbers: str) -> Product:
    """A HiRISE DTM lies in the folder of its first image's orbit, hundreds together."""
    (first, one), (second, other) = zip(numbers[::2], numbers[1::2], strict=True)
    begin = int(first) // 100 * 100
    images = "_".join(f"{_phase(o)}_{o}_{place}" for o, place in ((first, one), (second, other)))
    folder = f"{_phase(first)}/ORB_{begin:06d}_{begin + 99:06d}/{images}"
    return Product(
        name=name,
        body="mars",
        url=f"{HIRISE}/{folder}/{name}.IMG",
        licence="public domain (NASA); credit NASA/JPL-Caltech/University of Arizona",
        citation="Kirk et al. 2008, doi:10.1029/2007JE003000",
    )


def _phase(orbit: str) -> str:
    return "PSP" if int(orbit) < FIRST_EXTENDED else "ESP"
