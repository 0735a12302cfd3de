"""Makes docs/images/grounds.jpg: four sites, each seen by a rover, as a hillshade and by its slope.

`python docs/make_ground_pictures.py`
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from terrain_forge.making import plan
from terrain_forge.model import Heightfield
from terrain_forge.pipeline import realise
from terrain_forge.scene import render_preview

HERE = Path(__file__).parent
RECIPES = HERE.parent / "recipes"
SITES = ("gale_long", "mars_ripples", "moon_mare", "moon_craters")
SIDE = 360
STEEPEST_DEG = 25.0


def main() -> None:
    """Write the picture."""
    rows = [_site(RECIPES / f"{name}.yaml") for name in SITES]
    Image.fromarray(np.concatenate(rows)).save(HERE / "images" / "grounds.jpg", quality=88)


def _site(path: Path) -> NDArray[np.uint8]:
    world = realise(plan(path))
    view = render_preview(world, width=2 * SIDE, height=SIDE)
    maps = [_square(_hillshade(world.ground)), _square(_slope(world.ground))]
    return np.concatenate([view, *maps], axis=1)


def _gradient(ground: Heightfield) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    north, east = np.gradient(ground.elevation.astype(np.float64), ground.spacing)
    return east, north


def _hillshade(ground: Heightfield) -> NDArray[np.uint8]:
    """Light from the north-west, 20° high, heights twice what they are."""
    east, north = (2.0 * part for part in _gradient(ground))
    azimuth, elevation = np.radians(315.0), np.radians(20.0)
    sun = np.sin(azimuth), np.cos(azimuth), np.tan(elevation)
    light = (sun[2] - sun[0] * east - sun[1] * north) / np.sqrt(1.0 + east**2 + north**2)
    return np.clip(255 * light * np.cos(elevation) * 1.3, 0, 255).astype(np.uint8)


def _slope(ground: Heightfield) -> NDArray[np.uint8]:
    """Black where level, white from `STEEPEST_DEG` on."""
    angle = np.degrees(np.arctan(np.hypot(*_gradient(ground))))
    return np.clip(255 * angle / STEEPEST_DEG, 0, 255).astype(np.uint8)


def _square(grey: NDArray[np.uint8]) -> NDArray[np.uint8]:
    image = Image.fromarray(grey[::-1]).convert("RGB").resize((SIDE, SIDE), Image.Resampling.BOX)
    return np.asarray(image)


if __name__ == "__main__":
    main()
