"""Maximum-likelihood fits of size-frequency laws to counted rocks.

The rocks of an area are taken as an inhomogeneous Poisson process in diameter, so the number that
was counted is part of the likelihood:

- single diameters: log L = Σ log(A n(D_i)) - A N(>D_0), D_0 where the count begins;
- bins: log L = Σ m_j log μ_j - μ_j, μ_j = A (N(>low_j) - N(>high_j)), up to a constant.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from terrain_forge.base import Array, checked, portable
from terrain_forge.rocks.laws.exponential import Exponential
from terrain_forge.rocks.laws.golombek import MAX_K, Golombek
from terrain_forge.rocks.laws.power_law import PowerLaw

FittedLaw = Golombek | PowerLaw | Exponential

LEAST_EXPECTED = 5.0
"""Rocks that a bin of the chi-square test is expected to hold at least; smaller bins are joined."""
_ONE_SIGMA = 0.6827
_MOST_STEPS = 64
_DECAYS = 1e-3, 500.0
_IMPOSSIBLE = 1e100
_GRID = 200
_STEP = 1e-4
_FLAT = 1e-6
_SINGULAR = 1e-6
_LEAST_CURVATURE = 1e-3  # differences of log L are exact to about 1e-12 / _STEP²


@dataclass(frozen=True, kw_only=True, eq=False)
class RockCount:
    """Rocks that somebody counted on an area, one by one or in bins."""

    area: float
    """Area that was searched [m²]."""
    smallest: float
    """Diameter from which on every rock was counted [m]."""
    diameters: Array = field(default_factory=lambda: np.zeros(0))
    """Their diameters [m], if they were measured one by one, shape [rocks]."""
    bins: Array = field(default_factory=lambda: np.zeros((0, 2)))
    """Else the bins' lower and upper diameters [m], shape [bins, 2]."""
    counts: Array = field(default_factory=lambda: np.zeros(0))
    """Rocks in each bin, shape [bins]."""

    @property
    def rocks(self) -> int:
        """How many were counted."""
        return len(self.diameters) + int(self.counts.sum())

    @property
    def largest(self) -> float:
        """Diameter [m] up to which there are rocks: of an open bin its lower end."""
        held = self.bins[self.counts > 0]
        ends = np.where(np.isinf(held[:, 1]), held[:, 0], held[:, 1])
        return float(max(self.diameters.max(initial=0.0), ends.max(initial=0.0)))

    @property
    def different(self) -> int:
        """How many different diameters, or bins that hold rocks, there are."""
        return len(np.unique(self.diameters)) + int(np.count_nonzero(self.counts))

    def expected(self, law: FittedLaw) -> Array:
        """Rocks that a law expects in each bin, or of all sizes, shape [bins] or [1]."""
        if not len(self.bins):
            return self.area * np.atleast_1d(law.cumulative_number(self.smallest))
        number = law.cumulative_number(self.bins)
        return self.area * (number[:, 0] - number[:, 1])

    def log_likelihood(self, law: FittedLaw) -> float:
        """Logarithm of the likelihood of a law, up to a constant."""
        from scipy.special import xlogy

        expected = self.expected(law)
        likelihood = -float(expected.sum())
        if len(self.bins):
            return likelihood + float(xlogy(self.counts, expected).sum())
        single = portable.log(self.area) + law.log_density(self.diameters)
        return likelihood + float(single.sum())


class Estimate(NamedTuple):
    """A fitted parameter."""

    value: float
    standard_error: float | None
    """None where the count does not tell the parameters apart."""


@dataclass(frozen=True, kw_only=True)
class Fit:
    """A law fitted to a count."""

    law: FittedLaw
    """The likeliest law."""
    parameters: dict[str, Estimate]
    """Its parameters; standard errors are those of the observed information."""
    at_limit: bool
    """Whether an end of the range that the shape is searched in is as likely as any shape."""


class _Family(NamedTuple):
    """Laws of one form: one parameter shapes them; the other, if any, is their amplitude."""

    make: Callable[..., FittedLaw]
    shape: str
    limits: tuple[float, float]
    amplitude: str | None = None


def _family(fit: str, decay: str | None, smallest: float) -> _Family:
    """The family of a fit; decays are searched relative to the smallest diameter [m]."""
    decays = _DECAYS[0] / smallest, _DECAYS[1] / smallest
    if fit == "power_law":
        return _Family(PowerLaw, "exponent", (0.01, 10.0), "number_per_m2")
    if fit == "exponential":
        return _Family(Exponential, "decay_per_m", decays, "number_per_m2")
    if decay == "free":
        return _Family(Golombek, "q_per_m", decays, "k")
    return _Family(partial(Golombek, q_of_k=decay), "k", (1e-4, MAX_K))


@checked
def fit_law(count: RockCount, *, fit: str, decay: str | None) -> Fit:
    """The law of a family that makes a count likeliest.

    An amplitude follows from the shape in closed form, since the expected number equals the counted
    one; so one parameter is searched: on a grid of its logarithm first, then around the best.
    `decay` is the `q_of_k` of a `golombek` law; `free` fits q as well as k.
    """
    from scipy.optimize import minimize_scalar

    family = _family(fit, decay, count.smallest)

    def loss(log_shape: float) -> float:
        found = count.log_likelihood(family.make(**_parameters(family, count, log_shape)))
        return -found if np.isfinite(found) else _IMPOSSIBLE

    grid = np.linspace(portable.log(family.limits[0]), portable.log(family.limits[1]), _GRID)
    best = int(np.argmin([loss(at) for at in grid.tolist()]))
    around = grid[max(best - 1, 0)], grid[min(best + 1, _GRID - 1)]
    search = {"bounds": around, "method": "bounded", "options": {"xatol": 1e-10}}
    found = float(minimize_scalar(loss, **search).x)
    parameters = _parameters(family, count, found)
    errors = _standard_errors(family, count, parameters)
    return Fit(
        law=family.make(**parameters),
        parameters={
            name: Estimate(value, error)
            for (name, value), error in zip(parameters.items(), errors, strict=True)
        },
        at_limit=min(loss(float(grid[0])), loss(float(grid[-1]))) <= loss(found) + _FLAT,
    )


def _parameters(family: _Family, count: RockCount, log_shape: float) -> dict[str, float]:
    shape = {family.shape: float(np.clip(portable.exp(log_shape), *family.limits))}
    if family.amplitude is None:
        return shape
    one = float(count.expected(family.make(**shape, **{family.amplitude: 1.0})).sum())
    return shape | {family.amplitude: count.rocks / one if one > 0.0 else np.nan}


def _standard_errors(
    family: _Family, count: RockCount, parameters: dict[str, float]
) -> list[float] | list[None]:
    """Standard errors from the curvature of log L in logarithms; None where it is open."""
    names, centre = list(parameters), portable.log(list(parameters.values()))
    size = len(names)

    def log_likelihood(offset: Array) -> float:
        values = portable.exp(centre + offset)
        return count.log_likelihood(family.make(**dict(zip(names, values.tolist(), strict=True))))

    def curvature(a: Array, b: Array) -> float:
        mixed = log_likelihood(a - b) - log_likelihood(a + b)
        return (mixed + log_likelihood(b - a) - log_likelihood(-a - b)) / (4.0 * _STEP**2)

    steps = _STEP * np.eye(size)
    information = np.array([[curvature(a, b) for b in steps] for a in steps])
    if not np.isfinite(information).all():
        return [None] * size
    curvatures = np.linalg.eigvalsh(information)
    if curvatures[0] <= max(_SINGULAR * curvatures[-1], _LEAST_CURVATURE):
        return [None] * size
    variance = np.diag(portable.inverse(information))
    errors: list[float] = (portable.exp(centre) * np.sqrt(variance)).tolist()
    return errors


@checked
def goodness(count: RockCount, fit: Fit) -> dict[str, Any]:
    """How well a fitted law describes a count: Kolmogorov–Smirnov, or chi-square for bins.

    The law was fitted to the same rocks; chi-square allows for that by its degrees of freedom,
    Kolmogorov–Smirnov does not, so its p-value is too large.
    """
    from scipy.special import chdtrc, kolmogorov

    if len(count.bins):
        counted, expected = _joined(count.counts, count.expected(fit.law))
        free = len(counted) - len(fit.parameters)
        statistic = float(np.sum((counted - expected) ** 2 / expected))
        return {
            "test": "chi_square",
            "statistic": statistic,
            "degrees_of_freedom": free,
            "p_value": float(chdtrc(free, statistic)) if free > 0 else None,
        }
    diameters = np.sort(count.diameters)
    part = fit.law.cumulative_number(diameters) / fit.law.cumulative_number(count.smallest)
    steps = np.arange(len(diameters) + 1) / len(diameters)
    distance = float(np.max(np.maximum(steps[1:] - (1.0 - part), 1.0 - part - steps[:-1])))
    root = np.sqrt(len(diameters))
    # Stephens 1970: the limiting distribution serves small samples too with these corrections.
    return {
        "test": "kolmogorov_smirnov",
        "statistic": distance,
        "p_value": float(kolmogorov(distance * (root + 0.12 + 0.11 / root))),
        "fitted_parameters": len(fit.parameters),
        "note": "the law was fitted to the same rocks, so that the p-value is too large",
    }


def counted_above(count: RockCount, law: FittedLaw) -> dict[str, list[float]]:
    """Counted rocks above the lower end of each bin, and those that a law expects [1/m²].

    Rocks that were counted one by one are put in bins of half an octave. What lies in no bin was
    not counted: there the law's own number stands. `number_low` to `number_high` holds the mean of
    a Poisson count with 68 % (Garwood 1936).
    """
    from scipy.special import gammaincinv

    if not len(count.bins):
        edges = count.smallest * portable.power(2.0, 0.5 * np.arange(_MOST_STEPS))
        edges = np.append(edges[edges <= count.largest], np.inf)
        held, _ = np.histogram(count.diameters, edges)
        bins = np.column_stack([edges[:-1], edges[1:]])
        count = RockCount(area=count.area, smallest=count.smallest, bins=bins, counts=held)
    order = np.argsort(count.bins[:, 0])
    low = count.bins[order, 0]
    counted, expected = (
        np.cumsum(one[order][::-1])[::-1] for one in (count.counts, count.expected(law))
    )
    number, tail = law.cumulative_number(low), 0.5 * (1.0 - _ONE_SIGMA)
    between = number - expected / count.area  # what the law has where nobody counted
    found = {
        "number": counted,
        "number_low": np.where(counted > 0, gammaincinv(np.maximum(counted, 1.0), tail), 0.0),
        "number_high": gammaincinv(counted + 1.0, 1.0 - tail),
    }
    above = {name: (values / count.area + between).tolist() for name, values in found.items()}
    return {"diameter_m": low.tolist(), **above, "number_law": number.tolist()}


def _joined(counted: Array, expected: Array) -> tuple[Array, Array]:
    """Neighbouring bins joined, from the largest rocks down, until each expects enough."""
    groups = np.zeros(len(expected), np.intp)
    group, total = 0, 0.0
    for n in range(len(expected) - 1, -1, -1):
        groups[n] = group
        total += float(expected[n])
        if total >= LEAST_EXPECTED:
            group, total = group + 1, 0.0
    if total > 0.0 and group > 0:  # what is left over joins the last full one
        groups[groups == group] = group - 1
    joined = [np.bincount(groups, one).astype(np.float64) for one in (counted, expected)]
    return joined[0], joined[1]
