"""What all size-frequency laws have in common."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrain_forge.base import Array, Key


class SizeLaw(Protocol):
    """What scattering and the proof of the sizes need of a law; diameters D in metres."""

    @property
    def kind(self) -> str:
        """Name of the law, as a recipe writes it."""

    @property
    def smallest_known(self) -> float | None:
        """Least diameter [m] that the law speaks of; None if it goes on to ever smaller rocks."""

    def cumulative_number(self, diameter: ArrayLike) -> Array:
        """N(>D) [1/m²], rocks larger than each diameter on a square metre."""

    def cumulative_area(self, diameter: ArrayLike) -> Array:
        """F(>D), part of the ground that rocks larger than each diameter cover.

        Where that diverges it is given up to a constant, so that differences still hold.
        """

    def cover_variance(self, smallest: float, largest: float, area: float) -> float:
        """Variance of the cover that rocks between two diameters [m] have on an area [m²].

        The rocks are scattered as a Poisson process: (π/4)² ∫ D⁴ n(D) dD / area.
        """

    def sample(self, hashes: NDArray[np.uint64], smallest: float, largest: float) -> Array:
        """Diameters [m] drawn between two diameters [m], one by each hashed address."""

    def on(self, body: str) -> SizeLaw:
        """The law with what it leaves to the body (`mars` or `moon`) written out."""

    def check(self, key: Key) -> None:
        """Refuse a law that contradicts itself.

        Args:
            key: where the law stands in the recipe.

        Raises:
            RecipeError: says what is wrong and what is allowed.
        """

    def report(self) -> dict[str, Any]:
        """The law in plain numbers, sources and fits resolved, as JSON can hold it."""
