"""docs/limits.md says what the code keeps."""

from __future__ import annotations

from pathlib import Path

import pytest

from terrain_forge.base import MAX_DEPTH, MAX_NODES, specs
from terrain_forge.building import manifest
from terrain_forge.dtm import download, image, raster, window
from terrain_forge.evaluation import map_files, score
from terrain_forge.illumination import period, survey
from terrain_forge.model import world
from terrain_forge.paths import curves, recorded, routes
from terrain_forge.recipe import file, worlds
from terrain_forge.rocks import populations
from terrain_forge.rocks.laws import counts
from terrain_forge.rocks.scattering import layer_craters
from terrain_forge.rocks.shapes import custom_mesh

PAGE = Path(__file__).parents[2] / "docs" / "limits.md"
MIB = 2**20

ROWS = {
    "a recipe": f"{file.MAX_RECIPE // 1024} KiB of UTF-8; {MAX_NODES:,} keys and values; "
    f"{MAX_DEPTH} mappings and lists within each other; whole numbers of {file.MAX_DIGITS} "
    "digits; no tags but those of YAML itself, no anchors or merges",
    "a number that must be above 0": f"{specs.LEAST:g} to {specs.MOST:g}",
    "a coordinate": f"±{specs.FARTHEST:g} m",
    "a site": "as long each way as its body's radius",
    "a name": f"{specs.MAX_NAME} characters, {specs.MAX_NAME_BYTES} bytes of UTF-8; no separator, "
    "no leading dot, nothing that cannot be printed",
    "any input file": "a regular file: no pipe, no device, no folder",
    "a raster": f"{len(raster.DRIVERS)} of GDAL's formats, all files of it beside it; "
    f"{raster.MOST_SIDE:,} samples a side, blocks of {raster.MOST_BLOCK >> 20} MiB",
    "a raster that is fetched": f"{download.MOST // 2**30} GiB whole, {window.MOST // 2**30} GiB "
    "by window; GeoTIFF or JPEG 2000 by window",
    "an image": f"as a raster; {image.MAX_PIXELS:,} pixels",
    "a table": f"{specs.MAX_TABLE // MIB} MiB of UTF-8; {specs.InputFile.most:,} rows and twice as "
    "many lines",
    "sizes that a recipe counts": f"{counts.MAX_COUNTED:,}",
    "a path's file": f"{specs.MAX_TABLE // MIB} MiB of UTF-8; {recorded.MAX_POSES:,} poses",
    "a map that is scored": f"{map_files.MOST // 2**30} GiB; {map_files.MAX_PIXELS:,} pixels of a "
    f"raster, {map_files.MAX_NUMBERS:,} numbers of a point",
    "a trajectory that is scored": f"{score.MAX_STATIONS:,} stations",
    "a rock's mesh": f"{specs.MAX_MESH // MIB} MiB; {custom_mesh.MOST_FACES:,} faces; "
    "files that it names lie in its folder or below",
    "a route": f"{curves.LONGEST:,.0f} m; {curves.MAX_KNOTS:,} points that it is given by; "
    f"{routes.MOST_SAMPLES:,} samples",
    "rocks": f"{populations.MAX_POPULATIONS} populations and lists; "
    f"{0.9 * populations.MAX_ROCKS:,.0f} rocks of each, or {populations.MOST_ROCKS:,.0f} evenly "
    f"spread ones in all; around {layer_craters.MAX_CRATERS:,} of a layer's craters",
    "a world": "what the machine's memory holds, by the estimate of `terrain-forge check`",
    "many worlds": f"{worlds.MOST_WORLDS:,} of a series; a scene of a `--grid` of as many, and "
    "what memory holds; goals within half of a world's diagonal",
    "a map of light": f"the DTM's area, {survey.LARGEST / 1e3:,.0f} km a side; what memory holds, "
    f"about 8 bytes for each point and azimuth; {period.MOST:,} moments",
    "a saved world": f"{world.MAX_JSON // MIB:,} MiB of world.json; {manifest.MAX_MANIFEST // MIB} "
    "MiB of manifest.json; arrays.npz and shared.npz uncompressed, of the size that they say",
}


@pytest.mark.parametrize("name", ROWS)
def test_the_page_has_the_limit(name):
    assert f"| {name} | {ROWS[name]} |" in PAGE.read_text(encoding="utf-8").splitlines()


def test_the_page_has_no_other_limit():
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    assert sum(line.startswith("| ") for line in lines) == len(ROWS) + 1
