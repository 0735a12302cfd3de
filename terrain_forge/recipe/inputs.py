"""The files that a recipe names: reading them, their hashes, and names without a place.

Which fields name files their specs say (`base.InputFile`); one walk over the recipe finds them.
"""

from __future__ import annotations

import hashlib
import math
import os
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, fields, replace
from functools import cache
from operator import methodcaller
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

from terrain_forge.base import (
    MAX_MESH,
    DataError,
    InputFile,
    Key,
    RecipeError,
    Spec,
    reading,
    require_file,
)
from terrain_forge.dtm import files_of_raster, read_image
from terrain_forge.model import BODIES, CustomMesh, DtmPatch, Image, Table
from terrain_forge.recipe.schema import Recipe
from terrain_forge.recipe.tables import read_table

WHOLE_BYTES = 256 * 2**20
"""Size up to which all of an input is hashed [bytes]."""

_PIECES, _PIECE_BYTES = 64, 2**20
_Read = TypeVar("_Read", Image, Table, CustomMesh)


@dataclass(frozen=True, kw_only=True)
class Input:
    """A file that a recipe names."""

    key: Key
    """Where the recipe names it."""
    path: str
    """Path as the recipe writes it."""
    mark: InputFile
    """What it is."""
    owner: Key
    """Where the spec stands whose field names it."""
    taken_over: bool
    """Whether that spec holds its numbers from then on."""


def resolve(recipe: Recipe, inputs: InputFiles) -> Recipe:
    """The recipe with its body's defaults, its tables' numbers and all diameters written out.

    Raises:
        RecipeError: for a law that contradicts itself, or diameters that are not known.
        DataError: for a table that cannot be read.
    """
    area = recipe.dtm.size_m[0] * recipe.dtm.size_m[1]
    keys: list[Key] = [("rocks", "populations", n) for n in range(len(recipe.rocks.populations))]
    for key in keys:
        law = (*key, "size_frequency")
        recipe = _changed(recipe, law, methodcaller("on", BODIES[recipe.body], law))
    _check_laws(recipe, keys)
    recipe = inputs.taken_over(recipe)
    _check_laws(recipe, keys)
    for key in keys:
        try:
            recipe = _changed(recipe, key, methodcaller("with_diameters", area))
        except RecipeError as error:
            raise RecipeError(str(error), key=(*key, "diameter_m")) from None
    return recipe


def _check_laws(recipe: Recipe, keys: list[Key]) -> None:
    for key, population in zip(keys, recipe.rocks.populations, strict=True):
        population.size_frequency.check((*key, "size_frequency"))


def find_inputs(recipe: Recipe) -> tuple[Input, ...]:
    """All files and folders that a recipe names, in the order of its keys."""
    return tuple(_walk(recipe, (), None, (), recipe))


def input_paths(recipe: Recipe, folder: Path) -> list[Path]:
    """Paths of all files and folders that a recipe names, and of those that its meshes name."""
    from terrain_forge.rocks import files_of_mesh

    found = find_inputs(recipe)
    meshes = [folder / one.path for one in found if one.mark.kind == "mesh"]
    beside = [path for mesh in meshes for path in files_of_mesh(mesh)]
    return [*(folder / one.path for one in found), *beside]


class InputFiles:
    """The input files of one recipe.

    Args:
        recipe: what names them.
        folder: what its paths are relative to.
    """

    def __init__(self, recipe: Recipe, folder: Path) -> None:
        self.folder = folder
        self.found = find_inputs(recipe)
        self.names: dict[str, str] = {}
        """For each path, how the world calls it: as the recipe does, but never absolutely."""
        for one in self.found:
            name = Path(one.path).name if Path(one.path).is_absolute() else one.path
            taken = name in self.names.values()
            self.names.setdefault(one.path, f"{len(self.names)}/{name}" if taken else name)

    def require(self) -> None:
        """Refuse a recipe of which a file is missing.

        Raises:
            DataError: names the file.
        """
        for one in self.found:
            if one.mark.kind != "folder":
                most = MAX_MESH if one.mark.kind == "mesh" else math.inf
                require_file(self.folder / one.path, one.path, one.key, most=most)

    def taken_over(self, recipe: Recipe) -> Recipe:
        """The recipe whose specs hold the numbers of the tables that they take over.

        Raises:
            DataError: for a table that is missing or cannot be read.
        """
        for one in self.found:
            if one.taken_over:
                with reading(one.path, key=one.key):
                    table = read_table(one.path, self.folder, one.mark, key=one.key)
                try:
                    recipe = _changed(recipe, one.owner, methodcaller("with_table", table))
                except ValueError as error:
                    raise DataError(f"{one.path}: {error}", key=one.key) from None
        return recipe

    def portable(self, recipe: Recipe) -> Recipe:
        """The recipe with names instead of absolute paths."""
        for one in find_inputs(recipe):
            if self.names[one.path] != one.path:
                recipe = _changed(recipe, one.key, self.names.__getitem__)
        return recipe

    def images(self) -> tuple[Image, ...]:
        """The images that layers, the ground's colour and rocks use, under their portable names.

        Raises:
            DataError: for a file that is no image.
        """

        def read(one: Input) -> Image:
            values = read_image(one.path, self.folder, one.key)
            return Image(path=self.names[one.path], values=values)

        return self._read("image", read)

    def tables(self) -> tuple[Table, ...]:
        """The tables that layers and rocks use, under their portable names.

        Raises:
            DataError: for a file that is not the table that one of its keys wants.
        """

        def read(one: Input) -> Table:
            table = read_table(one.path, self.folder, one.mark, key=one.key)
            return table.replace(path=self.names[one.path])

        return self._read("table", read)

    def meshes(self) -> tuple[CustomMesh, ...]:
        """The user's own rock shapes, repaired, under their portable names.

        Raises:
            DataError: for a file that is no mesh, or none that encloses a volume.
        """

        def read(one: Input) -> CustomMesh:
            from terrain_forge.rocks import read_rock_mesh

            mesh, repairs = read_rock_mesh(self.folder / one.path, key=one.key)
            return CustomMesh(path=self.names[one.path], mesh=mesh, repairs=repairs)

        return self._read("mesh", read)

    def _read(self, kind: str, read: Callable[[Input], _Read]) -> tuple[_Read, ...]:
        """What is read of all files of a kind, each once for each way to read it."""
        found: dict[str, _Read] = {}
        marks = set()
        for one in self.found:
            if one.mark.kind != kind or one.taken_over or (one.path, one.mark) in marks:
                continue
            marks.add((one.path, one.mark))
            with reading(one.path, key=one.key):
                values = read(one)
            if found.setdefault(one.path, values) != values:
                raise DataError(
                    f"{one.path} is used elsewhere too, where its empty fields mean other numbers",
                    key=one.key,
                )
        return tuple(found.values())

    def hashes(
        self,
        *,
        patch: DtmPatch | None,
        rover_files: tuple[Path, ...],
        fetched: dict[str, Path] | None = None,
    ) -> tuple[tuple[str, str], ...]:
        """`fingerprint` of every file, by its portable name.

        A label's image counts as an input, and so do files that a mesh names, and those that the
        rover's own file includes, which come after it in `rover_files`; they are named by their
        place beside it. What was fetched counts by the name that the recipe has for it.
        """
        from terrain_forge.rocks import files_of_mesh

        heights = patch.heights.tobytes() if patch is not None else b""
        files: list[tuple[str, Path, bytes]] = [(*one, heights) for one in (fetched or {}).items()]
        beside = []
        for one in self.found:
            path, name, kind = self.folder / one.path, self.names[one.path], one.mark.kind
            others: Iterable[Path] = ()
            if kind == "dtm":
                others = files_of_raster(path)
            elif kind == "mesh":
                others = files_of_mesh(path)
            elif kind == "rover":
                others = rover_files[1:]
            used = heights if kind == "dtm" else b""
            if kind != "folder":
                files.append((name, path, used))
            for other in others:
                place = Path(name).parent / os.path.relpath(other, path.parent)
                beside.append((os.path.normpath(place), other, used))
        hashes: dict[str, str] = {}
        for name, path, used in (*files, *beside):
            if name not in hashes:
                with reading(name):
                    hashes[name] = fingerprint(path, used=used)
        return tuple(hashes.items())


def fingerprint(path: Path, *, used: bytes = b"") -> str:
    """SHA-256 of a file, hexadecimal; of one above `WHOLE_BYTES`, `pieces:` and that of a part.

    The part is its size [bytes, decimal], 64 pieces of 1 MiB, evenly spread from its first byte to
    its last, and what was used of it: a DTM of 20 GB is as quickly told as one of 256 MB.
    """
    size = path.stat().st_size
    if size <= WHOLE_BYTES:
        return sha256(path)
    digest = hashlib.sha256(str(size).encode())
    with path.open("rb") as file:
        for n in range(_PIECES):
            file.seek(n * (size - _PIECE_BYTES) // (_PIECES - 1))
            digest.update(file.read(_PIECE_BYTES))
    digest.update(used)
    return f"pieces:{digest.hexdigest()}"


def sha256(path: Path) -> str:
    """SHA-256 of a file, hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _walk(value: Any, key: Key, mark: InputFile | None, owner: Key, spec: Spec) -> Iterator[Input]:
    """The files that a value names; the mark is that of the field it stands in."""
    if isinstance(value, Spec):
        for name, marked in _marks(type(value)).items():  # type: ignore[arg-type]
            yield from _walk(getattr(value, name), (*key, name), marked, key, value)
    elif isinstance(value, tuple | dict):
        for step, item in enumerate(value) if isinstance(value, tuple) else value.items():
            yield from _walk(item, (*key, step), mark, owner, spec)
    elif mark is not None and isinstance(value, str):
        taken_over = mark.kind == "table" and hasattr(spec, "with_table")
        yield Input(key=key, path=value, mark=mark, owner=owner, taken_over=taken_over)


@cache
def _marks(spec: type[Spec]) -> dict[str, InputFile | None]:
    """The mark of each field of a class of specs, None where it names no file; those come last."""
    hints = get_type_hints(spec, include_extras=True)
    marks = {field.name: _mark(hints[field.name]) for field in fields(spec)}
    return dict(sorted(marks.items(), key=lambda item: item[1] is None))


def _mark(hint: Any) -> InputFile | None:
    """The mark anywhere in a type, such as in `Annotated[str, InputFile(…)] | None`."""
    if isinstance(hint, InputFile):
        return hint
    return next((found for part in get_args(hint) if (found := _mark(part))), None)


def _changed(value: Any, key: Key, change: Callable[[Any], Any]) -> Any:
    """A spec in which something else stands at a key."""
    if not key:
        return change(value)
    step: Any = key[0]
    if isinstance(value, Spec):
        return replace(value, **{step: _changed(getattr(value, step), key[1:], change)})
    inner = _changed(value[step], key[1:], change)
    if isinstance(value, dict):
        return {**value, step: inner}
    return (*value[:step], inner, *value[step + 1 :])
