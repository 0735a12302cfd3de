"""What lies beyond a world as one mesh with a palette: each vertex finds its own colour there."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from terrain_forge.geometry import horizon_surface
from terrain_forge.model import Mesh


def horizon(ground: np.ndarray, rocks: np.ndarray) -> SimpleNamespace:
    rgb = np.concatenate([ground, rocks]).round().astype(np.uint8)
    vertices = np.random.default_rng(1).uniform(-1.0, 1.0, (len(rgb), 3))
    return SimpleNamespace(
        rgb=rgb,
        mesh=Mesh(vertices=vertices, faces=np.array([[0, 1, 2]], np.int32)),
        normals=np.zeros((len(rgb), 3), np.float32),
        ground_vertices=len(ground),
    )


def found(made: SimpleNamespace) -> tuple[np.ndarray, tuple[int, ...]]:
    """The colours at the vertices' coordinates, and the palette's shape."""
    surface, palette = horizon_surface(made)
    rows, columns, _ = palette.shape
    at = surface.texture_coordinates * (columns, rows)
    column, row = np.floor(at).astype(int).T
    return palette[rows - 1 - row, column].astype(float), palette.shape


def shades(rgb, count: int) -> np.ndarray:
    return np.linspace(0.4, 1.0, count)[:, None] * np.array(rgb)


SOIL, ROCK = shades((150.0, 110.0, 80.0), 300), shades((90.0, 80.0, 75.0), 60)


@pytest.mark.parametrize("rocks", [ROCK, ROCK[:0]])
def test_ground_of_one_tint_is_a_row_of_shades(rocks):
    made = horizon(SOIL, rocks)
    colours, shape = found(made)
    assert shape == (8, 256, 3)
    assert np.abs(colours - made.rgb).max() <= 1.0


@pytest.mark.parametrize("other", [(40.0, 150.0, 60.0), (90.0, 100.0, 200.0), (200.0, 90.0, 80.0)])
def test_ground_of_several_tints_keeps_them(other):
    made = horizon(np.concatenate([SOIL, shades(other, 300), ROCK]), ROCK)
    colours, shape = found(made)
    assert shape == (32, 256, 3)
    assert np.abs(colours - made.rgb).max() <= 10.0
    assert np.abs(colours - made.rgb).mean() < 2.0


def test_between_two_tints_lie_those_between():
    made = horizon(np.concatenate([SOIL, shades((40.0, 150.0, 60.0), 300)]), ROCK)
    surface, palette = horizon_surface(made)
    rows, columns, _ = palette.shape
    a, b = surface.texture_coordinates[[150, 450]]  # of a brightness that both have
    way = np.linspace(0.0, 1.0, 9)[:, None]
    column, row = np.floor(((1.0 - way) * a + way * b) * (columns, rows)).astype(int).T
    red = palette[rows - 1 - row, column, 0].astype(float)
    assert red[0] - red[-1] > 50.0
    assert np.diff(red).max() < 12.0, "no stripe of another tint lies between"
