"""Rocks that the ground does not hold are left out, and told of."""

from __future__ import annotations

import numpy as np
import pytest

import terrain_forge as tf
from terrain_forge.model import Window
from terrain_forge.rocks import DAYLIGHT
from terrain_forge.truth.merging import count_rocks, merge_counts
from terrain_forge.truth.rasters import rock_rasters
from terrain_forge.truth.size_frequency import size_frequency
from terrain_forge.validation.checks.rocks import foot_and_top
from tests.helpers import rasters

LISTED = (-4.0, 1.0)
"""Where a listed rock lies on the wall."""


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Level ground, and a craggy wall that rises 14 m over 8 m in its middle."""
    folder = tmp_path_factory.mktemp("wall")
    east = np.arange(80.0) - 39.5
    rise = 14.0 * np.clip(0.5 + east / 8.0, 0.0, 1.0)
    crags = np.random.default_rng(5).normal(0.0, 1.0, (80, 80)) * (abs(east) < 6.0)
    rasters.write_raster(folder, (rise + crags).astype(np.float32))
    (folder / "rocks.csv").write_text("x_m,y_m,diameter_m\n{},{},0.8\n".format(*LISTED))
    recipe = tf.Recipe(
        name="wall",
        body="mars",
        dtm=tf.RasterDtm(source="dtm.tif", size_m=(24.0, 24.0), noise="keep", level="none"),
        terrain=tf.TerrainSpec(spacing_m=0.1),
        horizon=tf.HorizonSpec(reach_m=0),
        rocks=tf.RocksSpec(
            library=tf.LibrarySpec(shapes=4),
            lists=(tf.RockListSpec(name="mine", file="rocks.csv"),),
            populations=(
                tf.PopulationSpec(
                    name="many",
                    size_frequency=tf.Golombek(k=0.1),
                    diameter_m=(0.15, 1.0),
                ),
            ),
        ),
    )
    return tf.plan(recipe, folder=folder)


@pytest.fixture(scope="module")
def world(site):
    return tf.realise(site)


def daylight(world):
    """How far each rock's foot stands out of the ground, over its diameter."""
    feet = np.zeros(len(world.field))
    for number, prototype in enumerate(world.library.prototypes):
        rows = np.flatnonzero(world.field.prototype == number)
        feet[rows], _ = foot_and_top(world.field.select(rows), prototype, world.ground)
    return feet


def test_no_scattered_rock_hangs_on_a_wall(world):
    scattered = world.field.population == 0
    assert (daylight(world)[scattered] <= DAYLIGHT + 1e-9).all()
    on_wall = abs(world.field.position[:, 0]) < 4.0
    assert (scattered & on_wall).sum() > 5, "what finds hold stays"
    assert world.unsupported_number[0] > 5
    assert world.unsupported_number[1] == 0
    assert (~scattered).sum() == 1, "a listed rock stays where the user has it"


def test_what_is_left_out_is_told(world):
    told = size_frequency(world)
    assert told["populations"][0]["unsupported"] == world.unsupported_number[0]
    assert told["together"]["unsupported"] == sum(world.unsupported_number)


@pytest.fixture(scope="module")
def parts(site):
    """The quarters of the site, each made for itself."""
    corners = ((0, 0), (120, 0), (0, 120), (120, 120))
    return [tf.realise(site, Window(column=c, row=r, columns=120, rows=120)) for c, r in corners]


def test_parts_leave_out_what_the_whole_does(site, world, parts):
    found = np.concatenate([part.field.id for part in parts])
    assert np.array_equal(np.sort(found), np.sort(world.field.id))
    assert sum(part.unsupported_number[0] for part in parts) == world.unsupported_number[0]
    merged = merge_counts(site, [count_rocks(part, rock_rasters(part)[1]) for part in parts])
    assert merged["populations"][0]["unsupported"] == world.unsupported_number[0]


def test_a_tile_counts_what_is_left_out_in_it_alone(site, world, parts):
    tiles = [tile.world for tile in world.tiles(cells=100)]
    for part in parts:
        window = part.window
        tile = tf.realise(site, site.padded(window, 2.0)).tile(window, number=0).world
        assert tile.unsupported_number == part.unsupported_number
    assert sum(one.unsupported_number[0] for one in tiles) == world.unsupported_number[0]


def test_what_is_left_out_is_kept_with_the_world(world, tmp_path):
    world.save(tmp_path)
    kept = tf.World.load(tmp_path)
    assert np.array_equal(kept.unsupported.id, world.unsupported.id)
    assert not np.isin(kept.unsupported.id, kept.field.id).any()
    edited = tf.add_rock(
        kept, east=-9.0, north=0.0, diameter=0.3, population="new", may_overlap=True
    )
    assert edited.unsupported_number == (*world.unsupported_number, 0)
