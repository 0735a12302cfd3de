"""The film of a world's day: the preview's eye under the moving Sun."""

from __future__ import annotations

import json

import numpy as np
import pytest
from PIL import Image

import terrain_forge as tf
from terrain_forge.illumination import Wish, illuminate
from terrain_forge.making import light_at
from terrain_forge.scene import render_in_lights, render_preview
from terrain_forge.sky import read_time
from tests.helpers.rasters import rough, write_raster

RECIPE = """
name: day
body: mars
dtm: {source: dtm.tif, size_m: [16, 12], noise: keep}
terrain: {spacing_m: 0.5}
sun: {time: 2031-02-18, ltst: "09:00"}
exports: []
"""


@pytest.fixture(scope="module")
def world(tmp_path_factory) -> tf.World:
    folder = tmp_path_factory.mktemp("day")
    write_raster(folder, rough((80, 90)))
    (folder / "day.yaml").write_text(RECIPE)
    return tf.realise(tf.plan(folder / "day.yaml"))


def test_it_has_a_frame_for_each_moment_of_day(world, tmp_path):
    out, wish = tmp_path / "light", Wish(azimuths=8, step="3h")
    lines = illuminate(world.site, None, out, wish, world=world)
    assert "day.webp, what the preview's eye sees" in lines
    moments = json.loads((out / "illumination.json").read_text())["moments"]
    day = [one for one in moments if one["sun_elevation_deg"] > 0.2]
    assert 4 <= len(day) < len(moments)
    with Image.open(out / "day.webp") as film:
        assert film.n_frames == len(day)
        film.seek(1)
        shown = np.asarray(film.convert("RGB"), np.float64)[:-16]
    light = light_at(world.site, read_time(day[1]["time"]))
    (frame,) = render_in_lights(world, [light], width=shown.shape[1], height=len(shown) + 16)
    assert np.abs(shown - frame[:-16]).mean() < 4.0


def test_lights_change_the_shades_and_not_the_view(world):
    low = world.lighting.replace(sun_azimuth=world.lighting.sun_azimuth + np.pi)
    size = {"width": 64, "height": 36}
    here, there = render_in_lights(world, [world.lighting, low], **size)
    assert np.array_equal(here, render_preview(world, **size))
    assert np.abs(here.astype(int) - there).mean() > 1.0
