"""The ground that an SDF export holds as a heightmap, read back."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, image_rows
from terrain_forge.model import Check, World, at_most

_ROUNDING = 1e-6
"""Part of the range of heights that float32 and text round away."""


def find_heightmap(folder: Path) -> ElementTree.Element | None:
    """The collision of an SDF export that is a heightmap, if it has one."""
    for model in sorted(folder.glob("models/*/model.sdf")):
        for collision in ElementTree.parse(model).iterfind("model/link/collision"):
            if collision.find("geometry/heightmap") is not None:
                return collision
    return None


def heightmap_checks(
    world: World, folder: Path, collision: ElementTree.Element, at: Array
) -> list[Check]:
    """The samples nearest to points, shape [n, 2] [m], against the ground there.

    A sample may be off by half of a grey level; what lies between samples is a loss of the export.

    Args:
        world: The world.
        folder: Its SDF export.
        collision: The collision that is a heightmap.
        at: The points.
    """
    size = _triple(collision, "geometry/heightmap/size")
    uri = collision.findtext("geometry/heightmap/uri", "")
    pixels, largest = _pixels(folder / "models" / uri.split("//")[1])
    samples = len(pixels)
    if ElementTree.parse(folder / "world.sdf").getroot().get("version") == "1.6":
        # Gazebo Classic spreads the samples over all of the size, and only lifts them.
        spread, centre = size[:2], _triple(collision, "geometry/heightmap/pos") * (0, 0, 1)
    else:
        # gz-physics spreads them over less, and gz-sim hands it no `pos`.
        spread, centre = size[:2] * (samples - 1) / samples, _triple(collision, "pose")
    low = centre[:2] - spread / 2
    index = np.rint((at - low) / spread * (samples - 1)).astype(np.int64)
    places = np.clip(low + index * spread / (samples - 1), *_corners(world))
    quantum = size[2] / largest
    heights = centre[2] + pixels[index[:, 1], index[:, 0]] * quantum
    off = np.abs(heights - world.ground.height_at(places[:, 0], places[:, 1]))
    limit = quantum / 2 + _ROUNDING * size[2]
    note = f"largest difference at {len(at)} samples of the heightmap; half a grey level"
    return [at_most(f"{folder.name}: ground", float(off.max()), limit, unit="m", note=note)]


def _triple(collision: ElementTree.Element, path: str) -> Array:
    """The first three numbers of an element, zeros where there is none."""
    return np.array(collision.findtext(path, "0 0 0").split()[:3], np.float64)


def is_deep(path: Path) -> bool:
    """Whether a heightmap's image has 16 bits."""
    from PIL import Image

    with Image.open(path) as image:
        return image.mode != "L"


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
