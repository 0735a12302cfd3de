"""The recipe's `dtm` part: where the heights come from and which piece of them is the site."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Literal
from urllib.parse import urlsplit

from annotated_types import Ge, Gt, Interval, MinLen, Predicate

from terrain_forge.base import (
    Coordinate,
    Idle,
    InputFile,
    NotNegative,
    Pair,
    Positive,
    PositivePair,
    Spec,
)

Longitude = Annotated[float, Interval(ge=-180, le=360)]
Latitude = Annotated[float, Interval(ge=-90, le=90)]
Noise = Literal["auto", "keep"] | Annotated[float, Interval(ge=0, le=1000)]


def is_address(text: str) -> bool:
    """Whether a text is the address of a file on a web server, without a password in it."""
    parts = urlsplit(text)
    plain = text.isprintable() and " " not in text and "@" not in parts.netloc
    return plain and parts.scheme in ("http", "https") and bool(parts.hostname)


@dataclass(frozen=True, kw_only=True)
class Centre(Spec):
    """Centre of the site: exactly one of the three."""

    offset_m: Pair | None = None
    """Metres east and north of the DTM's centre."""
    crs: Pair | None = None
    """x and y in the DTM's own coordinate reference system."""
    lonlat_deg: tuple[Longitude, Latitude] | None = None
    """Longitude (positive east) and latitude [degrees]."""


@dataclass(frozen=True, kw_only=True)
class RasterDtm(Spec):
    """Heights from a raster: one of `source`, `product`, `place` and `url` (docs/places.md).

    Its data lie in the file or beside it (formats: docs/terrain.md).
    """

    kind: Literal["raster"] = "raster"
    source: Annotated[str, MinLen(1), InputFile(kind="dtm")] | None = None
    """A file, its path relative to the recipe (for PDS3 with a detached label: the label)."""
    product: Annotated[str, MinLen(1)] | None = None
    """A published terrain model by its name, such as `DTEEC_045994_1985_046060_1985_U01`; it is
    downloaded once."""
    place: Annotated[str, MinLen(1)] | None = None
    """A place by its name, such as `jezero`: its product, and where `centre` is left out its
    centre. `terrain-forge sites` lists them."""
    url: Annotated[str, Predicate(is_address)] | None = None
    """Address of a georeferenced GeoTIFF or JPEG 2000; what the site needs of it is read and
    kept."""
    size_m: PositivePair
    """Size of the site, node to node, east and north [m]; whole multiples of the spacing."""
    centre: Centre = Centre(offset_m=(0.0, 0.0))
    """Where the site's centre lies; by default in the middle of the DTM."""
    level: Literal["none", "plane"] = "none"
    """`plane` takes the best-fit plane away, so that the site is level on the whole."""
    band: Annotated[int, Ge(1)] = 1
    """Which band of the raster holds the heights."""
    nodata: float | None = None
    """A value that means "no data", besides those that the file declares."""
    nodata_range: tuple[float, float] | None = None
    """Values of the file from the first to the second mean "no data" too, such as [-1e9, -1e4]."""
    fill_holes_m: Annotated[float, Ge(0)] | None = None
    """Width of the widest hole within the site that is filled in [m]; without it 8 samples. Wider
    ones are an error."""
    destair: bool = False
    """Smooth the stairs of an 8-bit or otherwise coarsely stepped DTM; each height stays within
    half a step of its sample."""
    noise: Noise = "auto"
    """Errors of a stereo DTM's matcher: `auto` looks for them and takes them away, `keep` leaves
    them in, a figure is their RMS [m] where it is known."""
    extent_m: PositivePair | None = None
    """For a raster without georeference: its size on the ground, east and north [m]."""
    pixel_is: Literal["area", "point"] = "area"
    """For a raster without georeference: whether `extent_m` reaches to the outer pixels' edges
    (area) or their centres (point, as in height maps of 2^n+1 pixels)."""
    height_range_m: Pair | None = None
    """For integers without a vertical scale: heights of 0 and of the type's largest value [m]."""
    height_scale: Annotated[float, Gt(0)] | None = None
    """Metres per unit of the raster, instead of what the file declares."""
    height_offset_m: Coordinate | None = None
    """Height of the value 0 [m], instead of what the file declares."""

    def idle(self) -> Iterator[Idle]:
        """What the extent reaches to, where there is none."""
        if self.extent_m is None:
            yield Idle("pixel_is", "it is for a raster without georeference, give its extent_m")

    @property
    def name(self) -> str:
        """What the terrain model is called."""
        return self.source or self.product or self.url or self.place or "none"


@dataclass(frozen=True, kw_only=True)
class FlatDtm(Spec):
    """No DTM: level ground at the body's datum, that the layers shape."""

    kind: Literal["flat"] = "flat"
    size_m: PositivePair
    """Size of the site, node to node, east and north [m]; whole multiples of the spacing."""
    lonlat_deg: tuple[Longitude, Latitude] | None = None
    """Where on the body the site lies [degrees]; without it nothing is georeferenced."""


@dataclass(frozen=True, kw_only=True)
class ArrayDtm(Spec):
    """Heights given in Python, as `plan(recipe, heights=array)`: rows run north, columns east."""

    kind: Literal["array"] = "array"
    posting_m: Positive
    """Distance of the array's samples [m]."""
    size_m: PositivePair
    """Size of the site around the array's centre, node to node, east and north [m]."""
    level: Literal["none", "plane"] = "none"
    """`plane` takes the best-fit plane away."""
    noise: Noise = "auto"
    """Errors of a matcher: looked for (`auto`), kept (`keep`), or their RMS [m]."""
    lonlat_deg: tuple[Longitude, Latitude] | None = None
    """Where on the body the site lies [degrees]; without it nothing is georeferenced."""


@dataclass(frozen=True, kw_only=True)
class HorizonSpec(Spec):
    """What lies beyond the site, for cameras and lidars; nothing of it is ever touched."""

    dtm: Annotated[str, MinLen(1), InputFile(kind="dtm")] | None = None
    """A second, coarser terrain model that goes on where the site's own ends, such as a global one:
    a georeferenced raster. It is raised or lowered to the site's height."""
    reach_m: NotNegative | None = None
    """How far from the border the ground goes on [m], at most a quarter of the body's radius;
    without it to the true horizon, 0 for nothing."""
    rocks_m: Annotated[float, Interval(ge=0, le=500)] = 50.0
    """How far from the border rocks lie, by the law of each population, as simple shapes [m]."""

    def idle(self) -> Iterator[Idle]:
        """What would lie beyond the site where nothing shall."""
        if self.reach_m == 0.0:
            yield from (Idle(name, "reach_m: 0 leaves nothing") for name in ("dtm", "rocks_m"))
