"""Pictures of a world for people: through a rover's eyes, and as a map. No GL is needed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array
from terrain_forge.model import Lighting, World
from terrain_forge.scene.camera import Camera, map_camera, pinhole_camera
from terrain_forge.scene.picture import take_picture
from terrain_forge.scene.scene import GROUND, RayScene, open_scene
from terrain_forge.writers import write_png

_FIELD_OF_VIEW = 1.15
_PITCH = 0.13
_EYE = 2.0
_ASIDE = 1.5
_YAWS = 12
_MAP_HEIGHT = 100.0
_SKETCH = (32, 18)


def render_preview(
    world: World, *, width: int = 1280, height: int = 720, tracks: bool = False
) -> NDArray[np.uint8]:
    """The world from a good place at a rover's eye height, sRGB, shape [height, width, 3].

    It is what cameras of recordings see, from where no rover has been; with `tracks` the rover has
    driven the first path.

    Raises:
        TerrainForgeError: where Embree is missing.
    """
    with open_scene(world, close=True) as scene:
        camera = choose_view(world, scene, width=width, height=height)
        return take_picture(scene, camera, tracks=tracks)


def render_in_lights(
    world: World, lights: Iterable[Lighting], *, width: int, height: int
) -> Iterator[NDArray[np.uint8]]:
    """The world from `render_preview`'s place in one light after another, as it shows each.

    Raises:
        TerrainForgeError: where Embree is missing.
    """
    with open_scene(world, close=True) as scene:
        camera = choose_view(world, scene, width=width, height=height)
        for light in lights:
            yield take_picture(scene, camera, light)


def render_from_above(world: World, size: int) -> NDArray[np.uint8]:
    """The world from above, north up, lit from the north-west, sRGB, shape [height, width, 3].

    Its longer side has `size` pixels.

    Raises:
        TerrainForgeError: where Embree is missing.
    """
    north_west = world.lighting.replace(sun_azimuth=np.radians(315.0), sun_elevation=0.5)
    west, south, east, north = world.ground.bounds
    pixel = max(east - west, north - south) / size
    camera = map_camera(
        middle=(0.5 * (west + east), 0.5 * (south + north)),
        top=float(world.ground.elevation.max()) + _MAP_HEIGHT,
        pixel=pixel,
        width=max(1, round((east - west) / pixel)),
        height=max(1, round((north - south) / pixel)),
    )
    with open_scene(world) as scene:
        return take_picture(scene, camera, north_west)


def write_preview(world: World, path: Path) -> None:
    """Write `render_preview` as PNG."""
    write_png(path, render_preview(world))


def choose_view(world: World, scene: RayScene, *, width: int, height: int) -> Camera:
    """The camera whose picture shows most: rocks, relief, a path, the Sun from the side."""
    views = [
        (place, yaw) for place in _places(world) for yaw in 2.0 * np.pi * np.arange(_YAWS) / _YAWS
    ]
    sketches = [_camera(world, place, yaw, *_SKETCH) for place, yaw in views]
    origins, directions = zip(*(sketch.rays() for sketch in sketches), strict=True)
    hits = scene.cast(np.concatenate(origins), np.concatenate(directions))
    distance = hits.distance.reshape(len(views), -1).astype(np.float64)
    shape = (len(views), _SKETCH[1], _SKETCH[0])
    scores = _rock_score(hits.rock.reshape(shape)) + _depth_score(distance)
    # The Sun from the side, rather behind the camera than in front of it.
    away = np.array([yaw for _, yaw in views]) - (0.5 * np.pi - world.lighting.sun_azimuth)
    scores += 0.5 * np.abs(np.sin(away)) - 0.5 * np.maximum(np.cos(away), 0.0)
    scores += _path_score(world, sketches)
    return _camera(world, *views[int(np.argmax(scores))], width, height)


def _places(world: World) -> Array:
    """Where the camera may stand: beside the paths and on a coarse grid, shape [places, 2] [m]."""
    west, south, east, north = world.ground.bounds
    middle = 0.5 * np.array([west + east, south + north])
    half = 0.5 * np.array([east - west, north - south])
    grid = np.array([(x, y) for x in (-0.5, 0.0, 0.5) for y in (-0.5, 0.0, 0.5)])
    places = [middle + half * grid]
    for trajectory in world.trajectories:
        rows = np.linspace(0, len(trajectory.time) - 1, 9)[:-1].astype(int)
        yaw = trajectory.rpy[rows, 2]
        aside = np.stack([-np.sin(yaw), np.cos(yaw)], axis=-1)
        places += [trajectory.position[rows, :2] + side * aside for side in (-_ASIDE, _ASIDE)]
    every = np.concatenate(places)
    return every[np.all(np.abs(every - middle) < 0.85 * half, axis=1)]


def _camera(world: World, place: Array, yaw: float, width: int, height: int) -> Camera:
    foot = float(world.ground.height_at(place[0], place[1]))
    return pinhole_camera(
        position=np.array([place[0], place[1], foot + _EYE]),
        yaw=yaw,
        pitch=_PITCH,
        field_of_view=_FIELD_OF_VIEW,
        width=width,
        height=height,
    )


def _rock_score(rock: NDArray[np.int32]) -> Array:
    """Rocks are welcome on up to a fifth of the picture, and all over its width."""
    share = (rock > GROUND).mean(axis=(1, 2))
    spread = (rock > GROUND).any(axis=1).mean(axis=1)
    crowded = np.maximum(share - 0.2, 0.0)
    return np.asarray(3.0 * np.minimum(share, 0.15) - 4.0 * crowded + 0.5 * spread)


def _depth_score(distance: Array) -> Array:
    """Ground from near to far under a fifth of sky, nothing right before the camera."""
    seen = np.isfinite(distance)
    sky = 1.0 - seen.mean(axis=1)
    nearest = np.where(seen, distance, np.inf).min(axis=1)
    far = np.where(seen, np.minimum(distance, 80.0), 0.0).max(axis=1)
    crowded = np.maximum(2.2 - nearest, 0.0)
    return np.asarray(0.01 * far - 2.0 * np.abs(sky - 0.22) - crowded)


def _path_score(world: World, cameras: list[Camera]) -> Array:
    """A path that leads from the foreground into the picture."""
    if not world.trajectories:
        return np.zeros(len(cameras))
    points = np.concatenate([t.position[:: max(1, len(t.time) // 400)] for t in world.trajectories])
    scores = []
    for camera in cameras:
        ahead = points - camera.position
        depth = ahead @ camera.forward
        aside = np.abs(ahead @ camera.right) / np.linalg.norm(camera.right)
        shown = (depth > 4.0) & (depth < 16.0) & (aside < 0.4 * depth)
        spread = float(np.ptp(depth[shown])) if shown.any() else 0.0
        scores.append(min(1.0, spread / 10.0))
    return np.array(scores)
