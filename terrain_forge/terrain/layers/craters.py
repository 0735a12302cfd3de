"""Impact craters, scattered by a production function or listed by the user."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal, Union

import numpy as np
from annotated_types import Interval, MinLen

from terrain_forge.base import (
    BY_KIND,
    Array,
    DataError,
    FileName,
    Idle,
    InputFile,
    Key,
    Positive,
    RecipeError,
    parts,
    portable,
    rectangle_distance,
)
from terrain_forge.model import BODIES, Site, Table, Window
from terrain_forge.terrain.cratering.craters import Craters
from terrain_forge.terrain.cratering.degradation import EJECTA_FADE, REACH, shapes
from terrain_forge.terrain.cratering.layer_craters import (
    FEWEST_NODES,
    NOT_GIVEN,
    UNRESOLVED,
    listed_places,
    make_craters,
    population_of,
)
from terrain_forge.terrain.cratering.placement import expected_craters
from terrain_forge.terrain.cratering.population import Equilibrium
from terrain_forge.terrain.cratering.production import OLDEST, BodyProduction, CraterProduction
from terrain_forge.terrain.cratering.relief import crater_relief
from terrain_forge.terrain.layer import Layer

FADES_IN = 0.05
"""Age [10⁹ years] at which a brightness has fallen to 1/e. This and the next two: assumptions."""
FULL_FROM = 100.0
"""Diameter [m] from which craters dig up fresh rock; smaller ones bring up old soil the more."""
BRIGHTEST = 2.0
"""Largest factor, where the ejecta of several craters lie."""
_VISIBLE = 0.005
MAX_CRATERS = 2_000_000
"""Craters of a layer that may reach a site."""
_PLACES = ("x_m", "y_m", "lon_deg", "lat_deg")

CraterList = InputFile(
    kind="table",
    columns=("diameter_m",),
    optional=(*_PLACES, "age_ga", "depth_to_diameter"),
    blanks=(("age_ga", 0.0), ("depth_to_diameter", NOT_GIVEN)),
)

if TYPE_CHECKING:
    AnyProduction = CraterProduction
else:
    _FOLDER = "terrain_forge.terrain.cratering.productions"
    _OF_BODIES = {one.kind for body in BODIES.values() for one in body.craters.productions}
    _GROUP = "terrain_forge.crater_productions"
    _SEEN = parts(CraterProduction, _FOLDER, _GROUP, taken=_OF_BODIES)
    AnyProduction = Annotated[Union[(BodyProduction, *_SEEN)], BY_KIND]


@dataclass(frozen=True, kw_only=True)
class CraterLayer(Layer):
    """Simple impact craters, each as worn as its age makes it (docs/craters.md)."""

    kind: Literal["craters"] = "craters"
    name: FileName = "craters"
    """Name, unique among the layers of craters; it addresses their randomness."""
    production: AnyProduction | None = None
    """How many craters have come; without it only those of the file."""
    equilibrium: Equilibrium | None = None
    """How many there can be. Without it, the body's: Trask's law on airless
    ones, Hartmann's on Mars; none for a table or counts of your own."""
    diameter_m: tuple[Positive | None, Positive | None] = (None, None)
    """Smallest and largest diameter [m]. A smallest of null is 4 spacings, the least that the grid
    can show; a largest of null is 5 postings of the DTM, which shows the larger ones itself, or
    on a flat site what one crater of the area is expected to reach."""
    file: Annotated[str, MinLen(1), CraterList] | None = None
    """CSV of craters that are placed one by one: `x_m`, `y_m` (east and north of the site's centre)
    or `lon_deg`, `lat_deg`, and `diameter_m`; optionally `age_ga` (0 without) and
    `depth_to_diameter` (of the fresh crater, crest to floor). Fields of these two may be empty."""
    depth_to_diameter: Annotated[float, Interval(ge=0.02, le=0.3)] | None = None
    """Depth of the fresh craters over their diameter, crest to floor; by default the body's."""
    ejecta: bool = True
    """Whether rims carry an ejecta blanket; without, craters end at 1.5 radii when fresh."""
    ejecta_contrast: Annotated[float, Interval(ge=0, le=1)] = 0.4
    """How much brighter than the ground the ejecta of a fresh crater of 100 m and more are, on
    airless bodies; it fades with age (to 1/e in 50·10⁶ years) and is less for smaller craters."""
    diffusivity_m2_per_myr: Annotated[float, Interval(ge=0, le=1000)] | None = None
    """How fast craters wear [m²/10⁶ years]; by default so that equilibrium holds. 0: not at all."""

    def idle(self) -> Iterator[Idle]:
        """How bright ejecta are that there are none of."""
        if not self.ejecta:
            yield Idle("ejecta_contrast", "there are no ejecta; choose ejecta: true")

    def __post_init__(self) -> None:
        if self.production is None and self.file is None:
            raise ValueError("craters need a production function, a file, or both")

    def check(self, *, site: Site, key: Key) -> None:
        """Refuse craters that a site cannot have.

        Raises:
            RecipeError: for a law of another body, a range of diameters that is upside down, too
                fine for the grid or goes on to complex craters, or too many craters.
            DataError: for a listed crater that cannot be.
        """
        if self.production is not None:
            functions, body = site.body.craters.productions, site.body.name.capitalize()
            if not self.production.holds_on(site.body):
                own = ", ".join(one.kind for one in functions) or "none"
                raise RecipeError(
                    f"{self.production.kind} is no production function of {body}, which has {own}",
                    key=(*key, "production", "kind"),
                )
            _check_range(self, site, (*key, "diameter_m"))
        if self.file is not None:
            _check_list(site.table(self.file), site, (*key, "file"))

    def facts(self, site: Site) -> Iterator[tuple[str, str]]:
        """How many craters are expected on the site, of which sizes, and how many are listed."""
        told = []
        if (drawn := population_of(self, site=site)) is not None:
            low, high = drawn.diameters
            number = drawn.density(low, high) * site.size[0] * site.size[1]
            limit = (
                ""
                if drawn.equilibrium == "none"
                else f", limited by equilibrium ({drawn.equilibrium})"
            )
            told.append(f"about {number:,.0f} of {low:.3g} to {high:.3g} m{limit}")
        if self.file is not None:
            told.append(f"{len(site.table(self.file).values):,} of {self.file}")
        yield "craters", f"{self.name}: {' and '.join(told)}"

    def brightness(self, *, site: Site, window: Window) -> Array | None:
        """Bright ejecta of young craters; None where they are no brighter than the ground."""
        bright = self.ejecta and site.body.craters.bright_ejecta
        if not bright or self.ejecta_contrast == 0.0:
            return None
        craters, east, north = self._craters(site, window)
        return ejecta_brightness(craters, east=east, north=north, contrast=self.ejecta_contrast)

    def relief(self, *, site: Site, window: Window, elevation: Array) -> Array:  # noqa: ARG002
        """Relief of all craters that reach into the window."""
        craters, east, north = self._craters(site, window)
        return crater_relief(craters, east=east, north=north)

    def _craters(self, site: Site, window: Window) -> tuple[Craters, Array, Array]:
        """Those that reach into a window, whose columns and rows lie there."""
        east, north = site.axes(window)
        area = float(east[0]), float(north[0]), float(east[-1]), float(north[-1])
        return make_craters(self, site=site, area=area), east, north


def ejecta_brightness(craters: Craters, *, east: Array, north: Array, contrast: float) -> Array:
    """Factor on the albedo at the nodes of a grid [m], shape [north, east].

    `contrast` is how much brighter the fresh ejecta of a large crater are at its rim, 0 for not.
    """
    factor = np.ones((north.size, east.size))
    strength = contrast * portable.exp(-craters.age / FADES_IN)
    strength *= np.minimum(craters.diameter / FULL_FROM, 1.0)
    for n in np.flatnonzero(strength > _VISIBLE):
        (x, y), radius = craters.xy[n], 0.5 * craters.diameter[n]
        reach = EJECTA_FADE[1] * radius
        columns = slice(*np.searchsorted(east, (x - reach, x + reach)))
        rows = slice(*np.searchsorted(north, (y - reach, y + reach)))
        away = np.hypot(east[columns] - x, north[rows, None] - y) / radius
        factor[rows, columns] += strength[n] * shapes(away)[2]
    return np.minimum(factor, BRIGHTEST)


def _check_range(spec: CraterLayer, site: Site, key: Key) -> None:
    """Refuse diameters that the grid or the body do not have, or too many craters of them."""
    given = spec.diameter_m
    finest, complex_from = FEWEST_NODES * site.spacing, site.body.craters.largest_simple
    if given[0] is not None and given[0] < finest:
        raise RecipeError(
            f"craters of {given[0]:g} m need a spacing of {given[0] / FEWEST_NODES:g} m or less, "
            f"found {site.spacing:g} m; at this spacing the smallest is {finest:g} m",
            key=key,
        )
    if given[1] is not None and given[1] > complex_from:
        raise RecipeError(
            f"craters of {given[1]:g} m are complex, with central peaks and terraces, which are "
            f"not made; simple ones go up to {complex_from:g} m on {site.body.name.capitalize()}",
            key=key,
        )
    population = population_of(spec, site=site)
    assert population is not None
    smallest, largest = population.diameters
    if smallest < largest:
        tiled = site.recipe.tiles is not None
        east, north = (min(site.tile_side, side) if tiled else side for side in site.size)
        number = expected_craters(population, (0.0, 0.0, east, north))
        if number > MAX_CRATERS:
            what, remedy = ("a tile", "smaller tiles") if tiled else ("the site", "tiles")
            raise RecipeError(
                f"{number:.3g} craters of {smallest:g} m and more would reach {what}, at most "
                f"{MAX_CRATERS:.3g}; choose a larger smallest diameter, or {remedy}",
                key=key,
            )
        return
    if None not in given:
        raise RecipeError(
            f"from {smallest:g} to {largest:g} m: the first must be the smaller", key=key
        )
    why = "the largest that is expected on this area"
    if site.dtm is not None:
        why = f"{UNRESOLVED:g} postings of the DTM, which shows larger ones itself"
    ends = f"smallest {smallest:g} m", f"largest {largest:g} m"
    found = ", ".join(
        f"{end}{'' if value is not None else ' (by default)'}"
        for end, value in zip(ends, given, strict=True)
    )
    raise RecipeError(f"no craters between: {found}; the default is {why}", key=key)


def _check_list(table: Table, site: Site, key: Key) -> None:
    _check_places(table, site, key)
    complex_from = site.body.craters.largest_simple
    limits = {
        "lon_deg": (-180.0, 360.0),
        "lat_deg": (-90.0, 90.0),
        "diameter_m": (FEWEST_NODES * site.spacing, complex_from),
        "age_ga": (0.0, OLDEST),
        "depth_to_diameter": (0.02, 0.3),
    }
    for name in table.columns:
        low, high = limits.get(name, (-np.inf, np.inf))
        values = table.column(name)
        allowed = f"{low:g} to {high:g}"
        if name == "diameter_m":
            allowed += (
                f": at least {FEWEST_NODES:g} spacings, and no complex craters, which begin at "
                f"{complex_from:g} m on {site.body.name.capitalize()}"
            )
        blank = (name == "depth_to_diameter") & (values == NOT_GIVEN)
        good = (values >= low) & (values <= high) | blank
        if not good.all():
            row = int(np.argmin(good))
            raise DataError(
                f"{table.path}: {name} of crater {row + 1} is {values[row]:g}, allowed: {allowed}",
                key=key,
            )
    away = rectangle_distance(listed_places(table, site=site), site.bounds)
    if not np.any(away < 0.5 * REACH * table.column("diameter_m")):
        raise DataError(
            f"{table.path}: no crater reaches the site, which ends at ±{0.5 * site.size[0]:g}, "
            f"±{0.5 * site.size[1]:g} m",
            key=key,
        )


def _check_places(table: Table, site: Site, key: Key) -> None:
    places = tuple(name for name in _PLACES if name in table.columns)
    if places not in (_PLACES[:2], _PLACES[2:]):
        raise DataError(
            f"{table.path} needs the columns x_m and y_m, or lon_deg and lat_deg; found "
            f"{', '.join(places) or 'neither'}",
            key=key,
        )
    if places == _PLACES[2:] and not site.georeferenced:
        raise DataError(
            f"{table.path} gives longitudes and latitudes, but the site has none: give x_m and y_m",
            key=key,
        )
