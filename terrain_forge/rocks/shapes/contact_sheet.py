"""Contact sheets: a library's shapes on bare ground under a low Sun, to be looked at."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, quaternion_from_rpy
from terrain_forge.model import (
    MARS,
    Appearance,
    Body,
    Heightfield,
    Lighting,
    Mesh,
    RockField,
    RockLibrary,
    RockPrototype,
    Roughness,
    Site,
    Window,
    World,
)
from terrain_forge.rovers import find_rover
from terrain_forge.scene import RayScene, pinhole_camera, take_picture

SIZES = (1.0, 0.5, 0.25)
"""Exposed diameters of the rows of a sheet [m], the farthest first."""

_BURIED = (0.08, 0.2, 0.4)
_STEP = 1.45
_SPACING = 0.05
_MARGIN = 6.0
_DISTANCE = 8.0
_HEIGHT = 3.2


def render_contact_sheet(
    shapes: Sequence[RockPrototype], *, body: Body = MARS, width: int = 960, height: int = 340
) -> NDArray[np.uint8]:
    """Rocks side by side, each at three sizes, sRGB, shape [height, width, 3].

    The largest are at the back, hardly buried and of the finest level of detail; those before them
    are smaller, deeper in the ground and of the coarser levels.

    Args:
        shapes: what is shown, from left to right.
        body: whose ground, rocks and sky are shown.
        width: columns of pixels.
        height: rows of pixels.

    Raises:
        TerrainForgeError: where Embree is missing.
    """
    world = _stage(shapes, body)
    camera = pinhole_camera(
        position=np.array([0.0, -_DISTANCE, _HEIGHT]),
        yaw=0.5 * np.pi,
        pitch=float(np.arctan2(_HEIGHT - 0.1, _DISTANCE - 0.2)),
        field_of_view=2.0 * float(np.arctan(0.5 * _STEP * len(shapes) / _DISTANCE)),
        width=width,
        height=height,
    )
    with RayScene(ground=world.ground, library=world.library, rocks=world.field) as scene:
        return take_picture(world, scene, camera, world.lighting)


def _stage(shapes: Sequence[RockPrototype], body: Body) -> World:
    """A flat world on which the shapes lie in rows."""
    columns = (np.arange(len(shapes)) - 0.5 * (len(shapes) - 1)) * _STEP
    half = np.ceil(0.5 * _STEP * len(shapes) + _MARGIN)
    cells = round(2.0 * half / _SPACING)
    ground = Heightfield(
        elevation=np.zeros((cells + 1, cells + 1), np.float32),
        spacing=_SPACING,
        origin=(-half, -half),
    )
    levels = [
        shape.replace(meshes=(mesh,), uvs=(uvs,), outline_errors=(error,))
        for row in range(len(SIZES))
        for shape in shapes
        for mesh, uvs, error in [_level(shape, row)]
    ]
    rocks = _lay(levels, np.asarray(columns, np.float64))
    library = RockLibrary(prototypes=tuple(levels), seed=0, texture=np.full((2, 2), 255))
    rgb = np.round(255.0 * np.array([body.ground_rgb, body.rock_rgb])).astype(np.uint8)
    window = Window(column=0, row=0, columns=cells, rows=cells)
    return World(
        site=_site(body, 2.0 * half),
        window=window,
        ground=ground,
        appearance=Appearance(
            ground_rgb=np.broadcast_to(rgb[0], (*ground.shape, 3)), rock_rgb=rgb[1:]
        ),
        library=library,
        field=rocks,
        neighbours=rocks.select(np.zeros(len(rocks), np.bool_)),
        trajectories=(),
        rover=find_rover("morpheus"),
        lighting=Lighting(
            sun_azimuth=np.radians(250.0),
            sun_elevation=np.radians(28.0),
            irradiance=body.solar_irradiance,
            sky_rgb=body.sky_rgb,
        ),
        unplaced=(0,),
    )


def _level(shape: RockPrototype, row: int) -> tuple[Mesh, Array, float]:
    level = min(row, len(shape.meshes) - 1)
    return shape.meshes[level], shape.uvs[level], shape.outline_errors[level]


def _lay(levels: Sequence[RockPrototype], columns: Array) -> RockField:
    """The rocks in rows, buried a little more from row to row."""
    count = len(levels)
    row = np.repeat(np.arange(len(SIZES)), len(columns))
    size, buried = np.array(SIZES)[row], np.array(_BURIED)[row]
    meshes = [shape.meshes[0] for shape in levels]
    low = np.array([mesh.vertices[:, 2].min() for mesh in meshes]) * size
    high = np.array([mesh.vertices[:, 2].max() for mesh in meshes]) * size
    position = np.zeros((count, 3))
    position[:, 0] = np.tile(columns, len(SIZES))
    position[:, 1] = np.array([0.9, -0.5, -1.5])[row]
    position[:, 2] = -low - buried * (high - low)
    yaw = 0.9 * np.arange(count) + 0.4
    zero = np.zeros(count)
    volume = np.array([shape.volume for shape in levels]) * size**3
    return RockField(
        populations=("shapes",),
        id=np.arange(count, dtype=np.int32),
        population=np.zeros(count, np.int32),
        prototype=np.arange(count, dtype=np.int32),
        position=position,
        quaternion=quaternion_from_rpy(np.stack([zero, zero, yaw], -1)),
        scale=size,
        diameter=size,
        height=(1.0 - buried) * (high - low),
        buried_fraction=buried,
        volume=volume,
        mass=volume,
        dynamic=np.zeros(count, np.bool_),
        collides=np.ones(count, np.bool_),
    )


def _site(body: Body, side: float) -> Site:
    return Site(
        name="contact-sheet",
        seed=1,
        body=body,
        size=(side, side),
        spacing=_SPACING,
        crs="",
        lonlat=None,
        datum_height=0.0,
        slope=(0.0, 0.0),
        dtm=None,
        roughness=Roughness(hurst=0.7, deviation=0.0, source="flat"),
        largest_rock=max(SIZES),
        images=(),
        tables=(),
        meshes=(),
        inputs=(),
        routes=(),
        recipe_json="{}",
    )
