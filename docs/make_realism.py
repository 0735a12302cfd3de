"""Makes docs/images/realism.jpg and the table of docs/realism.md: ten views, figures of five.

    python docs/make_realism.py                          # ours
    python docs/make_realism.py PHOTOGRAPHS OUT.jpg      # theirs too; side by side into OUT.jpg

PHOTOGRAPHS is a folder with those of `REAL`, NASA's, which this project does not carry.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from dataclasses import astuple
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

import terrain_forge as tf
from terrain_forge.base import linear_from_srgb, srgb_from_linear
from terrain_forge.datasets import open_recording
from terrain_forge.making import plan
from terrain_forge.model import sensor_kinds
from terrain_forge.pipeline import realise
from terrain_forge.recipe import load_recipe
from terrain_forge.report import picture_statistics
from terrain_forge.rocks import with_pebbles
from terrain_forge.sensors import ImageStatistics, image_statistics

HERE = Path(__file__).parent
RECIPES = ("gale_short", "gale_long", "mars_ripples", "moon_mare", "moon_craters")
NEAR_RECIPES = ("gale_short", "mars_soils", "mars_ripples", "moon_mare", "moon_craters")
MAST, NEAR = (1.5, 18.0), (1.0, 30.0)
"""Height above base_link [m] and pitch [deg] of a camera on a mast, and near the ground."""
PEBBLES = 0.01
SIDE = 360


class Real(NamedTuple):
    """A photograph, and the part of it that shows ground alone."""

    name: str
    file: str
    part: tuple[float, float, float, float]
    """First and last row, first and last column, as shares."""
    linear: bool
    """Whether its values are intensities; those of JPEGs and scans are taken for sRGB's."""


REAL = (
    Real("Opportunity Navcam, sol 4087, gravel to a hill",
         "mer1_1N491020834ILFCNY9P0706L0M1.png", (0.2, 0.9, 0.03, 0.97), True),
    Real("Opportunity Navcam, sol 4087, gravel and slabs",
         "mer1_1N491020993ILFCNY9P0706L0M1.png", (0.04, 0.5, 0.03, 0.97), True),
    Real("Opportunity Navcam, sol 4709, soft ripples",
         "mer1_1N546228391RADCYELP0684L0M1.png", (0.28, 0.74, 0.03, 0.97), True),
    Real("Curiosity Navcam, sol 1431, scree",
         "msl_NLB_524534514EDR_F0562034NCAM00280M.jpg", (0.72, 0.98, 0.03, 0.97), False),
    Real("Curiosity Mastcam, half-buried rocks",
         "msl_mastcam_img_332_560.png", (0.1, 1.0, 0.0, 1.0), False),
    Real("Apollo 17, soil beside a boulder",
         "a17_AS17-138-21033_1170.png", (0.45, 0.97, 0.54, 0.98), False),
    Real("Apollo 17, clods",
         "a17_AS17-138-21035_1170.png", (0.62, 0.86, 0.02, 0.98), False),
)  # fmt: skip


def main() -> None:
    """Print the table, write the pictures."""
    ours = [_recorded(name, MAST) for name in RECIPES]
    near = [_recorded(name, NEAR, pebbles=PEBBLES)[1] for name in NEAR_RECIPES]
    lines = [_line(name, found) for name, (found, _) in zip(RECIPES, ours, strict=True)]
    _write(HERE / "images" / "realism.jpg", [picture for _, picture in ours], near)
    if len(sys.argv) > 2:
        real = [_photographed(Path(sys.argv[1]), one) for one in REAL]
        lines += [_line(one.name, found) for one, (found, _) in zip(REAL, real, strict=True)]
        rows = [[p for _, p in ours], near, [p for _, p in real]]
        wide = max(map(len, rows))
        for row in rows:
            row += [np.zeros_like(row[0])] * (wide - len(row))
        _write(Path(sys.argv[2]), *rows)
    sys.stdout.write("\n".join(lines) + "\n")


def _recorded(
    name: str, view: tuple[float, float], *, pebbles: float = 0.0
) -> tuple[ImageStatistics, NDArray[np.uint8]]:
    """Figures of a camera's frames, and one of them; with pebbles from a diameter on [m]."""
    height, pitch = view
    file = load_recipe(HERE.parent / "recipes" / f"{name}.yaml")
    world = realise(plan(file.recipe, folder=file.folder))
    camera = sensor_kinds()["camera"]
    preset = {**camera.PRESETS["navcam"], "rate_hz": 0.02, "exposure": {"kind": "auto", "lag_s": 0}}
    from pydantic import TypeAdapter

    mast = TypeAdapter(camera).validate_python(
        {**preset, "name": "mast", "position_m": (0.6, 0.0, height), "rpy_deg": (0, pitch, 0),
         "channels": ("class",)}
    )  # fmt: skip
    world = world.replace(rover=world.rover.replace(sensors=(mast,)))
    if pebbles:
        world = with_pebbles(world, smallest=pebbles)
    with TemporaryDirectory() as folder:
        tf.record(world, folder, end=400.0)
        recording = open_recording(folder)
        eye = recording.cameras[0]
        found = picture_statistics(recording, eye)
        middle = eye.image(len(eye.stamps) // 2) / 4095.0
    return found, _shown(middle)


def _photographed(folder: Path, one: Real) -> tuple[ImageStatistics, NDArray[np.uint8]]:
    values = np.asarray(Image.open(folder / one.file), np.float64)
    grey = values if values.ndim == 2 else values[..., :3].mean(axis=2)
    linear = grey if one.linear else linear_from_srgb(grey / 255.0)
    (top, bottom), (left, right) = (
        (round(first * size), round(last * size))
        for first, last, size in zip(one.part[::2], one.part[1::2], grey.shape, strict=True)
    )
    return image_statistics(linear[top:bottom, left:right]), _shown(linear)


def _shown(linear: NDArray[np.float64]) -> NDArray[np.uint8]:
    low, high = np.percentile(linear, (0.2, 99.8))
    scaled = srgb_from_linear(np.clip((linear - low) / (high - low), 0.0, 1.0))
    image = Image.fromarray((255 * scaled).astype(np.uint8))
    side = min(image.size)
    square = image.crop((0, image.height - side, side, image.height))
    return np.asarray(square.resize((SIDE, SIDE), Image.Resampling.BOX))


def _write(path: Path, *rows: Iterable[NDArray[np.uint8]]) -> None:
    picture = np.concatenate([np.concatenate([*row], axis=1) for row in rows])
    Image.fromarray(picture).save(path, quality=84)


def _line(name: str, found: ImageStatistics) -> str:
    slope, low, high, kurtosis, corners, dark = astuple(found)
    slopes = f"{slope:.2f} ({low:.2f} / {high:.2f})".replace("-", "\u2212")
    return f"| {name} | {slopes} | {kurtosis:.1f} | {corners:.1f} | {dark:.1%} |"


if __name__ == "__main__":
    main()
