"""What all size-frequency laws have in common."""

from __future__ import annotations

import json
from abc import abstractmethod
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrain_forge.base import Array, DataError, Key, RecipeError, Spec, returning
from terrain_forge.model import Body


@dataclass(frozen=True, kw_only=True)
class SizeLaw(Spec):
    """How many rocks of which exposed diameter D [m] lie on a square metre.

    A law is a subclass with a field `kind` (a Literal with its default). It must have the closed
    forms `cumulative_number`, `cumulative_area` and `cover_variance` and the exact sampler
    `sample`; the rest may stay. It is found if its module lies in
    `terrain_forge.rocks.laws` or is named by an entry point of the group `terrain_forge.size_laws`.
    """

    if TYPE_CHECKING:
        kind: str
        """Name of the law, as a recipe writes it."""

    @property
    def smallest_known(self) -> float | None:
        """Least diameter [m] that the law speaks of; None if it goes on to ever smaller rocks."""
        return None

    @abstractmethod
    def cumulative_number(self, diameter: ArrayLike) -> Array:
        """N(>D) [1/m²], rocks larger than each diameter on a square metre."""
        raise NotImplementedError

    @abstractmethod
    def cumulative_area(self, diameter: ArrayLike) -> Array:
        """F(>D), part of the ground that rocks larger than each diameter cover.

        Where that diverges it is given up to a constant, so that differences still hold.
        """
        raise NotImplementedError

    @abstractmethod
    def cover_variance(self, smallest: float, largest: float, area: float) -> float:
        """Variance of the cover that rocks between two diameters [m] have on an area [m²].

        The rocks are scattered as a Poisson process: (π/4)² ∫ D⁴ n(D) dD / area.
        """
        raise NotImplementedError

    @abstractmethod
    def sample(self, hashes: NDArray[np.uint64], smallest: float, largest: float) -> Array:
        """Diameters [m] drawn between two diameters [m], one by each hashed address."""
        raise NotImplementedError

    def fit_to_counts(self, smallest: float, largest: float) -> dict[str, Any] | None:  # noqa: ARG002
        """How well the law fits the rocks that it was made from, as JSON can hold it.

        None for a law that was not fitted to counts. `summary` says it in a line, `warnings` has a
        line for each reason to doubt rocks between two diameters [m] that are drawn from it.
        """
        return None

    def on(self, body: Body, key: Key = ()) -> SizeLaw:  # noqa: ARG002
        """The law with what it leaves to the body written out; by default itself.

        Args:
            body: where the rocks lie.
            key: where the law stands in the recipe.

        Raises:
            RecipeError: if the body does not say what the law needs.
        """
        return self

    def check(self, key: Key) -> None:
        """Refuse a law that contradicts itself.

        Args:
            key: where the law stands in the recipe.

        Raises:
            RecipeError: says what is wrong and what is allowed.
        """

    def require_one(self, key: Key, wanted: str, *choices: tuple[str, ...]) -> None:
        """Refuse a law that does not have all fields of one choice, and none of the others."""
        given = [name for one in choices for name in one if getattr(self, name) is not None]
        if tuple(given) not in choices:
            found = " and ".join(given) or "none"
            raise RecipeError(f"{self.kind} needs {wanted}, found {found}", key=key)

    def report(self) -> dict[str, Any]:
        """The law in plain numbers, sources and fits resolved, as JSON can hold it.

        Where a law leaves out `kind`, it is added (`told`).
        """
        return asdict(self)

    def told(self) -> dict[str, Any]:
        """The report, with the law's kind.

        Raises:
            PluginError: if a law of another package reports what JSON cannot hold.
        """
        what = f"size law {self.kind!r}: report"
        with returning(self, what, "a dict that JSON can hold"):
            plain = {"kind": self.kind, **self.report()}
            json.dumps(plain, allow_nan=False)
        return plain


def above_zero(diameter: ArrayLike) -> Array:
    """Diameters [m] for a law that has ever more rocks the smaller they are.

    Raises:
        DataError: if one is not above 0.
    """
    numbers = np.asarray(diameter, np.float64)
    if not (numbers > 0.0).all():
        raise DataError(f"diameter must be above 0, found {numbers.min():g}")
    return numbers
