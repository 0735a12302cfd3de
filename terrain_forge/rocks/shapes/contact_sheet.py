"""Contact sheets: a library's shapes on bare ground under a low Sun, to be looked at."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import (
    Array,
    linear_from_srgb,
    matrix_from_quaternion,
    quaternion_from_rpy,
)
from terrain_forge.model import MARS, Body, Heightfield, Lighting, RockPrototype
from terrain_forge.scene import Instances, RayScene, Subject, pinhole_camera, take_picture, tones

SIZES = (1.0, 0.5, 0.25)
"""Exposed diameters of the rows of a sheet [m], the farthest first."""

_BURIED = (0.08, 0.2, 0.4)
_STEP = 1.45
_SPACING = 0.05
_MARGIN = 6.0
_DISTANCE = 8.0
_HEIGHT = 3.2
_SEED = 1


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
    camera = pinhole_camera(
        position=np.array([0.0, -_DISTANCE, _HEIGHT]),
        yaw=0.5 * np.pi,
        pitch=float(np.arctan2(_HEIGHT - 0.1, _DISTANCE - 0.2)),
        field_of_view=2.0 * float(np.arctan(0.5 * _STEP * len(shapes) / _DISTANCE)),
        width=width,
        height=height,
    )
    half = np.ceil(0.5 * _STEP * len(shapes) + _MARGIN)
    cells = round(2.0 * half / _SPACING)
    ground = Heightfield(
        elevation=np.zeros((cells + 1, cells + 1), np.float32),
        spacing=_SPACING,
        origin=(-half, -half),
    )
    rgb = np.round(255.0 * np.array([body.ground_rgb, body.rock_rgb])).astype(np.uint8)
    stage = Subject(
        ground=ground,
        ground_rgb=np.broadcast_to(rgb[0], (*ground.shape, 3)),
        instances=_lay(shapes, linear_from_srgb(rgb[1] / 255.0)),
        lighting=Lighting(
            sun_azimuth=np.radians(250.0),
            sun_elevation=np.radians(28.0),
            irradiance=body.solar_irradiance,
            sky_rgb=body.sky_rgb,
        ),
        sun_diameter=body.sun_diameter,
        seed=_SEED,
        photometry=body.photometry,
        airless=body.airless,
    )
    with RayScene(stage) as scene:
        return take_picture(scene, camera)


def _lay(shapes: Sequence[RockPrototype], albedo: Array) -> Instances:
    """The rocks in rows, smaller, coarser and buried a little more from row to row."""
    rows, columns = len(SIZES), len(shapes)
    meshes = tuple(
        shape.meshes[min(row, len(shape.meshes) - 1)] for row in range(rows) for shape in shapes
    )
    row, count = np.repeat(np.arange(rows), columns), rows * columns
    size, buried = np.array(SIZES)[row], np.array(_BURIED)[row]
    low = np.array([mesh.vertices[:, 2].min() for mesh in meshes]) * size
    high = np.array([mesh.vertices[:, 2].max() for mesh in meshes]) * size
    position = np.zeros((count, 3))
    position[:, 0] = np.tile((np.arange(columns) - 0.5 * (columns - 1)) * _STEP, rows)
    position[:, 1] = np.array([0.9, -0.5, -1.5])[row]
    position[:, 2] = -low - buried * (high - low)
    rpy = np.zeros((count, 3))
    rpy[:, 2] = 0.9 * np.arange(count) + 0.4
    number = np.arange(count, dtype=np.int32)
    return Instances(
        meshes=meshes,
        mesh=number,
        position=position,
        rotation=matrix_from_quaternion(quaternion_from_rpy(rpy)),
        scale=size,
        grain=size,
        rgb=albedo * tones(number, _SEED)[:, None],
    )
