"""A site of six tiles that tests share, built once, and its world made as one."""

from __future__ import annotations

from pathlib import Path

import pytest

import terrain_forge as tf
from tests.helpers.places import ROOT

TEXT = """
name: six
seed: 7
body: mars
dtm: {{source: {root}/dtm_samples/gale_floor_synthetic.tif, size_m: [50, 40],
  level: plane, noise: keep}}
terrain:
  spacing_m: 0.25
  layers:
    - {{kind: fractal}}
    - {{kind: ripples, wavelength_m: 2, height_m: 0.1}}
  materials: [{{kind: sand, cover: 0.4, patch_m: 6}}]
rocks:
  library: {{shapes: 4}}
  populations:
    - name: rocks
      size_frequency: {{kind: golombek, k: 0.08}}
      diameter_m: [0.25, 0.8]
tiles: {{size_m: 20}}
exports: [{exports}]
"""


def write_recipe(folder: Path, *, exports: str = "geotiff, usd, glb, sdf", **changes: str) -> Path:
    """The recipe of the site, with other text in place of some of its lines' values."""
    text = TEXT.format(root=ROOT, exports=exports)
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    path = folder / "six.yaml"
    path.write_text(text)
    return path


@pytest.fixture(scope="session")
def recipe(tmp_path_factory):
    """The file of the site's recipe."""
    return write_recipe(tmp_path_factory.mktemp("recipe"))


@pytest.fixture(scope="session")
def built(recipe, tmp_path_factory):
    """The built site's folder."""
    out = tmp_path_factory.mktemp("site") / "six"
    tf.build(tf.load_recipe(recipe).recipe, out, workers=0)
    return out


@pytest.fixture(scope="session")
def whole(recipe):
    """The same site as one world."""
    return tf.realise(tf.plan(tf.load_recipe(recipe).recipe))
