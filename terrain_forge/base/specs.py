"""What the recipe's parts have in common; stages own their specs, `recipe` composes them.

A spec is a small frozen dataclass beside the stage that it configures. Its fields carry their
limits as `annotated_types`, and a string under each field is that field's documentation in
docs/recipe.md.
"""

from __future__ import annotations

import ast
import json
import math
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from dataclasses import MISSING, dataclass, fields
from functools import cache
from inspect import cleandoc, getsourcefile, isfunction
from itertools import pairwise
from linecache import getlines
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    ClassVar,
    Literal,
    NamedTuple,
    Self,
    Union,
    get_args,
)

import numpy as np
from annotated_types import Interval, Len, MinLen, Predicate

from terrain_forge.base.arrays import Key
from terrain_forge.base.errors import RecipeError
from terrain_forge.base.explaining import complaint
from terrain_forge.base.given import checked, trusting

if TYPE_CHECKING:
    from pydantic import TypeAdapter

LEAST, MOST = 1e-12, 1e12
"""Smallest and largest number of a recipe that must be above 0: their squares can be computed."""
FARTHEST = 1e9
"""Largest coordinate [m]."""

Positive = Annotated[float, Interval(ge=LEAST, le=MOST)]
NotNegative = Annotated[float, Interval(ge=0, le=MOST)]
NearPath = Annotated[float, Interval(ge=0, le=100)]
Fraction = Annotated[float, Interval(ge=0, le=1)]
Workers = Annotated[int, Interval(ge=0, le=4096)]
"""Processes; 0 for this one."""
Coordinate = Annotated[float, Interval(ge=-FARTHEST, le=FARTHEST)]
Pair = tuple[Coordinate, Coordinate]
PositivePair = tuple[Positive, Positive]

MAX_NAME = 100
"""Characters of a name that may become a file's."""
MAX_NAME_BYTES = 200
"""What it may have in UTF-8: file systems take 255, some of which our own endings need."""
MAX_TABLE = 256 * 2**20
"""Bytes of a table of the user's."""
MAX_MESH = 64 * 2**20
"""Bytes of a rock's mesh of the user's."""


def is_file_name(text: str) -> bool:
    """Whether a text can name a file or folder that is visible and does not leave its folder."""
    plain = bool(text) and text[0] != "." and text.isprintable() and not set(text) & set("/\\:")
    return plain and len(text.encode()) <= MAX_NAME_BYTES


def is_listed_name(text: str) -> bool:
    """Whether a file's name can stand among others with commas between, as `--only` takes them."""
    alone = "," not in text and text == text.strip()
    return alone and is_file_name(text) and len(text) <= MAX_NAME


def refused_name(name: str, taken: Collection[str], whole: str) -> str:
    """Why a part of others whose name becomes a folder's must not have it; empty if it may.

    Args:
        name: The part's name.
        taken: Names in small letters that are taken there, in any case.
        whole: Where the folder would lie, such as "world".
    """
    if name.lower() in taken:
        return f"{name!r} is part of every {whole}, choose another name"
    if is_listed_name(name):
        return ""
    allowed = f"up to {MAX_NAME} characters without / \\ : commas, a leading dot or control ones"
    return f"{name[:MAX_NAME]!r} cannot name a folder, choose another name: {allowed}"


def refuse_twice(names: Collection[str], key: Key) -> None:
    """Refuse a name that a list of a key has more than once.

    Raises:
        RecipeError: names the first.
    """
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise RecipeError(f"{name} is named twice", key=key)
        seen.add(name)


@dataclass(frozen=True)
class _Finite:
    """Marks what holds no NaN or infinity anywhere, whatever else it is."""

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        from pydantic_core import PydanticKnownError, core_schema

        def refuse(value: Any) -> Any:
            if isinstance(value, float) and not math.isfinite(value):
                raise PydanticKnownError("finite_number")
            if isinstance(value, dict | list | tuple):
                for one in value.values() if isinstance(value, dict) else value:
                    refuse(one)
            return value

        return core_schema.no_info_after_validator_function(refuse, handler(source))


Options = dict[str, Annotated[Any, _Finite()]]
"""Options of an exporter or a format, which alone knows their types."""
FileName = Annotated[str, MinLen(1), Len(1, MAX_NAME), Predicate(is_file_name)]
"""A name that may become a file's or a folder's: no separator, no leading dot."""


@dataclass(frozen=True, kw_only=True)
class InputFile:
    """Marks a field that names a file: `Annotated[str, MinLen(1), InputFile(kind="image")]`.

    The file's path is relative to the recipe. It must be there, its hash stands in the manifest,
    and the world calls it by a name that is no absolute path. Images, tables and meshes are read
    when the site is planned: a layer finds them as `site.image(path)` and `site.table(path)`. A
    spec with a method `with_table(table)`, such as a size law, takes the numbers over: the method
    returns the spec with the numbers and without the file, or raises a ValueError.
    """

    kind: Literal["image", "table", "mesh", "dtm", "orthoimage", "route", "rover", "folder"]
    """What it is; from `dtm` on, the room of the spec reads it. A folder has only its name
    changed."""
    columns: tuple[str, ...] = ()
    """Columns that a table (CSV) must have."""
    optional: tuple[str, ...] = ()
    """Columns that it may have; others are refused, lest a misspelt one is lost."""
    positive: tuple[str, ...] = ()
    """Columns whose numbers must be above 0."""
    blanks: tuple[tuple[str, float], ...] = ()
    """Columns whose fields may be empty, and what the table holds there."""
    most: int = 2_000_000
    """Rows that it may have."""


@dataclass(frozen=True)
class ByKind:
    """Marks a union of specs whose members are told apart by their `kind`."""

    default: str = ""
    """The kind that is meant where none is given; empty if one must be."""

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        from pydantic import Discriminator, Field, Tag

        if not self.default:
            return handler(Annotated[source, Field(discriminator="kind")])
        members = [Annotated[member, Tag(member.kind)] for member in get_args(source)]
        return handler(Annotated[Union[tuple(members)], Discriminator(self._kind)])  # noqa: UP007

    def _kind(self, given: Any) -> str | None:
        if isinstance(given, dict):
            return str(given.get("kind", self.default))
        return getattr(given, "kind", None)


BY_KIND = ByKind()
"""`Annotated[Golombek | PowerLaw, BY_KIND]`: errors then speak of the member that was meant."""


_CONFIG: dict[str, object] = {"extra": "forbid", "allow_inf_nan": False}


_documented = False


@contextmanager
def documented() -> Iterator[None]:
    """Within it, schemas take over the text under each field; reading all source takes a while."""
    global _documented
    _documented = True
    try:
        yield
    finally:
        _documented = False


class Idle(NamedTuple):
    """A key that changes nothing, whatever it says, because of what others say or leave out."""

    name: str
    """Name of the field."""
    why: str
    """What of the others makes it so."""
    refused: bool = False
    """Whether it contradicts them, so that to give it is an error; else it is worth a warning."""


@dataclass(frozen=True, kw_only=True)
class Spec:
    """Base of all recipe parts: unknown keys are refused, no NaN or infinity.

    Nothing is checked when a spec is made in Python, but by `plan`, by a function that takes the
    spec, and by its own public methods; it remembers that it was.
    """

    __slots__ = ("_checked",)  # beside the fields, so that `vars` and `asdict` don't see it
    __pydantic_config__: ClassVar[dict[str, object]] = _CONFIG

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        for name, method in list(vars(cls).items()):
            if isfunction(method) and not name.startswith("_"):
                setattr(cls, name, checked(method))

    @classmethod
    def __get_pydantic_json_schema__(cls, core: Any, handler: Any) -> Any:
        schema = handler(core)
        if _documented:
            keys = handler.resolve_ref_schema(schema).get("properties", {})
            for name, text in _texts(cls).items():
                if name in keys:
                    keys[name].setdefault("description", text)
        return schema

    def __getstate__(self) -> dict[str, Any]:
        return vars(self)

    def sound(self) -> Self:
        """The spec with its values as their types read them, lists as tuples.

        Raises:
            RecipeError: for the first value that its field does not allow.
        """
        known = getattr(self, "_checked", None)
        if known is None:
            known = _read_anew(self)
            object.__setattr__(known, "_checked", True)
            if known is not self:
                object.__setattr__(self, "_checked", known)
        return self if known is True or known is self else known

    def idle(self) -> Iterator[Idle]:
        """Its fields that change nothing beside its others; a spec says which, by default none."""
        return iter(())

    def is_default(self, name: str) -> bool:
        """Whether a field has its default."""
        found = next(field for field in fields(self) if field.name == name)
        made = found.default if found.default_factory is MISSING else found.default_factory()
        return bool(getattr(self, name) == made)

    def refuse_idle(self) -> None:
        """Refuse values of fields that contradict others; defaults say nothing.

        Raises:
            RecipeError: for the first of them.
        """
        for name, why, refused in self.idle():
            if refused and not self.is_default(name):
                raise RecipeError(f"has no effect: {why}", key=(name,))


def _texts(spec: type) -> dict[str, str]:
    """The texts under the fields of a spec and its bases, by the fields' names."""
    found: dict[str, str] = {}
    for base in spec.__mro__:
        whole = None
        with suppress(OSError, TypeError):  # one that is made in no file has none
            whole = _classes(getsourcefile(base) or "").get(base.__qualname__)
        for pair in pairwise(whole.body if whole else ()):
            match pair:
                case (
                    ast.AnnAssign(target=ast.Name(id=name)),
                    ast.Expr(value=ast.Constant(value=str(text))),
                ):
                    found.setdefault(name, cleandoc(text))
    return found


@cache
def _classes(file: str) -> dict[str, ast.ClassDef]:
    """The classes of a file of source, by their qualified names: `inspect` reads it for each."""
    return dict(_named_classes(ast.parse("".join(getlines(file)))))


def _named_classes(part: ast.AST, before: str = "") -> Iterator[tuple[str, ast.ClassDef]]:
    for one in ast.iter_child_nodes(part):
        if isinstance(one, ast.ClassDef):
            yield before + one.name, one
            yield from _named_classes(one, f"{before}{one.name}.")
        elif isinstance(one, ast.FunctionDef):
            yield from _named_classes(one, f"{before}{one.name}.<locals>.")
        elif isinstance(one, ast.stmt):
            yield from _named_classes(one, before)


def type_adapter(spec: type[Any]) -> TypeAdapter[Any]:
    """Pydantic's view of a class of specs, made once."""
    known: Any = spec  # a class is hashable, whatever mypy thinks of its instances
    return _adapter(known)


@cache
def _adapter(spec: Any) -> TypeAdapter[Any]:
    from pydantic import TypeAdapter

    return TypeAdapter(spec)


def _read_anew(spec: Any) -> Any:
    """A spec as its JSON is read; as it is where its own types cannot be told.

    Raises:
        RecipeError: if a value is not allowed.
    """
    from pydantic import ValidationError
    from pydantic.errors import PydanticUserError
    from pydantic_core import to_jsonable_python

    try:
        with trusting():  # what it makes of the values may use its own methods
            kind: Any = type(spec)
            adapter = type_adapter(kind)
            # What is wrong is told by reading it back, not by warnings of the writer.
            # JSON's own mode would make nothing of NaN where anything is allowed.
            found = adapter.dump_python(spec, warnings=False)
            plain = to_jsonable_python(found, fallback=_plain)
            text = json.dumps(plain, ensure_ascii=False).encode()
            return adapter.validate_json(text, strict=True)
    except PydanticUserError:  # of a class within a function, whose names only that knows
        return spec
    except UnicodeEncodeError as error:
        raise RecipeError(f"{type(spec).__name__}: a text of it is no Unicode: {error}") from None
    except ValidationError as error:
        told = complaint(error, adapter, plain)
        raise RecipeError(f"{type(spec).__name__}: {told}", key=told.key) from None


def _plain(value: Any) -> Any:
    """What JSON holds of a value that it does not know."""
    if isinstance(value, np.longdouble):  # whose own list holds it again
        return float(value)
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else repr(value)
