"""The recipe's rocks: populations, each with its sizes, its burial and its looks."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Annotated, Any, Union

from annotated_types import Interval, MinLen

from terrain_forge.base import (
    BY_KIND,
    Array,
    FileName,
    Fraction,
    InputFile,
    NotNegative,
    Pair,
    Positive,
    RecipeError,
    Spec,
    parts,
    portable,
    returning,
)
from terrain_forge.model import Site, Window
from terrain_forge.rocks.arrangement import Arrangement, Poisson
from terrain_forge.rocks.contact import Contact
from terrain_forge.rocks.laws.law import SizeLaw
from terrain_forge.rocks.library import LibrarySpec

if TYPE_CHECKING:
    SizeFrequency = SizeLaw
else:
    _LAWS = parts(SizeLaw, "terrain_forge.rocks.laws", "terrain_forge.size_laws")
    SizeFrequency = Annotated[Union[_LAWS], BY_KIND]  # noqa: UP007 (a tuple, not a list)

MAX_POPULATIONS = 64
"""Populations and lists of a site; a rock's id holds the population's index and its number."""
MAX_ROCKS = 2**25
"""Rocks of one population that are numbered one after the other; more are numbered by cells."""
_LARGE = 1e6
"""Area of the smallest site that may have more [m²]."""
MOST_ROCKS = 5e8
"""Rocks of all populations together that a site is expected to have at most."""
LAST_ID = 2**31 - 2**24
"""Ids of scattered rocks are below; rocks added by hand have those from here on, where rocks are
numbered by cells."""

ROCK_LIST = InputFile(
    kind="table",
    columns=("x_m", "y_m", "diameter_m"),
    optional=("yaw_deg", "buried_fraction", "prototype"),
)
"""Every list has the place east and north of the centre and the exposed plan diameter [m]; it may
have the turn anticlockwise [degrees], the buried part of the height, and the index of the shape in
the library."""

_RANGE = 1e-9, 1e6
"""Diameters [m] among which the largest rock is looked for."""

BuriedFraction = Annotated[float, Interval(ge=0, le=0.5)]


def largest_diameter(law: SizeLaw, area: float) -> float:
    """The diameter D [m] that one rock of an area [m²] is expected to exceed: N(>D) · area = 1.

    0 where less than one rock of any size is expected.
    """
    from scipy.optimize import brentq

    def surplus(log_diameter: float) -> Any:
        return law.cumulative_number(portable.exp(log_diameter)) * area - 1.0

    low, high = portable.log(_RANGE)
    what = f"size law {law.kind!r}: cumulative_number"
    with returning(law, what, "numbers that are finite and fall with the diameter"):
        if surplus(low) <= 0.0:
            return 0.0
        return float(portable.exp(brentq(surplus, low, high, xtol=1e-14)))


@dataclass(frozen=True, kw_only=True)
class PopulationSpec(Spec):
    """Rocks of one kind, scattered at random."""

    name: FileName
    """Name, unique among populations and lists; it also addresses the population's randomness."""
    size_frequency: SizeFrequency
    """How many rocks of which size there are."""
    diameter_m: tuple[Positive | None, Positive | None] = (None, None)
    """Smallest and largest exposed plan diameter [m]. A largest of null is that which one rock of
    the whole area is expected to exceed; a smallest of null is that of the counted or tabulated
    rocks. The other laws go on to ever smaller rocks and need a smallest diameter."""
    buried_fraction: tuple[BuriedFraction, BuriedFraction] = (0.05, 0.5)
    """Smallest and largest part of a rock's height that lies below the ground, 0 to 0.5; uniform
    between. No measured distribution is known; the older a surface, the deeper its rocks. Where the
    ground falls away under a rock it is sunk further, to 0.6, and a few rocks on very rough ground
    to 0.9, so that no daylight shows; one beneath which it shows all the same is left out."""
    arrangement: Arrangement = field(default_factory=Poisson)
    """How the rocks lie towards each other: anywhere (Poisson), in clusters, around craters."""
    density_image: Annotated[str, MinLen(1), InputFile(kind="image")] | None = None
    """An image laid over the site, north up; it multiplies the number of rocks by 0 (black) to 1
    (white, the law's own number). Of colours the luma counts."""
    max_slope_deg: Annotated[float, Interval(gt=0, le=90)] | None = None
    """No rock's centre lies on ground that is steeper than this [degrees]: neither the triangle of
    the surface under it, nor any node of its cell by central differences over two cells."""
    families: Annotated[tuple[str, ...], MinLen(1)] | None = None
    """Families of the library's shapes that these rocks have; by default any."""
    dynamic_m: tuple[Positive, Positive] | None = None
    """Smallest and largest diameter [m] of rocks that lie on the ground as bodies that a rover can
    push; the others are fixed in it."""
    collision_min_m: NotNegative = 0.0
    """Rocks smaller than this [m] are visual-only: nothing touches them."""
    rgb: tuple[Fraction, Fraction, Fraction] | None = None
    """Colour, sRGB 0 to 1; by default that of the body's rocks."""
    density_kg_m3: Annotated[float, Interval(ge=100, le=20000)] | None = None
    """Density [kg/m³]; by default that of the body's rocks."""

    def with_diameters(self, area: float) -> PopulationSpec:
        """The population with both diameters as numbers, equal where no rock is expected.

        The largest is rounded to 10 digits, so that it is the same on every machine.

        Args:
            area: the site's [m²].

        Raises:
            RecipeError: if neither the population nor its law has a smallest diameter.
        """
        smallest, largest = self.diameter_m
        smallest = smallest or self.size_frequency.smallest_known
        if smallest is None:
            raise RecipeError(
                f"a {self.size_frequency.kind} law goes on to ever smaller rocks: give the "
                "smallest diameter, as in [0.1, null]"
            )
        if largest is None:
            found = float(f"{largest_diameter(self.size_frequency, area):.10g}")
            largest = max(smallest, found)
        return replace(self, diameter_m=(smallest, largest))

    @property
    def diameters(self) -> tuple[float, float]:
        """Smallest and largest diameter [m] of a population of a planned site."""
        smallest, largest = self.diameter_m
        if smallest is None or largest is None:
            raise ValueError(f"{self.name!r} needs both diameters: see with_diameters")
        return smallest, largest

    @property
    def dynamic_diameters(self) -> tuple[float, float] | None:
        """Smallest and largest diameter [m] of its dynamic rocks; None where all are static."""
        if self.dynamic_m is None:
            return None
        return max(self.diameters[0], self.dynamic_m[0]), min(self.diameters[1], self.dynamic_m[1])

    def density(self, smallest: float, largest: float) -> float:
        """Rocks between two diameters [m] on a square metre, by the law [1/m²]."""
        law = self.size_frequency
        return float(law.cumulative_number(smallest) - law.cumulative_number(largest))

    def is_many(self, size: tuple[float, float]) -> bool:
        """Whether its rocks on a site [m] are too many to be numbered one after the other."""
        area = size[0] * size[1]
        if not isinstance(self.arrangement, Poisson) or area < _LARGE:
            return False
        return area * self.density(*self.diameters) > 0.9 * MAX_ROCKS

    @property
    def cover(self) -> float:
        """Part of the ground that the rocks cover, by the law."""
        smallest, largest = self.diameters
        law = self.size_frequency
        return float(law.cumulative_area(smallest) - law.cumulative_area(largest))


@dataclass(frozen=True, kw_only=True)
class RockListSpec(Spec):
    """Rocks that a table lists one by one."""

    name: FileName
    """Name, unique among lists and populations."""
    file: Annotated[str, MinLen(1), ROCK_LIST]
    """CSV with a header: `x_m`, `y_m` (east and north of the centre in the site's frame) and
    `diameter_m`; optionally `yaw_deg`, `buried_fraction` and `prototype` too."""
    buried_fraction: tuple[BuriedFraction, BuriedFraction] = (0.05, 0.5)
    """Smallest and largest buried part of the height, where the table gives none."""
    families: Annotated[tuple[str, ...], MinLen(1)] | None = None
    """Families of the library's shapes that these rocks have, where the table names no prototype;
    by default any."""
    rgb: tuple[Fraction, Fraction, Fraction] | None = None
    """Colour, sRGB 0 to 1; by default that of the body's rocks."""
    density_kg_m3: Annotated[float, Interval(ge=100, le=20000)] | None = None
    """Density [kg/m³]; by default that of the body's rocks."""


@dataclass(frozen=True, kw_only=True)
class ExclusionSpec(Spec):
    """A circle that is kept free of scattered rocks; listed ones lie where the user has them."""

    centre_m: Pair
    """East and north of its centre [m]."""
    radius_m: Positive
    """Radius [m]."""
    clearance_m: NotNegative = 0.0
    """Height above the ground [m] that rocks within may have; 0 for no rock at all."""


@dataclass(frozen=True, kw_only=True)
class RocksSpec(Spec):
    """All rocks of a world."""

    library: LibrarySpec = field(default_factory=LibrarySpec)
    """The rock shapes."""
    populations: tuple[PopulationSpec, ...] = ()
    """The populations; none for bare ground. Rocks are numbered population by population."""
    lists: tuple[RockListSpec, ...] = ()
    """The user's own rocks, each placed as it is listed; scattered rocks keep clear of them."""
    exclusion_zones: tuple[ExclusionSpec, ...] = ()
    """Circles that no scattered rock reaches into, as a landing pad or the rover's start; listed
    rocks are left where they are."""

    contact: Contact | None = None
    """What the ground does at static rocks that are at least two spacings wide: `wind`, `fillets`
    or `none`; by default wind on Mars and fillets on bodies without air."""

    @property
    def groups(self) -> tuple[PopulationSpec | RockListSpec, ...]:
        """The populations, then the lists: a rock's `population` is an index into these."""
        return (*self.populations, *self.lists)

    def expected_cover(self, site: Site, window: Window) -> Array:
        """Part of the ground that scattered rocks cover on average, shape [rows, columns].

        Density images and craters count; limits by slope do not, since the ground is not known yet,
        and rocks that are listed one by one do not.
        """
        from terrain_forge.rocks.scattering.expectation import expected_cover

        return expected_cover(self.populations, site, window)
