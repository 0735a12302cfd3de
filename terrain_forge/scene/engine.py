"""Which engine casts the rays."""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Sequence
from functools import cache
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import TerrainForgeError
from terrain_forge.scene.embree import EmbreeScene, load_library
from terrain_forge.scene.tracer import TracerScene, register

VARIABLE = "TERRAIN_FORGE_RAYS"
"""Environment variable that names the ray engine: `embree` or `own`."""


class EngineScene(Protocol):
    """Geometry that rays can be cast at; `EmbreeScene` says what each method does."""

    @property
    def handle(self) -> int: ...  # noqa: D102
    def add_grid(self, vertices: NDArray[np.float32], *, often: bool = False) -> None: ...  # noqa: D102
    def add_triangles(  # noqa: D102
        self, vertices: NDArray[np.floating], faces: NDArray[np.int32]
    ) -> None: ...
    def add_instances(  # noqa: D102
        self,
        scenes: Sequence[Any],
        *,
        which: NDArray[np.int32],
        transforms: NDArray[np.float32],
    ) -> None: ...
    def commit(self) -> None: ...  # noqa: D102
    def release(self) -> None: ...  # noqa: D102


_ENGINES: dict[str, type[EngineScene]] = {"embree": EmbreeScene, "own": TracerScene}


def engine_name() -> str:
    """Name of the ray engine: Embree, or our own on machines that embreex has no wheel for.

    Raises:
        TerrainForgeError: if `TERRAIN_FORGE_RAYS` names an unknown one.
    """
    named = os.environ.get(VARIABLE)
    if not named:
        wheel = sys.platform == "darwin" or platform.machine().lower() in {"x86_64", "amd64"}
        return "embree" if wheel else "own"
    if named not in _ENGINES:
        raise TerrainForgeError(
            f"{VARIABLE}: unknown ray engine {named!r}, allowed: {', '.join(_ENGINES)}"
        )
    return named


@cache
def _engine() -> type[EngineScene]:
    """The engine of this process, whatever the variable says later."""
    name = engine_name()
    if name == "own":
        register()
    return _ENGINES[name]


def before_compiling() -> None:
    """Let the compiler find the calls of the engine that is in use."""
    if _engine() is EmbreeScene:
        load_library()


def empty_scene() -> EngineScene:
    """A scene of the engine that is in use, without geometry.

    Raises:
        TerrainForgeError: where Embree is in use and missing or of another version.
    """
    return _engine()()
