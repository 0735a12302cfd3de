"""A small asymmetric world made by hand: every flip, transpose and swapped axis shows on it."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import trimesh

from terrain_forge.base import quaternion_from_rpy
from terrain_forge.making import make_horizon
from terrain_forge.model import (
    MARS,
    Appearance,
    DtmPatch,
    GroundMaterial,
    Heightfield,
    Lighting,
    Mesh,
    RockField,
    RockLibrary,
    RockPrototype,
    Roughness,
    Route,
    Rover,
    Site,
    Trajectory,
    Window,
    World,
)
from terrain_forge.recipe import recipe_json
from tests.helpers.recipes import flat

SIZE = (24.0, 16.0)
SPACING = 0.25


def hill(east, north):
    """A tilted plane with one off-centre bump and some ripples [m]."""
    bump = 1.2 * np.exp(-((east - 6) ** 2 + (north + 3) ** 2) / 8)
    return 0.05 * east - 0.02 * north + bump + 0.03 * np.sin(3.1 * east + 1.7 * north)


def site() -> Site:
    """A flat Mars site of 24 × 16 m that nothing was planned for."""
    return Site(
        name="by-hand",
        seed=1,
        body=MARS,
        size=SIZE,
        spacing=SPACING,
        crs="",
        lonlat=None,
        datum_height=0.0,
        slope=(0.0, 0.0),
        dtm=None,
        roughness=Roughness(hurst=0.6, deviation=0.05, source="test"),
        largest_rock=2.0,
        images=(),
        tables=(),
        meshes=(),
        inputs=(),
        routes=(),
        recipe_json=recipe_json(flat(SIZE, SPACING, name="by-hand", seed=1)),
    )


def shaped(place: Site, height: Any, window: Window | None = None) -> Heightfield:
    """The ground of a window of a site, all of it by default, of z = height(east, north) [m]."""
    east, north = place.axes(window or place.window)
    z = np.broadcast_to(height(east[None, :], north[:, None]), (len(north), len(east)))
    origin = (float(east[0]), float(north[0]))
    return Heightfield(elevation=z, spacing=place.spacing, origin=origin)


@cache
def ground() -> Heightfield:
    """The hill on the site's lattice."""
    return shaped(site(), hill)


def patch(heights: Any, to_pixel: tuple[float, ...], posting: float = 1.0) -> DtmPatch:
    """A DTM that was read, whose posts lie so many metres apart."""
    return DtmPatch(
        heights=heights, to_pixel=to_pixel, crs="", wrap=(0.0, 0.0), posting=posting, filled=0
    )


def _prototype(stretch: tuple[float, float, float], seed: int) -> RockPrototype:
    random = np.random.default_rng(seed)
    ball = trimesh.creation.icosphere(subdivisions=2)
    vertices = ball.vertices * stretch * random.uniform(0.85, 1.0, (len(ball.vertices), 1))
    mesh = trimesh.Trimesh(vertices, ball.faces).convex_hull
    mesh.apply_translation(-mesh.center_mass)
    mesh.apply_scale(1.0 / float(np.mean(mesh.extents)))
    shape = Mesh(vertices=mesh.vertices, faces=mesh.faces)
    inertia = mesh.moment_inertia
    return RockPrototype(
        family="test",
        meshes=(shape,),
        hulls=(shape,),
        volume=float(mesh.volume),
        inertia=np.asarray(inertia),
        hull_excess=0.0,
        hull_distance=0.0,
        uvs=(shape.vertices[shape.faces][:, :, :2],),
        outline_errors=(0.0,),
        reach=0.8,
        rise=1.0,
    )


@cache
def library() -> RockLibrary:
    """Three convex, asymmetric shapes."""
    stretches = [(1.0, 0.8, 0.6), (1.2, 0.7, 0.7), (0.9, 0.9, 0.5)]
    prototypes = tuple(_prototype(s, n) for n, s in enumerate(stretches))
    texture = np.arange(64 * 64).reshape(64, 64) % 251
    normals = np.stack([texture // 4 + 90, texture // 8 + 100, np.full_like(texture, 240)], -1)
    roughness = 255 - texture // 4
    return RockLibrary(
        prototypes=prototypes, seed=0, texture=texture, normals=normals, roughness=roughness
    )


@cache
def field(count: int = 40) -> RockField:
    """Rocks of two populations lying half buried, yawed at random, away from the edge."""
    random = np.random.default_rng(5)
    shapes = library().prototypes
    prototype = random.integers(0, len(shapes), count)
    scale = random.uniform(0.2, 1.2, count)
    xy = random.uniform((-10.5, -6.5), (10.5, 6.5), (count, 2))
    z = ground().height_at(xy[:, 0], xy[:, 1])
    rpy = np.stack([random.uniform(-0.2, 0.2, count)] * 2 + [random.uniform(-3, 3, count)], -1)
    volume = np.array([shapes[p].volume for p in prototype]) * scale**3
    return RockField(
        populations=("pebbles", "boulders"),
        id=np.arange(count),
        population=(scale > 0.7).astype(int),
        prototype=prototype,
        position=np.column_stack([xy, z]),
        quaternion=quaternion_from_rpy(rpy),
        scale=scale,
        diameter=scale,
        height=0.4 * scale,
        buried_fraction=np.full(count, 0.5),
        volume=volume,
        mass=volume * MARS.rock_density,
        dynamic=np.zeros(count, np.bool_),
        collides=np.ones(count, np.bool_),
    )


@cache
def trajectory() -> Trajectory:
    """An open arc over the ground whose yaw passes π without wrapping."""
    time = np.arange(0, 20, 1 / 12)
    angle = 0.5 + 0.2 * time
    xy = np.stack([7 * np.cos(angle), 5 * np.sin(angle)], -1)
    z = ground().height_at(xy[:, 0], xy[:, 1])
    yaw = np.unwrap(np.arctan2(np.gradient(xy[:, 1]), np.gradient(xy[:, 0])))
    zero = np.zeros_like(yaw)
    return Trajectory(
        name="arc",
        time=time,
        position=np.column_stack([xy, z]),
        rpy=np.stack([zero + 0.02, zero - 0.03, yaw], -1),
        closed=False,
    )


def no_rover() -> Rover:
    """A rover without any part, for what needs none."""
    return Rover(
        name="none",
        links=(),
        wheels=(),
        sensors=(),
        torque_limit=1.0,
        speed_limit=1.0,
        tilt_limit=0.5,
        clearance=0.2,
    )


def world(*, rocks: int = 40, rover: Rover | None = None) -> World:
    """The whole world."""
    land = ground()
    return World(
        site=site(),
        window=site().window,
        ground=land,
        appearance=Appearance(
            ground_rgb=np.full((*land.shape, 3), (166, 110, 74)),
            rock_rgb=np.array([(112, 84, 69), (100, 75, 60)]),
        ),
        library=library(),
        field=field(rocks),
        neighbours=field(0),
        trajectories=(trajectory(),),
        rover=rover or no_rover(),
        lighting=Lighting(
            sun_azimuth=4.0, sun_elevation=0.6, irradiance=586.2, sky_rgb=MARS.sky_rgb
        ),
        unplaced=(0, 0),
    )


def on_ground(world: World, ground: Heightfield, **more: Any) -> World:
    """A world on another ground: all of its window, in one colour, with what else is changed."""
    rows, columns = ground.shape
    looks = world.appearance.replace(
        ground_rgb=np.tile(world.appearance.ground_rgb[0, 0], (rows, columns, 1)),
        material=None,
        drift=None,
    )
    window = Window(column=0, row=0, columns=columns - 1, rows=rows - 1)
    return world.replace(**({"ground": ground, "appearance": looks, "window": window} | more))


def of_materials(world: World, material, frictions) -> World:
    """A world whose nodes are of materials of some coefficients of friction."""
    known = [
        GroundMaterial(
            name=f"soil_{n}", kind="own", rgb=(0.4, 0.3, 0.2), friction=friction, pebbles=0.5,
            roughness=1.0, slabs=0.0,
        )
        for n, friction in enumerate(frictions)
    ]  # fmt: skip
    looks = world.appearance.replace(materials=tuple(known), material=material.astype(np.uint8))
    return world.replace(appearance=looks)


def bare(world: World, **more: Any) -> World:
    """A world without rocks, with what else is changed."""
    return world.replace(field=world.field.select(np.arange(0)), **more)


def loosened(world: World) -> World:
    """A world with every third rock dynamic, and every fifth of the others visual only."""
    row = np.arange(len(world.field))
    dynamic = row % 3 == 0
    solid = dynamic | (row % 5 > 0)
    return world.replace(field=world.field.replace(dynamic=dynamic, collides=solid))


def crowded(world: World, count: int, *, dynamic: bool = False) -> World:
    """A world with so many rocks, of 0.2 to 1.4 m, where its own are."""
    field = world.field.select(np.arange(count) % len(world.field)).replace(
        id=np.arange(count),
        diameter=np.linspace(0.2, 1.4, count),
        dynamic=np.full(count, dynamic, np.bool_),
    )
    return world.replace(field=field)


def route(points, **changes) -> Route:
    """A planned path through some points, all of the same heading."""
    points = np.asarray(points, float)
    steps = np.hypot(*np.diff(points, axis=0).T)
    values = {"name": "way", "speed": 1.0, "corridor_width": 0.0, "corridor_clearance": 0.0}
    return Route(
        position=points,
        heading=np.zeros(len(points)),
        distance=np.concatenate([[0.0], np.cumsum(steps)]),
        closed=False,
        **(values | changes),
    )


def with_horizon(world: World) -> World:
    """The world with what lies beyond its edge."""
    beyond = make_horizon(world.site, world.ground, world.appearance, world.library)
    return world.replace(horizon=beyond)
