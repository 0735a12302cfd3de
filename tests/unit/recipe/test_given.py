"""A recipe, its file and the file's path say the same."""

from __future__ import annotations

import numpy as np
import pytest
import rasterio

import terrain_forge as tf

RECIPE = """\
schema: 1
name: given
seed: 4
body: moon
dtm: {kind: raster, source: dem.tif, size_m: [12, 12]}
terrain: {spacing_m: 1}
"""


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    folder = tmp_path_factory.mktemp("given")
    heights = np.hypot(*np.mgrid[:20, :20]).astype(np.float32)
    form = {"width": 20, "height": 20, "count": 1, "dtype": "float32"}
    crs = "+proj=stere +lat_0=-90 +R=1737400"
    place = rasterio.Affine(1, 0, 50, 0, -1, 70)
    with rasterio.open(folder / "dem.tif", "w", crs=crs, transform=place, **form) as file:
        file.write(heights, 1)
    (folder / "given.yaml").write_text(RECIPE)
    return folder / "given.yaml"


def told(lines):
    """The lines but for what a build takes, which hangs on what other builds have left."""
    return [line for line in lines if not line.startswith(("cost", "  time"))]


def test_plan_and_check_take_a_recipe_its_file_or_its_path(path, monkeypatch):
    file = tf.load_recipe(path)
    whole = tf.plan(file.recipe, folder=file.folder)
    lines = told(tf.check(file.recipe, folder=file.folder))
    monkeypatch.chdir("/")
    for given in (file, path, str(path)):
        assert tf.plan(given) == whole
        assert told(tf.check(given)) == lines


def test_a_file_that_is_none_is_told(path):
    with pytest.raises(tf.RecipeError, match="no such file"):
        tf.plan(path.with_name("no.yaml"))
