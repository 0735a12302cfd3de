"""The recipe: the whole schema, composed of the stages' own specs, and its canonical JSON."""

from __future__ import annotations

import json
import reprlib
from dataclasses import dataclass, field, fields
from difflib import get_close_matches
from functools import cache
from typing import TYPE_CHECKING, Annotated, Any, Literal, Union

from annotated_types import Ge, Interval, Lt, MinLen
from pydantic import Discriminator, Tag, TypeAdapter, ValidationError

from terrain_forge.base import BY_KIND, FileName, Positive, RecipeError, Spec
from terrain_forge.dtm import ArrayDtm, FlatDtm, RasterDtm
from terrain_forge.model import BODIES, exporter
from terrain_forge.paths import PathSpec
from terrain_forge.recipe.validate_spec import ValidateSpec
from terrain_forge.rocks import RocksSpec
from terrain_forge.rovers import RoverChoice
from terrain_forge.terrain import AppearanceSpec, Layer, layer_types

if TYPE_CHECKING:
    from terrain_forge.model import Exporter

    AnyLayer = Layer
    BodyName = str
else:
    BodyName = Literal[tuple(BODIES)]
    AnyLayer = Annotated[Union[layer_types()], BY_KIND]  # noqa: UP007 (a tuple, not a list)


def _dtm_kind(value: Any) -> str:
    given = value.get("kind", "raster") if isinstance(value, dict) else getattr(value, "kind", "")
    return str(given)


Dtm = Annotated[
    Annotated[RasterDtm, Tag("raster")]
    | Annotated[FlatDtm, Tag("flat")]
    | Annotated[ArrayDtm, Tag("array")],
    Discriminator(_dtm_kind),
]


@dataclass(frozen=True, kw_only=True)
class TerrainSpec(Spec):
    """The ground's grid and what shapes it."""

    spacing_m: Positive
    """Distance of the ground's nodes [m]; a wheel needs a few per radius, say 0.05 to 0.25."""
    layers: tuple[AnyLayer, ...] = ()
    """Displacement layers, added in this order."""
    appearance: AppearanceSpec = field(default_factory=AppearanceSpec)
    """Colours of the ground."""


@dataclass(frozen=True, kw_only=True)
class SunSpec(Spec):
    """Where the Sun stands."""

    azimuth_deg: Annotated[float, Interval(ge=-360, le=360)] = 250.0
    """Compass direction, clockwise from north [degrees]."""
    elevation_deg: Annotated[float, Interval(gt=0, le=90)] = 35.0
    """Height above the horizon [degrees]."""


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
    rocks: RocksSpec = field(default_factory=RocksSpec)
    """The rocks; none by default."""
    paths: tuple[PathSpec, ...] = ()
    """Paths of the rover."""
    sun: SunSpec = SunSpec()
    """The Sun."""
    rover: RoverChoice = "morpheus"
    """The rover: a name (`morpheus`, `skid4`), or a mapping of its `kind` with what shall differ;
    `kind: file` brings your own URDF or MJCF."""
    exports: Annotated[tuple[FileName, ...], MinLen(0)] | dict[FileName, dict[str, Any]] = (
        "sdf",
        "mjcf",
        "usd",
    )
    """Formats to write: a list, or a mapping from a folder's name to `kind` and the format's
    options."""
    validate: ValidateSpec | None = None
    """What the finished world is tested by; without it, only what needs no drive."""

    @property
    def driven_path(self) -> str | None:
        """Name of the path that the validation drives, if any."""
        drive = self.validate.drive_spec if self.validate else None
        return drive.path if drive else None


@dataclass(frozen=True, kw_only=True)
class ExportOrder:
    """One folder of an export: which exporter fills it, and how."""

    folder: str
    kind: str
    exporter: Exporter
    options: Any


RESERVED = {
    *("world", "truth", "paths", "validation", "dataset"),
    *("manifest.json", "timings.json", "report.html", "preview.png"),
}
"""Names in a world's folder that no export may have, in any case."""


@cache
def adapter() -> TypeAdapter[Recipe]:
    """Pydantic's view of the schema."""
    return TypeAdapter(Recipe)


def json_schema() -> dict[str, Any]:
    """The JSON Schema of a recipe, for editors and for docs/recipe.md."""
    schema = adapter().json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def recipe_json(recipe: Recipe) -> str:
    """Canonical JSON of a recipe, defaults written out."""
    # What is wrong with a recipe made in Python is told by reading it back, not by warnings here.
    plain = adapter().dump_python(recipe, mode="json", warnings=False)
    return json.dumps(plain, sort_keys=True, separators=(",", ":"), allow_nan=False)


def recipe_from_json(text: str) -> Recipe:
    """The recipe of a canonical JSON.

    Raises:
        RecipeError: for what the schema does not allow; recipes made in Python are checked here.
    """
    try:
        return adapter().validate_json(text, strict=True)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"]))
        found = f"{first['msg']}, found {reprlib.repr(first['input'])}"
        raise RecipeError(f"{key}: {found}" if key else found) from None


def export_orders(recipe: Recipe) -> tuple[ExportOrder, ...]:
    """The recipe's exports with their exporters found and their options checked.

    Raises:
        RecipeError: for an unknown exporter or option, a folder that the world needs itself, or one
            that is another again.
    """
    exports = recipe.exports
    if not isinstance(exports, dict):
        if len(set(exports)) < len(exports):
            raise RecipeError("a format is named twice", key=("exports",))
        exports = {name: {} for name in exports}
    orders = tuple(_order(folder, dict(options)) for folder, options in exports.items())
    for number, order in enumerate(orders):
        _require_another(order, orders[:number])
    return orders


def _require_another(order: ExportOrder, earlier: tuple[ExportOrder, ...]) -> None:
    """Refuse a folder that is one before it again, by its name or by all that is in it."""
    key = ("exports", order.folder)
    for other in earlier:
        if other.folder.lower() == order.folder.lower():
            raise RecipeError(
                f"a folder before is called {other.folder!r}, which is the same, case aside",
                key=key,
            )
        if (other.kind, other.options) == (order.kind, order.options):
            raise RecipeError(
                f"{order.kind} with the same options as {other.folder!r}: one of them is enough",
                key=key,
            )


def _order(folder: str, options: dict[str, Any]) -> ExportOrder:
    key = ("exports", folder)
    if folder.lower() in RESERVED:
        raise RecipeError(f"{folder!r} is part of every world, choose another name", key=key)
    kind = options.pop("kind", folder)
    if not isinstance(kind, str):
        raise RecipeError(f"must be the name of an exporter, found {kind!r}", key=(*key, "kind"))
    try:
        found = exporter(kind)
        checked = TypeAdapter(found.Options).validate_json(json.dumps(options), strict=True)
    except RecipeError as error:
        raise RecipeError(str(error), key=(*key, *error.key)) from None
    except ValueError as error:
        option = error.errors()[0]["loc"][:1]  # type: ignore[attr-defined]
        message = _option_message(kind, found, error)
        raise RecipeError(message, key=(*key, *option)) from None
    return ExportOrder(folder=folder, kind=kind, exporter=found, options=checked)


def _option_message(kind: str, found: Exporter, error: ValueError) -> str:
    first = error.errors()[0]  # type: ignore[attr-defined]
    option = ".".join(map(str, first["loc"]))
    if first["type"] == "unexpected_keyword_argument":
        allowed = sorted(field.name for field in fields(found.Options) if field.name != "kind")
        close = get_close_matches(option, allowed, n=1)
        hint = f" (did you mean {close[0]!r}?)" if close else ""
        return f"{kind} has no option {option!r}{hint}, it has: {', '.join(allowed) or 'none'}"
    return f"option {option!r} of {kind}: {first['msg']}, found {first['input']!r}"
