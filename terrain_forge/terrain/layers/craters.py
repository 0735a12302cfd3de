"""Impact craters, scattered by a production function or listed by the user."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal, Union

import numpy as np
from annotated_types import Interval, MinLen

from terrain_forge.base import BY_KIND, Array, FileName, InputFile, Positive, parts, portable
from terrain_forge.model import BODIES, Site, Window
from terrain_forge.terrain.cratering.craters import Craters
from terrain_forge.terrain.cratering.degradation import EJECTA_FADE, shapes
from terrain_forge.terrain.cratering.feasibility import check_craters
from terrain_forge.terrain.cratering.layer_craters import NOT_GIVEN, make_craters
from terrain_forge.terrain.cratering.population import Equilibrium
from terrain_forge.terrain.cratering.production import BodyProduction, CraterProduction
from terrain_forge.terrain.cratering.relief import crater_relief
from terrain_forge.terrain.layer import Layer

FADES_IN = 0.05
"""Age [10⁹ years] at which a brightness has fallen to 1/e. This and the next two: assumptions."""
FULL_FROM = 100.0
"""Diameter [m] from which craters dig up fresh rock; smaller ones bring up old soil the more."""
BRIGHTEST = 2.0
"""Largest factor, where the ejecta of several craters lie."""
_VISIBLE = 0.005

CraterList = InputFile(
    kind="table",
    columns=("diameter_m",),
    optional=("x_m", "y_m", "lon_deg", "lat_deg", "age_ga", "depth_to_diameter"),
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
    ones, Hartmann's on Mars."""
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
    """How fast craters wear [m²/10⁶ years]; by default it grows with their size. 0: not at all."""

    def __post_init__(self) -> None:
        if self.production is None and self.file is None:
            raise ValueError("craters need a production function, a file, or both")

    def check(self, *, site: Site, key: tuple[str | int, ...]) -> None:
        """Refuse craters that a site cannot have."""
        check_craters(self, site=site, key=key)

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
    """Factor on the albedo at the nodes of a grid, shape [north, east].

    Args:
        craters: Those that reach the grid, the youngest first.
        east: Coordinates of the columns [m], ascending.
        north: Coordinates of the rows [m], ascending.
        contrast: How much brighter the fresh ejecta of a large crater are at its rim, 0 for not.
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
