"""How the rocks of a population lie towards each other: anywhere, in clusters, around craters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Interval, MinLen

from terrain_forge.specs import BY_KIND, Pair, Positive, Spec


@dataclass(frozen=True, kw_only=True)
class Poisson(Spec):
    """Anywhere, each rock independent of the others but that none overlap."""

    kind: Literal["poisson"] = "poisson"


@dataclass(frozen=True, kw_only=True)
class Clustered(Spec):
    """In clusters (a Thomas process): rocks scatter normally about random parent points.

    Thomas 1949, doi:10.1093/biomet/36.1-2.18.
    """

    kind: Literal["clustered"] = "clustered"
    clusters_per_m2: Annotated[float, Interval(gt=0, le=10)]
    """Parent points on a square metre [1/m²]."""
    radius_m: Positive
    """Standard deviation of the rocks about their parent point, east and north alike [m]."""


@dataclass(frozen=True, kw_only=True)
class Crater(Spec):
    """A crater that rocks lie around."""

    centre_m: Pair
    """East and north of its centre [m]."""
    diameter_m: Positive
    """Rim-to-rim diameter [m]."""
    age_ga: Annotated[float, Interval(ge=0, le=4.5)] = 0.0
    """Age [10⁹ years]; old craters have lost their rocks."""


@dataclass(frozen=True, kw_only=True)
class AroundCraters(Spec):
    """Around craters: the law holds at a fresh rim, and falls with range and age."""

    kind: Literal["craters"] = "craters"
    craters: Annotated[tuple[Crater, ...], MinLen(1)]
    """The craters."""


Arrangement = Annotated[Poisson | Clustered | AroundCraters, BY_KIND]
"""The arrangements that a recipe can name by their `kind`."""
