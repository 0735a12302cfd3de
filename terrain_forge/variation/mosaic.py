"""What the worlds of a scene look like: colours, materials and populations of all of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import astuple
from typing import Any

import numpy as np

from terrain_forge.base import OutputError
from terrain_forge.model import Appearance, GroundDetail, GroundMaterial, RockField, World

_MOST = 256


class Mosaic:
    """Looks of a scene that is put together of worlds; what is alike in them is there once."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        """Begin a scene of so many rows and columns of nodes."""
        self._rgb = np.zeros((*shape, 3), np.uint8)
        self._material = np.zeros(shape, np.uint8)
        self._drift = np.zeros(shape, np.uint8)
        self._materials: dict[Any, GroundMaterial] = {}
        self._rocks: dict[tuple[str, tuple[int, ...]], str] = {}
        self._unplaced: list[int] = []

    def add(self, world: World, place: tuple[slice, slice], margin: int) -> RockField:
        """Lay a world's looks at some nodes, its edges over a margin of nodes around it.

        Returns its rocks, each of its population of the scene.

        Raises:
            OutputError: if the scene has more materials than a raster of classes holds.
        """
        looks = world.appearance
        ground = np.array([self._class_of(one) for one in looks.materials] or [0], np.uint8)
        classes = (
            np.zeros(world.ground.shape, np.uint8) if looks.material is None else looks.material
        )
        self._material[place] = np.pad(ground[classes], margin, mode="edge")
        if looks.drift is not None:
            self._drift[place] = np.pad(looks.drift, margin, mode="edge")
        edges = ((margin, margin), (margin, margin), (0, 0))
        self._rgb[place] = np.pad(looks.ground_rgb, edges, mode="edge")
        numbers = [
            self._population_of(name, tuple(rgb))
            for name, rgb in zip(world.field.populations, looks.rock_rgb.tolist(), strict=True)
        ]
        for number, missing in zip(numbers, world.unplaced, strict=True):
            self._unplaced[number] += missing
        mapped = np.array(numbers, np.int32)[world.field.population]
        return world.field.replace(population=mapped)

    @property
    def populations(self) -> tuple[str, ...]:
        """Names of the scene's populations."""
        return tuple(self._rocks.values())

    @property
    def unplaced(self) -> tuple[int, ...]:
        """How many rocks of each found no place."""
        return tuple(self._unplaced)

    def appearance(self, detail: GroundDetail | None) -> Appearance:
        """What all of it looks like."""
        rgb = [colour for _, colour in self._rocks]
        return Appearance(
            ground_rgb=self._rgb,
            rock_rgb=np.array(rgb, np.uint8).reshape(-1, 3),
            detail=detail,
            materials=tuple(self._materials.values()),
            material=self._material if len(self._materials) > 1 else None,
            drift=self._drift if self._drift.any() else None,
        )

    def _class_of(self, material: GroundMaterial) -> int:
        key = astuple(material)
        if key not in self._materials:
            if len(self._materials) == _MOST:
                raise OutputError(
                    f"a grid of more than {_MOST} materials: vary fewer of their keys"
                )
            name = _free(material.name, lambda name: name in self._names)
            self._materials[key] = material.replace(name=name)
        return [*self._materials].index(key)

    @property
    def _names(self) -> set[str]:
        return {material.name for material in self._materials.values()}

    def _population_of(self, name: str, rgb: tuple[int, ...]) -> int:
        key = name, rgb
        if key not in self._rocks:
            self._rocks[key] = _free(name, lambda name: name in self._rocks.values())
            self._unplaced.append(0)
        return [*self._rocks].index(key)


def _free(name: str, is_taken: Callable[[str], bool]) -> str:
    """The name, or with the first number behind it that is free."""
    number, free = 1, name
    while is_taken(free):
        number += 1
        free = f"{name}-{number}"
    return free
