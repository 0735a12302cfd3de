"""Pictures: what must be visible in them, that they repeat, and the colour of the ground."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image
from scipy.ndimage import gaussian_filter

from terrain_forge.base import compass_to_direction
from terrain_forge.model import MARS, MOON, Mesh, Window
from terrain_forge.scene import (
    RayScene,
    open_scene,
    render_from_above,
    render_preview,
    subject_of,
    take_picture,
    write_preview,
)
from terrain_forge.scene.camera import map_camera, pinhole_camera
from terrain_forge.scene.picture import radiance_seen
from terrain_forge.scene.stage import AMBIENT, GROUND_RGB, prepare_stage
from terrain_forge.terrain import AppearanceSpec, colour_ground, stencil_reach
from tests.helpers import worlds
from tests.helpers.pictures import PREVIEW


@pytest.fixture(scope="module")
def flat_world():
    """Level grey ground on the Moon with one boulder at (3, 2), the Sun low in the east."""
    world = worlds.world(rocks=1)
    ground = world.ground.replace(elevation=np.zeros_like(world.ground.elevation))
    rock = world.field.replace(
        position=np.array([[3.0, 2.0, 0.3]]), scale=np.array([1.5]), diameter=np.array([1.5])
    )
    grey = np.full_like(world.appearance.ground_rgb, 107)
    return world.replace(
        site=world.site.replace(body=MOON),
        ground=ground,
        field=rock,
        trajectories=(),
        appearance=world.appearance.replace(ground_rgb=grey),
        lighting=world.lighting.replace(
            sun_azimuth=np.pi / 2, sun_elevation=0.5, sky_rgb=MOON.sky_rgb
        ),
    )


def aerial(world, width=240, height=160):
    with open_scene(world) as scene:
        camera = map_camera(middle=(0, 0), top=50, pixel=0.1, width=width, height=height)
        return take_picture(scene, camera)


def patch(image, east, north, reach=3):
    """Mean of the pixels about a place in a picture of 0.1 m pixels centred on the origin."""
    column, row = int(120 + east * 10), int(80 - north * 10)
    return image[row - reach : row + reach + 1, column - reach : column + reach + 1].mean()


def test_shadow_falls_away_from_the_sun_and_is_as_long_as_geometry_says(flat_world):
    image = aerial(flat_world)
    lit, shadow = patch(image, 6.0, 2.0), patch(image, 1.75, 2.0, reach=1)
    assert shadow < 0.5 * lit
    top = rock_top(flat_world)
    length = top / np.tan(flat_world.lighting.sun_elevation)
    assert patch(image, 3.0 - length - 1.6, 2.0) == pytest.approx(lit, rel=0.25)
    assert patch(image, 3.0, -2.0) == pytest.approx(lit, rel=0.25)


def edge_width(world):
    """Width [m] over which the end of a wall's shadow brightens from 15 % to 85 % of its range."""
    wall = np.zeros_like(world.ground.elevation)
    wall[:, world.ground.east > 5.0] = 0.6
    lighting = world.lighting.replace(sun_elevation=0.1)
    image = aerial(world.replace(ground=world.ground.replace(elevation=wall), lighting=lighting))
    rows = np.r_[30:55, 95:130]  # those that the boulder's shadow does not cross
    light = (image[rows, 60:160].mean(axis=(0, 2)) / 255.0) ** 2.2  # 6 m west to 4 m east
    dark, lit = light[60:90].mean(), light[:15].mean()
    part = (light - dark) / (lit - dark)
    return 0.1 * np.count_nonzero((part > 0.15) & (part < 0.85))


def test_edges_of_shadows_are_as_soft_as_the_sun_is_wide(flat_world):
    """h·d/sin²(elevation) in all; of a disc, 59 % of that lie between 15 and 85 % of its light."""
    body = flat_world.site.body
    point = flat_world.replace(site=flat_world.site.replace(body=body.replace(sun_diameter=1e-9)))
    wide = flat_world.replace(
        site=flat_world.site.replace(body=body.replace(sun_diameter=2 * body.sun_diameter))
    )
    whole = 0.6 * body.sun_diameter / np.sin(0.1) ** 2
    assert edge_width(point) <= 0.2
    assert edge_width(wide) == pytest.approx(0.585 * 2 * whole, abs=0.2)


def rock_top(world):
    with open_scene(world) as scene:
        return 50.0 - scene.cast([3.0, 2.0, 50.0], [0, 0, -1]).distance[0]


def test_level_sunlit_ground_shows_in_its_own_colour(flat_world):
    for elevation in (0.2, 0.6, 1.2):
        lighting = flat_world.lighting.replace(sun_elevation=elevation)
        image = aerial(flat_world.replace(lighting=lighting))
        assert image[20:140, 10:80].mean() == pytest.approx(107, rel=0.12)


def test_slope_towards_the_sun_is_brighter(small_world):
    tilted = small_world.ground.replace(
        elevation=np.broadcast_to(0.15 * small_world.ground.east, small_world.ground.shape)
    )
    bare = worlds.bare(small_world, ground=tilted, trajectories=())
    west = bare.lighting.replace(sun_azimuth=np.radians(270), sun_elevation=0.5)
    east = bare.lighting.replace(sun_azimuth=np.radians(90), sun_elevation=0.5)
    assert compass_to_direction(np.radians(90), 0.0)[0] == pytest.approx(1.0)
    towards, away = (aerial(bare.replace(lighting=light)).mean() for light in (west, east))
    assert towards > 1.1 * away


def test_slopes_get_more_of_the_sky_on_the_suns_side(small_world):
    """So relief shows in shadows: by the sky's lean and the sine of the slope."""
    rise = np.broadcast_to(0.15 * small_world.ground.east, small_world.ground.shape)
    bare = small_world.replace(
        ground=small_world.ground.replace(elevation=rise),
        field=small_world.field.select(np.arange(0)),
        trajectories=(),
        horizon=None,
        lighting=small_world.lighting.replace(sun_elevation=0.5, dust=MARS.dust),
    )
    camera = map_camera(middle=(0, 0), top=50, pixel=0.1, width=40, height=40)
    gains = []
    with open_scene(bare) as scene:
        for azimuth in (270.0, 90.0):
            light = bare.lighting.replace(sun_azimuth=np.radians(azimuth))
            stage = prepare_stage(scene, light, 3, facing=1.0, camera=camera)
            even = stage._replace(lean=(np.float32(0.0), np.float32(0.0)))
            pictures = [
                radiance_seen(scene, camera, stage=one).mean(axis=(0, 1)) for one in (stage, even)
            ]
            gains.append(pictures[0] - pictures[1])
    lean = float(np.hypot(*stage.lean)) * np.sin(np.arctan(0.15))
    albedo = stage.nodes[..., GROUND_RGB:].mean(axis=(0, 1))
    # The grain tilts faces every way, some steeply, which takes a part of it.
    whole = albedo * stage.colours[AMBIENT] * lean
    assert gains[0] == pytest.approx(0.85 * whole, rel=0.12)
    assert gains[1] == pytest.approx(-0.65 * whole, rel=0.25)


def test_preview_shows_sky_above_ground_and_repeats(small_world):
    image = render_preview(small_world, width=322, height=181)
    assert image.shape == (181, 322, 3)
    assert image.dtype == np.uint8
    sky, ground = image[:20].astype(float), image[-60:].astype(float)
    assert sky.std(axis=1).max() < 3.0
    assert ground.std() > 8.0
    np.testing.assert_array_equal(image, render_preview(small_world, width=322, height=181))


def test_moon_has_a_black_sky(flat_world):
    image = render_preview(flat_world, width=160, height=90)
    assert image[:10].max() == 0


def test_written_picture_is_the_rendered_one(small_world, tmp_path):
    write_preview(small_world, tmp_path / "preview.png")
    image = np.asarray(Image.open(tmp_path / "preview.png"))
    assert image.shape == (PREVIEW[1], PREVIEW[0], 3)
    np.testing.assert_array_equal(image, render_preview(small_world))


def test_map_is_north_up(flat_world):
    rgb = flat_world.appearance.ground_rgb.copy()
    rows, columns = rgb.shape[:2]
    rgb[rows // 2 :, columns // 2 :] = (107, 20, 20)  # the north-east
    world = flat_world.replace(appearance=flat_world.appearance.replace(ground_rgb=rgb))
    image = render_from_above(world, 240).astype(int)
    assert image.shape == (160, 240, 3)
    red = (image[..., 0] - image[..., 2] > 40).reshape(2, 80, 2, 120).mean(axis=(1, 3))
    np.testing.assert_allclose(red, [[0.0, 1.0], [0.0, 0.0]], atol=0.1)


def test_a_map_is_lit_alike_on_both_sides_of_the_border(small_world):
    grey = np.full_like(small_world.appearance.ground_rgb, 107)
    level = np.zeros_like(small_world.ground.elevation)
    bare = small_world.replace(
        ground=small_world.ground.replace(elevation=level),
        appearance=small_world.appearance.replace(ground_rgb=grey),
        field=small_world.field.select(np.arange(0)),
    )
    image = aerial(worlds.with_horizon(bare), width=280, height=200).astype(float)
    within, beyond = image[60:140, 60:220].mean(), image[:, :15].mean()  # from 2 m on, in 0.1 m
    assert beyond == pytest.approx(within, rel=0.05)


def test_ground_beyond_the_border_is_as_rough_to_the_eye_as_that_within(small_world):
    """Its rings hold no waves so short: what a pixel shows of them has to be drawn."""
    grey = np.full_like(small_world.appearance.ground_rgb, 107)
    rows, columns = grey.shape[:2]
    spacing = small_world.ground.spacing
    noise = np.random.default_rng(4).normal(size=(rows, columns))
    waves = gaussian_filter(noise, 0.15 / spacing)
    ratios = []
    for rise in (0.05, 0.2):
        slopes = np.hypot(*np.gradient(waves, spacing)) / np.sqrt(2.0)
        rough = waves * rise / np.sqrt((slopes**2).mean())
        bare = small_world.replace(
            ground=small_world.ground.replace(elevation=rough),
            appearance=small_world.appearance.replace(ground_rgb=grey),
            field=small_world.field.select(np.arange(0)),
        )
        image = aerial(worlds.with_horizon(bare), width=280, height=200).astype(float)
        within, beyond = image[60:140, 60:220].std(), image[:, :15].std()
        ratios.append(beyond / within)
    np.testing.assert_allclose(ratios, 1.0, atol=0.35)


def test_what_leans_over_beyond_the_border_is_lit_by_the_sun_before_it(small_world):
    """As faces of rocks do; the ground's triangles alone all look up."""
    bare = small_world.replace(
        ground=small_world.ground.replace(elevation=np.zeros_like(small_world.ground.elevation)),
        field=small_world.field.select(np.arange(0)),
    )
    world = worlds.with_horizon(bare)
    east = world.ground.bounds[2]
    wall = np.array([(4.0, -3.0, -1.0), (4.0, 3.0, -1.0), (3.2, 3.0, 2.0), (3.2, -3.0, 2.0)])
    first, horizon = len(world.horizon.mesh.vertices), world.horizon
    faces = first + np.array([(1, 0, 3), (1, 3, 2)], np.int32)
    normal = np.cross(wall[0] - wall[1], wall[3] - wall[1])
    assert (normal[[0, 2]] < 0.0).all()
    world = world.replace(
        horizon=horizon.replace(
            mesh=Mesh(
                vertices=np.concatenate([horizon.mesh.vertices, wall + np.array([east, 0.0, 0.0])]),
                faces=np.concatenate([horizon.mesh.faces, faces]),
            ),
            normals=np.concatenate(
                [horizon.normals, np.tile(normal / np.linalg.norm(normal), (4, 1))]
            ),
            rgb=np.concatenate([horizon.rgb, np.full((4, 3), 120.0)]),
        )
    )
    camera = pinhole_camera(
        position=np.array([east - 4.0, 0.0, 0.5]), yaw=0.0, pitch=0.0, field_of_view=0.2,
        width=20, height=10,
    )  # fmt: skip
    seen = []
    for azimuth_deg in (270.0, 90.0):
        sun = {"sun_azimuth": np.radians(azimuth_deg), "sun_elevation": np.radians(15.0)}
        with open_scene(world.replace(lighting=world.lighting.replace(**sun))) as scene:
            seen.append(take_picture(scene, camera).astype(float).mean())
    assert seen[0] > 1.4 * seen[1]


def test_hills_beyond_the_border_show_no_triangles_where_the_sun_grazes_them(flat_world):
    """Coarse triangles shade themselves and each other where the smooth hill is lit."""
    world = worlds.with_horizon(worlds.bare(flat_world))
    steps = np.linspace(-30.0, 30.0, 13)
    x, y = (part.ravel() for part in np.meshgrid(steps, steps))
    middle, bend = world.ground.bounds[2] + 31.0, 1.0 / 60.0
    hill = np.column_stack([x + middle, y, -0.5 * bend * (x * x + y * y)])
    normals = np.column_stack([bend * x, bend * y, np.ones_like(x)])
    corner = np.add.outer(13 * np.arange(12), np.arange(12)).ravel()
    faces = [(corner, corner + 1, corner + 14), (corner, corner + 14, corner + 13)]
    horizon = world.horizon.replace(
        mesh=Mesh(
            vertices=hill,
            faces=np.concatenate([np.column_stack(three) for three in faces]).astype(np.int32),
        ),
        normals=normals / np.linalg.norm(normals, axis=1)[:, None],
        rgb=np.full((len(hill), 3), 120.0),
        ground_vertices=len(hill),
        ground_faces=2 * len(corner),
    )
    sun = {"sun_azimuth": np.radians(90.0), "sun_elevation": np.radians(10.0)}
    world = world.replace(horizon=horizon, lighting=world.lighting.replace(**sun))
    camera = map_camera(middle=(middle, 0), top=100, pixel=0.2, width=250, height=250)
    with open_scene(world) as scene:
        picture = take_picture(scene, camera).astype(float).mean(axis=-1)
    along = picture.mean(axis=0)
    assert np.ptp(along) > 100.0
    assert np.abs(np.diff(along)).max() < 10.0


def test_world_without_rocks_and_paths_has_a_picture(flat_world):
    assert render_preview(worlds.bare(flat_world), width=64, height=36).shape == (36, 64, 3)


def test_ground_colour_is_the_same_in_every_window(small_world):
    site, ground = small_world.site, small_world.ground
    whole = colour_ground(site=site, window=site.window, ground=ground, spec=AppearanceSpec())
    for column, row, columns, rows in ((0, 0, 20, 11), (13, 9, 40, 30), (70, 50, 26, 14)):
        window = Window(column=column, row=row, columns=columns, rows=rows)
        padded = site.padded(window, stencil_reach(site))
        part = ground.cut(
            column=padded.column, row=padded.row, columns=padded.columns, rows=padded.rows
        )
        colour = colour_ground(site=site, window=window, ground=part, spec=AppearanceSpec())
        np.testing.assert_array_equal(colour, whole[window.nodes_in(site.window)])


def test_ground_colour_is_the_wanted_one_and_varies_as_told(small_world):
    site, ground = small_world.site, small_world.ground
    wanted = (0.2, 0.5, 0.7)
    spread = {}
    for variation in (0.0, 0.3, 1.0):
        spec = AppearanceSpec(ground_rgb=wanted, variation=variation)
        colour = colour_ground(site=site, window=site.window, ground=ground, spec=spec)
        spread[variation] = colour.astype(float).std(axis=(0, 1)).max()
        np.testing.assert_allclose(colour.mean(axis=(0, 1)) / 255, wanted, atol=0.1)
    assert spread[0.0] == 0.0
    assert 1.0 < spread[0.3] < 0.5 * spread[1.0]


def test_steep_ground_and_hollows_are_darker(small_world):
    site = small_world.site
    east, north = site.axes(site.window)
    bowl = 0.15 * (east[None, :] ** 2 + north[:, None] ** 2)
    shape = small_world.ground
    images = [
        colour_ground(
            site=site,
            window=site.window,
            ground=shape.replace(elevation=elevation),
            spec=AppearanceSpec(variation=1.0),
        ).astype(float)
        for elevation in (np.zeros(shape.shape), bowl)
    ]
    assert np.all(images[1].mean(axis=2) <= images[0].mean(axis=2) + 1)
    assert images[1].mean() < images[0].mean() - 5


def test_rocks_of_the_scene_are_the_world_s(small_world):
    with open_scene(small_world) as scene:
        assert isinstance(scene, RayScene)
        assert scene.subject == subject_of(small_world)
        np.testing.assert_array_equal(scene.subject.instances.position, small_world.field.position)
