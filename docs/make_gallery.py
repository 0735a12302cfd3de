"""Makes docs/gallery: four sites from above, by their slopes, and as a rover sees them.

`python docs/make_gallery.py [NAME …]`
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from terrain_forge.making import plan
from terrain_forge.model import Heightfield, World
from terrain_forge.pipeline import realise
from terrain_forge.scene import render_preview

HERE = Path(__file__).parent
GALLERY = HERE / "gallery"
SIDE, VIEW = 600, (1024, 576)
COLOURS = 176
STEEPEST_DEG = 30.0
SUN_DEG = 20.0
_MAP = np.array(  # magma, by eye: level ground is dark
    [(0, 0, 4), (59, 15, 112), (140, 41, 129), (222, 73, 104), (254, 159, 109), (252, 253, 191)]
)


def main() -> None:
    """Write the pictures of all recipes in the gallery, or of some."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", nargs="*", help="sites to draw; all without")
    wanted = parser.parse_args().name or sorted(p.stem for p in GALLERY.glob("*.yaml"))
    for name in wanted:
        world = realise(plan(GALLERY / f"{name}.yaml"))
        for kind, picture in pictures(world).items():
            save(picture, GALLERY / f"{name}_{kind}.png")


def pictures(world: World) -> dict[str, NDArray[np.uint8]]:
    """Hillshade, slope map and view of a world."""
    ground = world.ground
    return {
        "hillshade": hillshade(ground, world.lighting.sun_azimuth),
        "slope": slope_map(ground),
        "view": render_preview(world, width=VIEW[0], height=VIEW[1]),
    }


def gradient(ground: Heightfield) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rise per metre east and north."""
    north, east = np.gradient(ground.elevation.astype(np.float64), ground.spacing)
    return east, north


def hillshade(ground: Heightfield, azimuth: float) -> NDArray[np.uint8]:
    """The ground lit from the Sun's azimuth [rad], `SUN_DEG` high, without shadows; north up."""
    east, north = gradient(ground)
    rise = np.tan(np.radians(SUN_DEG))
    light = rise - np.sin(azimuth) * east - np.cos(azimuth) * north
    light *= np.cos(np.radians(SUN_DEG)) / np.sqrt(1.0 + east**2 + north**2)
    grey = np.clip(255.0 * light / 0.75, 0.0, 255.0).astype(np.uint8)
    return shrunk(np.repeat(grey[::-1, :, None], 3, axis=2))


def slope_map(ground: Heightfield) -> NDArray[np.uint8]:
    """Slopes from level (dark) to `STEEPEST_DEG` (bright); north up."""
    angle = np.degrees(np.arctan(np.hypot(*gradient(ground))))
    place = np.clip(angle / STEEPEST_DEG, 0.0, 1.0) * (len(_MAP) - 1)
    colours = [np.interp(place, range(len(_MAP)), channel) for channel in _MAP.T]
    return shrunk(np.stack(colours, axis=2)[::-1].astype(np.uint8))


def shrunk(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A square picture of `SIDE` pixels, averaged."""
    return np.asarray(Image.fromarray(image).resize((SIDE, SIDE), Image.Resampling.BOX))


def save(picture: NDArray[np.uint8], path: Path) -> None:
    """A PNG of few colours, a third as large as with all."""
    image = Image.fromarray(picture).quantize(COLOURS, dither=Image.Dither.FLOYDSTEINBERG)
    image.save(path, optimize=True)


if __name__ == "__main__":
    main()
