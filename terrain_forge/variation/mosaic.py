"""What the worlds of a scene look like: colours, materials and populations of all of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable
from dataclasses import asdict
from itertools import count
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import OutputError
from terrain_forge.model import Appearance, GroundDetail, GroundMaterial, World

_MOST = 256
_Thing = TypeVar("_Thing", bound=Hashable)


class Mosaic:
    """Looks of a scene that is put together of worlds; what is alike in them is there once."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        """Begin a scene of so many rows and columns of nodes."""
        self._rgb = np.zeros((*shape, 3), np.uint8)
        self._material = np.zeros(shape, np.uint8)
        self._drift = np.zeros(shape, np.uint8)
        self._materials: dict[tuple[tuple[str, Any], ...], str] = {}
        self._rocks: dict[tuple[str, tuple[int, ...]], str] = {}
        self._unplaced: Counter[int] = Counter()

    def add(self, world: World, place: tuple[slice, slice], margin: int) -> NDArray[np.int32]:
        """Lay a world's looks at some nodes, its edges over a margin of nodes around it.

        Returns for each of its populations which one of the scene it is.

        Raises:
            OutputError: if the scene has more materials than a raster of classes holds.
        """
        looks, edges = world.appearance, ((margin, margin), (margin, margin), (0, 0))
        ground = [_number(self._materials, (*asdict(m).items(),), m.name) for m in looks.materials]
        if len(self._materials) > _MOST:
            raise OutputError(f"a grid of more than {_MOST} materials: vary fewer of their keys")
        nodes = np.zeros(world.ground.shape, np.uint8) if looks.material is None else looks.material
        self._material[place] = np.pad(np.array(ground or [0])[nodes], margin, mode="edge")
        if looks.drift is not None:
            self._drift[place] = np.pad(looks.drift, margin, mode="edge")
        self._rgb[place] = np.pad(looks.ground_rgb, edges, mode="edge")
        numbers = [
            _number(self._rocks, (name, tuple(rgb)), name)
            for name, rgb in zip(world.field.populations, looks.rock_rgb.tolist(), strict=True)
        ]
        self._unplaced.update(dict(zip(numbers, world.unplaced, strict=True)))
        return np.array(numbers, np.int32)

    @property
    def populations(self) -> tuple[str, ...]:
        """Names of the scene's populations."""
        return tuple(self._rocks.values())

    @property
    def unplaced(self) -> tuple[int, ...]:
        """How many rocks of each found no place."""
        return tuple(self._unplaced[number] for number in range(len(self._rocks)))

    def appearance(self, detail: GroundDetail | None) -> Appearance:
        """What all of it looks like."""
        named = [{**dict(told), "name": name} for told, name in self._materials.items()]
        return Appearance(
            ground_rgb=self._rgb,
            rock_rgb=np.array([rgb for _, rgb in self._rocks], np.uint8).reshape(-1, 3),
            detail=detail,
            materials=tuple(GroundMaterial(**told) for told in named),
            material=self._material if len(named) > 1 else None,
            drift=self._drift if self._drift.any() else None,
        )


def _number(known: dict[_Thing, str], thing: _Thing, name: str) -> int:
    """The number of a thing among those known, with its name, or the first free one behind it."""
    if thing not in known:
        names = (name if n == 1 else f"{name}-{n}" for n in count(1))
        known[thing] = next(one for one in names if one not in known.values())
    return [*known].index(thing)
