"""Saving and loading a World: its arrays in one npz, everything else in one json beside it."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zipfile import ZIP_STORED, ZipFile

import numpy as np
from numpy.lib.format import read_array_header_1_0, read_array_header_2_0, read_magic
from numpy.typing import NDArray

from terrain_forge.base import OutputError, from_plain, read_text, require_file, to_plain
from terrain_forge.model.sensor import sensor_kinds

if TYPE_CHECKING:
    from terrain_forge.model.world import World

FORMAT = 5
MAX_JSON = 2**30
"""Bytes of a world's JSON."""


def save_world(world: World, directory: Path) -> list[Path]:
    """Write `directory`/world/world.json and arrays.npz; returns both."""
    folder = directory / "world"
    folder.mkdir(parents=True, exist_ok=True)
    arrays: dict[str, NDArray[Any]] = {}
    # A custom rover is the site's and the world's; its meshes are stored once.
    shared = world.site.custom_rover == world.rover
    if shared:
        world = world.replace(site=world.site.replace(custom_rover=None))
    plain = {"format": FORMAT, "shared_rover": shared, "world": to_plain(world, arrays, "world")}
    text, binary = folder / "world.json", folder / "arrays.npz"
    text.write_text(json.dumps(plain, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    np.savez(binary, allow_pickle=False, **arrays)  # type: ignore[arg-type]
    return [text, binary]


def load_world(directory: Path) -> World:
    """Read what `save_world` wrote."""
    import terrain_forge.model.route  # noqa: F401  (registers Route among the records)

    sensor_kinds()  # registers them too

    text = directory / "world" / "world.json"
    try:
        plain = json.loads(read_text(text, text.name, most=MAX_JSON))
        if plain.get("format") != FORMAT:
            found = plain.get("format")
            raise OutputError(f"{text}: world format {found!r}, this version reads {FORMAT}")
        arrays = _read_arrays(text.with_name("arrays.npz"))
        world: World = from_plain(plain["world"], arrays)
        if plain["shared_rover"]:
            world = world.replace(site=world.site.replace(custom_rover=world.rover))
        world = world.replace(site=world.site.with_current_keys(text))
    except OutputError:
        raise
    except Exception as error:  # a record's own checks may stumble over whatever stands there
        why = " ".join(str(error).split()) or type(error).__name__
        message = f"{directory}: holds no readable terrain-forge world ({why})"
        raise OutputError(message) from error
    return world


def _read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """The arrays of an npz, whose bytes are all there: it is stored as it is, not compressed.

    Raises:
        DataError, ValueError, BadZipFile: if an array claims more than the file holds.
    """
    require_file(path, path.name)
    with ZipFile(path) as archive:
        for one in archive.infolist():
            if one.compress_type != ZIP_STORED or one.file_size != one.compress_size:
                raise ValueError(f"{one.filename} of {path.name} is compressed")
            with archive.open(one) as file:
                readers = {(1, 0): read_array_header_1_0, (2, 0): read_array_header_2_0}
                shape, _, kind = readers[read_magic(file)](file)
                if one.file_size - file.tell() != math.prod(shape) * kind.itemsize:
                    raise ValueError(f"{one.filename} of {path.name} is not of the size it says")
        if sum(one.file_size for one in archive.infolist()) > path.stat().st_size:
            raise ValueError(f"{path.name} holds the same bytes twice")
    with np.load(path, allow_pickle=False) as arrays:
        return {name: arrays[name] for name in arrays.files}
