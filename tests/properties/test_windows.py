"""Any window of any seed is the cut of the whole; the same seed is the same world."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import terrain_forge as tf
from terrain_forge.model import Window
from tests.helpers import worlds
from tests.helpers.recipes import flat

FEW = settings(max_examples=8, deadline=None, derandomize=True, database=None)
seeds = st.sampled_from([0, 3, 2**40 + 1])


@cache
def site(seed, reach=0.0):
    law = tf.Golombek(k=0.1)
    stones = tf.PopulationSpec(name="rocks", size_frequency=law, diameter_m=(0.2, 0.8))
    rocks = tf.RocksSpec(library=tf.LibrarySpec(shapes=2), populations=(stones,))
    terrain = {"layers": (tf.Fractal(), tf.Ripples(wavelength_m=1.2))}
    more = {"seed": seed, "horizon": tf.HorizonSpec(reach_m=reach), "rocks": rocks, "exports": ()}
    return tf.plan(flat((12, 9), 0.25, terrain=terrain, **more))


@pytest.mark.parametrize(
    ("column", "row", "columns", "rows"),
    [(-1, 0, 4, 4), (48, 0, 1, 1), (0, 30, 4, 7), (0, 0, 49, 1)],
)
def test_a_window_outside_of_the_site_is_refused(column, row, columns, rows):
    window = Window(column=column, row=row, columns=columns, rows=rows)
    with pytest.raises(tf.DataError, match=r"has columns 0 to 48 and rows 0 to 36$"):
        tf.realise(site(0), window)


@cache
def whole(seed):
    return tf.realise(site(seed))


@st.composite
def windows(draw):
    column, row = draw(st.integers(0, 46)), draw(st.integers(0, 34))
    columns, rows = draw(st.integers(1, 48 - column)), draw(st.integers(1, 36 - row))
    return Window(column=column, row=row, columns=columns, rows=rows)


@FEW
@given(seed=seeds, window=windows())
def test_a_window_is_the_cut(seed, window):
    part = tf.realise(site(seed), window)
    world = whole(seed)
    cut = window.nodes_in(world.window)
    assert part.ground.elevation.tobytes() == world.ground.elevation[cut].tobytes()
    assert np.array_equal(part.appearance.ground_rgb, world.appearance.ground_rgb[cut])
    west, south, east, north = part.ground.bounds
    x, y = world.field.position[:, 0], world.field.position[:, 1]
    assert part.field == world.field.select((x >= west) & (x < east) & (y >= south) & (y < north))


@settings(FEW, max_examples=2)
@given(seed=seeds)
def test_the_same_seed_is_the_same_world(seed):
    one, same = (tf.realise(site(seed, None)) for _ in range(2))
    assert one.horizon is not None
    assert one == same


@settings(FEW, max_examples=40)
@given(window=windows(), share=st.tuples(st.floats(0, 1), st.floats(0, 1)))
def test_a_cut_ground_has_the_heights_of_the_whole(window, share):
    ground = worlds.ground()
    part = ground.cut(
        column=window.column, row=window.row, columns=window.columns, rows=window.rows
    )
    assert part.elevation.shape == (window.rows + 1, window.columns + 1)
    west, south, east, north = part.bounds
    place = west + share[0] * (east - west), south + share[1] * (north - south)
    np.testing.assert_allclose(part.height_at(*place), ground.height_at(*place), atol=1e-9)


def test_heights_outside_of_the_ground_are_refused():
    """A border is inside, a point beyond it is not, whatever else is asked for."""
    ground = worlds.ground()
    west, south, east, north = ground.bounds
    assert np.isfinite(ground.height_at([west, east], [south, north])).all()
    for place in ((west - 1e-3, 0.0), (0.0, north + 1e-3), (np.nan, 0.0)):
        with pytest.raises(tf.DataError, match="point outside the grid"):
            ground.height_at([0.0, place[0]], [0.0, place[1]])
