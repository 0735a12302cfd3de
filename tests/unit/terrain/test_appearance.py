"""The ground's looks: soils, orthoimages, the detail tile, baked textures, in every window."""

from __future__ import annotations

import numpy as np
import pytest
import rasterio
from PIL import Image as Picture
from rasterio.crs import CRS
from rasterio.enums import ColorInterp
from rasterio.transform import Affine

from terrain_forge.base import DataError, RecipeError, linear_from_srgb
from terrain_forge.dtm import transform
from terrain_forge.geometry import bake_ground, finest_texture, grid_texture_coordinates
from terrain_forge.making import plan
from terrain_forge.model import BODIES, GroundDetail, Window, World
from terrain_forge.pipeline import realise
from terrain_forge.terrain import (
    AppearanceSpec,
    colour_ground,
    ground_detail,
    shape_ground,
    stencil_reach,
)
from terrain_forge.terrain.detail import DetailSpec
from terrain_forge.terrain.layers.displacement_map import DisplacementMap
from terrain_forge.terrain.masks import HeightBand, Mask
from terrain_forge.terrain.orthoimage import OrthoimageSpec
from tests.helpers import worlds
from tests.helpers.recipes import flat

MARS_RADIUS = 3396190.0


def recipe(spec, *, body="mars", lonlat=(137.4, -4.6), size=(60.0, 40.0), spacing=0.5):
    more = {"terrain": {"appearance": spec}, "body": body, "exports": ()}
    return flat(size, spacing, shapes=1, lonlat=lonlat, **more)


def ortho(image, **others):
    return AppearanceSpec(variation=0.0, orthoimage=OrthoimageSpec(image=image, **others))


def coloured(site):
    """sRGB colour of the nodes of a planned site."""
    layers, spec = site.recipe.terrain.layers, site.recipe.terrain.appearance
    ground = shape_ground(site=site, window=site.window, layers=layers)
    return colour_ground(site=site, window=site.window, ground=ground, spec=spec, layers=layers)


def write_picture(path, proj, *, pixel, centre, values, turn=0.0):
    """A GeoTIFF whose middle lies on longitude and latitude [degrees]."""
    crs = CRS.from_proj4(proj)
    geographic = CRS.from_proj4(f"+proj=longlat +R={MARS_RADIUS} +no_defs")
    x, y = transform(
        geographic.to_wkt(), crs.to_wkt(), np.array([centre[0]]), np.array([centre[1]])
    )
    bands, rows, columns = values.shape
    across = Affine.rotation(turn) * Affine.scale(pixel, -pixel)
    middle = Affine.translation(-columns / 2, -rows / 2)
    to_ground = Affine.translation(x[0], y[0]) * across * middle
    with rasterio.open(
        path, "w", driver="GTiff", width=columns, height=rows, count=bands, dtype=values.dtype,
        crs=crs, transform=to_ground,
    ) as dataset:  # fmt: skip
        dataset.write(values)
    return to_ground, crs


def blob(to_ground, crs, shape, local_crs, place, width):
    """Brightness of pixels: a Gaussian about a place of the site [m]."""
    column, row = np.meshgrid(np.arange(shape[1]) + 0.5, np.arange(shape[0]) + 0.5)
    x, y = to_ground * (column, row)
    east, north = transform(crs.to_wkt(), local_crs, x, y)
    return np.exp(-((east - place[0]) ** 2 + (north - place[1]) ** 2) / (2 * width**2))


@pytest.mark.parametrize(
    ("proj", "pixel", "turn"),
    [
        (f"+proj=eqc +lat_ts=0 +lon_0=0 +R={MARS_RADIUS}", 0.5, 0.0),
        (f"+proj=sinu +lon_0=130 +R={MARS_RADIUS}", 0.3, 30.0),
        (f"+proj=stere +lat_0=-90 +lon_0=0 +R={MARS_RADIUS}", 0.5, 0.0),
        (f"+proj=eqc +lat_ts=0 +lon_0=180 +R={MARS_RADIUS}", 0.13, 0.0),
    ],
)
def test_orthoimage_lands_where_it_belongs(tmp_path, proj, pixel, turn):
    side = 1000 if pixel < 0.2 else 600
    centre = (137.4, -4.6 if "stere" not in proj else -80.0)
    # Planned once for its local CRS, then again with a picture that is drawn in it.
    bare = plan(recipe(AppearanceSpec(), lonlat=centre))
    values = np.zeros((1, side, side), np.uint16)
    to_ground, crs = write_picture(
        tmp_path / "o.tif", proj, pixel=pixel, centre=centre, values=values, turn=turn
    )
    place = (11.3, -7.9)
    spot = blob(to_ground, crs, (side, side), bare.crs, place, 3.0)
    write_picture(
        tmp_path / "o.tif", proj, pixel=pixel, centre=centre, turn=turn,
        values=np.rint(6000 + 50000 * spot)[None].astype(np.uint16),
    )  # fmt: skip
    site = plan(recipe(ortho("o.tif"), lonlat=centre), folder=tmp_path)
    rgb = coloured(site)
    light = linear_from_srgb(rgb[..., 0] / 255.0)
    weight = light - np.median(light)
    weight[weight < 0.3 * weight.max()] = 0.0
    east, north = site.axes(site.window)
    found = (np.sum(weight * east) / weight.sum(), np.sum(weight * north[:, None]) / weight.sum())
    assert np.hypot(*np.subtract(found, place)) < 0.1
    assert [name for name, _ in site.inputs] == ["o.tif"]


def test_one_band_keeps_the_soils_mean_and_three_bands_are_the_colour(tmp_path):
    random = np.random.default_rng(0)
    grey = random.integers(60, 200, (40, 60)).astype(np.uint8)
    Picture.fromarray(grey).save(tmp_path / "grey.png")
    site = plan(recipe(ortho("grey.png", strength=0.5)), folder=tmp_path)
    light = linear_from_srgb(coloured(site) / 255.0)
    soil = linear_from_srgb(site.body.ground_rgb)
    assert np.allclose(light.mean(axis=(0, 1)), soil, rtol=0.03)
    assert light[..., 0].std() > 0.1 * soil[0]
    colour = np.zeros((40, 60, 3), np.uint8)
    colour[:20] = (200, 100, 50)  # north
    colour[20:] = (20, 40, 90)
    Picture.fromarray(colour).save(tmp_path / "rgb.png")
    rgb = coloured(plan(recipe(ortho("rgb.png")), folder=tmp_path))
    assert np.abs(rgb[50:].astype(int) - (200, 100, 50)).max() <= 1
    assert np.abs(rgb[:30].astype(int) - (20, 40, 90)).max() <= 1


def test_bands_and_palettes_are_taken_by_their_colours(tmp_path):
    wanted = (200, 120, 40)
    bands = np.stack([np.full((80, 120), value, np.uint8) for value in wanted])
    with rasterio.open(
        *(tmp_path / "bgr.tif", "w"), driver="GTiff", width=120, height=80, count=3, dtype="uint8",
        transform=Affine(2, 0, 0, 0, -2, 0),
    ) as dataset:  # fmt: skip
        dataset.write(bands[::-1])
        dataset.colorinterp = ColorInterp.blue, ColorInterp.green, ColorInterp.red
    palette = Picture.fromarray(np.full((80, 120), 3, np.uint8), "P")
    palette.putpalette([0] * 9 + [*wanted])
    palette.save(tmp_path / "palette.png")
    for name in ("bgr.tif", "palette.png"):
        found = coloured(plan(recipe(ortho(name)), folder=tmp_path))
        assert np.abs(found.astype(int) - wanted).max() <= 1, name


@pytest.mark.parametrize("orientation", range(1, 9))
def test_an_orthoimage_lies_as_its_exif_says(tmp_path, orientation):
    values = np.full((80, 120, 3), 128, np.uint8)
    values[:20, :30], values[60:, :30] = (250, 20, 20), (20, 20, 250)
    upright, exif = Picture.fromarray(values), Picture.Exif()
    upright.save(tmp_path / "upright.png")
    exif[0x0112] = orientation
    undone = {
        2: "FLIP_LEFT_RIGHT", 3: "ROTATE_180", 4: "FLIP_TOP_BOTTOM", 5: "TRANSPOSE",
        6: "ROTATE_90", 7: "TRANSVERSE", 8: "ROTATE_270",
    }.get(orientation)  # fmt: skip
    stored = upright.transpose(Picture.Transpose[undone]) if undone else upright
    stored.save(tmp_path / "turned.png", exif=exif)
    wanted, found = (
        coloured(plan(recipe(ortho(name)), folder=tmp_path)).astype(int)
        for name in ("upright.png", "turned.png")
    )
    assert np.abs(found - wanted).max() <= 1


def test_an_orthoimage_that_lies_on_no_body_runs_as_its_transform_says(tmp_path):
    values = np.full((80, 120), 128, np.uint8)
    values[:20, :30] = 250
    Picture.fromarray(values).save(tmp_path / "upright.png")
    for name, affine in (("up", (1, 0, 5, 0, 1, 7)), ("askew", (1, 1, 5, -1, 1, 7))):
        with rasterio.open(
            *(tmp_path / f"{name}.tif", "w"), driver="GTiff", width=120, height=80, count=1,
            dtype="uint8", transform=Affine(*affine),
        ) as dataset:  # fmt: skip
            dataset.write(values[None, ::-1])
    wanted, found = (
        coloured(plan(recipe(ortho(name)), folder=tmp_path)).astype(int)
        for name in ("upright.png", "up.tif")
    )
    assert np.abs(found - wanted).max() <= 1
    with pytest.raises(DataError, match=r"askew\.tif lies askew by its georeference"):
        plan(recipe(ortho("askew.tif")), folder=tmp_path)


def test_fine_orthoimage_is_averaged_not_sampled(tmp_path):
    chequers = np.indices((800, 1200)).sum(axis=0) % 2 * 65535
    Picture.fromarray(chequers.astype(np.uint16)).save(tmp_path / "fine.png")
    rgb = coloured(plan(recipe(ortho("fine.png")), folder=tmp_path))
    assert np.ptp(rgb[1:-1, 1:-1].astype(int), axis=(0, 1)).max() <= 2


def test_an_orthoimage_of_another_shape_than_the_site_is_refused_as_masks_are(tmp_path):
    Picture.fromarray(np.full((50, 100), 90, np.uint8)).save(tmp_path / "wide.png")
    with pytest.raises(DataError, match=r"100 × 50 pixels for a site of .* would be 100 × \d+"):
        plan(recipe(ortho("wide.png")), folder=tmp_path)


def test_bad_orthoimages_are_refused(tmp_path):
    proj = f"+proj=eqc +R={MARS_RADIUS}"
    values = np.full((1, 100, 100), 9, np.uint8)
    write_picture(tmp_path / "far.tif", proj, pixel=1.0, centre=(137.401, -4.6), values=values)
    with pytest.raises(DataError, match=r"the site needs columns .* which has 100 × 100") as error:
        plan(recipe(ortho("far.tif")), folder=tmp_path)
    assert error.value.key == ("terrain", "appearance", "orthoimage", "image")
    write_picture(tmp_path / "here.tif", proj, pixel=1.0, centre=(137.4, -4.6), values=values)
    with pytest.raises(DataError, match="georeferenced and the site is not"):
        plan(recipe(ortho("here.tif"), lonlat=None), folder=tmp_path)
    with pytest.raises(DataError, match=r"3396 km radius, moon has 1737 km"):
        plan(recipe(ortho("here.tif"), body="moon"), folder=tmp_path)
    with pytest.raises(DataError, match="no such file"):
        plan(recipe(ortho("none.tif")), folder=tmp_path)
    with rasterio.open(tmp_path / "here.tif", "r+") as dataset:
        dataset.nodata = 0
        values[0, 45:55, 45:55] = 0
        dataset.write(values)
    with pytest.raises(DataError, match=r"no data on \d% of the site"):
        plan(recipe(ortho("here.tif")), folder=tmp_path)


def test_soils_differ_and_belong_to_their_body():
    means = {}
    for place, soil in [(body.name, soil) for body in BODIES.values() for soil in body.soils]:
        spec = AppearanceSpec(regolith=soil.name, variation=0.0)
        rgb = coloured(plan(recipe(spec, body=place)))
        means[soil.name] = rgb.mean()
        assert np.abs(rgb / 255.0 - soil.rgb).max() < 0.005
    assert means["mars_dust"] > means["mars_plains"] > means["mars_sand"]
    assert means["lunar_highlands"] > means["lunar_mare"]
    with pytest.raises(RecipeError, match="lunar_mare is no soil of mars, which has mars_dust"):
        plan(recipe(AppearanceSpec(regolith="lunar_mare")))
    with pytest.raises(ValueError, match="not both"):
        AppearanceSpec(regolith="mars_dust", ground_rgb=(0.1, 0.1, 0.1))


class Bright(DisplacementMap):
    """A layer that brightens the ground to the east and lowers nothing."""

    def brightness(self, *, site, window):
        east, north = site.axes(window)
        return np.broadcast_to(1.0 + 0.5 * (east > 0.0), (north.size, east.size))


def test_layers_brighten_the_ground_where_their_mask_lets_them():
    site, ground = worlds.site(), worlds.ground()
    north = np.broadcast_to(ground.north[:, None] > 0.0, ground.shape)
    level = ground.replace(elevation=north)
    spec = AppearanceSpec(ground_rgb=(0.4, 0.4, 0.4), variation=0.0)
    layer = Bright(image="none", height_m=0.0, mask=Mask(height=HeightBand(above_m=0.5)))
    rgb = colour_ground(site=site, window=site.window, ground=level, spec=spec, layers=(layer,))
    light = linear_from_srgb(rgb[..., 0] / 255.0) / linear_from_srgb(0.4)
    assert np.allclose(light[40:, 50:], 1.5, rtol=0.02)
    assert np.allclose(light[:, :48], 1.0, rtol=0.02)
    assert np.allclose(light[:30], 1.0, rtol=0.02)


def test_colours_of_a_window_are_the_cut(tmp_path):
    grey = np.random.default_rng(0).integers(60, 200, (33, 49)).astype(np.uint8)
    Picture.fromarray(grey).save(tmp_path / "grey.png")
    spec = AppearanceSpec(orthoimage=OrthoimageSpec(image="grey.png"))
    site = plan(recipe(spec), folder=tmp_path)
    whole = realise(site)
    for column, row, columns, rows in ((3, 5, 70, 40), (60, 31, 60, 49)):
        window = Window(column=column, row=row, columns=columns, rows=rows)
        part, cut = realise(site, window), whole.appearance.ground_rgb[window.nodes_in(site.window)]
        assert np.array_equal(part.appearance.ground_rgb, cut)
        assert part.appearance.detail == whole.appearance.detail
    assert stencil_reach(site) == 0.5
    whole.save(tmp_path)
    assert World.load(tmp_path) == whole


def seam(values):
    """Mean step over the border of a tile that repeats, over the mean step within it."""
    values = np.asarray(values, float).reshape(*values.shape[:2], -1)
    across = np.abs(values[:, 0] - values[:, -1]).mean() / np.abs(np.diff(values, axis=1)).mean()
    along = np.abs(values[0] - values[-1]).mean() / np.abs(np.diff(values, axis=0)).mean()
    return max(across, along)


@pytest.mark.parametrize("body", ["mars", "moon"])
def test_detail_tiles_without_seam_or_anything_large(body):
    detail = ground_detail(None, plan(recipe(AppearanceSpec(), body=body)))
    assert detail.size / len(detail.brightness) <= 0.003
    assert seam(detail.brightness) < 1.2
    assert seam(detail.normals) < 1.2
    assert detail.brightness.mean() == pytest.approx(GroundDetail.MIDDLE, abs=0.5)
    normals = detail.normals / 127.5 - 1.0
    assert np.abs(np.linalg.norm(normals, axis=2) - 1.0).max() < 0.02
    assert np.abs(normals[..., :2].mean(axis=(0, 1))).max() < 0.01
    # What repeats is seen by its coarse parts: blocks of a sixth of the tile are all alike.
    side = len(detail.brightness) // 6
    blocks = detail.brightness[: 6 * side, : 6 * side].reshape(6, side, 6, side).mean(axis=(1, 3))
    assert blocks.std() < 0.02 * GroundDetail.MIDDLE


def test_users_own_detail(tmp_path):
    column, row = np.meshgrid(np.arange(64), np.arange(48))
    wave = 128 + 90 * np.sin(2 * np.pi * 2 * column / 64) + 0 * row
    Picture.fromarray(wave.astype(np.uint8)).save(tmp_path / "sand.png")
    spec = AppearanceSpec(detail=DetailSpec(image="sand.png", size_m=0.48, relief_m=0.01))
    site = plan(recipe(spec), folder=tmp_path)
    detail = ground_detail(spec.detail, site)
    assert detail.size == 0.48
    assert detail.brightness.shape == (48, 48)
    assert detail.brightness.mean() == pytest.approx(128, abs=1.5)
    rise = -(detail.normals[..., 0] / 127.5 - 1.0) / (detail.normals[..., 2] / 127.5 - 1.0)
    expected = 0.01 * 90 / 255 * 2 * np.pi * 2 / 0.48
    assert np.abs(rise).max() == pytest.approx(expected, rel=0.15)
    assert [name for name, _ in site.inputs] == ["sand.png"]


def test_baked_texture_has_the_colours_of_the_nodes_and_meets_at_tiles(small_world):
    rows, columns = small_world.ground.shape
    colours = np.empty((rows, columns, 3), np.uint8)
    colours[..., 0] = 60 + np.arange(columns)
    colours[..., 1] = 60 + np.arange(rows)[:, None]
    colours[..., 2] = 90
    world = small_world.replace(appearance=small_world.appearance.replace(ground_rgb=colours))
    baked = bake_ground(world, finer=8)
    assert baked.rgb.shape == (8 * rows, 8 * columns, 3)
    # Where texture coordinates put the nodes, the picture shows their colour on the mean.
    uv = grid_texture_coordinates(rows, columns).reshape(rows, columns, 2)[20:30, 40:60]
    i = np.floor(uv[..., 0] * baked.rgb.shape[1]).astype(int)
    j = np.floor(uv[..., 1] * baked.rgb.shape[0]).astype(int)
    shown = linear_from_srgb(baked.rgb[j, i] / 255.0).mean(axis=(0, 1))
    wanted = linear_from_srgb(colours[20:30, 40:60] / 255.0).mean(axis=(0, 1))
    assert np.allclose(shown, wanted, rtol=0.12)
    west, east = [tile.world for tile in world.tiles(cells=48)][:2]
    one, other = bake_ground(west, finer=4), bake_ground(east, finer=4)
    assert np.array_equal(one.normals[:, -4:], other.normals[:, :4])
    assert np.abs(one.rgb[:, -4:].astype(int) - other.rgb[:, :4]).max() <= 1


@pytest.mark.slow
def test_baked_texture_holds_what_the_grid_cannot(small_world):
    plain = bake_ground(small_world, finer=1)
    fine = bake_ground(small_world, finer=16)
    assert fine.rgb.astype(float).std() > plain.rgb.astype(float).std()
    step = np.abs(np.diff(fine.normals[..., 0].astype(int), axis=1))
    assert step.mean() > 1.0
    normals = fine.normals / 127.5 - 1.0
    assert np.abs(np.linalg.norm(normals, axis=2) - 1.0).max() < 0.02
    # Nothing repeats: no shift of the picture is like the picture.
    tone = fine.normals[..., 0].astype(float)
    tone -= tone.mean()
    power = np.abs(np.fft.rfft2(tone)) ** 2
    likeness = np.fft.irfft2(power, tone.shape) / power.sum() * 0.5
    likeness /= likeness[0, 0]
    likeness[:48, :48] = likeness[-48:, :48] = likeness[:48, -48:] = likeness[-48:, -48:] = 0.0
    assert np.abs(likeness).max() < 0.2


def test_finest_texture_fits():
    ground = worlds.ground()  # 65 × 97 nodes
    assert finest_texture(ground, 4096) == 42
    assert finest_texture(ground, 97) == 1
    assert finest_texture(ground, 50) == 1
