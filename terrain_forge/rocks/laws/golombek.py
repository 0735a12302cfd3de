"""The rocks of Mars' landing sites: exponential cover."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from annotated_types import Interval
from numpy.typing import ArrayLike, NDArray

from terrain_forge.base import (
    Array,
    Key,
    NotNegative,
    Positive,
    RecipeError,
    Spec,
    kernel,
    mix,
    portable,
    uniform,
)
from terrain_forge.model import BODIES, MARS, Body
from terrain_forge.rocks.laws.law import SizeLaw, above_zero
from terrain_forge.rocks.laws.sites import ABUNDANCES, GolombekSite, RockAbundance

MAX_K = 0.4
"""Largest rock abundance of the family: none larger was counted, and curves might cross."""

DECAYS = {body.name: body.rock_decay for body in BODIES.values() if body.rock_decay}
"""q(k) = a + b / k [1/m] as (a, b), by the bodies whose rocks it was fitted to."""
USUAL = DECAYS[MARS.name]
"""The law's own q(k) (Golombek et al. 2003, LPSC XXXIV)."""

if TYPE_CHECKING:
    DecayOf = str
else:
    DecayOf = Literal[tuple(DECAYS)]


@dataclass(frozen=True, kw_only=True)
class CoverAbove(Spec):
    """Part of the ground that rocks above a diameter cover."""

    fraction: Annotated[float, Interval(ge=1e-12, le=MAX_K)]
    """The part, 0 to 0.4."""
    above_m: NotNegative
    """Their smallest diameter [m]."""


@dataclass(frozen=True, kw_only=True)
class Golombek(SizeLaw):
    """Exponential cover F(>D) = k exp(-q D) by one of `k`, `cover` and `site`.

    Golombek & Rapp 1997, doi:10.1029/96JE03319; q(k) of Golombek et al. 2003, LPSC XXXIV. The law
    has ever more rocks the smaller they are: a population needs a smallest diameter.
    """

    kind: Literal["golombek"] = "golombek"
    """Name of the law."""
    k: Annotated[float, Interval(ge=1e-12, le=MAX_K)] | None = None
    """Part of the ground that rocks of all sizes cover, 0 to 0.4."""
    cover: CoverAbove | None = None
    """Part of the ground that rocks above some diameter cover; k follows from it."""
    site: GolombekSite | None = None
    """A landing site whose rocks to take. Viking's two, Meridiani, Gale, Jezero and Chang'e 3 are
    commonly quoted figures that were not checked in their sources (docs/science.md)."""
    q_of_k: DecayOf | None = None
    """How the cover's decay q follows from k: `mars` 1.79 + 0.152 / k, `moon` 0.5648 + 0.01285 / k
    [1/m], the latter known at second hand; by default that of the site's body."""
    q_per_m: Annotated[float, Interval(ge=0.01, le=1000)] | None = None
    """Decay q of the cover with diameter [1/m], instead of q(k)."""

    @property
    def preset(self) -> RockAbundance | None:
        """The landing site's figures, if the law is named by a site."""
        return ABUNDANCES[self.site] if self.site else None

    @property
    def abundance(self) -> float:
        """Rock abundance k, however it is given."""
        if self.preset:
            return self.preset.k
        if self.cover:
            fraction, above = self.cover.fraction, self.cover.above_m
            if self.q_per_m:
                return float(fraction * portable.exp(self.q_per_m * above))
            from scipy.special import lambertw

            # The k of F = k exp(-(a + b / k) D): b D / k = W(b D exp(-a D) / F), Lambert's W.
            constant, slope = self._decay
            w = float(lambertw(slope * above * portable.exp(-constant * above) / fraction).real)
            # k = b D / W(x) in a form that holds for D = 0 too: 1 / W(x) = exp(W(x)) / x.
            return float(fraction * portable.exp(constant * above + w))
        if self.k is None:
            raise RecipeError("golombek needs one of k, cover and site")
        return self.k

    @property
    def q(self) -> float:
        """Decay of the cover with diameter [1/m]."""
        given = self.preset.q_per_m if self.preset else self.q_per_m
        constant, slope = self._decay
        return given or constant + slope / self.abundance

    def cumulative_number(self, diameter: ArrayLike) -> Array:
        """N(>D) = (4 k q / π) (exp(-q D) / D - q E1(q D)) [1/m²]."""
        from scipy.special import exp1

        d, k, q = above_zero(diameter), self.abundance, self.q
        return np.asarray(4.0 * k * q / np.pi * (portable.exp(-q * d) / d - q * exp1(q * d)))

    def cumulative_area(self, diameter: ArrayLike) -> Array:
        """F(>D) = k exp(-q D)."""
        return self.abundance * portable.exp(-self.q * np.asarray(diameter, np.float64))

    def log_density(self, diameter: ArrayLike) -> Array:
        """Logarithm of n = -dN/dD [m⁻³]: log n(D) = log(4 k q / π) - q D - 2 log D."""
        d, q = above_zero(diameter), self.q
        return portable.log(4.0 * self.abundance * q / np.pi) - q * d - 2.0 * portable.log(d)

    def cover_variance(self, smallest: float, largest: float, area: Positive) -> float:
        """(π k q / 4 area) (G(a) - G(b)), G(D) = exp(-q D) (D² / q + 2 D / q² + 2 / q³)."""
        q = self.q
        d = np.array([smallest, largest])
        moment = portable.exp(-q * d) * (d * d / q + 2 * d / q**2 + 2 / q**3)
        return float(np.pi * self.abundance * q / (4.0 * area) * (moment[0] - moment[1]))

    def sample(self, hashes: NDArray[np.uint64], smallest: float, largest: float) -> Array:
        """Diameters [m] of density exp(-q D) / D², exactly: proposed by 1 / D², thinned by exp."""
        return np.asarray(_sample(hashes, smallest, largest, self.q))

    def on(self, body: Body, key: Key = ()) -> Golombek:
        """The law with the body's q(k), unless it has a q of its own."""
        if self.site or self.q_of_k or self.q_per_m or body.rock_decay == USUAL:
            return self
        return replace(self, q_of_k=decay_of(body, key))

    def check(self, key: Key) -> None:
        """Refuse a law without or with two of k, cover and site, or a cover beyond the family."""
        self.require_one(key, "one of k, cover and site", ("k",), ("cover",), ("site",))
        decays = [name for name in ("q_of_k", "q_per_m") if getattr(self, name) is not None]
        if self.site and decays:
            raise RecipeError("a site has its own q, leave it out", key=(*key, decays[0]))
        if len(decays) > 1:
            raise RecipeError("q_of_k and q_per_m contradict, give one", key=(*key, "q_per_m"))
        if self.cover and self.abundance > MAX_K:
            most = replace(self, cover=None, k=MAX_K).cumulative_area(self.cover.above_m)
            raise RecipeError(
                f"rocks above {self.cover.above_m:g} m that cover {self.cover.fraction:g} of the "
                f"ground need k = {self.abundance:.3g}, at most {MAX_K}: there a cover of "
                f"{most:.3g}",
                key=(*key, "cover", "fraction"),
            )

    def report(self) -> dict[str, Any]:
        """k, q and the source of a site's figures."""
        plain: dict[str, Any] = {"kind": self.kind, "k": self.abundance, "q_per_m": self.q}
        if self.cover:
            plain["cover"] = asdict(self.cover)
        if self.preset:
            plain |= {"site": self.site, **self.preset.about}
        return plain

    @property
    def _decay(self) -> tuple[float, float]:
        if self.preset:
            return DECAYS[self.preset.body.name]
        return DECAYS[self.q_of_k] if self.q_of_k else USUAL


def decay_of(body: Body, key: Key) -> str:
    """The `q_of_k` of a body; refuses one to whose rocks no q(k) was fitted."""
    if body.rock_decay is None:
        raise RecipeError(
            f"no q(k) was fitted to rocks of {body.name.capitalize()}: give q_per_m, or take that "
            f"of another body by q_of_k: {' or '.join(DECAYS)}",
            key=key,
        )
    return body.name


@kernel
def _sample(hashes, smallest, largest, q):  # type: ignore[no-untyped-def]
    diameters = np.empty(len(hashes))
    inverse, width = 1.0 / smallest, 1.0 / smallest - 1.0 / largest
    for n in range(len(hashes)):
        trial = 0
        while True:
            diameter = 1.0 / (inverse - uniform(mix(hashes[n], trial)) * width)
            trial += 2
            if uniform(mix(hashes[n], trial - 1)) < np.exp(-q * (diameter - smallest)):
                break
        diameters[n] = diameter
    return diameters
