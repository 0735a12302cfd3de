"""How the rocks of a population lie towards each other: anywhere, in clusters, around craters."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from math import exp, pi
from typing import Annotated, Literal

import numpy as np
from annotated_types import Interval
from numpy.typing import ArrayLike

from terrain_forge.base import (
    BY_KIND,
    Array,
    FileName,
    Idle,
    Pair,
    Positive,
    Spec,
    portable,
    unchanging,
)
from terrain_forge.rocks.around_craters import (
    FARTHEST,
    INTERIOR,
    LIFETIME,
    RIM_FALL,
    densities,
    throwers,
)

_RIM_POINTS, _AT_ONCE, _PARTS = 72, 4096, 64
"""Points on a crater's rim, craters that are looked at together, and points each way on what of a
crater lies on a site."""


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

    @property
    def strength(self) -> float:
        """Density of its rocks over that of a fresh crater's, (1 - age / 4 Ga)³."""
        return float(max(1.0 - self.age_ga / LIFETIME, 0.0) ** 3)

    @property
    def largest_rock_m(self) -> float:
        """Diameter [m] that no rock exceeds, 0.25 (diameter / 1 m)^0.7.

        After Moore 1971 and Lee et al. 1996 (Icarus 120, 87), both quoted second-hand.
        """
        return float(0.25 * self.diameter_m**0.7)

    @property
    def effective_area(self) -> float:
        """Integral of the weight over endless ground [m²].

        π R² (i + 2 ∫ x exp((1 - x) / s) dx from the rim to f radii), with s the range of the fall.
        """
        falling = (1.0 + RIM_FALL) - (FARTHEST + RIM_FALL) * exp((1.0 - FARTHEST) / RIM_FALL)
        radius = 0.5 * self.diameter_m
        return self.strength * pi * radius**2 * (INTERIOR + 2.0 * RIM_FALL * falling)

    def weight(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Density of its rocks at places [m] over that at a fresh rim."""
        away = np.hypot(np.subtract(x, self.centre_m[0]), np.subtract(y, self.centre_m[1]))
        away *= 2.0 / self.diameter_m
        outside = np.where(away > FARTHEST, 0.0, portable.exp((1.0 - away) / RIM_FALL))
        return self.strength * np.where(away < 1.0, INTERIOR, outside)


@dataclass(frozen=True, kw_only=True)
class AroundCraters(Spec):
    """Around craters: the law holds at a fresh rim, and falls with range and age.

    The density falls as exp(-(r/R - 1) / 0.7) from the rim to two radii R and is 0.05 within; it is
    multiplied by (1 - age / 4 Ga)³, and no rock is larger than 0.25 D^0.7 of a crater of D metres.
    Craters that overlap add up.
    """

    kind: Literal["craters"] = "craters"
    craters: tuple[Crater, ...] = ()
    """The craters, one by one."""
    layer: FileName | None = None
    """Instead: name of a layer of craters (`craters` where it has none of its own)."""
    smallest_crater_m: Positive = 10.0
    """Diameter [m] of the layer's smallest craters that have rocks, since they dig deep enough."""

    @cached_property
    def table(self) -> Array:
        """East, north, radius [m], strength, largest rock [m] of each crater, shape [craters, 5].

        Made once, since a layer may have a hundred thousand.
        """
        rows = [
            (*c.centre_m, 0.5 * c.diameter_m, c.strength, c.largest_rock_m) for c in self.craters
        ]
        return unchanging(np.array(rows, np.float64).reshape(-1, 5))

    @cached_property
    def densest(self) -> float:
        """The largest density on any rim over that of the law."""
        angle = 2.0 * pi * np.arange(_RIM_POINTS) / _RIM_POINTS
        x, y, radius = self.table[:, :3].T
        far = radius * (1.0 + 1e-9)
        bounds = [(x - far).min(), (y - far).min(), (x + far).max(), (y + far).max()]
        thrown = throwers([self.table], np.array(bounds))
        found = 0.0
        for first in range(0, len(x), _AT_ONCE):
            part = np.s_[first : first + _AT_ONCE, None]
            east, north = x[part] + far[part] * np.cos(angle), y[part] + far[part] * np.sin(angle)
            rims = np.column_stack([east.ravel(), north.ravel()])
            found = max(found, float(densities(thrown, rims).max()))
        return found

    def areas_within(self, size: tuple[float, float]) -> Array:
        """Integral of each crater's weight over a site about the origin [m²], shape [craters].

        Exact for craters whose rocks all lie on it, else by the midpoint rule on what does.
        """
        x, y, radius = self.table[:, :3].T
        reach, half = FARTHEST * radius, 0.5 * np.array(size)
        within = (np.abs(x) + reach <= half[0]) & (np.abs(y) + reach <= half[1])
        areas = np.zeros(len(x))
        middles = (np.arange(_PARTS) + 0.5) / _PARTS
        for n, crater in enumerate(self.craters):
            if within[n]:
                areas[n] = crater.effective_area
                continue
            low = np.maximum((x[n] - reach[n], y[n] - reach[n]), -half)
            sides = np.minimum((x[n] + reach[n], y[n] + reach[n]), half) - low
            if sides.min() > 0.0:
                east, north = low[:, None] + sides[:, None] * middles
                areas[n] = crater.weight(east[None, :], north[:, None]).mean() * sides.prod()
        return areas

    def idle(self) -> Iterator[Idle]:
        """Which craters of a layer, where they are listed one by one."""
        if self.layer is None:
            yield Idle("smallest_crater_m", "it is for craters of a layer")

    def __post_init__(self) -> None:
        if bool(self.craters) == (self.layer is not None):
            raise ValueError("one of craters and layer")


Arrangement = Annotated[Poisson | Clustered | AroundCraters, BY_KIND]
"""The arrangements that a recipe can name by their `kind`."""


def crowding(arrangement: Arrangement) -> float:
    """How many times denser than their law rocks lie where they are densest.

    In a cluster's middle: 1 + 2 s + √s with s = 1 / (4 π κ σ²), which are the mean of all other
    clusters, the middle's own rocks and one standard deviation of the others (up to a cover of 0.4
    there, less than one rock in a thousand was found to have no place). Around craters that
    overlap: the largest sum on any rim.
    """
    if isinstance(arrangement, Clustered):
        own = 1.0 / (4.0 * pi * arrangement.clusters_per_m2 * arrangement.radius_m**2)
        return float(1.0 + 2.0 * own + own**0.5)
    if isinstance(arrangement, AroundCraters) and arrangement.craters:
        return arrangement.densest
    return 1.0
