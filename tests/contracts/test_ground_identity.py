"""All kinds of layers under all kinds of masks at once: any window is the cut, bit for bit."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import rasterio
from PIL import Image
from rasterio.transform import Affine

from terrain_forge.making import plan
from terrain_forge.model import Window
from terrain_forge.terrain import colour_ground, shape_ground, stencil_reach

RECIPE = """
schema: 1
name: everything
seed: 77
body: moon
dtm: {source: dtm.tif, size_m: [48, 36], level: plane}
terrain:
  spacing_m: 0.25
  layers:
    - {kind: fractal}
    - {kind: fractal, hurst: 0.6, deviation_1m_m: 0.05, mask: {image: mask.png}}
    - {kind: craters, production: {kind: neukum, age_ga: 3.5}, diameter_m: [1, 30],
       mask: {height: {above_m: -2, fade_m: 1}}}
    - {kind: displacement_map, image: relief.png, height_m: 0.3, tile_m: [5, 3],
       mask: {slope: {below_deg: 6, fade_deg: 5, baseline_m: 0.7}, invert: true}}
    - {kind: ripples, wavelength_m: 1.1, height_m: 0.06,
       mask: {route: {beyond_m: 1.5, fade_m: 2}, slope: {below_deg: 15, fade_deg: 5}}}
    - {kind: craters, name: late, file: craters.csv}
rocks:
  populations:
    - {name: stones, size_frequency: {kind: golombek, k: 0.05}, diameter_m: [0.2, 1.0]}
paths:
  - {name: way, route: {kind: spline, points_m: [[-15, -9], [0, 4], [14, -5]]}, speed_m_s: 0.1}
exports: []
"""
WINDOWS = 4
MOON = "+proj=stere +lat_0=-90 +lat_ts=-90 +lon_0=0 +R=1737400"


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A polar DTM, turned on its grid, with everything that a ground can have."""
    folder = tmp_path_factory.mktemp("everything")
    random = np.random.default_rng(4)
    heights = random.normal(0.0, 0.05, (120, 140)).cumsum(0).cumsum(1) / 12.0
    grid = Affine.translation(30_000.0, 80_000.0) @ Affine.rotation(31.0) @ Affine.scale(1.5, -1.25)
    with rasterio.open(
        folder / "dtm.tif", "w", driver="GTiff", count=1, dtype="float32", crs=MOON,
        height=120, width=140, transform=grid,
    ) as file:  # fmt: skip
        file.write(heights.astype("float32"), 1)
    for name, shape in (("mask.png", (73, 97)), ("relief.png", (40, 60))):
        pixels = random.integers(0, 256, (*shape,)).astype(np.uint8)
        Image.fromarray(pixels).save(folder / name)
    rows = ["x_m,y_m,diameter_m,age_ga", "3,-2,9,0", "-12,5,6,0.01", "26,0,8,0"]
    (folder / "craters.csv").write_text("\n".join(rows) + "\n")
    (folder / "everything.yaml").write_text(RECIPE)
    return plan(folder / "everything.yaml")


def shape(site, window):
    """Heights and colours of a window."""
    layers = site.recipe.terrain.layers
    around = site.padded(window, stencil_reach(site, layers))
    ground = shape_ground(site=site, window=around, layers=layers)
    colours = colour_ground(
        site=site,
        window=window,
        ground=ground,
        spec=site.recipe.terrain.appearance,
        layers=layers,
    )
    return ground.elevation[window.nodes_in(around)], colours


def test_every_layer_shows(site):
    """Else the test below would say nothing of it."""
    layers = site.recipe.terrain.layers
    found = [
        shape_ground(site=site, window=site.window, layers=layers[:n]).elevation
        for n in range(len(layers) + 1)
    ]
    for layer, (less, more) in zip(layers, pairwise(found), strict=True):
        assert (np.abs(more - less) > 5e-3).mean() > 0.01, layer.kind


def test_any_window_is_the_cut(site):
    elevation, colours = shape(site, site.window)
    random = np.random.default_rng(6)
    whole = site.window
    for _ in range(WINDOWS):
        columns, rows = (int(v) for v in random.integers(1, 100, 2))
        window = Window(
            column=int(random.integers(0, whole.columns - columns)),
            row=int(random.integers(0, whole.rows - rows)),
            columns=columns,
            rows=rows,
        )
        part = window.nodes_in(whole)
        heights, rgb = shape(site, window)
        assert heights.tobytes() == elevation[part].tobytes()
        assert rgb.tobytes() == colours[part].tobytes()


def test_threads_change_nothing(site, use_threads):
    found = []
    for threads in (1, 3):
        use_threads(threads)
        found.append([part.tobytes() for part in shape(site, site.window)])
    assert found[0] == found[1]
