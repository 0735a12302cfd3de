"""How much disk `check` says that a build needs: images that are kept, rocks of many faces."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from terrain_forge.exporters.drake.options import COARSENESS

from terrain_forge.building.cost import DETAIL
from terrain_forge.geometry import level_of_detail
from terrain_forge.making import plan
from terrain_forge.pipeline import check
from terrain_forge.rocks import LibrarySpec, make_library
from terrain_forge.rocks.shapes.families import COARSE_FACES
from terrain_forge.terrain import AppearanceSpec
from terrain_forge.terrain.detail import DetailSpec, ground_detail
from terrain_forge.writers import write_png
from tests.helpers.recipes import flat

SIDE = 1024
BARE = flat((16.0, 12.0), 0.1, exports=("geotiff",))


def disk(recipe, folder="."):
    """MB on disk, as told."""
    (line,) = (line for line in check(recipe, folder=folder) if line.startswith("cost"))
    return float(re.search(r"([\d,]+) MB on disk", line)[1].replace(",", ""))


def test_an_image_of_the_grounds_detail_counts_where_it_is_kept(tmp_path):
    pixels = np.random.default_rng(1).integers(0, 256, (SIDE, SIDE), np.uint8)
    write_png(tmp_path / "soil.png", pixels)
    detail = DetailSpec(image="soil.png", size_m=2.0)
    terrain = replace(BARE.terrain, appearance=AppearanceSpec(detail=detail))
    own = replace(BARE, terrain=terrain)
    made = ground_detail(detail, plan(own, folder=tmp_path))
    assert made.normals.nbytes + made.brightness.nbytes == DETAIL * SIDE**2
    kept = (8 + DETAIL) * SIDE**2 / 1e6
    assert disk(own, tmp_path) - disk(BARE) == pytest.approx(kept, abs=1.1)
    with_usd = [replace(recipe, exports=("usd", "geotiff")) for recipe in (own, BARE)]
    more = disk(with_usd[0], tmp_path) - disk(with_usd[1])
    assert more == pytest.approx(kept + 2.3 * SIDE**2 / 1e6, abs=1.1)


@pytest.mark.slow
def test_shapes_keep_about_as_many_triangles_as_is_said():
    families = tuple(COARSE_FACES)
    library = make_library(LibrarySpec(shapes=len(families), families=families, seed=3))
    shapes = library.prototypes
    faces = [len(p.meshes[level_of_detail(p, COARSENESS[0])].faces) for p in shapes]
    assert np.mean(faces) == pytest.approx(LibrarySpec(families=families).coarse_faces, rel=0.5)
