"""A law fitted to rocks that the user counted."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from annotated_types import Ge, MaxLen, MinLen
from numpy.typing import ArrayLike, NDArray

from terrain_forge.base import Array, InputFile, Key, Positive, RecipeError
from terrain_forge.model import Body
from terrain_forge.rocks.laws.fitting import Fit, RockCount, counted_above, fit_law, goodness
from terrain_forge.rocks.laws.golombek import MAX_K, USUAL, DecayOf, decay_of
from terrain_forge.rocks.laws.law import SizeLaw

if TYPE_CHECKING:
    from terrain_forge.model import Table

MAX_COUNTED = 100_000
"""Rocks or bins of a count; more are told apart well enough by bins."""
LEAST_COUNTED = 5
"""Rocks that a law is fitted to at least."""
MISFIT = 0.001
"""A law that fits has a lower p-value once in a thousand counts."""
FARTHEST_BEYOND = 2.0
"""How many times smaller or larger than any counted rock others may be drawn without a warning: an
octave, in which the laws that fit a count equally well still tell about the same number."""

_BINS = ("low_m", "high_m", "count")
_TABLE = InputFile(
    kind="table",
    optional=("diameter_m", *_BINS),
    positive=("diameter_m", "low_m", "high_m"),
    most=MAX_COUNTED,
)

Bin = tuple[Positive, Positive | None, Annotated[int, Ge(0)]]


@dataclass(frozen=True, kw_only=True)
class Counts(SizeLaw):
    """A law fitted by maximum likelihood to a count of rocks, and used in its place.

    The rocks are given by one of `file`, `diameters_m` and `bins`. The fit and how good it is stand
    in truth/size_frequency.json.
    """

    kind: Literal["counts"] = "counts"
    """Name of the law."""
    file: Annotated[str, MinLen(1), _TABLE] | None = None
    """CSV with a header: a column `diameter_m`, a row for each rock; or `low_m`, `high_m`,
    `count`, a row for each bin."""
    diameters_m: Annotated[tuple[Positive, ...], MinLen(1), MaxLen(MAX_COUNTED)] | None = None
    """Diameter of each rock [m]."""
    bins: Annotated[tuple[Bin, ...], MinLen(1), MaxLen(MAX_COUNTED)] | None = None
    """Smallest and largest diameter [m] and number of rocks of each bin; a largest of null means
    all that are larger. What lies in no bin is taken as not counted."""
    area_m2: Positive
    """Area on which they were counted [m²]."""
    complete_from_m: Positive | None = None
    """Diameter from which on every rock was counted [m]; smaller ones are left out of the fit. By
    default the smallest diameter of the count."""
    fit: Literal["golombek", "power_law", "exponential"] = "golombek"
    """The law to fit."""
    q_of_k: DecayOf | Literal["free"] | None = None
    """For `golombek`: how the cover's decay q follows from k; `free` fits both. By default that of
    the site's body."""

    @property
    def smallest_known(self) -> float:
        """Diameter from which on the rocks were counted [m]."""
        return self.count.smallest

    @cached_property
    def count(self) -> RockCount:
        """The rocks that the law is fitted to."""
        least = self.complete_from_m
        if self.bins is not None:
            bins = np.array([(a, b or np.inf, n) for a, b, n in self.bins], float)
            bins = bins[bins[:, 0] >= (least or 0.0)]
            first = float(bins[:, 0].min(initial=np.inf))
            return RockCount(area=self.area_m2, smallest=first, bins=bins[:, :2], counts=bins[:, 2])
        if self.diameters_m is None:
            raise RecipeError("counts needs one of file, diameters_m and bins")
        diameters = np.array(self.diameters_m)
        first = least or float(diameters.min())
        # A smallest rock that sets the limit tells no more than that: counted too, it would bend
        # the fit.
        counted = diameters >= first if least else diameters > first
        return RockCount(area=self.area_m2, smallest=first, diameters=diameters[counted])

    @cached_property
    def fitted(self) -> Fit:
        """The fit of the law."""
        return fit_law(self.count, fit=self.fit, decay=self.q_of_k)

    def cumulative_number(self, diameter: ArrayLike) -> Array:
        """N(>D) [1/m²] of the fitted law."""
        return self.fitted.law.cumulative_number(diameter)

    def cumulative_area(self, diameter: ArrayLike) -> Array:
        """F(>D) of the fitted law; up to a constant where it diverges."""
        return self.fitted.law.cumulative_area(diameter)

    def cover_variance(self, smallest: float, largest: float, area: Positive) -> float:
        """Variance of the cover by the fitted law."""
        return self.fitted.law.cover_variance(smallest, largest, area)

    def sample(self, hashes: NDArray[np.uint64], smallest: float, largest: float) -> Array:
        """Diameters [m] of the fitted law."""
        return self.fitted.law.sample(hashes, smallest, largest)

    def with_table(self, table: Table) -> Counts:
        """The law with the rocks or bins of its file."""
        if set(table.columns) == {"diameter_m"}:
            return replace(self, file=None, diameters_m=tuple(table.column("diameter_m").tolist()))
        if set(table.columns) != set(_BINS):
            found = ", ".join(table.columns)
            columns = "the column diameter_m alone, or low_m, high_m and count"
            raise ValueError(f"needs {columns}; found {found}")
        rows = [*zip(*(table.column(name).tolist() for name in _BINS), strict=True)]
        if any(count < 0 or count != int(count) for _, _, count in rows):
            raise ValueError("a count is no whole number of rocks")
        return replace(self, file=None, bins=tuple((a, b, int(count)) for a, b, count in rows))

    def on(self, body: Body, key: Key = ()) -> Counts:
        """The law with the body's q(k), unless it has its own."""
        if self.fit != "golombek" or self.q_of_k or body.rock_decay == USUAL:
            return self
        return replace(self, q_of_k=decay_of(body, key))

    def check(self, key: Key) -> None:
        """Refuse a count that is missing, doubled, too small, or beyond the law's family."""
        wanted = "one of file, diameters_m and bins"
        self.require_one(key, wanted, ("file",), ("diameters_m",), ("bins",))
        if self.q_of_k and self.fit != "golombek":
            raise RecipeError(f"q_of_k is golombek's, the fit is {self.fit}", key=(*key, "q_of_k"))
        if self.file:
            return
        ordered = sorted((low, high or np.inf) for low, high, _ in self.bins or ())
        for low, high in ordered:
            if high <= low:
                text = f"a bin from {low:g} to {high:g} m: low comes first"
                raise RecipeError(text, key=(*key, "bins"))
        for (low, high), (following, _) in pairwise(ordered):
            if high > following * (1.0 + 1e-9):
                text = f"the bin from {low:g} to {high:g} m overlaps that from {following:g} m"
                raise RecipeError(text, key=(*key, "bins"))
        if self.count.rocks < LEAST_COUNTED:
            raise RecipeError(
                f"{self.count.rocks} rocks above {self.count.smallest:g} m, at least "
                f"{LEAST_COUNTED} are needed for a fit",
                key=(*key, "bins" if self.bins else "diameters_m"),
            )
        self._check_fit((*key, "fit"))

    def report(self) -> dict[str, Any]:
        """The fitted law's numbers, their standard errors, and how good the fit is."""
        return {
            "kind": self.kind,
            "fit": self.fitted.law.report(),
            "rocks": self.count.rocks,
            "area_m2": self.area_m2,
            "complete_from_m": self.count.smallest,
            "parameters": {name: one._asdict() for name, one in self.fitted.parameters.items()},
            "goodness": goodness(self.count, self.fitted),
        }

    def fit_to_counts(self, smallest: float, largest: float) -> dict[str, Any]:
        """How well the fitted law agrees with the count, and how far it goes beyond it."""
        known, most = self.count.smallest, self.count.largest
        good = goodness(self.count, self.fitted)
        p = good["p_value"]
        test = good["test"].replace("_", "-").replace("kolmogorov-smirnov", "Kolmogorov–Smirnov")
        shown = f"{test} p = {p:.2g}" if p is not None else f"too few bins for a {test} test"
        below, above = known / smallest, largest / most
        summary = f"{self.fit} law fitted to {self.count.rocks} rocks of {known:g} to {most:.3g} m"
        summary += f", {shown}"
        warnings = []
        if p is not None and p < MISFIT:
            warnings.append(f"the law does not fit the count: {shown}, at least {MISFIT:g}")
        for drawn, end, factor in ((smallest, known, below), (largest, most, above)):
            if factor > 1.0 + 1e-9:
                summary += f", extrapolated from {end:.3g} to {drawn:.3g} m ({factor:.2g} times)"
            if factor > FARTHEST_BEYOND:
                warnings.append(
                    f"rocks of {drawn:.3g} m are {factor:.2g} times beyond the count, which ends "
                    f"at {end:.3g} m: more than {FARTHEST_BEYOND:g} times, few laws hold so far"
                )
        return {
            "summary": summary,
            "warnings": warnings,
            "test": good["test"],
            "p_value": p,
            "fits": None if p is None else p >= MISFIT,
            "extrapolated_below": max(below, 1.0),
            "extrapolated_above": max(above, 1.0),
            "counted_above": counted_above(self.count, self.fitted.law),
        }

    def _check_fit(self, key: Key) -> None:
        """Refuse a fit that the count does not determine, or that ends beyond the law's family."""
        parameters, told = self.fitted.parameters, self.count.different
        names = " and ".join(parameters)
        if told < len(parameters):
            what = "bins that hold rocks" if self.bins else "different diameters"
            raise RecipeError(
                f"{what}: {told}, at least {len(parameters)} are needed to fit {names}", key=key
            )
        advice = "look at the diameters and the area, or fit another law"
        shown = ", ".join(f"{name} = {one.value:.3g}" for name, one in parameters.items())
        if self.fitted.at_limit:
            raise RecipeError(
                f"no {self.fit} law is likeliest: the fit runs to the end of its range, {shown}; "
                f"{advice}",
                key=key,
            )
        k = parameters.get("k")
        if k is not None and k.value > MAX_K:
            raise RecipeError(
                f"the likeliest law has k = {k.value:.3g}, at most {MAX_K}; {advice}", key=key
            )
        if any(one.standard_error is None for one in parameters.values()):
            raise RecipeError(
                f"the count does not tell {names} apart, {shown} is one of many; {advice}", key=key
            )
