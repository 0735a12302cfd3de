"""The recipe: the whole schema, composed of the stages' own specs, and its canonical JSON."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, Annotated, Any, Literal, Union

from annotated_types import Ge, Interval, Lt, MinLen
from pydantic import TypeAdapter, ValidationError

from terrain_forge.base import (
    BY_KIND,
    ByKind,
    DataError,
    FileName,
    Fraction,
    Options,
    Positive,
    RecipeError,
    Spec,
    checked,
    complaint,
    documented,
    type_adapter,
)
from terrain_forge.dtm import ArrayDtm, FlatDtm, HorizonSpec, RasterDtm
from terrain_forge.model import (
    BODIES,
    exporter,
    exporter_names,
    html,
    plot_area,
)
from terrain_forge.paths import PathSpec, sketch_route
from terrain_forge.recipe.dataset import DatasetSpec
from terrain_forge.recipe.worlds import WorldsSpec
from terrain_forge.rocks import RocksSpec
from terrain_forge.rovers import RoverChoice, SensorsChoice
from terrain_forge.sky import SkySpec, SunSpec
from terrain_forge.terrain import AppearanceSpec, Layer, MaterialSpec, layer_types


@dataclass(frozen=True, kw_only=True)
class DriveSpec(Spec):
    """A drive of the rover along a path, and the limits that it must keep."""

    path: FileName
    """Name of the path to drive."""
    cross_track_m: Positive = 0.5
    """Largest distance from the path [m]."""
    tilt_deg: Annotated[float, Interval(gt=0, lt=90)] = 35.0
    """Largest tilt of the rover's body from the vertical [deg]."""
    time_factor: Annotated[float, Ge(1)] = 2.0
    """Longest duration, as a multiple of the path's own."""
    film: bool = True
    """Whether to make an animated picture of the drive."""


@dataclass(frozen=True, kw_only=True)
class StartsSpec(Spec):
    """Many drives straight on, from starts and in directions that are drawn at random."""

    count: Annotated[int, Interval(ge=1, le=10_000)]
    """How many."""
    length_m: Annotated[float, Interval(ge=1, le=1000)] = 10.0
    """How far each goes [m]."""
    speed_m_s: Annotated[float, Interval(ge=0.01, le=10)] = 0.3
    """Speed [m/s]; at most the rover's own."""
    arrive: Fraction = 0.5
    """Part of them that must arrive; 0 only counts them."""


@dataclass(frozen=True, kw_only=True)
class ValidateSpec(Spec):
    """What is checked after a build."""

    drive: FileName | DriveSpec | None = None
    """The path that the rover must drive: its name, or a mapping with limits; none if left out."""
    drives: Annotated[int, Interval(ge=1, le=10_000)] | StartsSpec | None = None
    """Drives straight on from so many random starts: their number, or a mapping; none if left
    out."""
    points: Annotated[int, Interval(ge=1, le=1_000_000)] = 2000
    """Random points at which each format's ground is compared with the world's."""
    consumers: Literal["quick", "all"] = "quick"
    """`all` opens every export in every program that reads its format and is installed, which
    `terrain-forge validate` does in any case; `quick` compares the ground alone, and of MJCF the
    rocks."""

    @property
    def drive_spec(self) -> DriveSpec | None:
        """The drive with its limits, where one is asked for."""
        return DriveSpec(path=self.drive) if isinstance(self.drive, str) else self.drive

    @property
    def starts_spec(self) -> StartsSpec | None:
        """The drives from many starts, where they are asked for."""
        return StartsSpec(count=self.drives) if isinstance(self.drives, int) else self.drives


if TYPE_CHECKING:
    AnyLayer = Layer
    BodyName = str
else:
    BodyName = Literal[tuple(BODIES)]
    AnyLayer = Annotated[Union[layer_types()], BY_KIND]  # noqa: UP007 (a tuple, not a list)


Dtm = Annotated[RasterDtm | FlatDtm | ArrayDtm, ByKind(default="raster")]


@dataclass(frozen=True, kw_only=True)
class TerrainSpec(Spec):
    """The ground's grid and what shapes it."""

    spacing_m: Annotated[float, Interval(ge=0.001, le=10_000)]
    """Distance of the ground's nodes [m]; a wheel needs a few per radius, say 0.05 to 0.25."""
    layers: tuple[AnyLayer, ...] = ()
    """Displacement layers, added in this order."""
    appearance: AppearanceSpec = field(default_factory=AppearanceSpec)
    """Colours of the ground."""
    materials: tuple[MaterialSpec, ...] = ()
    """Kinds of ground on the regolith, each with a colour, grain and friction of its own; a later
    one lies on those before it."""


@dataclass(frozen=True, kw_only=True)
class TilesSpec(Spec):
    """A site that is built tile by tile, whatever its size (docs/sites.md)."""

    size_m: Positive | None = None
    """Side of a tile [m], a whole number of cells; without it 1024 cells."""
    parquet: bool = False
    """Whether each tile's rocks are also written as GeoParquet (extra `parquet`)."""


@dataclass(frozen=True, kw_only=True)
class Recipe(Spec):
    """Everything that makes a world."""

    schema: Literal[1] = 1
    """Version of the recipe's format."""
    name: FileName
    """Name of the world, and of its folder unless the command line gives another."""
    seed: Annotated[int, Ge(0), Lt(2**63)] = 0
    """Root of all randomness: the same seed makes the same world."""
    body: BodyName
    """The planet or moon."""
    dtm: Dtm
    """Where the heights come from."""
    terrain: TerrainSpec
    """The ground."""
    horizon: HorizonSpec = field(default_factory=HorizonSpec)
    """What lies beyond the site."""
    rocks: RocksSpec = field(default_factory=RocksSpec)
    """The rocks; none by default."""
    paths: tuple[PathSpec, ...] = ()
    """Paths of the rover."""
    sun: SunSpec = field(default_factory=SunSpec)
    """The Sun: its place, or a date."""
    sky: SkySpec = field(default_factory=SkySpec)
    """The sky: what is in the air."""
    rover: RoverChoice = "morpheus"
    """The rover: a name (`morpheus`, `skid4`), or a mapping of its `kind` with what shall differ;
    `kind: file` brings your own URDF or MJCF."""
    sensors: SensorsChoice | None = None
    """What the rover carries: a list takes the place of its own rig, `add: […]` adds to it."""
    exports: Annotated[tuple[FileName, ...], MinLen(0)] | dict[FileName, Options] = (
        "sdf",
        "mjcf",
        "usd",
    )
    """Formats to write: a list, or a mapping from a folder's name to `kind` and the format's
    options."""
    validate: ValidateSpec | None = None
    """What the finished world is tested by; without it, only what needs no drive."""
    tiles: TilesSpec | None = None
    """How the site is cut into tiles that are built one by one; without it a site that fits into
    memory is built as one world."""
    dataset: DatasetSpec | None = None
    """What `terrain-forge record` records in the finished world; without it, its defaults."""
    worlds: WorldsSpec | None = None
    """What differs among the worlds that `terrain-forge worlds` makes; a build does not use it."""

    def __repr__(self) -> str:
        size = self.dtm.size_m
        parts = {
            "layers": [str(vars(type(layer)).get("kind", "")) for layer in self.terrain.layers],
            "rocks": [group.name for group in self.rocks.groups],
            "paths": [path.name for path in self.paths],
            "exports": list(self.exports),
        }
        told = ", ".join(f"{part}: {' '.join(names) or 'none'}" for part, names in parts.items())
        return (
            f"<Recipe {self.name!r}: {self.body}, {size[0]:g} × {size[1]:g} m at "
            f"{self.terrain.spacing_m:g} m, {told}, seed {self.seed}>"
        )

    def _repr_html_(self) -> str:
        sketched = {path.name: sketch_route(path.route) for path in self.paths}
        known = {name: points for name, points in sketched.items() if points is not None}
        size = self.dtm.size_m
        return html(repr(self), size, lambda axes: plot_area(axes, size, known))

    @property
    def driven_path(self) -> str | None:
        """Name of the path that the validation drives, if any."""
        drive = self.validate.drive_spec if self.validate else None
        return drive.path if drive else None


def adapter() -> TypeAdapter[Recipe]:
    """Pydantic's view of the schema."""
    return type_adapter(Recipe)


@checked
@cache
def json_schema(*, exporters: bool = True) -> dict[str, Any]:
    """The JSON Schema of a recipe, for editors and for docs/recipe.md.

    Args:
        exporters: Whether it names the installed exporters and their options, which must all be
            imported for it.
    """
    with documented():
        schema = adapter().json_schema()
        if exporters:
            _name_exporters(schema)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def _name_exporters(schema: dict[str, Any]) -> None:
    """Write the installed exporters and their options into the schema's `exports`."""
    listed, mapped = schema["properties"]["exports"]["anyOf"]
    listed["items"] = {"enum": exporter_names()}
    defs, by_kind = schema["$defs"], []
    for name in exporter_names():
        options = _exporter_schema(name)
        defs.update({f"{name}_{part}": one for part, one in options.pop("$defs", {}).items()})
        defs[f"{name}_options"] = options
        by_kind.append({"$ref": f"#/$defs/{name}_options", "required": ["kind"]})
    defs["export"] = {"anyOf": by_kind}
    mapped["additionalProperties"] = other = {"$ref": "#/$defs/export"}
    own = {name: {"$ref": f"#/$defs/{name}_options"} for name in exporter_names()}
    mapped["properties"] = {name: {"anyOf": [one, other]} for name, one in own.items()}


def _exporter_schema(name: str) -> dict[str, Any]:
    """The JSON Schema of an exporter's options and its kind; of one that is broken, of anything."""
    try:
        options: TypeAdapter[Any] = TypeAdapter(exporter(name).Options)
        schema = options.json_schema(ref_template=f"#/$defs/{name}_{{model}}")
    except RecipeError:
        schema = {"type": "object"}
    kind = {"const": name, "description": "The exporter; by default that of the folder's name."}
    return {**schema, "properties": {**schema.get("properties", {}), "kind": kind}}


def recipe_json(recipe: Recipe) -> str:
    """Canonical JSON of a recipe, defaults written out."""
    # What is wrong with a recipe made in Python is told by reading it back, not by warnings here.
    plain = adapter().dump_python(recipe, mode="json", warnings=False)
    return json.dumps(plain, sort_keys=True, separators=(",", ":"), allow_nan=False)


def recipe_from_json(text: str) -> Recipe:
    """The recipe of a canonical JSON.

    Raises:
        RecipeError: for what the schema does not allow; recipes made in Python are checked here.
        DataError: if it is no JSON, as in a world that was damaged.
    """
    try:
        return adapter().validate_json(text, strict=True)
    except ValidationError as error:
        try:
            plain = json.loads(text)
        except ValueError as fault:
            raise DataError(f"its recipe is no JSON: {fault}") from None
        raise RecipeError(str(complaint(error, adapter(), plain))) from None
