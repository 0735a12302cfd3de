"""What the page's sections are made from, and what they are."""

from __future__ import annotations

import json
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from terrain_forge.datasets import Recording, open_recording
from terrain_forge.model import Export, World
from terrain_forge.recording import dataset_folder
from terrain_forge.report.blocks import ANIMATED, Block
from terrain_forge.validation import content_of

MAP_PIXELS = 1024
"""Pixels along the longer side of the picture from above."""

Content = dict[str, Any]
"""What a JSON file says."""


class Section:
    """A headed part of the page. A subclass is a module of report/sections, which finds itself."""

    kind: ClassVar[str]
    """Tells it apart."""
    title: ClassVar[str]
    """Its heading."""
    place: ClassVar[int]
    """Sections stand in the order of their places."""

    @abstractmethod
    def blocks(self, built: Built) -> Sequence[Block]:
        """Its parts, one below the other; none where there is nothing to say."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class Built:
    """A world and its built folder, in which any file may be missing."""

    world: World
    """The world."""
    directory: Path
    """The built folder."""
    exports: tuple[Export, ...] = ()
    """The exports in the folder."""
    above: NDArray[np.uint8] | None = None
    """The picture from above, where it was taken already."""
    dataset: Path | None = None
    """The folder of its recording, where that is not `dataset` of the built folder."""

    def json(self, path: str) -> Content:
        """The content of a JSON file of the folder, empty where it was not written."""
        return content_of(self.directory / path)

    @cached_property
    def validation(self) -> Content:
        """Content of validation/report.json, empty where the world was not validated."""
        return self.json("validation/report.json")

    @cached_property
    def recording(self) -> Recording | None:
        """The recording, where there is one.

        Raises:
            DataError: if it cannot be read.
        """
        place = self.dataset or dataset_folder(self.directory)
        return open_recording(place) if (place / "dataset.json").is_file() else None

    @cached_property
    def recipe(self) -> Content:
        """The recipe as it was resolved."""
        return dict(json.loads(self.world.site.recipe_json))

    def pictures(self, *names: str) -> list[Path]:
        """The validation's pictures whose names begin so, in the order of their names."""
        found = sorted((self.directory / "validation").glob("*"))
        shown = (path for path in found if path.suffix in (".png", *ANIMATED))
        return [path for path in shown if path.stem.startswith(names)]

    @cached_property
    def map(self) -> NDArray[np.uint8]:
        """The world from above without its paths, sRGB, north up, shape [height, width, 3]."""
        return take_map(self.world) if self.above is None else self.above

    @property
    def extent(self) -> tuple[float, float]:
        """How far the ground goes from west to east and from south to north [m]."""
        west, south, east, north = self.world.ground.bounds
        return east - west, north - south


def take_map(world: World) -> NDArray[np.uint8]:
    """The picture from above that the page shows; see `Built.map`."""
    from terrain_forge.scene import render_from_above

    return render_from_above(world, MAP_PIXELS)
