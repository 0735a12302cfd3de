"""Ground, rocks and tracks as the kernels of `looking.py` need them: records in 32 bits."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, kernel, linear_from_srgb
from terrain_forge.model import Lighting
from terrain_forge.scene.buffers import prepare_light, prepare_stones, resampled
from terrain_forge.scene.camera import Camera
from terrain_forge.scene.relief import roughness
from terrain_forge.scene.scene import RayScene
from terrain_forge.scene.skylight import sky_shares
from terrain_forge.sky import earth_disc, sky_points

HEIGHT, SLOPE_X, SLOPE_Y, SKY, GRAIN = range(5)
GROUND_RGB = GRAIN + 3
"""Columns of a node: its height in the scene's frame [m], the ground's rise along x and y, the
share of the sky that it sees, its pebbles, roughness and slabs (1 for 1), and then its albedo."""
CENTRE, TURN, SIZE, SCALE, ROCK_RGB = 0, 3, 12, 13, 14
"""Columns of a rock: its place in the scene's frame [m], its rotation row by row, its diameter [m],
its size in units of its shape [m], and from here on its albedo."""
SUN, AMBIENT, BOUNCE, EVEN = range(4)
"""Rows of the light's colours, as in `Light`."""
_ROOM = 4096
"""Passes that there is room for at first."""


class Stage(NamedTuple):
    """What a scene shows, in the colours of a picture."""

    nodes: NDArray[np.float32]
    """The ground's nodes, shape [rows, columns, GROUND_RGB + channels]."""
    corner_x: np.float32
    """Place of node [0, 0] in the scene's frame [m]."""
    corner_y: np.float32
    """As `corner_x`."""
    spacing: np.float32
    """Distance of the nodes [m]."""
    rocks: NDArray[np.float32]
    """Rocks and other instances, shape [rocks, ROCK_RGB + channels]."""
    first_face: NDArray[np.int64]
    """Where each rock's shape begins in `faces`, shape [rocks]."""
    faces: NDArray[np.int64]
    """Corners of all shapes, rows of `normals`, shape [faces, 3]."""
    normals: NDArray[np.float32]
    """Unit normals at all shapes' vertices, shape [vertices, 3]."""
    tile: NDArray[np.float32]
    """Relief of rocks' faces, as `rock_tile` makes it."""
    dust: np.float32
    """How much of the ground's colour lies on faces that look up, 0 to 1."""
    colours: NDArray[np.float32]
    """The light's colours, shape [EVEN + 1, channels]."""
    dome: NDArray[np.float32]
    """The sky's tables, as in `Light`, shape [2, entries, channels]."""
    through: float
    """What of the Sun's light on level ground gets through the air."""
    land: NDArray[np.float32]
    """Albedo at the corners of what lies beyond the site, shape [vertices, channels]."""
    land_face: int
    """Where its triangles begin in `faces`."""
    land_corner: int
    """Where its corners begin in `normals`."""
    land_points: NDArray[np.float32]
    """Their places in the scene's frame [m], shape [vertices, 3]."""
    land_rock: int
    """Which of its triangles is the first of a rock."""
    rough: np.float32
    """RMS slope of the ground's short waves along an axis."""
    usual: tuple[np.float32, np.float32, np.float32]
    """Grain of the land beyond the site."""
    sun: tuple[np.float32, np.float32, np.float32]
    """Unit vector to the Sun's middle."""
    sun_up: tuple[np.float32, np.float32, np.float32]
    """From the Sun's middle to its upper limb, over its distance."""
    sun_side: tuple[np.float32, np.float32, np.float32]
    """From the Sun's middle to its limb beside, over its distance."""
    lean: tuple[np.float32, np.float32]
    """How much more of the sky's light gets to a face for each unit of its normal's x and y."""
    law: NDArray[np.float32]
    """How ground and rocks send light back, as `photometric_law` makes it."""
    disc: NDArray[np.float32]
    """The Earth, if it is more than a point: unit vector to it, half the angle that it fills [rad],
    unit vector from there to the Sun, radiance where it is full, shape [0 or 1, 7 + channels]."""
    points: NDArray[np.float32]
    """Unit vectors to points of light in the sky, shape [points, 3]."""
    point_rgb: NDArray[np.float32]
    """What comes from them, radiance times solid angle, shape [points, channels]."""
    lowest: np.float32
    """Sine of the elevation above which the sky is seen through: where nothing lies beyond the
    ground's edge, what is below that is not sky."""
    haze: np.float32
    """Distance after which 1/e of the contrast is left [m]; infinite without air."""


class Wheels(NamedTuple):
    """The tracks of a drive."""

    newest: NDArray[np.int32]
    """Last pass by each node, a row of `passes`; -1 where none is near, shape [rows, columns]."""
    passes: NDArray[np.int32]
    """Nearest point of the path of each pass by a node, and the pass before by the same node or -1,
    shape [passes, 2]."""
    points: NDArray[np.float32]
    """East, north (scene's frame), cosine, sine of the heading, distance, shape [points, 5]."""
    half_gauge: np.float32
    """Sideways distance of a wheel from the path [m]."""
    width: np.float32
    """Width of a wheel [m]."""


def prepare_stage(
    scene: RayScene,
    lighting: Lighting,
    channels: int,
    *,
    facing: float = 0.35,
    camera: Camera | None = None,
) -> Stage:
    """A scene in some light; with one channel colours are the mean of three.

    For one camera alone it takes less.

    Level ground that is seen under an angle of this cosine, `facing`, shows in its own colour.
    """
    subject, ground = scene.subject, scene.subject.ground
    light, stones = prepare_light(subject, lighting, facing=facing), prepare_stones(scene)
    z = (ground.elevation - scene.origin[2]).astype(np.float32)
    nodes = np.empty((*ground.shape, GROUND_RGB + channels), np.float32)
    nodes[..., HEIGHT] = z
    for column, axis in ((SLOPE_X, 1), (SLOPE_Y, 0)):
        nodes[..., column] = np.gradient(z, ground.spacing, axis=axis)
    nodes[..., SKY] = sky_shares(scene, camera) if light.airy else 0.0
    np.multiply(subject.node_grain, np.float32(0.01), out=nodes[..., GRAIN:GROUND_RGB])
    albedo = linear_from_srgb(np.arange(256) / 255.0)
    for row, rgb in zip(nodes, subject.ground_rgb, strict=True):
        row[:, GROUND_RGB:] = bands(albedo[rgb], channels)
    rocks = np.empty((len(stones.size), ROCK_RGB + channels), np.float32)
    rocks[:, CENTRE:TURN], rocks[:, SIZE] = stones.centre, stones.size
    rocks[:, SCALE] = stones.scale
    rocks[:, TURN:SIZE] = stones.rotation.reshape(-1, 9)
    rocks[:, ROCK_RGB:] = bands(stones.rgb, channels)
    colours = light.sun, light.sky, light.bounce, light.even
    faces, normals = stones.faces, stones.normals
    land, land_points = np.empty((0, 3)), np.empty((0, 3))
    if (beyond := subject.horizon) is not None:
        faces = np.concatenate([faces, beyond.mesh.faces + len(normals)])
        normals = np.concatenate([normals, beyond.normals])
        land = linear_from_srgb(np.arange(256) / 255.0)[beyond.rgb]
        land_points = beyond.mesh.vertices - scene.origin
    points, point_rgb = sky_points(lighting)
    lowest = np.float32(0.0 if beyond is None else -1.0)
    shown = points[:, 2] > lowest
    points, point_rgb = points[shown], point_rgb[shown]
    return Stage(
        nodes=nodes,
        corner_x=np.float32(ground.origin[0] - scene.origin[0]),
        corner_y=np.float32(ground.origin[1] - scene.origin[1]),
        spacing=np.float32(ground.spacing),
        rocks=rocks,
        first_face=stones.first_face,
        faces=np.ascontiguousarray(faces, np.int64),
        normals=normals.astype(np.float32),
        tile=stones.tile,
        dust=np.float32(stones.dust),
        colours=bands(np.array(colours), channels),
        dome=_dome(light.dome, channels),
        through=light.through,
        land=bands(land, channels),
        land_face=len(stones.faces),
        land_corner=len(stones.normals),
        land_points=land_points.astype(np.float32),
        land_rock=beyond.ground_faces if beyond is not None else 0,
        rough=np.float32(roughness(nodes[..., SLOPE_X], nodes[..., SLOPE_Y], ground.spacing)),
        usual=triple32(subject.usual_grain),
        sun=triple32(light.towards_sun),
        sun_up=triple32(light.upwards),
        sun_side=triple32(light.sideways),
        lean=(np.float32(light.lean[0]), np.float32(light.lean[1])),
        law=light.law.astype(np.float32),
        disc=_disc(lighting, light.sun, channels),
        points=points.astype(np.float32),
        point_rgb=bands(np.pi * point_rgb * np.array(light.sun), channels),
        lowest=lowest,
        haze=np.float32(light.haze),
    )


def prepare_wheels(scene: RayScene, plan: Array) -> Wheels:
    """The tracks of a rover whose path is given by its places [m], shape [places, 2]."""
    subject, ground = scene.subject, scene.subject.ground
    points = resampled(plan - scene.origin[:2])
    newest = np.full(ground.shape, -1, np.int32)
    corner = np.array(ground.origin) - scene.origin[:2]
    reach = subject.half_gauge + subject.wheel_width + ground.spacing
    passes = _stamp_passes(points, corner, ground.spacing, reach, newest)
    return Wheels(
        newest=newest,
        passes=passes,
        points=points.astype(np.float32),
        half_gauge=np.float32(subject.half_gauge),
        width=np.float32(subject.wheel_width),
    )


def bands(rgb: Array, channels: int) -> NDArray[np.float32]:
    """Linear colours as a picture's channels."""
    return np.asarray(rgb if channels == 3 else rgb.mean(axis=-1, keepdims=True), np.float32)


def _disc(lighting: Lighting, sun: tuple[float, ...], channels: int) -> NDArray[np.float32]:
    if (disc := earth_disc(lighting)) is None:
        return np.empty((0, 7 + channels), np.float32)
    rgb = bands((disc.rgb * np.array(sun))[None], channels)[0]
    numbers = np.concatenate([disc.towards, [disc.radius], disc.sun, rgb])
    return np.asarray(numbers[None], np.float32)


def _dome(dome: Array, channels: int) -> NDArray[np.float32]:
    """The sky's tables in a picture's channels; of one, the mean product where both are one."""
    if channels == 3:
        return np.asarray(dome, np.float32)
    weight = dome[0].mean(axis=0)
    weight = weight / max(float(weight.sum()), 1e-12)
    return np.stack([dome[0].mean(axis=-1), (dome[1] * weight).sum(axis=-1)]).astype(np.float32)[
        :, :, None
    ]


def triple32(vector: Any) -> tuple[np.float32, np.float32, np.float32]:
    """Three plain numbers of 32 bits."""
    return np.float32(vector[0]), np.float32(vector[1]), np.float32(vector[2])


@kernel
def _stamp_passes(points, corner, spacing, reach, newest):  # type: ignore[no-untyped-def]
    """Note at each node within `reach` of a path all passes by it; returns the passes.

    A rover that crosses its path, or comes back beside it, leaves the wheel tracks of each pass.
    One ends where the node is left, or the rover has turned back.
    """
    rows, columns = newest.shape
    best, last = np.empty((rows, columns)), np.full((rows, columns), -2)
    passes, count = np.empty((_ROOM, 2), np.int32), 0
    for n in range(len(points)):
        west = max(0, int(np.ceil((points[n, 0] - reach - corner[0]) / spacing)))
        east = min(columns - 1, int(np.floor((points[n, 0] + reach - corner[0]) / spacing)))
        south = max(0, int(np.ceil((points[n, 1] - reach - corner[1]) / spacing)))
        north = min(rows - 1, int(np.floor((points[n, 1] + reach - corner[1]) / spacing)))
        for j in range(south, north + 1):
            for i in range(west, east + 1):
                away = (corner[0] + i * spacing - points[n, 0]) ** 2
                away += (corner[1] + j * spacing - points[n, 1]) ** 2
                anew = last[j, i] < n - 1
                if not anew:
                    at = passes[newest[j, i], 0]
                    ahead = points[n, 2] * points[at, 2] + points[n, 3] * points[at, 3]
                    anew = ahead < 0.0
                if anew:
                    if count == len(passes):
                        grown = np.empty((2 * count, 2), np.int32)
                        grown[:count] = passes
                        passes = grown
                    passes[count, 0], passes[count, 1] = n, newest[j, i]
                    newest[j, i], best[j, i] = count, away
                    count += 1
                elif away < best[j, i]:
                    best[j, i], passes[newest[j, i], 0] = away, n
                last[j, i] = n
    return passes[:count].copy()
