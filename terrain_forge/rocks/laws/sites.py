"""Rock counts of landing sites, as values with their sources.

`verified` is False for a figure that is commonly quoted but was not read in its source.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from terrain_forge.model import MARS, MOON, Body


@dataclass(frozen=True, kw_only=True)
class SiteCount:
    """Where the figures of a site come from."""

    source: str
    """Who counted."""
    verified: bool
    """Whether the figures were read in the source itself."""
    note: str = ""
    """What else there is to know."""

    @property
    def about(self) -> dict[str, Any]:
        """The source as JSON can hold it."""
        return {"source": self.source, "verified": self.verified, "note": self.note}


@dataclass(frozen=True, kw_only=True)
class RockAbundance(SiteCount):
    """Cover F(>D) = k exp(-q D) of a site."""

    body: Body
    """Where the site lies; its q(k) holds where the site has no fitted q."""
    k: float
    """Part of the ground that rocks of all sizes cover."""
    q_per_m: float | None = None
    """Decay of the cover with diameter [1/m], where it was fitted to the site itself."""


@dataclass(frozen=True, kw_only=True)
class FragmentCount(SiteCount):
    """Number N(>D) = c D^-m of a site."""

    number_per_m2: float
    """Rocks larger than 1 m on a square metre, c [1/m²]."""
    exponent: float
    """Fall of the cumulative number with diameter, m."""


def _read(body: Body, k: float, source: str, note: str) -> RockAbundance:
    return RockAbundance(body=body, k=k, source=source, verified=True, note=note)


def _quoted(
    k: float,
    note: str = "",
    *,
    body: Body = MARS,
    q_per_m: float | None = None,
    source: str = "commonly quoted, not traced to a count",
) -> RockAbundance:
    return RockAbundance(body=body, k=k, q_per_m=q_per_m, source=source, verified=False, note=note)


def _surveyor(number_per_m2: float, exponent: float) -> FragmentCount:
    return FragmentCount(
        number_per_m2=number_per_m2,
        exponent=exponent,
        source="Shoemaker & Morris 1970, Icarus 12",
        verified=False,
        note="converted from numbers per 100 m² and millimetres; counted below about 1 m: for "
        "blocks above 2.5 m the laws give too many, but for Surveyor 3 (Cintala & McBride 1995, "
        "NASA TM-104804)",
    )


_RAPP = "Golombek & Rapp 1997, doi:10.1029/96JE03319"
_PATHFINDER = "Golombek et al. 2003, doi:10.1029/2002JE002035"
_INSIGHT = "Golombek et al. 2021, doi:10.1002/essoar.10507665.1"
_ZHURONG = "Wang et al. 2024, doi:10.1016/j.icarus.2024.116001"
_CHANGE_3 = _quoted(0.0125, body=MOON, source="Di et al. 2016, doi:10.1016/j.pss.2015.11.012")
_CHANGE_4 = _read(
    MOON,
    0.0021,
    "Wu et al. 2021, doi:10.1016/j.epsl.2020.116666",
    "around the lander, from the abstract",
)
_ELLIPSE = "the landing ellipse's order of magnitude, no count of one place"
_GUSEV = "the plains at Spirit's landing site, as quoted there; up to 0.35 near Bonneville"
_TRAVERSE = "along the whole traverse, 0.02 to 0.05 from stop to stop, from the abstract"

ABUNDANCES: dict[str, RockAbundance] = {
    "viking_1": _quoted(0.069, q_per_m=4.08, source=_RAPP),
    "viking_2": _quoted(0.176, q_per_m=2.73, source=_RAPP),
    "pathfinder": _read(MARS, 0.19, _PATHFINDER, "from the abstract"),
    "gusev": _read(MARS, 0.05, _INSIGHT, _GUSEV),
    "meridiani": _quoted(0.01, "plains almost free of rocks; figures up to 0.05 are quoted too"),
    "phoenix": _read(MARS, 0.02, _INSIGHT, "as quoted there"),
    "gale": _quoted(0.05, _ELLIPSE),
    "insight": _read(
        MARS, 0.03, _INSIGHT, "within 10 m of the lander; 0.006 to 0.05 from side to side"
    ),
    "jezero": _quoted(0.08, _ELLIPSE),
    "zhurong": _read(MARS, 0.033, _ZHURONG, _TRAVERSE),
    "change_3": _CHANGE_3,
    "chang_e_3": _CHANGE_3,
    "change_4": _CHANGE_4,
    "chang_e_4": _CHANGE_4,
}
"""Rock abundances of sites whose rocks follow an exponential cover, by a recipe's names."""

FRAGMENTS: dict[str, FragmentCount] = {
    "surveyor_1": _surveyor(2.34e-3, 2.11),
    "surveyor_3": _surveyor(6.90e-4, 2.56),
    "surveyor_5": _surveyor(1.40e-4, 2.65),
    "surveyor_6": _surveyor(5.64e-4, 2.51),
    "surveyor_7": _surveyor(2.74e-2, 1.82),
}
"""Fragment counts of the Surveyor landers, by a recipe's names."""

if TYPE_CHECKING:
    GolombekSite = str
    SurveyorSite = str
else:
    GolombekSite = Literal[tuple(ABUNDANCES)]
    SurveyorSite = Literal[tuple(FRAGMENTS)]
