"""Levels of detail of the ground: watertight, one border, true errors."""

from __future__ import annotations

import numpy as np
import pytest

from terrain_forge.geometry import ground_levels, level_normals, tile_anchor
from terrain_forge.model import TileGrid


def tiles_of(whole, cells):
    """The tiles of a world, which know what lies beyond their borders."""
    grid = TileGrid.of(whole.site, cells)
    return grid, [whole.tile(grid.window(n), number=n) for n in range(len(grid))]


def height_of(level, x, y):
    """Height of a level at a place, by the triangle that lies over it; how many do."""
    a, b, c = (level.vertices[level.faces[:, n]].astype(float) for n in range(3))
    place = np.array([x, y])

    def side(p, q):
        d, e = q[:, :2] - p[:, :2], place - p[:, :2]
        return d[:, 0] * e[:, 1] - d[:, 1] * e[:, 0]

    weights = np.stack([side(b, c), side(c, a), side(a, b)])
    over = np.flatnonzero((weights > 0).all(axis=0))
    n = over[0]
    w = weights[:, n] / weights[:, n].sum()
    return w @ np.array([a[n, 2], b[n, 2], c[n, 2]]), len(over)


@pytest.mark.parametrize("cells", [80, 75])
def test_all_levels_have_one_border_with_their_neighbours(whole, cells):
    """Places of a border's nodes are the same numbers from either side, at any two levels."""
    grid, tiles = tiles_of(whole, cells)
    rims = {}
    for tile in tiles:
        anchor, (rows, columns) = tile_anchor(tile, grid), tile.ground.shape
        for level in ground_levels(tile, grid, (1, 4, 16)):
            where = np.stack(np.divmod(level.nodes, columns), axis=-1)
            window = tile.world.window
            border = (where[:, 0] % (rows - 1) == 0) | (where[:, 1] % (columns - 1) == 0)
            assert np.count_nonzero(border) == 2 * (rows + columns) - 4
            places = level.vertices[border].astype(np.float64) + anchor
            nodes = where[border] + (window.row, window.column)
            for node, place in zip(map(tuple, nodes.tolist()), places.tolist(), strict=True):
                assert rims.setdefault(node, place) == place


@pytest.mark.parametrize("stride", [4, 16])
def test_coarse_levels_shade_smoothly_but_on_their_borders(whole, stride):
    """Normals of a fine border beside the coarse ground within looked like a seam."""
    grid, tiles = tiles_of(whole, 80)
    for tile in tiles:
        rows, columns = tile.ground.shape
        full, level = ground_levels(tile, grid, (1, stride))
        fine, coarse = level_normals(tile, full)[level.nodes], level_normals(tile, level)
        assert np.linalg.norm(coarse, axis=1) == pytest.approx(1.0, abs=1e-6)
        row, column = np.divmod(level.nodes, columns)
        border = (row % (rows - 1) == 0) | (column % (columns - 1) == 0)
        assert np.array_equal(coarse[border], fine[border])
        ring = np.flatnonzero((row == 1) & ~border)
        assert len(ring) == columns - 2
        bends = [np.diff(normals[ring, :2], axis=0).std() for normals in (coarse, fine)]
        assert bends[0] < 0.6 * bends[1]


@pytest.mark.parametrize("stride", [1, 4, 16])
def test_a_level_covers_its_tile_once_and_within_its_error(whole, stride):
    grid, tiles = tiles_of(whole, 80)
    rng = np.random.default_rng(5)
    for tile in tiles:
        (level,) = ground_levels(tile, grid, (stride,))
        edges = np.sort(level.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        _, count = np.unique(edges, axis=0, return_counts=True)
        rows, columns = tile.ground.shape
        assert np.count_nonzero(count == 1) == 2 * (rows + columns - 2)
        assert count.max() == 2
        anchor = tile_anchor(tile, grid)
        west, south, east, north = tile.ground.bounds
        for x, y in rng.uniform((west, south), (east, north), (40, 2)).tolist():
            height, times = height_of(level, x - anchor[0], y - anchor[1])
            assert times == 1
            assert abs(height + anchor[2] - tile.ground.height_at(x, y)) <= level.error


def test_levels_too_coarse_for_a_tile_are_left_out(whole):
    grid, tiles = tiles_of(whole, 80)
    assert [level.stride for level in ground_levels(tiles[0], grid, (1, 16, 64))] == [1, 16]
