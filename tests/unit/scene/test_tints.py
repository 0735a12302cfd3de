"""Dust and soil on rocks: by the body's air, and by the ground that a picture shows."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from terrain_forge.base import linear_from_srgb
from terrain_forge.making import make_horizon, plan
from terrain_forge.model import MOON, Window
from terrain_forge.pipeline import realise
from terrain_forge.rocks import Golombek, LibrarySpec, PopulationSpec, RocksSpec
from terrain_forge.scene import dust_share, soil_colour, soil_of
from terrain_forge.terrain import AppearanceSpec, OrthoimageSpec
from tests.helpers.recipes import flat


def test_a_clear_day_takes_no_dust_off_rocks(small_world):
    up = np.array([1.0])
    clear = small_world.replace(
        lighting=small_world.lighting.replace(dust=None, sky_rgb=(0.0, 0.0, 0.0))
    )
    assert dust_share(clear, up) == dust_share(small_world, up)
    moon = small_world.replace(site=small_world.site.replace(body=MOON))
    assert dust_share(moon, up) < dust_share(small_world, up)


@pytest.fixture(scope="module")
def coloured(tmp_path_factory):
    """A site whose picture is green in the west and blue in the east."""
    folder = tmp_path_factory.mktemp("ortho")
    values = np.zeros((40, 60, 3), np.uint8)
    values[:, :30], values[:, 30:] = (40, 200, 60), (40, 60, 200)
    Image.fromarray(values).save(folder / "ground.png")
    appearance = AppearanceSpec(variation=0.0, orthoimage=OrthoimageSpec(image="ground.png"))
    law = Golombek(k=0.1)
    stones = PopulationSpec(name="r", size_frequency=law, diameter_m=(0.3, 1.0))
    rocks = RocksSpec(library=LibrarySpec(shapes=1), populations=(stones,))
    terrain = {"appearance": appearance}
    return plan(flat((30.0, 20.0), 0.5, terrain=terrain, rocks=rocks, exports=()), folder=folder)


def test_soil_on_rocks_is_what_the_picture_shows(coloured):
    world = realise(coloured)
    shown = linear_from_srgb(world.appearance.ground_rgb / 255.0).mean(axis=(0, 1))
    assert soil_colour(world) == pytest.approx(shown, rel=0.03)
    west = realise(coloured, Window(column=0, row=0, columns=20, rows=20))
    assert np.array_equal(soil_colour(west), soil_colour(world)), "tiles agree"
    horizon = world.horizon
    stones = horizon.rgb[horizon.ground_vertices :].reshape(-1, 3).astype(float)
    brown = coloured.replace(orthoimage=None)
    plain = make_horizon(brown, world.ground, world.appearance, world.library)
    bare = plain.rgb[plain.ground_vertices :].reshape(-1, 3).astype(float)
    away = np.abs(linear_from_srgb(stones / 255.0) - soil_of(coloured, world.appearance))
    assert away.mean() < np.abs(linear_from_srgb(bare / 255.0) - shown).mean()
