"""What may be wrong with a DTM, and must not become wrong ground: units, holes, stairs."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
import rasterio
from hypothesis import given, settings
from hypothesis import strategies as st
from rasterio.transform import Affine

import terrain_forge as tf
from terrain_forge.base import DataError, RecipeWarning
from terrain_forge.building.checking import dtm_lines
from terrain_forge.dtm import site_facts
from terrain_forge.dtm.quality import assess, destair, farthest_filled, planar_posts
from terrain_forge.dtm.spec import Centre
from terrain_forge.model import MARS, MOON
from tests.helpers.places import DATA
from tests.helpers.rasters import EQC, MOON_EQC, SPEC, plan, rough, words, write_raster


@pytest.mark.parametrize(
    ("dtype", "scale", "offset", "units", "stored"),
    [
        ("int16", 0.5, 1737400.0, "METER", lambda h: h / 0.5),  # LOLA
        ("int16", 0.5, 1737400.0, None, lambda h: h / 0.5),  # the same, no unit
        ("float32", 1.0, 1737.4, "KILOMETER", lambda h: h / 1000.0),  # LOLA, floats
        ("float32", 1.0, 1737.4, None, lambda h: h / 1000.0),
        ("float64", 1.0, 0.0, None, lambda h: h + 1737400.0),  # values are radii
        ("float64", 1.0, 1e6, None, lambda h: h + 737400.0),  # … with the offset
        ("float64", 1.0, 0.0, "km", lambda h: (h + 1737400.0) / 1000.0),
        ("float64", 1.0, 0.0, None, lambda h: (h + 1737400.0) / 1000.0),
        ("float32", 1.0, 0.0, "km", lambda h: h / 1000.0),
        ("float32", 1.0, 0.0, "cm", lambda h: h * 100.0),
        ("float32", 1.0, 0.0, "feet", lambda h: h / 0.3048),
        ("float32", 1.0, 0.0, "", lambda h: h),
    ],
)
def test_any_unit_becomes_metres_above_the_datum(tmp_path, dtype, scale, offset, units, stored):
    ramp = 0.2 * np.arange(200.0)
    heights = -1900.0 + 0.5 * np.round(2.0 * rough((150, 200)) + ramp)
    write_raster(
        tmp_path, stored(heights).astype(dtype), crs=MOON_EQC, scale=scale, offset=offset,
        units=units, transform=Affine(1.0, 0.0, 900.0, 0.0, -1.0, 500.0),
    )  # fmt: skip
    site, ground = plan(tmp_path, body=MOON)
    assert site.datum_height == pytest.approx(heights[74:76, 99:101].mean(), abs=0.5)
    tilt = np.polyfit(ground.east, ground.elevation.mean(axis=0), 1)[0]
    assert tilt == pytest.approx(0.1, rel=0.05)


def test_heights_in_a_unit_that_is_not_known_want_a_scale(tmp_path):
    write_raster(tmp_path, rough().astype("float32"), units="furlong")
    assert "'furlong' is no length that is known" in words(tmp_path)
    with pytest.raises(DataError, match=r"'furlong'.*give dtm\.height_scale"):
        plan(tmp_path)
    site, _ = plan(tmp_path, replace(SPEC, height_scale=201.168))
    assert np.ptp(site.dtm.heights) > 150.0 * np.ptp(rough())


@pytest.mark.parametrize("spec", [{"nodata": -7777.0}, {"nodata_range": (-1e5, -5000.0)}])
def test_nodata_by_value_or_range(tmp_path, spec):
    heights = rough().astype("float32")
    heights[73:76, 90:95] = -7777.0
    write_raster(tmp_path, heights)
    site, ground = plan(tmp_path, replace(SPEC, **spec))
    assert site.dtm.filled == 15
    assert np.abs(ground.elevation).max() < 50.0


def test_nodata_by_mask(tmp_path):
    write_raster(tmp_path, rough().astype("float32"))
    with rasterio.open(tmp_path / "dtm.tif", "r+") as file:
        mask = np.full((150, 200), 255, np.uint8)
        mask[73:76, 90:95] = 0
        file.write_mask(mask)
    site, _ = plan(tmp_path)
    assert site.dtm.filled == 15


def test_undeclared_mark_of_no_data_is_refused(tmp_path):
    heights = rough().astype("float32")
    heights[73:76, 90:95] = -32768.0
    write_raster(tmp_path, heights)
    with pytest.raises(DataError, match=r"15 samples of the value -32768.*dtm.nodata"):
        plan(tmp_path)
    assert "-32768" in words(tmp_path)
    assert plan(tmp_path, replace(SPEC, nodata=-32768.0))[0].dtm.filled == 15


@pytest.mark.parametrize(
    ("mark", "dtype", "scale"),
    [(0.0, "float32", 1.0), (-1e10, "float32", 1.0), (-99999.9, "float64", 1.0),
     (0.0, "uint16", 0.01), (65535.0, "uint16", 0.01)],
)  # fmt: skip
def test_any_number_far_from_all_others_is_asked_about(tmp_path, mark, dtype, scale):
    heights = (rough() + 300.0) / scale
    heights[73:77, 90:95] = mark
    write_raster(tmp_path, heights.astype(dtype), scale=scale)
    with pytest.raises(
        DataError, match=r"20 samples of the value .*dtm.nodata: .*dtm.nodata_range.*by dtm.centre$"
    ):
        plan(tmp_path)
    assert plan(tmp_path, replace(SPEC, nodata=mark))[0].dtm.filled == 20


def test_a_block_that_somebody_has_put_there_is_no_mark(tmp_path):
    heights = rough().astype("float32")
    heights[65:85, 90:110] = heights.max() + 2.0
    write_raster(tmp_path, heights)
    assert np.ptp(plan(tmp_path)[1].elevation) > 2.0


def test_radii_are_known_where_most_of_a_raster_is_empty(tmp_path):
    radii = np.full((1200, 1600), -9999.0)
    radii[560:700, 700:840] = 1737400.0 - 1900.0 + rough((140, 140))
    grid = Affine(1.0, 0.0, 900.0, 0.0, -1.0, 500.0)
    write_raster(tmp_path, radii, crs=MOON_EQC, transform=grid, nodata=-9999.0)
    spec = replace(SPEC, size_m=(60.0, 60.0), centre=Centre(offset_m=(-30.0, -30.0)))
    assert plan(tmp_path, spec, body=MOON)[0].datum_height == pytest.approx(-1900.0, abs=20.0)


def test_heights_as_large_as_the_body_are_refused(tmp_path):
    """Numbers of an unknown unit, or radii of another body's size."""
    write_raster(tmp_path, (1e6 + rough()).astype("float64"))
    with pytest.raises(DataError, match=r"1e\+06 m from the datum, mars's radius is 3.39e\+06 m"):
        plan(tmp_path)


def test_a_scale_of_zero_is_refused(tmp_path):
    write_raster(tmp_path, np.ones((300, 400), np.int16), scale=0.0)
    with pytest.raises(DataError, match=r"scale in dtm\.tif is 0"):
        plan(tmp_path)
    assert plan(tmp_path, replace(SPEC, height_scale=2.0))[0].datum_height == pytest.approx(2.0)


def test_a_scale_or_offset_that_is_no_number_is_refused(tmp_path):
    write_raster(tmp_path, np.ones((300, 400), np.int16), scale=np.nan)
    with pytest.raises(DataError, match=r"scale in dtm\.tif is nan, .* give dtm\.height_scale"):
        plan(tmp_path)
    assert plan(tmp_path, replace(SPEC, height_scale=2.0))[0].datum_height == pytest.approx(2.0)
    write_raster(tmp_path, np.ones((300, 400), np.int16), offset=np.inf)
    with pytest.raises(DataError, match=r"offset in dtm\.tif is inf: give dtm\.height_offset_m"):
        plan(tmp_path)


@pytest.mark.parametrize("shape", [(1, 1), (1, 400), (300, 1)])
def test_a_single_line_of_pixels_is_refused(tmp_path, shape):
    write_raster(tmp_path, np.ones(shape, np.float32))
    with pytest.raises(DataError, match=rf"has {shape[1]} × {shape[0]} pixels, .* at least 2 × 2"):
        plan(tmp_path)


def test_deep_ground_is_no_mark(tmp_path):
    """-9999 among its neighbours is a height: LOLA's integers pass through it."""
    heights = (np.mgrid[0:300, 0:400][1] - 10199).astype("int16")
    write_raster(tmp_path, heights)
    assert plan(tmp_path)[0].datum_height == pytest.approx(-9999.5, abs=1.0)


def test_range_upside_down_is_refused(tmp_path):
    write_raster(tmp_path, rough().astype("float32"))
    with pytest.raises(DataError, match="the lower value first"):
        plan(tmp_path, replace(SPEC, nodata_range=(5.0, -5.0)))


def test_wide_hole_is_an_error_that_says_where(tmp_path):
    heights = rough().astype("float32")
    heights[65:85, 120:140] = np.nan
    write_raster(tmp_path, heights)
    with pytest.raises(DataError, match=r"20 m \(20 samples\) wide around 30 m east, 0 m nor"):
        plan(tmp_path)
    site, ground = plan(tmp_path, replace(SPEC, fill_holes_m=20.0))
    assert "400 samples in holes up to 20 m" in site.dtm.repairs[0]
    assert "inverse-distance" in site.dtm.repairs[0]
    assert np.isfinite(ground.elevation).all()
    with pytest.raises(DataError, match="holes of up to 0 m are filled"):
        plan(tmp_path, replace(SPEC, fill_holes_m=0.0))


@pytest.mark.parametrize("width", [1, 2, 3, 4, 7, 12])
def test_widths_of_holes_are_counted_in_samples(width):
    valid = np.ones((60, 80), np.bool_)
    valid[20 : 20 + width, 10:60] = False
    samples, row, column = farthest_filled(valid, np.ix_(np.arange(2, 50), np.arange(4, 70)))
    assert samples == width
    assert row == 20 + 0.5 * (width - 1)
    assert 10 <= column <= 59


@pytest.mark.parametrize("posting", [0.9999, 1.0, 1.0041])
def test_holes_of_eight_samples_are_filled_and_of_nine_are_not(tmp_path, posting):
    heights, placed = rough().astype("float32"), Affine(posting, 0, 5000, 0, -posting, -272000)
    heights[65:73, 80:140] = np.nan
    write_raster(tmp_path, heights, transform=placed)
    assert "holes up to 8" in plan(tmp_path)[0].dtm.repairs[0]
    heights[65:74, 80:140] = np.nan
    write_raster(tmp_path, heights, transform=placed)
    with pytest.raises(DataError, match=r"\(9 samples\) wide .*; holes of up to 8(\.03)? m are"):
        plan(tmp_path)
    with pytest.raises(DataError, match=r"about 9(\.04)? m .*; holes of up to 8\.9995 m are"):
        plan(tmp_path, replace(SPEC, fill_holes_m=8.9995))


def test_hole_beside_the_site_is_no_error(tmp_path):
    heights = rough().astype("float32")
    heights[:20] = np.nan
    write_raster(tmp_path, heights)
    site, _ = plan(tmp_path)
    assert site.dtm.filled == 0
    assert site.dtm.repairs == ()


def test_stairs_go_and_samples_stay_within_half_a_step(tmp_path):
    row, column = np.mgrid[0:150, 0:200]
    truth = 12.0 + 0.012 * column + 2.0 * np.sin(row / 60.0) + 1.2 * np.cos(column / 45.0)
    quantum = 0.1
    write_raster(tmp_path, np.round(truth / quantum).astype(np.uint8), scale=quantum)
    plain, _ = plan(tmp_path)
    site, _ = plan(tmp_path, replace(SPEC, destair=True))
    before, after = plain.dtm.heights, site.dtm.heights
    rows, columns = (slice(n // 2 - 60, n // 2 + 60) for n in after.shape)
    assert np.abs(after - before).max() <= 0.5 * quantum + 1e-9
    # Steps of a whole quantum between neighbours are gone, and the truth is nearer.
    step_before, step_after = (np.abs(np.diff(z[rows, columns], axis=1)) for z in (before, after))
    assert (step_before > 0.9 * quantum).mean() > 0.1
    assert step_after.max() < 0.7 * quantum
    assert (step_after < 0.01 * quantum).mean() < 0.2 * (step_before < 0.01 * quantum).mean()
    assert "half a step" in site.dtm.repairs[0]
    assert "destair" in words(tmp_path)
    smoothed = tf.Recipe(
        name="x", body="mars", dtm=replace(SPEC, destair=True),
        terrain=tf.TerrainSpec(spacing_m=1.0),
    )  # fmt: skip
    assert "smooths them" in words(tmp_path)
    assert "smooths them" not in " ".join(dtm_lines(smoothed, tmp_path))


def test_destairing_brings_the_truth_nearer():
    row, column = np.mgrid[0:160, 0:160]
    truth = 0.03 * column + 1.5 * np.sin(row / 40.0)
    steps = np.round(truth / 0.1) * 0.1
    smooth = destair(steps, 0.1)
    assert np.std((smooth - truth)[20:-20, 20:-20]) < 0.35 * np.std((steps - truth)[20:-20, 20:-20])


def test_destair_is_for_heights_that_were_rounded(tmp_path):
    write_raster(tmp_path, rough().astype("float32"))
    with pytest.raises(DataError, match="not rounded: they have no stairs"):
        plan(tmp_path, replace(SPEC, destair=True))


@pytest.mark.parametrize(("step", "datum"), [(1.0, -2500.3), (0.25, 0.0), (0.05, -1800.0)])
def test_floats_that_were_rounded_are_told_and_smoothed(tmp_path, step, datum):
    heights = 6.0 * rough()
    write_raster(tmp_path, (step * np.round(heights / step) + datum).astype("float32"))
    told = words(tmp_path)
    assert "float32: heights come in stairs of" in told
    assert "exact planes" not in told
    site, _ = plan(tmp_path, replace(SPEC, destair=True))
    assert any("stairs of" in note for note in site.dtm.repairs)
    write_raster(tmp_path, (heights + datum).astype("float32"))
    assert "stairs" not in words(tmp_path)


@pytest.mark.parametrize("ratio", [1.5, 6.0])
def test_steps_that_bury_the_roughness_are_told(tmp_path, ratio):
    heights = fractal((400, 400))
    heights /= ratio * np.sqrt(np.mean(np.square(np.diff(heights))))
    write_raster(tmp_path, np.round(heights).astype("float32"))
    told = re.search(r"a step is ([\d.]+) times the RMS difference of neighb", words(tmp_path))
    assert (told is not None) == (ratio > 3.0)
    assert told is None or float(told.group(1)) == pytest.approx(ratio, rel=0.1)


def test_radii_in_single_precision_come_in_stairs(tmp_path):
    radii = 1737400.0 + rough()
    grid = Affine(1.0, 0.0, -200.0, 0.0, -1.0, 150.0)
    write_raster(tmp_path, radii.astype("float32"), crs=MOON_EQC, transform=grid)
    assert "float32: heights come in stairs of 12 cm" in words(tmp_path, body=MOON)
    site, _ = plan(tmp_path, replace(SPEC, destair=True), body=MOON)
    assert any("stairs of 0.125 m" in note for note in site.dtm.repairs)
    write_raster(tmp_path, radii, crs=MOON_EQC, transform=grid)
    assert "stairs" not in words(tmp_path, body=MOON)


def test_facets_are_found(tmp_path):
    heights = rough()
    heights[25:125, 50:150] = 0.05 * np.arange(100)[:, None] + 0.02 * np.arange(100)[None, :]
    write_raster(tmp_path, heights.astype("float32"))
    site, _ = plan(tmp_path)
    patch = site.dtm.heights.size
    assert site.dtm.planar_fraction == pytest.approx(96**2 / patch, rel=0.05)
    assert "exact planes" in words(tmp_path)
    assert not planar_posts(rough()).any()


def test_seams_are_found():
    heights = rough()
    valid = np.ones(heights.shape, bool)
    assert assess(heights, valid, quantum=None).seams == ()
    heights[:, 123:] += 0.4
    found = assess(heights, valid, quantum=None).seams
    assert [(line, number) for line, number, _ in found] == [("column", 123)]
    assert found[0][2] == pytest.approx(0.4, rel=0.1)


@pytest.mark.parametrize("height", [20.0, -1000.0])
def test_spikes_are_no_seams(tmp_path, height):
    heights = fractal()
    write_raster(tmp_path, heights.astype("float32"))
    assert "spike" not in words(tmp_path)
    heights[70, 100], heights[20, 50] = height, 0.7 * height
    assert assess(heights, np.ones(heights.shape, bool), quantum=None).seams == ()
    write_raster(tmp_path, heights.astype("float32"))
    told = words(tmp_path)
    assert "above or below all around it: a spike, at row 70, column 100" in told
    assert "seams" not in told


def fractal(shape=(200, 240), seed=3):
    """Ground that is as rough in each direction [m]."""
    waves = np.hypot(*np.meshgrid(np.fft.rfftfreq(shape[1]), np.fft.fftfreq(shape[0])))
    waves[0, 0] = np.inf
    noise = np.random.default_rng(seed).normal(size=waves.shape)
    found = np.fft.irfft2(noise / waves**1.7, s=shape)
    return 2.0 * found / found.std()


@pytest.mark.parametrize("period", [2, 4, 9])
def test_stripes_are_found(tmp_path, period):
    heights = fractal()
    valid = np.ones(heights.shape, bool)
    assert assess(heights, valid, quantum=None).stripes == ()
    seamed = heights + 0.8 * (np.arange(heights.shape[1]) > 90)
    assert assess(seamed, valid, quantum=None).stripes == ()
    striped = heights + 0.3 * (np.arange(heights.shape[1]) % period < period // 2)
    for z, name in ((striped, "column"), (striped.T, "row")):
        ((line, step),) = assess(z, np.ones(z.shape, bool), quantum=None).stripes
        assert line == name
        assert 0.05 < step < 0.7
    write_raster(tmp_path, striped.astype("float32"))
    assert "stripes along its columns" in words(tmp_path)


@settings(max_examples=15, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 2**32 - 1),
    quantum=st.floats(1e-3, 50.0),
    slope=st.floats(0.0, 3.0),
    jump=st.integers(0, 60),
    shape=st.tuples(st.integers(3, 40), st.integers(3, 40)),
)
@pytest.mark.slow
def test_destaired_heights_stay_within_half_a_step(seed, quantum, slope, jump, shape):
    """Whatever the ground: smooth, steep, noisy, with cliffs."""
    random = np.random.default_rng(seed)
    row, column = np.mgrid[0 : shape[0], 0 : shape[1]]
    steps = slope * column + random.normal(0.0, random.uniform(0.0, 3.0), shape) - 0.2 * row
    steps += jump * (column > shape[1] // 2)
    heights = np.round(steps) * quantum - 4000.0
    smooth = destair(heights, quantum)
    assert np.abs(smooth - heights).max() <= 0.5 * quantum * (1.0 + 1e-9) + 1e-9
    level = destair(np.full(shape, 7.0 * quantum), quantum)
    assert np.allclose(level, 7.0 * quantum, rtol=0.0, atol=1e-9 * quantum)


def test_context_moves_off_the_edge(tmp_path):
    write_raster(tmp_path, rough((400, 400)).astype("float32"))
    site, _ = plan(tmp_path, replace(SPEC, centre=Centre(offset_m=(-140.0, 160.0))))
    assert site.dtm.heights.shape == (256, 256)


LABEL = DATA / "labels"
"""Holds the label of the Curiosity landing site's DTM, whose pixels are not at hand."""


@pytest.mark.skipif(not LABEL.is_dir(), reason="the PDS3 label is not at hand")
def test_attached_pds3_label_of_a_hirise_dtm(tmp_path):
    """The label as it stands, but for its size, before an image of our own."""
    text = next(LABEL.glob("DTEEC*")).read_text(errors="replace").replace("\r", "")
    rows, columns = 300, 400
    for key, value in (
        ("RECORD_BYTES", 4 * columns), ("FILE_RECORDS", rows + 20), ("LABEL_RECORDS", 20),
        ("LINES", rows), ("LINE_SAMPLES", columns), (r"\^IMAGE", 21), ("LINE_LAST_PIXEL", rows),
        ("SAMPLE_LAST_PIXEL", columns),
    ):  # fmt: skip
        text = re.sub(rf"(?m)^(\s*{key}\s*=\s*)\S+", rf"\g<1>{value}", text)
    heights = (-4500.0 + rough((300, 400))).astype("<f4")
    heights[10:30, 10:30] = np.frombuffer(bytes.fromhex("fbff7fff"), "<f4")[0]
    label = text.replace("\n", "\r\n").encode().ljust(20 * 4 * columns)
    (tmp_path / "dtm.tif").write_bytes(label + heights.tobytes())
    site, ground = plan(tmp_path)
    assert site.datum_height == pytest.approx(heights[149:151, 199:201].mean(), abs=0.01)
    lon, lat = np.degrees(site.lonlat)
    assert 137.2 < lon < 137.6
    assert -4.75 < lat < -4.35
    assert site.dtm.posting == pytest.approx(1.0118, abs=0.01)
    assert ground.shape == (61, 101)


@pytest.mark.parametrize(("body", "crs", "height"), [(MARS, EQC, -9500.0), (MOON, MOON_EQC, 12e3)])
def test_heights_that_no_ground_has_are_told(tmp_path, body, crs, height):
    heights = rough().astype("float32")
    write_raster(tmp_path, heights + 100.0, crs=crs)
    assert "beyond" not in words(tmp_path, body=body)
    write_raster(tmp_path, heights + height, crs=crs)
    assert f"are beyond {body.name}'s" in words(tmp_path, body=body)
    site, _ = plan(tmp_path, body=body)
    assert any(f"are beyond {body.name}'s" in line for line in site_facts(site))


def test_units_that_nobody_declares_are_called_assumed(tmp_path):
    write_raster(tmp_path, rough().astype("float32"))
    assert "the file declares no unit: metres are assumed" in words(tmp_path)
    assert "assumed" not in words(tmp_path, replace(SPEC, height_scale=1.0))
    write_raster(tmp_path, rough().astype("float32"), units="m")
    assert "assumed" not in words(tmp_path)


def test_a_dtm_with_two_posts_across_the_site_is_told(tmp_path):
    write_raster(tmp_path, rough().astype("float32"))
    site, _ = plan(tmp_path, replace(SPEC, size_m=(2.0, 2.0)))
    assert any("2 postings wide" in line for line in site_facts(site))
    site, _ = plan(tmp_path, replace(SPEC, size_m=(8.0, 8.0)))
    assert not any("postings wide" in line for line in site_facts(site))


def test_the_extent_of_a_georeferenced_raster_is_told_to_be_idle(tmp_path):
    write_raster(tmp_path, rough().astype("float32"))
    recipe = tf.Recipe(name="a", body="mars", dtm=SPEC, terrain=tf.TerrainSpec(spacing_m=1.0))
    tf.plan(recipe, folder=tmp_path)
    extended = replace(recipe, dtm=replace(SPEC, extent_m=(50.0, 50.0)))
    told = "dtm.extent_m: has no effect: dtm.tif is georeferenced"
    with pytest.warns(RecipeWarning, match=told) as caught:
        tf.plan(extended, folder=tmp_path)
    assert {warning.filename for warning in caught} == {__file__}


def test_a_scale_below_zero_is_told_and_taken_at_its_word(tmp_path):
    heights = rough()
    write_raster(tmp_path, (-heights).astype("float32"), scale=-1.0)
    assert "a scale of -1: the larger a number, the lower its ground" in words(tmp_path)
    site, _ = plan(tmp_path)
    assert "numbers taken as depths, by their scale of -1" in site.dtm.repairs
    write_raster(tmp_path, heights.astype("float32"))
    assert "the lower its ground" not in words(tmp_path)
    assert np.array_equal(plan(tmp_path)[0].dtm.heights, site.dtm.heights)
