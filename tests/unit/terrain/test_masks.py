"""Where layers apply: by slope, height, image and route, alone and together, in every window."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import EntryPoint
from itertools import pairwise
from typing import Literal

import numpy as np
import pytest
from PIL import Image as Picture

from terrain_forge.base import DataError, PluginError, RecipeError, registry
from terrain_forge.making import plan
from terrain_forge.model import Image
from terrain_forge.terrain import Fractal, Layer, layer, mask_weight, shape_ground
from terrain_forge.terrain.layer import LAYERS
from terrain_forge.terrain.layers.displacement_map import DisplacementMap
from terrain_forge.terrain.masks import HeightBand, Mask, RouteBand, SlopeBand
from terrain_forge.terrain.route_distance import route_distance
from tests.helpers import worlds
from tests.helpers.recipes import flat


@dataclass(frozen=True, kw_only=True)
class Ramp(Layer):
    """Ground that rises to the east by its square: all slopes and heights occur."""

    kind: Literal["ramp"] = "ramp"

    def relief(self, *, site, window, elevation):
        east, _ = site.axes(window)
        return np.broadcast_to(0.02 * (east - site.west) ** 2, elevation.shape).copy()


@dataclass(frozen=True, kw_only=True)
class Step(Layer):
    """One metre everywhere."""

    kind: Literal["step"] = "step"

    def relief(self, *, site, window, elevation):
        return np.ones_like(elevation)


def raised(mask, *, site=None):
    """What a layer of 1 m under a mask adds to the ramp, shape [columns] of the middle row."""
    site = site or worlds.site()
    ramp = shape_ground(site=site, window=site.window, layers=(Ramp(),)).elevation.astype(float)
    both = shape_ground(site=site, window=site.window, layers=(Ramp(), Step(mask=mask)))
    return both.elevation - ramp


@dataclass(frozen=True, kw_only=True)
class Broken(Layer):
    """A layer of somebody who divides by zero."""

    kind: Literal["broken"] = "broken"

    def relief(self, *, site, window, elevation):
        return np.full_like(elevation, np.nan)


def test_layer_that_is_not_finite_is_named():
    site = worlds.site()
    with pytest.raises(PluginError, match=r"terrain.layers\[1\] \(Broken\) makes heights that"):
        shape_ground(site=site, window=site.window, layers=(Ramp(), Broken(), Step()))


def test_height_mask_keeps_the_layer_between_its_bounds():
    east, _ = worlds.site().axes(worlds.site().window)
    height = 0.02 * (east + 12.0) ** 2
    added = raised(Mask(height=HeightBand(above_m=2.0, below_m=6.0, fade_m=1.0)))[20]
    assert np.allclose(added[(height >= 2.0) & (height <= 6.0)], 1.0, atol=1e-6)
    assert np.allclose(added[(height <= 1.0) | (height >= 7.0)], 0.0, atol=1e-6)
    fading = (height > 6.0) & (height < 7.0)
    t = 7.0 - height[fading]
    assert np.allclose(added[fading], t * t * (3 - 2 * t), atol=1e-6)


def test_slope_mask_measures_the_slope_that_the_ramp_has():
    site = worlds.site()
    east, _ = site.axes(site.window)
    inner = np.s_[8:-8]
    slope = np.degrees(np.arctan(0.04 * (east + 12.0)))[inner]
    added = raised(Mask(slope=SlopeBand(below_deg=20.0, fade_deg=10.0, baseline_m=2.0)))[20, inner]
    assert np.allclose(added[slope <= 20.0], 1.0, atol=1e-6)
    assert np.allclose(added[slope >= 30.0], 0.0, atol=1e-6)
    assert np.all(np.diff(added[(slope > 20.0) & (slope < 30.0)]) < 0.0)
    above = raised(Mask(slope=SlopeBand(above_deg=25.0)))[20, inner]
    assert np.allclose(above, slope >= 25.0, atol=1e-6)


def test_inverted_mask_is_the_rest():
    band = HeightBand(below_m=3.0, fade_m=2.0)
    one, other = raised(Mask(height=band)), raised(Mask(height=band, invert=True))
    assert np.allclose(one + other, 1.0, atol=1e-6)
    assert 0.2 < one.mean() < 0.8


def test_image_mask_is_north_up_and_bilinear():
    values = np.zeros((5, 7))
    values[4, 6], values[0, 0] = 1.0, 0.5  # north-east, south-west
    site = worlds.site().replace(images=(Image(path="m.png", values=values),))
    added = raised(Mask(image="m.png"), site=site)
    assert added[-1, -1] == pytest.approx(1.0, abs=1e-6)
    assert added[0, 0] == pytest.approx(0.5, abs=1e-6)
    assert added[-1, 0] == pytest.approx(0.0, abs=1e-6)
    # Half a pixel from the corner: 24 m are 6 pixels, 16 m are 4.
    assert added[-1, -1 - 8] == pytest.approx(0.5, abs=1e-6)


def test_distance_to_a_route_is_exact():
    random = np.random.default_rng(2)
    lines = [np.cumsum(random.normal(0, 1.5, (30, 2)), axis=0), random.uniform(-9, 9, (2, 2))]
    east, north = np.arange(-20, 20, 0.37), np.arange(-15, 15, 0.41)
    found = route_distance(lines, east=east, north=north, farthest=8.0)
    expected = np.full(found.shape, np.inf)
    for line in lines:
        for a, b in pairwise(line):
            place = np.stack(np.meshgrid(east, north), -1) - a
            part = np.clip(place @ (b - a) / ((b - a) @ (b - a)), 0, 1)
            off = place - part[..., None] * (b - a)
            expected = np.minimum(expected, np.linalg.norm(off, axis=-1))
    near = expected <= 8.0
    assert near.any()
    assert not near.all()
    assert np.abs(found[near] - expected[near]).max() < 1e-12
    assert np.all(found[~near] > 8.0)


def test_route_mask_keeps_a_strip_free():
    site = worlds.site().replace(
        routes=(worlds.route([[-20, 2], [20, 2]]), worlds.route([[0, -5], [0, -4]], name="other"))
    )
    added = raised(Mask(route=RouteBand(path="way", beyond_m=3.0, fade_m=1.0)), site=site)
    _, north = site.axes(site.window)
    away = np.abs(north - 2.0)
    assert np.allclose(added[away >= 3.0], 1.0, atol=1e-6)
    assert np.allclose(added[away <= 2.0], 0.0, atol=1e-6)
    either = raised(Mask(route=RouteBand(within_m=0.5)), site=site)
    assert either[np.ix_(np.abs(north + 4.5) < 0.4, [48])].min() == pytest.approx(1.0, abs=1e-6)


def test_conditions_multiply():
    site = worlds.site().replace(routes=(worlds.route([[-20, 2], [20, 2]]),))
    height, near = HeightBand(below_m=4.0, fade_m=2.0), RouteBand(within_m=1.0, fade_m=3.0)
    both = raised(Mask(height=height, route=near), site=site)
    product = raised(Mask(height=height), site=site) * raised(Mask(route=near), site=site)
    assert np.allclose(both, product, atol=1e-5)


def test_weights_stay_between_0_and_1():
    site = worlds.site()
    random = np.random.default_rng(3)
    elevation = random.normal(0, 3, (site.window.rows + 1, site.window.columns + 1))
    mask = Mask(
        slope=SlopeBand(above_deg=10, below_deg=60, fade_deg=20),
        height=HeightBand(above_m=-2, below_m=2, fade_m=1),
    )
    weight = mask_weight(mask, site=site, window=site.window, elevation=elevation)
    assert weight.min() == 0.0
    assert 0.5 < weight.max() <= 1.0


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Mask(), "needs a slope"),
        (lambda: HeightBand(fade_m=1.0), "above_m or below_m"),
        (lambda: SlopeBand(above_deg=30.0, below_deg=10.0), "lies over"),
        (lambda: RouteBand(), "beyond_m or within_m"),
    ],
)
def test_mask_without_meaning_is_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def recipe(mask):
    relief = DisplacementMap(image="relief.png", height_m=0.2, mask=mask)
    return flat((20.0, 10.0), 0.5, terrain={"layers": (relief,)}, body="moon", exports=())


def write(path, shape, value=128):
    Picture.fromarray(np.full(shape, value, np.uint8)).save(path)


def test_another_package_can_register_a_layer(monkeypatch, caplog):
    points = [
        EntryPoint(name="ramp", value=__name__, group=LAYERS),
        EntryPoint(name="broken", value="no.such.package", group=LAYERS),
    ]
    monkeypatch.setattr(registry, "entry_points", lambda group: points if group == LAYERS else [])
    found = layer.layer_types.__wrapped__()
    assert {Ramp, Step, Fractal} <= set(found)
    assert "layer 'broken' (no.such.package) is skipped" in caplog.text


def test_mask_image_is_read_hashed_and_named(tmp_path):
    write(tmp_path / "relief.png", (11, 21), 255)
    write(tmp_path / "mask.png", (11, 21), 51)
    site = plan(recipe(Mask(image=str(tmp_path / "mask.png"))), folder=tmp_path)
    assert site.image("mask.png").max() == pytest.approx(0.2)
    assert [name for name, _ in site.inputs] == ["relief.png", "mask.png"]
    ground = shape_ground(site=site, window=site.window, layers=site.recipe.terrain.layers)
    assert np.allclose(ground.elevation, 0.04, atol=1e-6)


def test_bad_masks_are_refused_when_planned(tmp_path):
    write(tmp_path / "relief.png", (11, 21))
    write(tmp_path / "mask.png", (20, 20))
    with pytest.raises(DataError, match=r"20 × 20 pixels .* would be 20 × 10") as error:
        plan(recipe(Mask(image="mask.png")), folder=tmp_path)
    assert error.value.key == ("terrain", "layers", 0, "mask", "image")
    with pytest.raises(DataError, match="no such file"):
        plan(recipe(Mask(image="none.png")), folder=tmp_path)
    with pytest.raises(RecipeError, match="no path is called 'long', there are: none") as error:
        plan(recipe(Mask(route=RouteBand(path="long", within_m=1.0))), folder=tmp_path)
    assert error.value.key == ("terrain", "layers", 0, "mask", "route", "path")
    with pytest.raises(RecipeError, match="no path to keep a distance"):
        plan(recipe(Mask(route=RouteBand(within_m=1.0))), folder=tmp_path)
