"""Saving and loading a World: its arrays in one npz, everything else in one json beside it."""

from __future__ import annotations

import json
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import OutputError, from_plain, to_plain
from terrain_forge.model.sensor import sensor_kinds

if TYPE_CHECKING:
    from terrain_forge.model.world import World

FORMAT = 5


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
        plain = json.loads(text.read_text(encoding="utf-8"))
        if plain.get("format") != FORMAT:
            found = plain.get("format")
            raise OutputError(f"{text}: world format {found!r}, this version reads {FORMAT}")
        with np.load(text.with_name("arrays.npz"), allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        world: World = from_plain(plain["world"], arrays)
        if plain["shared_rover"]:
            world = world.replace(site=world.site.replace(custom_rover=world.rover))
        world = world.replace(site=world.site.with_current_keys(text))
    except OutputError:
        raise
    except (OSError, ValueError, LookupError, TypeError, AttributeError, EOFError) as error:
        raise _unreadable(directory, error) from None
    except (BadZipFile, zlib.error) as error:
        raise _unreadable(directory, error) from None
    return world


def _unreadable(directory: Path, error: Exception) -> OutputError:
    why = " ".join(str(error).split()) or type(error).__name__
    return OutputError(f"{directory}: holds no readable terrain-forge world ({why})")
