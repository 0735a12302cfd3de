"""Whole worlds from real terrain models, where they are at hand."""

from __future__ import annotations

import json

import numpy as np
import pytest

import terrain_forge as tf
from tests.helpers.places import DATA

pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="the real DTMs are not at hand")

ROCKS = """
rocks:
  library: {shapes: 4, seed: 1}
  populations:
    - {name: rocks, size_frequency: {kind: golombek, k: 0.05}, diameter_m: [0.3, 2.0]}
    - {name: gravel, size_frequency: {kind: golombek, k: 0.02}, diameter_m: [0.2, 0.3]}
exports: [mjcf]
"""
JEZERO = """
dtm:
  source: mars/jezero_hirise_3p69m_1024.tif
  centre: {lonlat_deg: [77.45077151, 18.44471049]}
  size_m: [60, 60]
  level: plane
terrain: {spacing_m: 0.5, layers: [{kind: fractal}]}
"""
SEED = """
dtm:
  source: mars/marssim_flatsmars_513_8bit.png
  extent_m: [1024, 1024]
  pixel_is: point
  height_range_m: [0, 16]
  centre: {offset_m: [-100, 60]}
  size_m: [60, 60]
terrain: {spacing_m: 0.5, layers: [{kind: fractal}]}
"""
GALE = """
dtm: {source: mars/gale_hirise_floor_5m_200_envi.bin, size_m: [60, 60]RANGE}
terrain: {spacing_m: 0.5, layers: [{kind: fractal}]}
"""


def recipe(tmp_path, site):
    path = tmp_path / "site.yaml"
    path.write_text(
        f"schema: 1\nname: site\nbody: mars\n{site}{ROCKS}".replace("mars/", f"{DATA}/mars/")
    )
    return tf.load_recipe(path)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("site", "relief"),
    [
        (SEED, (0.5, 9.0)),
        (GALE.replace("RANGE", ", height_range_m: [-4460, -4400]"), (1.0, 25.0)),
    ],
    ids=["seed", "gale"],
)
def test_world_of_a_real_site(tmp_path, site, relief):
    file = recipe(tmp_path, site)
    world = tf.realise(tf.plan(file.recipe, folder=file.folder))
    assert relief[0] < float(np.ptp(world.ground.elevation)) < relief[1]
    assert len(world.field) > 5


@pytest.mark.slow
def test_build_of_a_real_site(tmp_path):
    file = recipe(tmp_path, JEZERO)
    result = tf.build(file.recipe, tmp_path / "out", folder=file.folder)
    assert result.passed
    assert 1.0 < float(np.ptp(result.world.ground.elevation)) < 12.0
    assert len(result.world.field) > 5
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_text())
    assert len(manifest["inputs"]) >= 1


def test_envi_tile_wants_its_vertical_scale(tmp_path):
    file = recipe(tmp_path, GALE.replace("RANGE", ""))
    with pytest.raises(tf.DataError, match="vertical scale"):
        tf.plan(file.recipe, folder=file.folder)
