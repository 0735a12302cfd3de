"""Keys that change nothing are told, with file and line."""

import warnings

import pytest

from terrain_forge.base import RecipeError, RecipeWarning
from terrain_forge.recipe import load_recipe, save_recipe

PLAIN = """\
name: plain
body: moon
dtm: {kind: flat, size_m: [8, 8], lonlat_deg: [0, 0]}
terrain: {spacing_m: 0.1}
"""
ROCKS = """\
rocks:
  populations:
    - {name: one, diameter_m: [0.1, 0.5], size_frequency: {kind: golombek, k: 0.05}}
"""
PATH = """\
paths:
  - {name: track, speed_m_s: 0.1, route: {kind: spline, points_m: [[-3, 0], [3, 0]]}}
"""


def load(tmp_path, text):
    path = tmp_path / "recipe.yaml"
    path.write_text(text)
    return load_recipe(path)


IDLE = [
    ("sky: {star_gain: 3.0e+4}", "sky.star_gain"),
    ("horizon: {reach_m: 0, dtm: far.tif}", "horizon.dtm"),
    ("horizon: {rocks_m: 10}", "horizon.rocks_m"),
    ("rocks: {contact: {kind: none}}", "rocks.contact"),
    ("exports: {glb: {close_within_m: 2}}", "exports.glb.close_within_m"),
    ("exports: {fine: {kind: usd, pebbles_within_m: 1}}", "exports.fine.pebbles_within_m"),
    ("exports: {sdf: {flavour: classic, normal_maps: true}}", "exports.sdf.normal_maps"),
    ("exports: {mjcf: {surface: bedrock, friction: 0.5}}", "exports.mjcf.surface"),
    ("exports: {drake: {surface: bedrock, friction: 0.5}}", "exports.drake.surface"),
    ("exports: {geotiff: {products: [slope], heights: datum}}", "exports.geotiff.heights"),
    ("dataset: {pebbles_within_m: 1}", "dataset.pebbles_within_m"),
    ("sensors: [{kind: camera, name: c, depth_factor: 500}]", "sensors[0].depth_factor"),
]


@pytest.mark.parametrize(("text", "key"), IDLE)
def test_an_idle_key_is_told_in_one_line(tmp_path, text, key):
    with pytest.warns(RecipeWarning) as caught:
        load(tmp_path, f"{PLAIN}{text}\n")
    (told,) = (str(warning.message) for warning in caught)
    line = 5 + text.count("\n")
    assert told.startswith(f"{tmp_path}/recipe.yaml:{line}: {key}: has no effect: ")
    assert {warning.filename for warning in caught} == {__file__}


@pytest.mark.parametrize(
    ("material", "key"),
    [
        ("cover: 0.5, patch_m: 1.0e-6", "patch_m"),
        ("mask: {hollow: {above_m: 0, baseline_m: 0.01}}", "mask.hollow.baseline_m"),
        ("mask: {roughness: {above_m: 0, baseline_m: 0.19}}", "mask.roughness.baseline_m"),
        ("mask: {slope: {above_deg: 5, baseline_m: 0.1}}", "mask.slope.baseline_m"),
    ],
)
def test_a_length_below_what_the_ground_tells_is_told(tmp_path, material, key):
    whole = f"{PLAIN.replace('0.1}', '0.1,')}  materials: [{{kind: sand, {material}}}]}}\n"
    with pytest.warns(RecipeWarning) as caught:
        load(tmp_path, whole)
    (told,) = (str(warning.message) for warning in caught)
    assert told.startswith(f"{tmp_path}/recipe.yaml:5: terrain.materials[0].{key}: has no effect: ")
    assert " of the ground, 0." in told


@pytest.mark.parametrize("part", ["exports: {glb: ", "exports: {usd: ", "dataset: "])
def test_pebbles_as_large_as_rocks_are_refused(tmp_path, part):
    whole = f"{PLAIN}{ROCKS}{PATH}{part}{{pebbles_min_m: 0.1}}" + "}" * part.count("{") + "\n"
    with pytest.raises(
        RecipeError, match=r":10: .*pebbles_min_m: has no effect: pebbles are below"
    ):
        load(tmp_path, whole)


CONTRADICTING = [
    ("sun: {time: 2031-02-18T20:55:00Z, azimuth_deg: 250.0}", "sun.azimuth_deg"),
    ("sun: {ls_deg: 0, elevation_deg: 12.0}", "sun.elevation_deg"),
    ("exports: {usd: {pebbles_min_m: 0.01}}", "exports.usd.pebbles_min_m"),
    ("exports: {mesh: {rocks: none, outline_error: 0.03}}", "exports.mesh.outline_error"),
    (
        "sensors: [{kind: lidar, name: l, elevations_deg: [0, 1], channels: 16}]",
        "sensors[0].channels",
    ),
]


@pytest.mark.parametrize(("text", "key"), CONTRADICTING)
def test_a_key_that_contradicts_others_is_refused_even_with_its_default(tmp_path, text, key):
    with pytest.raises(RecipeError) as error:
        load(tmp_path, f"{PLAIN}{text}\n")
    assert str(error.value).startswith(f"{tmp_path}/recipe.yaml:5: {key}: has no effect: ")


def test_an_idle_key_of_the_command_line_is_told_as_it_was_given(tmp_path):
    path = tmp_path / "recipe.yaml"
    path.write_text(PLAIN)
    with pytest.warns(RecipeWarning, match=r"^--set sky=\{star_gain: 2\}: sky.star_gain: has no"):
        load_recipe(path, changes=("sky={star_gain: 2}",))


@pytest.mark.filterwarnings("error")
def test_what_the_command_line_switches_off_is_not_told_of_the_file(tmp_path):
    path = tmp_path / "recipe.yaml"
    path.write_text(f"{PLAIN}{ROCKS}horizon: {{rocks_m: 10}}\n")
    load_recipe(path, changes=("horizon.reach_m=0",))


@pytest.mark.filterwarnings("error")
def test_keys_that_have_an_effect_are_not_told(tmp_path):
    whole = (
        f"{PLAIN}{ROCKS}{PATH}"
        "sun: {time: 2031-02-18T20:55:00Z}\n"
        "sky: {stars: true, star_gain: 10}\n"
        "horizon: {rocks_m: 10}\n"
        "exports: {usd: {pebbles_min_m: 0.02, pebbles_within_m: 1, close_within_m: 2}}\n"
    )
    load(tmp_path, whole)
    load(tmp_path, f"{PLAIN}exports: {{glb: {{close_within_m: 0}}}}\n")  # none are asked for


def test_a_saved_recipe_has_no_idle_defaults(tmp_path):
    recipe = load(tmp_path, f"{PLAIN}sun: {{time: 2031-02-18T20:55:00Z}}\n").recipe
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        again = load_recipe(save_recipe(recipe, tmp_path / "saved.yaml")).recipe
    assert again == recipe
