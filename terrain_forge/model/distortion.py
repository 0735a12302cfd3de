"""How lenses bend pictures: OpenCV's models, which calibrations of cameras are written in."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import Interval, Len

from terrain_forge.base import BY_KIND, Record, Spec, checked, remembered

Coefficient = Annotated[float, Interval(ge=-1e4, le=1e4)]

_STEPS = 4000


@dataclass(frozen=True, kw_only=True, eq=False)
class Distortion(Record, Spec):
    """A lens model; `radius` is what it makes of the distance from the principal point."""

    MODEL: ClassVar[str]
    """What EuRoC's calibrations call it."""
    MOST: ClassVar[float]
    """Largest argument of `radius` that is looked at."""

    kind: str
    """The model's name; a model overrides it by a `Literal`."""
    k: tuple[Coefficient, ...]
    """Coefficients."""

    def radius(self, r: float) -> float:
        """Distance from the principal point [focal lengths]."""
        raise NotImplementedError

    def growth(self, r: float) -> float:
        """Derivative of `radius`."""
        raise NotImplementedError

    @property
    @remembered
    @checked
    def fold(self) -> float:
        """The argument up to which `radius` grows: beyond, the lens would show things twice."""
        for step in range(1, _STEPS + 1):
            r = self.MOST * step / _STEPS
            if self.growth(r) <= 0.0:
                return self.MOST * (step - 1) / _STEPS
        return self.MOST


@dataclass(frozen=True, kw_only=True, eq=False)
class RadialTangential(Distortion):
    """Brown's model, of a pinhole's lens: r = tan θ becomes r (1 + k₁ r² + k₂ r⁴ + k₃ r⁶)."""

    MODEL: ClassVar[str] = "radial-tangential"
    MOST: ClassVar[float] = 20.0

    kind: Literal["radtan"] = "radtan"
    """Radial and tangential."""
    k: Annotated[tuple[Coefficient, ...], Len(4, 5)]
    """k₁, k₂, p₁, p₂ and, if there are five, k₃, as OpenCV orders them."""

    @property
    def _radial(self) -> tuple[float, float, float]:
        return self.k[0], self.k[1], self.k[4] if len(self.k) > 4 else 0.0

    def radius(self, r: float) -> float:
        """Distance from the principal point [focal lengths] of what is at r = tan θ."""
        (a, b, c), s = self._radial, r * r
        return r * (1.0 + s * (a + s * (b + s * c)))

    def growth(self, r: float) -> float:
        """Derivative of `radius`."""
        (a, b, c), s = self._radial, r * r
        return 1.0 + s * (3.0 * a + s * (5.0 * b + s * 7.0 * c))


@dataclass(frozen=True, kw_only=True, eq=False)
class Equidistant(Distortion):
    """Kannala & Brandt's model, of a fisheye lens: θ (1 + k₁ θ² + k₂ θ⁴ + k₃ θ⁶ + k₄ θ⁸)."""

    MODEL: ClassVar[str] = "equidistant"
    MOST: ClassVar[float] = math.pi

    kind: Literal["equidistant"] = "equidistant"
    """Equidistant, of a fisheye lens."""
    k: Annotated[tuple[Coefficient, ...], Len(4, 4)] = (0.0, 0.0, 0.0, 0.0)
    """k₁ to k₄."""

    def radius(self, r: float) -> float:
        """Distance from the principal point [focal lengths] of what is at θ [rad]."""
        (a, b, c, d), s = self.k, r * r
        return r * (1.0 + s * (a + s * (b + s * (c + s * d))))

    def growth(self, r: float) -> float:
        """Derivative of `radius`."""
        (a, b, c, d), s = self.k, r * r
        return 1.0 + s * (3.0 * a + s * (5.0 * b + s * (7.0 * c + s * 9.0 * d)))


AnyDistortion = Annotated[RadialTangential | Equidistant, BY_KIND]
"""What a recipe may say of a lens."""
