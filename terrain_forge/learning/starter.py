"""A few worlds to learn in where nobody has made any: of our own recipe, made once."""

from __future__ import annotations

import fcntl
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path
from tempfile import gettempdir

from terrain_forge import __version__
from terrain_forge.base import StorageError, cache_folder
from terrain_forge.dtm import FlatDtm
from terrain_forge.recipe import (
    DifficultySpec,
    Recipe,
    TerrainSpec,
    WorldsSpec,
    recipe_json,
)
from terrain_forge.rocks import Golombek, LibrarySpec, PopulationSpec, RocksSpec
from terrain_forge.terrain import Fractal
from terrain_forge.variation import ORDER, name_of, worlds

COUNT = 8
"""Worlds that are made."""


def starter_recipe() -> Recipe:
    """Level ground of Mars, 16 × 16 m, with rocks; difficulty 0 to 1."""
    return Recipe(
        name="drive",
        seed=1,
        body="mars",
        dtm=FlatDtm(size_m=(16.0, 16.0)),
        terrain=TerrainSpec(spacing_m=0.1, layers=(Fractal(),)),
        rocks=RocksSpec(
            library=LibrarySpec(shapes=8),
            populations=(
                PopulationSpec(
                    name="rocks", size_frequency=Golombek(k=0.05), diameter_m=(0.15, 1.0)
                ),
            ),
        ),
        rover="skid4",
        exports={"mjcf": {"timestep_s": 0.004, "visual_min_m": 0.9}},
        worlds=WorldsSpec(count=COUNT, difficulty=DifficultySpec(rock_cover=(0.005, 0.08))),
    )


def starter_worlds() -> Path:
    """The folder of these worlds, which are made where they are missing."""
    home = cache_folder() or Path(gettempdir()) / "terrain-forge"
    recipe = starter_recipe()
    wish = sha256(f"{__version__}\n{recipe_json(recipe)}".encode()).hexdigest()
    out = home / f"drive-{wish[:16]}"
    if not _are_whole(out):
        with _waiting(home / f"{out.name}.lock"):
            if not _are_whole(out):
                worlds(recipe, out)
    return out


@contextmanager
def _waiting(lock: Path) -> Iterator[None]:
    """Whoever comes while another one makes them waits for it.

    Raises:
        StorageError: if the cache cannot be written.
    """
    try:
        lock.parent.mkdir(parents=True, exist_ok=True)
        file = lock.open("ab")
    except OSError as error:
        raise StorageError(f"{lock.parent} cannot be written: {error.strerror}") from error
    with file:
        with suppress(OSError):  # a file system without locks
            fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _are_whole(out: Path) -> bool:
    """Whether all worlds are there; each takes its name when it is whole."""
    return (out / ORDER).is_file() and all((out / name_of(n)).is_dir() for n in range(COUNT))
