"""The files that a recipe names: reading them, their hashes, and names without a place."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path

from terrain_forge.base import DataError, Key
from terrain_forge.dtm import RasterDtm, files_of_raster, read_image, require_file
from terrain_forge.model import BODIES, CustomMesh, DtmPatch, Image, Table
from terrain_forge.paths import Recorded
from terrain_forge.recipe.input_table import read_table
from terrain_forge.recipe.schema import Recipe, recipe_json
from terrain_forge.rocks import (
    MAX_COUNTED,
    MAX_LISTED,
    MAX_ROWS,
    NEEDED,
    OPTIONAL,
    Counts,
    SizeFrequency,
    Tabulated,
    check_list,
)
from terrain_forge.rovers import FileRover
from terrain_forge.terrain import CraterLayer, CraterTable, Layer

WHOLE_BYTES = 256 * 2**20
"""Size up to which all of an input is hashed [bytes]."""

_PIECES, _PIECE_BYTES = 64, 2**20


def resolve_laws(recipe: Recipe, folder: Path) -> Recipe:
    """The recipe with each law written out: its file read, its body's defaults set.

    These are the size-frequency laws of the rocks, and productions of craters that are tables.

    Raises:
        DataError: for a table that is missing or cannot be read.
    """
    populations = tuple(
        replace(population, size_frequency=_resolve(population.size_frequency, recipe, folder, n))
        for n, population in enumerate(recipe.rocks.populations)
    )
    layers = tuple(
        _with_production(layer, folder, ("terrain", "layers", n, "production", "file"))
        for n, layer in enumerate(recipe.terrain.layers)
    )
    return replace(
        recipe,
        rocks=replace(recipe.rocks, populations=populations),
        terrain=replace(recipe.terrain, layers=layers),
    )


def read_images(recipe: Recipe, folder: Path) -> tuple[Image, ...]:
    """The images of all layers and populations, under their portable names.

    Of the orthoimage it is only seen to that there is one: it is read once the site is known.

    Raises:
        DataError: for a file that is missing or no image, or a density image without density.
    """
    names = portable_names(recipe)
    picture = recipe.terrain.appearance.orthoimage
    if picture is not None:
        key = ("terrain", "appearance", "orthoimage", "image")
        require_file(folder / picture.image, picture.image, key)
    images = {
        path: Image(path=names[path], values=read_image(path, folder, key))
        for path, key in _ground_images(recipe)
    }
    for number, population in enumerate(recipe.rocks.populations):
        if population.density_image is not None:
            path = population.density_image
            where: Key = ("rocks", "populations", number, "density_image")
            image = Image(path=names[path], values=read_image(path, folder, where))
            _require_density(image, where)
            images[path] = image
    return tuple(images.values())


def read_tables(recipe: Recipe, folder: Path) -> tuple[Table, ...]:
    """The lists of rocks, under their portable names.

    Raises:
        DataError: for a table that is missing, cannot be read, or has rocks that cannot be.
    """
    names, library = portable_names(recipe), recipe.rocks.library
    shapes = library.shapes + len(library.meshes)
    tables = {}
    for number, listed in enumerate(recipe.rocks.lists):
        key = ("rocks", "lists", number, "file")
        table = read_table(
            listed.file, folder, needed=NEEDED, optional=OPTIONAL, most=MAX_LISTED, key=key
        )
        check_list(table, size=recipe.dtm.size_m, shapes=shapes, key=key)
        tables[listed.file] = table.replace(path=names[listed.file])
    return tuple(tables.values())


def read_layer_tables(recipe: Recipe, folder: Path) -> tuple[Table, ...]:
    """The tables of the layers, each file once under its portable name.

    Raises:
        DataError: for a table that is missing or cannot be read.
    """
    names = portable_names(recipe)
    tables = {}
    for number, layer in enumerate(recipe.terrain.layers):
        for wanted in layer.tables():
            table = read_table(
                wanted.file,
                folder,
                needed=wanted.needed,
                optional=wanted.optional,
                blanks=wanted.blanks,
                most=MAX_LISTED,
                key=("terrain", "layers", number, wanted.field),
            )
            tables[wanted.file] = table.replace(path=names[wanted.file])
    return tuple(tables.values())


def read_meshes(recipe: Recipe, folder: Path) -> tuple[CustomMesh, ...]:
    """The user's own rock shapes, repaired, each file once under its portable name.

    Raises:
        DataError: for a file that is missing, no mesh, or none that encloses a volume.
    """
    if not recipe.rocks.library.meshes:
        return ()
    from terrain_forge.rocks import read_rock_mesh

    names = portable_names(recipe)
    meshes = {}
    for number, mesh in enumerate(recipe.rocks.library.meshes):
        if mesh.file not in meshes:
            key = ("rocks", "library", "meshes", number, "file")
            require_file(folder / mesh.file, mesh.file, key)
            shape, repairs = read_rock_mesh(folder / mesh.file, key=key)
            meshes[mesh.file] = CustomMesh(path=names[mesh.file], mesh=shape, repairs=repairs)
    return tuple(meshes.values())


def hash_inputs(
    recipe: Recipe, folder: Path, *, patch: DtmPatch | None = None
) -> tuple[tuple[str, str], ...]:
    """`fingerprint` of every input, by its portable name; a label's image counts as an input.

    Args:
        recipe: what names the inputs.
        folder: what its paths are relative to.
        patch: the samples that were read of the DTM.
    """
    names = portable_names(recipe)
    used = patch.heights.tobytes() if patch is not None else b""
    hashes = {}
    for path in _paths(recipe):
        is_dtm = isinstance(recipe.dtm, RasterDtm) and path == recipe.dtm.source
        hashes[names[path]] = fingerprint(folder / path, used=used if is_dtm else b"")
    if isinstance(recipe.dtm, RasterDtm):
        for other in files_of_raster(folder / recipe.dtm.source):
            name = Path(names[recipe.dtm.source]).with_name(other.name).as_posix()
            hashes.setdefault(name, fingerprint(other, used=used))
    return tuple(hashes.items())


def hash_rover(files: tuple[Path, ...], recipe: Recipe) -> tuple[tuple[str, str], ...]:
    """`fingerprint` of the files that the rover's own file includes, by their place beside it.

    Args:
        files: the rover's file, then those that were read for it.
        recipe: what names the rover.
    """
    if not isinstance(recipe.rover, FileRover):
        return ()
    first, *others = files
    beside = Path(portable_names(recipe)[recipe.rover.file]).parent.as_posix()
    names = [f"{beside}/{os.path.relpath(other, first.parent)}" for other in others]
    return tuple(
        (os.path.normpath(name), fingerprint(other))
        for name, other in zip(names, others, strict=True)
    )


def portable_json(recipe: Recipe) -> str:
    """Canonical JSON of a recipe whose absolute paths have become names."""
    if isinstance(recipe.rover, FileRover):
        recipe = replace(recipe, rover=recipe.rover.portable())
    text = recipe_json(recipe)
    for path, name in portable_names(recipe).items():
        text = text.replace(json.dumps(path), json.dumps(name))
    return text


def portable_names(recipe: Recipe) -> dict[str, str]:
    """For each input's path, how the world calls it: as the recipe does, but never absolutely."""
    names: dict[str, str] = {}
    for path in _paths(recipe):
        name = Path(path).name if Path(path).is_absolute() else path
        names[path] = name if name not in names.values() else f"{len(names)}/{name}"
    return names


def fingerprint(path: Path, *, used: bytes = b"") -> str:
    """SHA-256 of a file, hexadecimal; of one above `WHOLE_BYTES`, `pieces:` and that of a part.

    The part is its size [bytes, decimal], 64 pieces of 1 MiB, evenly spread from its first byte to
    its last, and what was used of it: a DTM of 20 GB is as quickly told as one of 256 MB.

    Args:
        path: the file.
        used: what was read of the file, as little-endian numbers.
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


def _ground_images(recipe: Recipe) -> Iterator[tuple[str, Key]]:
    """Images that shape the ground or tell its looks, and where the recipe names them."""
    for number, layer in enumerate(recipe.terrain.layers):
        for path in layer.images():
            name = next(f.name for f in fields(layer) if getattr(layer, f.name) == path)
            yield path, ("terrain", "layers", number, name)
        if layer.mask is not None and layer.mask.image is not None:
            yield layer.mask.image, ("terrain", "layers", number, "mask", "image")
    detail = recipe.terrain.appearance.detail
    if detail is not None:
        yield detail.image, ("terrain", "appearance", "detail", "image")


def _paths(recipe: Recipe) -> list[str]:
    """Paths of all inputs as the recipe writes them, each once."""
    return list(dict.fromkeys(_all_paths(recipe)))


def _all_paths(recipe: Recipe) -> Iterator[str]:
    if isinstance(recipe.dtm, RasterDtm):
        yield recipe.dtm.source
    for layer in recipe.terrain.layers:
        yield from layer.images()
        if layer.mask is not None and layer.mask.image is not None:
            yield layer.mask.image
        yield from (table.file for table in layer.tables())
    looks = recipe.terrain.appearance
    yield from (part.image for part in (looks.orthoimage, looks.detail) if part is not None)
    yield from recipe.rocks.library.files()
    for population in recipe.rocks.populations:
        if population.density_image is not None:
            yield population.density_image
    for listed in recipe.rocks.lists:
        yield listed.file
    yield from (path.route.file for path in recipe.paths if isinstance(path.route, Recorded))
    if isinstance(recipe.rover, FileRover):
        yield recipe.rover.file
    # Last, so that the names of the others are the same once the laws are resolved.
    for population in recipe.rocks.populations:
        law = population.size_frequency
        if isinstance(law, Counts | Tabulated) and law.file is not None:
            yield law.file
    for layer in recipe.terrain.layers:
        if (production := _production_table(layer)) is not None:
            yield str(production.file)


def _resolve(law: SizeFrequency, recipe: Recipe, folder: Path, number: int) -> SizeFrequency:
    key: Key = ("rocks", "populations", number, "size_frequency")
    law = law.on(BODIES[recipe.body], key)
    law.check(key)
    if isinstance(law, Counts) and law.file is not None:
        return _read_counts(law, law.file, folder, (*key, "file"))
    if isinstance(law, Tabulated) and law.file is not None:
        needed = ("diameter_m", "number_per_m2")
        rows = read_table(law.file, folder, needed=needed, most=MAX_ROWS, key=(*key, "file"))
        diameters, numbers = (tuple(rows.column(name).tolist()) for name in needed)
        _require_positive(rows, needed, (*key, "file"))
        return replace(law, file=None, diameters_m=diameters, numbers_per_m2=numbers)
    return law


def _production_table(layer: Layer) -> CraterTable | None:
    """The production of a layer of craters that is to be read from a file."""
    production = layer.production if isinstance(layer, CraterLayer) else None
    return production if isinstance(production, CraterTable) and production.file else None


def _with_production(layer: Layer, folder: Path, key: Key) -> Layer:
    production = _production_table(layer)
    if production is None:
        return layer
    needed = ("diameter_m", "number_per_km2")
    rows = read_table(str(production.file), folder, needed=needed, most=MAX_ROWS, key=key)
    _require_positive(rows, needed, key)
    diameters, numbers = (tuple(rows.column(name).tolist()) for name in needed)
    try:
        law = replace(production, file=None, diameters_m=diameters, numbers_per_km2=numbers)
    except ValueError as error:
        raise DataError(f"{production.file}: {error}", key=key) from None
    assert isinstance(layer, CraterLayer)
    return replace(layer, production=law)


def _read_counts(law: Counts, file: str, folder: Path, key: Key) -> Counts:
    single, binned = ("diameter_m",), ("low_m", "high_m", "count")
    table = read_table(
        file, folder, needed=(), optional=(*single, *binned), most=MAX_COUNTED, key=key
    )
    if set(table.columns) == set(single):
        _require_positive(table, single, key)
        return replace(law, file=None, diameters_m=tuple(table.column("diameter_m").tolist()))
    if set(table.columns) != set(binned):
        raise DataError(
            f"{file} needs the column diameter_m, or low_m, high_m and count; found "
            f"{', '.join(table.columns)}",
            key=key,
        )
    _require_positive(table, binned[:2], key)
    low, high, count = (tuple(table.column(name).tolist()) for name in binned)
    if any(number < 0 or number != int(number) for number in count):
        raise DataError(f"{file}: a count is no whole number of rocks", key=key)
    bins = tuple((a, b, int(number)) for a, b, number in zip(low, high, count, strict=True))
    return replace(law, file=None, bins=bins)


def _require_positive(table: Table, names: tuple[str, ...], key: Key) -> None:
    for name in names:
        least = float(table.column(name).min())
        if least <= 0.0:
            raise DataError(f"{table.path}: {name} must be above 0, found {least:g}", key=key)


def _require_density(image: Image, key: Key) -> None:
    least, most = float(image.values.min()), float(image.values.max())
    if least < 0.0 or most > 1.0:
        raise DataError(
            f"{image.path} holds values from {least:g} to {most:g}, allowed: 0 (no rocks) to 1",
            key=key,
        )
    if most == 0.0:
        raise DataError(f"{image.path} is black all over: it leaves no place for rocks", key=key)
