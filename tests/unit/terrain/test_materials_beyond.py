"""Materials beyond a world's border: the same rule near it, the regolith's colour far out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image as Picture

from terrain_forge.base import linear_from_srgb
from terrain_forge.making import make_horizon, plan
from terrain_forge.paths import PathSpec, Spline
from terrain_forge.recipe import Recipe
from terrain_forge.terrain import Fractal, MaterialSpec, mask_weight, paint, shape_ground
from terrain_forge.terrain.horizon.colours import material_tints, regolith_colour
from terrain_forge.terrain.horizon.rings import rings_around
from terrain_forge.terrain.masks import (
    HeightBand,
    Mask,
    ReliefBand,
    RouteBand,
    SlopeBand,
    mask_weight_at,
)
from tests.helpers import worlds
from tests.helpers.recipes import flat

GREEN = MaterialSpec(kind="own", rgb=(0.1, 0.7, 0.2), friction=0.5, cover=0.3, patch_m=6.0)
NO_IMAGE = Mask(slope=SlopeBand(below_deg=80.0))


def recipe(*materials: MaterialSpec, size: float, variation: bool = False) -> Recipe:
    wanted = flat((size, size), 0.25, terrain={"materials": materials}, seed=5)
    appearance = replace(wanted.terrain.appearance, variation=0.5 if variation else 0.0)
    return replace(wanted, terrain=replace(wanted.terrain, appearance=appearance))


def made(wanted: Recipe, folder="."):
    site = plan(wanted, folder=folder)
    ground = shape_ground(site=site, window=site.window, layers=())
    looks = paint(site, site.window, ground)
    return site, ground, looks, make_horizon(site, ground, looks, worlds.library())


def greenness(rgb: np.ndarray) -> np.ndarray:
    """Linear green over red."""
    linear = linear_from_srgb(np.asarray(rgb) / 255.0)
    return np.asarray(linear[..., 1] / linear[..., 0])


def on_rings(ground, horizon):
    """Each ring with the colours of its nodes."""
    start = 0
    for ring in rings_around(ground, horizon.reach):
        yield ring, horizon.rgb[start : start + len(ring.points)]
        start += len(ring.points)


@pytest.mark.parametrize("mask", [None, NO_IMAGE])
def test_patches_go_on_over_the_border(mask):
    green = replace(GREEN, mask=mask)
    _, ground, _, horizon = made(recipe(green, size=40.0))
    _, wide, looks, _ = made(recipe(green, size=60.0))
    agreed, lies = [], []
    start = 0
    for ring in rings_around(ground, horizon.reach):
        rows = slice(start, start + len(ring.points))
        start += len(ring.points)
        if not 0.0 < ring.away < 2.0:
            continue
        column, row = np.rint((ring.points - wide.origin) / wide.spacing).astype(int).T
        there = looks.material[row, column] == 1
        agreed.append(there == (greenness(horizon.rgb[rows]) > 1.2))
        lies.append(there)
    assert 0.1 < np.concatenate(lies).mean() < 0.6
    assert np.concatenate(agreed).mean() > 0.9, "nodes lie up to half a cell from those compared"


def test_far_out_the_ground_is_regolith():
    site, _, looks, horizon = made(recipe(GREEN, size=40.0, variation=True))
    _, _, bare, plain = made(recipe(size=40.0, variation=True))
    vertices = horizon.mesh.vertices[: horizon.ground_vertices]
    far = np.abs(vertices[:, :2]).max(axis=1) > 2000.0
    of_site = looks.ground_rgb.reshape(-1, 3).astype(float).mean(axis=0)
    seen = horizon.rgb[: horizon.ground_vertices][far].astype(float).mean(axis=0)
    alone = plain.rgb[: plain.ground_vertices][far].astype(float).mean(axis=0)
    assert seen == pytest.approx(alone, abs=2.0)
    assert of_site[0] - seen[0] < -5.0, "the site's own mean is another"
    assert site.recipe.terrain.materials
    assert regolith_colour(looks) == pytest.approx(regolith_colour(bare), rel=0.03)


def test_a_tint_is_the_colour_over_the_regolith_s():
    _, _, looks, _ = made(recipe(GREEN, size=40.0))
    tints = material_tints(looks)
    assert tints[0].tolist() == [1.0, 1.0, 1.0]
    soil = linear_from_srgb(looks.materials[0].rgb)
    assert tints[1] * soil == pytest.approx(linear_from_srgb(GREEN.rgb))


def test_the_colour_of_hidden_regolith_is_its_own():
    _, _, looks, _ = made(recipe(GREEN, size=40.0))
    hidden = looks.replace(material=np.ones_like(looks.material))
    assert regolith_colour(hidden) == pytest.approx(linear_from_srgb(looks.materials[0].rgb))


def test_a_mask_by_an_image_ends_beyond_the_border(tmp_path):
    Picture.fromarray(np.full((8, 8), 255, np.uint8)).save(tmp_path / "all.png")
    green = replace(GREEN, mask=Mask(image="all.png"), cover=1.0, patch_m=3.0)
    _, ground, looks, horizon = made(recipe(green, size=40.0), tmp_path)
    assert (looks.material == 1).all()
    start, seen = 0, {}
    for ring in rings_around(ground, horizon.reach):
        rows = slice(start, start + len(ring.points))
        start += len(ring.points)
        seen[ring.away] = float(np.median(greenness(horizon.rgb[rows])))
    regolith = greenness(255.0 * np.array(looks.materials[0].rgb))
    assert min(value for away, value in seen.items() if away < 1.0) > 4.0 * regolith
    outside = [value for away, value in seen.items() if away > 6.0]
    assert outside == pytest.approx([float(regolith)] * len(outside), rel=0.05)


@pytest.mark.parametrize("invert", [False, True])
def test_a_masked_material_goes_on_from_what_lies_at_the_border(tmp_path, invert):
    """West of the site the image is white, east of it black; there was a halo all around."""
    values = np.zeros((8, 8), np.uint8)
    values[:, :4] = 255
    Picture.fromarray(values).save(tmp_path / "west.png")
    mask = Mask(image="west.png", invert=invert)
    green = replace(GREEN, mask=mask, cover=1.0, patch_m=3.0)
    _, ground, looks, horizon = made(recipe(green, size=40.0), tmp_path)
    regolith = float(greenness(255.0 * np.array(looks.materials[0].rgb)))
    sides = {True: [], False: []}
    for ring, rgb in on_rings(ground, horizon):
        east = ring.points[:, 0]
        if 0.0 < ring.away < 1.0:
            for west in sides:
                side = east < -15.0 if west else east > 15.0
                sides[west].append(greenness(rgb[side]))
    with_green, without = (np.concatenate(sides[west]) for west in (not invert, invert))
    assert np.median(with_green) > 4.0 * regolith
    assert without == pytest.approx(np.full(len(without), regolith), rel=0.05)


def test_a_route_s_material_lies_beyond_where_the_route_is_near():
    green = replace(
        GREEN, mask=Mask(route=RouteBand(within_m=3.0)), cover=1.0, patch_m=3.0
    )  # fmt: skip
    path = PathSpec(
        name="east", route=Spline(points_m=((-10.0, 0.0), (0.0, 0.0), (19.0, 0.0))), speed_m_s=0.3
    )
    _, ground, looks, horizon = made(replace(recipe(green, size=40.0), paths=(path,)))
    regolith = float(greenness(255.0 * np.array(looks.materials[0].rgb)))
    near, far = [], []
    for ring, rgb in on_rings(ground, horizon):
        if 0.0 < ring.away < 1.0:
            away = np.hypot(ring.points[:, 0] - 19.0, ring.points[:, 1])
            near.append(greenness(rgb[away < 2.5]))
            far.append(greenness(rgb[away > 4.0]))
    assert np.median(np.concatenate(near)) > 4.0 * regolith
    far = np.concatenate(far)
    assert far == pytest.approx(np.full(len(far), regolith), rel=0.05)


MASKS = [
    Mask(slope=SlopeBand(above_deg=6.0, fade_deg=4.0, baseline_m=1.0)),
    Mask(hollow=ReliefBand(above_m=0.0, fade_m=0.02, baseline_m=2.0)),
    Mask(roughness=ReliefBand(below_m=0.01, fade_m=0.02, baseline_m=1.5), invert=True),
    Mask(height=HeightBand(above_m=0.0, fade_m=0.1), slope=SlopeBand(below_deg=9.0, fade_deg=5.0)),
]


@pytest.mark.parametrize("mask", MASKS)
def test_a_point_has_the_weight_that_it_has_on_a_grid(mask):
    site = plan(recipe(size=20.0))
    layers = (Fractal(hurst=0.7, deviation_1m_m=0.08),)
    ground = shape_ground(site=site, window=site.window, layers=layers)
    z = ground.elevation.astype(np.float64)
    whole = mask_weight(mask, site=site, window=site.window, elevation=z)
    j, i = (part.ravel() for part in np.mgrid[10:70:3, 10:70:3])
    found = mask_weight_at(
        mask, placed=np.ones(len(i)), east=ground.east[i], north=ground.north[j], cell=0.25,
        height_at=ground.height_at,
    )  # fmt: skip
    assert 0.05 < whole.mean() < 0.95
    assert found == pytest.approx(whole[j, i], abs=1e-6)
