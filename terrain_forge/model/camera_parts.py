"""What a camera is made of: how it is exposed, its chip's noise, stray light in its lens."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Literal, Self

from annotated_types import Interval

from terrain_forge.base import BY_KIND, Fraction, Idle, NotNegative, Record, Spec

Gain = Annotated[float, Interval(ge=0.01, le=1000)]
ShutterTime = Annotated[float, Interval(ge=1e-7, le=100)]
MOST_ELECTRONS = 1e7
"""What the largest pixel holds."""


@dataclass(frozen=True, kw_only=True, eq=False)
class FixedExposure(Record, Spec):
    """The same exposure for every picture."""

    kind: Literal["fixed"] = "fixed"
    """The same for every picture."""
    time_s: ShutterTime
    """How long the shutter is open [s]."""
    gain: Gain = 1.0
    """Amplification: at 1 a full well is the largest value of a pixel."""

    @property
    def longest(self) -> float:
        """The longest time of exposure [s]."""
        return self.time_s


@dataclass(frozen=True, kw_only=True, eq=False)
class AutoExposure(Record, Spec):
    """Exposure that follows what the camera saw a moment ago; the time first, then the gain."""

    kind: Literal["auto"] = "auto"
    """By what the camera sees."""
    level: Annotated[float, Interval(ge=0.01, le=1)] = 0.6
    """What the brightest tenth of a picture begins at without the sky, as a part of the largest
    value, before the lens darkens it towards the edge."""
    sky: Literal["held", "ignored"] = "held"
    """`held`: less than `level` where the brightest tenth of the whole picture would get white, as
    of cameras that meter all of it, whose ground gets dark towards the Sun; `ignored`: the sky may
    get white, as of cameras that meter a region of the ground."""
    lag_s: Annotated[float, Interval(ge=0, le=60)] = 0.5
    """Time constant with which it follows [s]; 0 to be right at once."""
    shortest_s: ShutterTime = 2e-5
    """Shortest time of exposure [s]."""
    longest_s: ShutterTime = 0.01
    """Longest time of exposure [s]; what is darker is amplified."""
    most_gain: Annotated[float, Interval(ge=1, le=1000)] = 16.0
    """Largest amplification."""

    def __post_init__(self) -> None:
        if self.shortest_s > self.longest_s:
            raise ValueError(
                f"shortest_s {self.shortest_s:g} is above longest_s {self.longest_s:g}"
            )

    @property
    def longest(self) -> float:
        """The longest time of exposure [s]."""
        return self.longest_s


AnyExposure = Annotated[FixedExposure | AutoExposure, BY_KIND]
"""What a recipe may say of exposure."""


@dataclass(frozen=True, kw_only=True, eq=False)
class CameraNoise(Record, Spec):
    """What a camera's chip adds to a picture (EMVA 1288), in electrons of a pixel.

    Simulators' own cameras have white noise instead: that of a pixel at half of a full well.
    """

    full_well_e: Annotated[float, Interval(ge=10, le=MOST_ELECTRONS)] = 10_000.0
    """Electrons that a pixel holds."""
    shot: bool = True
    """Whether electrons are counted with the noise of chance: variance = mean."""
    read_e: NotNegative = 6.0
    """Standard deviation of reading a pixel."""
    prnu: Fraction = 0.005
    """Standard deviation of the pixels' sensitivities, a pattern that stays, as a part of them."""
    dsnu_e: NotNegative = 1.0
    """Standard deviation of the pixels' dark values, a pattern that stays."""

    @property
    def at_half(self) -> float:
        """Standard deviation at half of a full well, as a part of it."""
        variance = self.read_e**2 + (0.5 * self.full_well_e if self.shot else 0.0)
        return math.sqrt(variance) / self.full_well_e

    def binned(self, side: float) -> Self:
        """Of pixels that are sums of `side` × `side` of these, each read for itself."""
        return self.replace(
            full_well_e=side**2 * self.full_well_e,
            read_e=side * self.read_e,
            prnu=self.prnu / side,
            dsnu_e=side * self.dsnu_e,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class LensFlare(Record, Spec):
    """The Sun's light that goes astray in a lens: a veil, ghosts, a star around the Sun.

    The Sun counts as far as nothing hides it from the camera. Ghosts lie on the line through the
    Sun and the principal point; where, how large and how bright is each camera's own.
    """

    veil: Fraction = 0.01
    """Part of the light that is scattered, most of it near the Sun."""
    ghosts: Annotated[int, Interval(ge=0, le=32)] = 6
    """Number of ghosts."""
    ghost_strength: Annotated[float, Interval(ge=0, le=1)] = 5e-5
    """Part of the light that a ghost has on average."""
    star: Annotated[float, Interval(ge=0, le=1)] = 5e-4
    """Part of the light that goes into the rays of the star."""
    blades: Annotated[int, Interval(ge=3, le=32)] = 6
    """Blades of the aperture, which give ghosts their corners and the star its rays."""

    def idle(self) -> Iterator[Idle]:
        """What is of ghosts and stars that there are none of."""
        if self.ghosts == 0:
            yield Idle("ghost_strength", "there are no ghosts")
        if self.ghosts == 0 and self.star == 0.0:
            yield Idle("blades", "there are neither ghosts nor a star")


BrightnessOffAxis = tuple[
    Annotated[float, Interval(ge=-10, le=10)],
    Annotated[float, Interval(ge=-10, le=10)],
    Annotated[float, Interval(ge=-10, le=10)],
]
