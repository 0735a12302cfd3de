"""Rock counts of landing sites, as values with their sources.

`verified` is False for a figure that is commonly quoted but was not read in its source.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from terrain_forge.model import MARS, MOON, Body

GolombekSite = Literal[
    "viking_1",
    "viking_2",
    "pathfinder",
    "gusev",
    "meridiani",
    "phoenix",
    "gale",
    "insight",
    "jezero",
    "zhurong",
    "change_3",
    "chang_e_3",
    "change_4",
    "chang_e_4",
]
"""Sites whose rocks follow an exponential cover."""

SurveyorSite = Literal["surveyor_1", "surveyor_3", "surveyor_5", "surveyor_6", "surveyor_7"]
"""Sites whose fragments follow a power law."""


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

    @property
    def decay(self) -> tuple[float, float]:
        """The body's q(k) = a + b / k as (a, b)."""
        assert self.body.rock_decay is not None
        return self.body.rock_decay


@dataclass(frozen=True, kw_only=True)
class FragmentCount(SiteCount):
    """Number N(>D) = c D^-m of a site."""

    number_per_m2: float
    """Rocks larger than 1 m on a square metre, c [1/m²]."""
    exponent: float
    """Fall of the cumulative number with diameter, m."""


_RAPP = "Golombek & Rapp 1997, doi:10.1029/96JE03319"
_INSIGHT = "Golombek et al. 2021, doi:10.1002/essoar.10507665.1"
_SHOEMAKER = "Shoemaker & Morris 1970, Icarus 12"
_FRAGMENTS = (
    "converted from numbers per 100 m² and millimetres; counted below about 1 m: for blocks above "
    "2.5 m the laws give too many, but for Surveyor 3 (Cintala & McBride 1995, NASA TM-104804)"
)
_CHANGE_3 = RockAbundance(
    body=MOON,
    k=0.0125,
    source="Di et al. 2016, doi:10.1016/j.pss.2015.11.012",
    verified=False,
)
_CHANGE_4 = RockAbundance(
    body=MOON,
    k=0.0021,
    source="Wu et al. 2021, doi:10.1016/j.epsl.2020.116666",
    verified=True,
    note="around the lander, from the abstract",
)

ABUNDANCES: dict[GolombekSite, RockAbundance] = {
    "viking_1": RockAbundance(body=MARS, k=0.069, q_per_m=4.08, source=_RAPP, verified=False),
    "viking_2": RockAbundance(body=MARS, k=0.176, q_per_m=2.73, source=_RAPP, verified=False),
    "pathfinder": RockAbundance(
        body=MARS,
        k=0.19,
        source="Golombek et al. 2003, doi:10.1029/2002JE002035",
        verified=True,
        note="from the abstract",
    ),
    "gusev": RockAbundance(
        body=MARS,
        k=0.05,
        source=_INSIGHT,
        verified=True,
        note="the plains at Spirit's landing site, as quoted there; up to 0.35 near Bonneville",
    ),
    "meridiani": RockAbundance(
        body=MARS,
        k=0.01,
        source="commonly quoted, not traced to a count",
        verified=False,
        note="plains almost free of rocks; figures up to 0.05 are quoted too",
    ),
    "phoenix": RockAbundance(
        body=MARS, k=0.02, source=_INSIGHT, verified=True, note="as quoted there"
    ),
    "gale": RockAbundance(
        body=MARS,
        k=0.05,
        source="commonly quoted, not traced to a count",
        verified=False,
        note="the landing ellipse's order of magnitude, no count of one place",
    ),
    "insight": RockAbundance(
        body=MARS,
        k=0.03,
        source=_INSIGHT,
        verified=True,
        note="within 10 m of the lander; 0.006 to 0.05 from side to side",
    ),
    "jezero": RockAbundance(
        body=MARS,
        k=0.08,
        source="commonly quoted, not traced to a count",
        verified=False,
        note="the landing ellipse's order of magnitude, no count of one place",
    ),
    "zhurong": RockAbundance(
        body=MARS,
        k=0.033,
        source="Wang et al. 2024, doi:10.1016/j.icarus.2024.116001",
        verified=True,
        note="along the whole traverse, 0.02 to 0.05 from stop to stop, from the abstract",
    ),
    "change_3": _CHANGE_3,
    "chang_e_3": _CHANGE_3,
    "change_4": _CHANGE_4,
    "chang_e_4": _CHANGE_4,
}
"""Rock abundances by the names that a recipe can give."""


def _surveyor(number_per_m2: float, exponent: float) -> FragmentCount:
    return FragmentCount(
        number_per_m2=number_per_m2,
        exponent=exponent,
        source=_SHOEMAKER,
        verified=False,
        note=_FRAGMENTS,
    )


FRAGMENTS: dict[SurveyorSite, FragmentCount] = {
    "surveyor_1": _surveyor(2.34e-3, 2.11),
    "surveyor_3": _surveyor(6.90e-4, 2.56),
    "surveyor_5": _surveyor(1.40e-4, 2.65),
    "surveyor_6": _surveyor(5.64e-4, 2.51),
    "surveyor_7": _surveyor(2.74e-2, 1.82),
}
"""Fragment counts of the Surveyor landers by the names that a recipe can give."""
