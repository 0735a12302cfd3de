"""A planetary body: all that the stages need to know of it, as cited values in SI units.

A body is one module of terrain_forge.model.bodies, or one of another package that an entry point of
the group `terrain_forge.bodies` names (docs/bodies.md). Nothing else asks which body it is.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from typing import Any, Literal, get_type_hints

import numpy as np
from numpy.typing import ArrayLike

from terrain_forge.base import (
    Array,
    DataError,
    FileName,
    Fraction,
    NotNegative,
    Positive,
    Record,
    checked,
    complaint,
    given_numbers,
    portable,
)
from terrain_forge.model.orbit import Ephemeris

RGB = tuple[Fraction, Fraction, Fraction]
Surface = Literal["regolith", "bedrock", "rock"]
"""What a wheel rolls on: loose ground, ground of solid rock, or a rock that lies on the ground."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfaceFriction(Record):
    """Sliding friction between a wheel and a surface.

    A wheel with grousers does not slide on regolith, it shears it: see `sheared`. On bedrock and on
    rocks no measured coefficient of a rover's metal wheel was found: it is
    an assumption.
    """

    coefficient: Positive
    """Coulomb coefficient that is used by default."""
    lowest: Positive
    """Lower end of the plausible range."""
    highest: Positive
    """Upper end of the plausible range."""
    source: str
    """Where it comes from; begins with `assumption` where it has not been measured."""


@checked
def sheared(low_deg: float, mean_deg: float, high_deg: float, source: str) -> SurfaceFriction:
    """Friction on regolith: the tangent of its angle of internal friction [degrees].

    Cohesion adds to it and sinkage takes from it; neither is modelled by a rigid contact.

    Raises:
        DataError: unless the three ascend.
    """
    if not low_deg <= mean_deg <= high_deg:
        raise DataError(f"sheared: {low_deg:g}, {mean_deg:g}, {high_deg:g}°: must ascend")
    low, mean, high = (round(math.tan(math.radians(a)), 2) for a in (low_deg, mean_deg, high_deg))
    return SurfaceFriction(coefficient=mean, lowest=low, highest=high, source=source)


def _on_rock(coefficient: float) -> SurfaceFriction:
    return SurfaceFriction(
        coefficient=coefficient,
        lowest=0.6,
        highest=1.0,
        source="assumption: metal grousers on rock, below rock on rock (doi:10.1007/BF00876528)",
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Frictions(Record):
    """Friction of wheels on the surfaces of a body."""

    regolith: SurfaceFriction
    """On loose ground."""
    bedrock: SurfaceFriction = field(default_factory=lambda: _on_rock(0.8))
    """On ground of solid rock; by default below rock on rock, 0.85 (Byerlee 1978)."""
    rock: SurfaceFriction = field(default_factory=lambda: _on_rock(0.7))
    """On rocks that lie on the ground."""


_OLDEST = 100.0
"""Age of a surface [10⁹ years] for which a number is told."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Chronology(Record):
    """N(1 km) = a (exp(b T) - 1) + c T, craters of 1 km and more on a km² of an age T [10⁹ years].

    Neukum et al. 2001, doi:10.1023/A:1011989004263; coefficients as in Craterstats (Michael et
    al.).
    """

    burst: NotNegative
    """a [1/km²]."""
    rate: float = 6.93
    """b [1/10⁹ years]."""
    steady: NotNegative
    """c [1/(km² · 10⁹ years)]."""

    @checked
    def number(self, age: ArrayLike) -> Array:
        """N(1 km) [1/km²] of surfaces of ages [10⁹ years].

        Raises:
            DataError: for ages below 0 or above 100.
        """
        age = given_numbers(age, "Chronology.number: age")
        if age.size and not 0.0 <= age.min() <= age.max() <= _OLDEST:
            raise DataError(f"Chronology.number: age must be 0 to {_OLDEST:g} [10⁹ years]")
        return np.asarray(self.burst * portable.expm1(self.rate * age) + self.steady * age)

    @checked
    def growth(self, age: float) -> float:
        """Craters that a surface of an age [10⁹ years] has, over those after 10⁹ years."""
        return float(self.number(age) / self.number(1.0))


@dataclass(frozen=True, kw_only=True, eq=False)
class ProductionFunction(Record):
    """Craters that a surface of a body has gathered after 10⁹ years: a polynomial, or bins."""

    kind: str
    """Its name, as a recipe writes it as the `kind` of a layer's production."""
    coefficients: tuple[float, ...] = ()
    """a₀, a₁, … of log₁₀ N = Σ aₙ (log₁₀ D)ⁿ, N(≥D) on a km², D in km."""
    range_km: tuple[float, float] = (0.0, 0.0)
    """Diameters [km] that the polynomial was fitted to."""
    bins: tuple[float, ...] = ()
    """Or craters on a km² in bins of a factor √2 of diameter, the smallest first."""
    first_bin: float = 0.0
    """log₂ of the smallest diameter of the first bin [km]."""
    chronology: Chronology
    """How their number grows with time."""
    source: str
    """Who counted."""


@dataclass(frozen=True, kw_only=True, eq=False)
class CraterConstants(Record):
    """What craters of a body are like, and how many there are."""

    largest_simple: Positive
    """Diameter [m] at which craters become complex."""
    depth: tuple[Positive, float]
    """Depth over diameter of fresh craters, crest to floor, as (a, b): a D^b, D in km."""
    shallow: tuple[Fraction, Positive] = (0.0, 1.0)
    """Small ones are shallower, as (c, s): that ratio times 1 - c exp(-D / s), s in m."""
    diffusivity_1_km: NotNegative | None = None
    """Diffusivity that wears craters of 1 km and more [m²/10⁶ years]; None for what holds them at
    equilibrium, as it wears the small ones."""
    equilibrium: str
    """How many craters there can be where the recipe does not say: a name of the crater layer's
    `equilibrium`."""
    bright_ejecta: bool
    """Whether ejecta of young craters are brighter than the ground."""
    chronology: Chronology
    """How the number of craters grows with time, where no production function has its own."""
    productions: tuple[ProductionFunction, ...] = ()
    """The production functions that were made for the body."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Soil(Record):
    """The appearance of one kind of loose ground."""

    name: str
    """Its name, as a recipe writes it; no two bodies share one."""
    rgb: RGB
    """Colour of level ground as a well exposed camera shows it, sRGB 0 to 1."""
    rock_rgb: RGB | None = None
    """Colour of the rocks on it; None for that of the body's rocks."""
    pebbles: float = 0.6
    """Share of places that hold a pebble too small to be a rock, in pictures alone, 0 to 1."""
    roughness: float = 1.0
    """Rise of its fine relief over that of usual regolith, in pictures alone."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Dust(Record):
    """Dust in the air, which scatters light: figures for linear red, green, blue."""

    tau: NotNegative
    """Optical depth of the whole column, alike in all colours."""
    albedo: RGB
    """Part of the light that a grain does not absorb."""
    share: RGB
    """Part of the scattered light that goes forward, as a disc of the grain's size bends it."""
    forward: RGB
    """Mean cosine of the angle by which that part is turned."""
    wide: RGB
    """Mean cosine of the angle by which the other part is turned."""
    height: Positive
    """Height in which its density falls to 1/e [m]."""
    air_masses: Positive
    """Columns of dust on a level line of sight: √(π/2 · radius / height)."""
    source: str
    """Where the figures come from."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Photometry(Record):
    """How the light that ground and rocks send back hangs on the angles: figures of Hapke's law.

    Hapke 2012, Theory of Reflectance and Emittance Spectroscopy, doi:10.1017/CBO9781139025683,
    without coherent backscatter and with the porosity factor 1. Colours scale it.
    """

    albedo: Fraction
    """Albedo w of a single particle, which tells how much is scattered more than once."""
    lobe: float
    """b: how narrow both lobes of a particle are, 0 where it scatters alike all around."""
    back: float
    """c: (1 + c) / 2 of what it scatters is in the lobe towards the light."""
    surge: float
    """B₀: how much brighter its shadows' hiding makes it, where the light comes from behind."""
    surge_width: float
    """h: tangent of half the phase angle at which half of that is left."""
    roughness: float
    """Mean slope of what is too small to be seen [rad]."""
    source: str
    """Where the figures come from."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Body(Record):
    """A planet or moon as far as a rover's world needs it."""

    name: FileName
    """Lower-case name, as the recipe writes it."""
    gravity: Positive
    """Surface gravity [m/s²], towards -z."""
    mean_radius: Positive
    """Mean radius [m]; a DTM whose ellipsoid is within 5 % of it is one of the body."""
    solar_irradiance: Positive
    """Irradiance at the mean distance from the Sun, above any atmosphere [W/m²]."""
    sun_diameter: Positive
    """Apparent diameter of the Sun [rad]."""
    airless: bool
    """Whether there is no wind that could move soil."""
    sky_rgb: RGB
    """Colour of the sky, linear 0 to 1."""
    ground_rgb: RGB
    """Colour of the regolith as a camera shows it, sRGB 0 to 1."""
    soils: tuple[Soil, ...]
    """Kinds of regolith that a recipe can name."""
    rock_rgb: RGB
    """Colour of the rocks as a camera shows it, sRGB 0 to 1."""
    rock_density: Positive
    """Density of a rock [kg/m³]."""
    rock_decay: tuple[float, float] | None
    """Golombek's q(k) = a + b / k [1/m] of the body's rocks as (a, b); None where there is no fit.
    """
    roughness: tuple[Fraction, NotNegative]
    """Fallback where no DTM tells: Hurst exponent, RMS deviation at 1 m [m]."""
    friction: Frictions
    """Friction of wheels."""
    repose: Positive | None = None
    """Steepest slope at which its loose ground rests [rad]; None where nobody knows."""
    relief: tuple[float, float] | None = None
    """Heights of its lowest and highest ground above the datum [m]; None where not known."""
    craters: CraterConstants
    """Shapes and numbers of craters."""
    dust: Dust | None = None
    """Dust in its air, with the optical depth of a usual day; None without air."""
    photometry: Photometry | None = None
    """How its surface sends light back; None for Lambert's law."""
    ephemeris: Ephemeris | None = None
    """Orbit, rotation and figure, which tell the Sun's place by date; None where a recipe must give
    its azimuth and elevation."""


def unfit(body: Body) -> str:
    """Why no world can be made of a body, as the types of its fields say; empty if one can."""
    from pydantic import ConfigDict, TypeAdapter, ValidationError

    limits = ConfigDict(arbitrary_types_allowed=True, allow_inf_nan=False, strict=True)
    for place, kind, value in _values(body, "has "):
        adapter: TypeAdapter[Any] = TypeAdapter(tuple[kind], config=limits)  # type: ignore[valid-type]
        try:
            adapter.validate_python((value,))
        except ValidationError as error:
            return f"{place} that {complaint(error, adapter, (value,)).words}"
    return ""


def _values(record: Record, place: str) -> Iterator[tuple[str, Any, Any]]:
    """The place, type and value of all fields of a record, and of the records in them."""
    kinds = get_type_hints(type(record), include_extras=True)
    for one in fields(record):
        value, inner = getattr(record, one.name), f"{place}{one.name}"
        yield inner, kinds[one.name], value
        for part in value if isinstance(value, tuple) else (value,):
            if isinstance(part, Record):
                yield from _values(part, f"{inner}.")
