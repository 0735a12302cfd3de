"""The ground that an SDF export holds as a heightmap, read back."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from terrain_forge.frames import image_rows
from terrain_forge.validation.check import Check, at_most
from terrain_forge.world import World

Array = NDArray[np.float64]

_ROUNDING = 1e-6
"""Part of the range of heights that float32 and text round away."""


def find_heightmap(folder: Path) -> ElementTree.Element | None:
    """The heightmap that an SDF export collides with, if it has one."""
    for model in sorted(folder.glob("models/*/model.sdf")):
        found = ElementTree.parse(model).find("model/link/collision/geometry/heightmap")
        if found is not None:
            return found
    return None


def heightmap_checks(
    world: World, folder: Path, heightmap: ElementTree.Element, at: Array
) -> list[Check]:
    """The samples nearest to points, shape [n, 2] [m], against the ground there.

    A sample may be off by half of a grey level; what lies between samples is a loss of the export.
    """
    size, centre = (
        np.array(heightmap.findtext(tag, "").split(), np.float64) for tag in ("size", "pos")
    )
    pixels, largest = _pixels(folder / "models" / heightmap.findtext("uri", "").split("//")[1])
    samples = len(pixels)
    version = ElementTree.parse(folder / "world.sdf").getroot().get("version")
    # gz-physics spreads the samples over less than the size, Gazebo Classic over all of it.
    spread = size[:2] if version == "1.6" else size[:2] * (samples - 1) / samples
    low = centre[:2] - spread / 2
    index = np.rint((at - low) / spread * (samples - 1)).astype(np.int64)
    places = np.clip(low + index * spread / (samples - 1), *_corners(world))
    quantum = size[2] / largest
    heights = centre[2] + pixels[index[:, 1], index[:, 0]] * quantum
    off = np.abs(heights - world.ground.height_at(places[:, 0], places[:, 1]))
    limit = quantum / 2 + _ROUNDING * size[2]
    note = f"largest difference at {len(at)} samples of the heightmap; half a grey level"
    return [at_most(f"{folder.name}: ground", float(off.max()), limit, unit="m", note=note)]


def _pixels(path: Path) -> tuple[NDArray[np.float64], int]:
    """Grey levels, rows run north, and the largest that the image's type holds."""
    from PIL import Image

    with Image.open(path) as image:
        levels = np.asarray(image)
    largest = 255 if levels.dtype == np.uint8 else 65535
    return image_rows(levels).astype(np.float64), largest


def _corners(world: World) -> tuple[Array, Array]:
    west, south, east, north = world.ground.bounds
    return np.array([west, south]), np.array([east, north])
