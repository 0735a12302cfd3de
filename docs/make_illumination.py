"""Makes the pictures of docs/illumination.md: `python docs/make_illumination.py`."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

import terrain_forge as tf
from terrain_forge.illumination import Source, Wish, illuminate
from terrain_forge.making import plan
from terrain_forge.model import MARS
from terrain_forge.scene import open_scene, pinhole_camera, render_preview, take_picture
from terrain_forge.writers import write_png

ROOT = Path(__file__).parents[1]
OUT = ROOT / "docs" / "images"
_SKIES = ((40.0, 0.5), (40.0, 1.5), (8.0, 0.5), (4.0, 0.5))
"""Elevation of the Sun [degrees], optical depth."""


def skies() -> None:
    """The sky towards the Sun, a low one through a long lens, and away from it."""
    file = tf.load_recipe(ROOT / "recipes" / "hello.yaml")
    world = tf.realise(plan(file.recipe, folder=file.folder), settled=False)
    eye = np.array([0.0, 0.0, float(world.ground.height_at(0.0, 0.0)) + 1.8])
    rows = []
    with open_scene(world) as scene:
        for elevation, tau in _SKIES:
            light = world.lighting.replace(
                sun_azimuth=np.radians(250.0),
                sun_elevation=np.radians(elevation),
                dust=MARS.dust and MARS.dust.replace(tau=tau),
            )
            views = [
                take_picture(
                    scene,
                    pinhole_camera(
                        position=eye, yaw=np.radians(90.0 - azimuth), pitch=-0.15,
                        field_of_view=0.4 if narrow else 1.3, width=480, height=220,
                    ),
                    light,
                )
                for azimuth, narrow in ((250.0, elevation < 10.0), (70.0, False))
            ]  # fmt: skip
            rows.append(np.concatenate(views, axis=1))
    write_png(OUT / "mars_skies.png", np.concatenate(rows))


def pole() -> None:
    """The polar recipe: its preview, its hours of sunlight, some of its shadows."""
    file = tf.load_recipe(ROOT / "recipes" / "moon_pole.yaml")
    site = plan(file.recipe, folder=file.folder)
    write_png(OUT / "moon_pole.png", render_preview(tf.realise(site), width=960, height=540))
    dtm = file.recipe.dtm
    assert isinstance(dtm, tf.RasterDtm)
    with tempfile.TemporaryDirectory() as folder:
        wish = Wish(size=(1000.0, 900.0), spacing=10.0)
        illuminate(site, Source(dtm=dtm, folder=file.folder), Path(folder), wish)
        with Image.open(Path(folder) / "sunlight_hours.png") as hours:
            sheet = [hours.convert("RGB")]
        with Image.open(Path(folder) / "shadows.webp") as film:
            for frame in (4, 20):
                film.seek(frame)
                sheet.append(film.convert("RGB"))
        write_png(OUT / "pole_light.png", np.concatenate([np.asarray(s) for s in sheet], axis=1))


if __name__ == "__main__":
    skies()
    pole()
