"""Sites beyond memory: in tiles by themselves, their rocks numbered by cells."""

from __future__ import annotations

import numpy as np
import pytest

import terrain_forge as tf
from terrain_forge.base import RecipeError
from terrain_forge.model import Window, merge

WIDE = """
name: wide
seed: 3
body: moon
dtm: {kind: flat, size_m: [12000, 12000]}
terrain: {spacing_m: 0.25}
horizon: {reach_m: 0}
rocks:
  library: {shapes: 4}
  populations:
    - {name: some, size_frequency: {kind: golombek, k: 0.004}, diameter_m: [0.6, 2.0]}
    - {name: many, size_frequency: {kind: golombek, k: 0.2}, diameter_m: [0.2, 1.0]}
    - {name: more, size_frequency: {kind: golombek, k: 0.002}, diameter_m: [0.5, 1.0]}
exports: [geotiff]
"""


@pytest.fixture(scope="module")
def wide(tmp_path_factory):
    path = tmp_path_factory.mktemp("wide") / "wide.yaml"
    path.write_text(WIDE)
    return tf.plan(tf.load_recipe(path).recipe)


def test_a_site_beyond_memory_is_in_tiles_by_itself(wide):
    assert wide.recipe.tiles is not None
    with pytest.raises(
        RecipeError, match=r"GB of memory, this machine has .* build it in smaller `tiles`"
    ):
        tf.realise(wide)


def test_windows_of_more_rocks_than_can_be_counted_agree(wide):
    """Ids and places of rocks are those of any window, however far into the site."""
    one, other = (
        tf.realise(wide, Window(column=column, row=31_000, columns=160, rows=120))
        for column in (40_000, 40_080)
    )
    first, second = merge(one.field, one.neighbours), merge(other.field, other.neighbours)
    assert {"some", "many", "more"} == {first.populations[n] for n in np.unique(first.population)}
    assert len(np.unique(first.id)) == len(first)
    assert first.id.max() > 2**26
    assert first.id.min() >= 0
    common = np.isin(one.field.id, second.id)
    east = one.field.position[:, 0] > other.ground.bounds[0]
    assert np.array_equal(common | ~east, np.ones(len(east), np.bool_))
    rows = np.searchsorted(second.id, one.field.id[common])
    assert np.array_equal(second.position[rows], one.field.position[common])


def test_numbers_of_rocks_follow_the_law(wide):
    world = tf.realise(wide, Window(column=100, row=100, columns=400, rows=400))
    for index, population in enumerate(wide.recipe.rocks.populations):
        expected = population.density(*population.diameters) * 100.0**2
        found = np.count_nonzero(world.field.population == index)
        assert abs(found - expected) < 4.5 * expected**0.5 + 3


def test_a_tile_beyond_memory_is_refused(tmp_path):
    path = tmp_path / "wide.yaml"
    path.write_text(WIDE.replace("terrain:", "tiles: {size_m: 6000}\nterrain:"))
    with pytest.raises(RecipeError, match=r"GB of memory, this machine has"):
        tf.plan(tf.load_recipe(path).recipe)
