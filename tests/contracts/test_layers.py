"""Every kind of layer that is installed, by itself: a new one has to do no more than be there."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from terrain_forge.making import plan
from terrain_forge.model import Window
from terrain_forge.recipe import recipe_from_json, recipe_json
from terrain_forge.terrain import layer_types, mask_weight, shape_ground, stencil_reach

EXAMPLES = {
    "craters": "production: {kind: neukum, age_ga: 3.5}, diameter_m: [1, 6]",
    "displacement_map": "image: relief.png, height_m: 0.3, tile_m: [5, 3]",
    "ripples": "wavelength_m: 1.1, height_m: 0.06",
}
"""What a kind needs beyond its defaults."""

RECIPE = """
schema: 1
name: one_layer
seed: 7
body: moon
dtm: {{kind: flat, size_m: [24, 16]}}
terrain:
  spacing_m: 0.25
  layers:
    - {{{first}}}
    - {{{second}}}
rocks: {{populations: []}}
"""
KINDS = [getattr(layer, "kind", "") for layer in layer_types()]


@pytest.fixture(scope="module", params=KINDS)
def site(request, tmp_path_factory):
    """A site with a layer without a mask and one under an image of all greys."""
    folder = tmp_path_factory.mktemp(request.param)
    random = np.random.default_rng(3)
    Image.fromarray(random.integers(0, 256, (40, 60)).astype(np.uint8)).save(folder / "relief.png")
    greys = np.tile(np.linspace(0, 255, 49).astype(np.uint8), (33, 1))
    greys[:, :16] = 0
    Image.fromarray(greys).save(folder / "mask.png")
    kind = next(layer for layer in layer_types() if getattr(layer, "kind", "") == request.param)
    name = "name: second, " if "name" in kind.__dataclass_fields__ else ""
    example = EXAMPLES.get(request.param, "")
    first = f"kind: {request.param}" + (f", {example}" if example else "")
    second = f"{name}{first}, mask: {{image: mask.png}}"
    (folder / "one.yaml").write_text(RECIPE.format(first=first, second=second))
    return plan(folder / "one.yaml")


def relief(site, layer, window=None):
    """What one layer alone makes of level ground."""
    window = window or site.window
    around = site.padded(window, stencil_reach(site, (layer,)))
    land = shape_ground(site=site, window=around, layers=(layer,))
    return land.elevation[window.nodes_in(around)]


def test_it_adds_finite_heights(site):
    for layer in site.recipe.terrain.layers:
        found = relief(site, layer)
        assert np.isfinite(found).all()
        assert np.ptp(found) > 0.01


def test_a_window_is_the_cut_of_the_whole(site):
    random = np.random.default_rng(5)
    for layer in site.recipe.terrain.layers:
        whole = relief(site, layer)
        for _ in range(4):
            columns, rows = (int(n) for n in random.integers(1, 30, 2))
            column = int(random.integers(0, site.window.columns - columns))
            row = int(random.integers(0, site.window.rows - rows))
            window = Window(column=column, row=row, columns=columns, rows=rows)
            cut = whole[window.nodes_in(site.window)]
            assert relief(site, layer, window).tobytes() == cut.tobytes()


def test_its_mask_weighs_what_it_adds(site):
    masked = site.recipe.terrain.layers[1]
    level = np.zeros(relief(site, masked).shape)
    weight = mask_weight(masked.mask, site=site, window=site.window, elevation=level)
    assert (weight == 0.0).any()
    assert (weight > 0.5).any()
    found = relief(site, masked)
    assert (found[weight == 0.0] == 0.0).all()
    bare = masked.__class__(**{**vars(masked), "mask": None})
    np.testing.assert_allclose(found, weight * relief(site, bare), atol=1e-5)


def test_a_recipe_with_it_is_the_same_from_its_json(site):
    assert recipe_from_json(recipe_json(site.recipe)) == site.recipe
