"""Pictures of a world for people: as a rover's camera would see it, and as a map. No GL is needed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from terrain_forge.scene.camera import Camera, map_camera, pinhole_camera
from terrain_forge.scene.render import develop, expose
from terrain_forge.scene.scene import GROUND, RayScene, open_scene
from terrain_forge.scene.subject import (
    prepare_land,
    prepare_light,
    prepare_stones,
    prepare_tracks,
)
from terrain_forge.world import Lighting, World
from terrain_forge.writers.image import write_png

Array = NDArray[np.float64]

_FIELD_OF_VIEW = 1.15
_PITCH = 0.13
_EYE = 2.0
_YAWS = 16
_SKETCH = (64, 36)


def render_preview(world: World, *, width: int = 1280, height: int = 720) -> NDArray[np.uint8]:
    """The world from a good place at a rover's eye height, sRGB, shape [height, width, 3]."""
    with open_scene(world) as scene:
        camera = choose_view(world, scene, width=width, height=height)
        return take_picture(world, scene, camera, world.lighting)


def render_map(world: World, size: int = 900) -> NDArray[np.uint8]:
    """The world from above, north up, light from the north-west; its longer side has `size` pixels."""
    west, south, east, north = world.ground.bounds
    pixel = max(east - west, north - south) / size
    with open_scene(world) as scene:
        camera = map_camera(
            middle=(0.5 * (west + east), 0.5 * (south + north)),
            top=float(world.ground.elevation.max()) + 100.0,
            pixel=pixel,
            width=max(1, round((east - west) / pixel)),
            height=max(1, round((north - south) / pixel)),
        )
        north_west = world.lighting.replace(sun_azimuth=np.radians(315.0), sun_elevation=0.5)
        return take_picture(world, scene, camera, north_west)


def write_preview(world: World, path: Path) -> None:
    """Write `render_preview` as PNG."""
    write_png(path, render_preview(world))


def take_picture(
    world: World, scene: RayScene, camera: Camera, lighting: Lighting
) -> NDArray[np.uint8]:
    """A picture of a world through a camera, sRGB, shape [height, width, 3]."""
    image = expose(
        scene,
        camera,
        land=prepare_land(world, scene, lighting),
        tracks=prepare_tracks(world, scene),
        stones=prepare_stones(world, scene),
        light=prepare_light(world, lighting),
    )
    return develop(image)


def choose_view(world: World, scene: RayScene, *, width: int, height: int) -> Camera:
    """The camera of the picture that shows most: rocks, relief, the path, the Sun from the side."""
    best, best_score = None, -np.inf
    for place in _places(world):
        for yaw in 2.0 * np.pi * np.arange(_YAWS) / _YAWS:
            sketch = _camera(world, place, yaw, *_SKETCH)
            score = _score(world, scene, sketch, yaw)
            if score > best_score:
                best, best_score = (place, yaw), score
    assert best is not None
    return _camera(world, *best, width, height)


def _places(world: World) -> Array:
    """Where the camera may stand: beside the paths, or on a coarse grid, east and north [m]."""
    west, south, east, north = world.ground.bounds
    middle, half = (
        np.array([west + east, south + north]) / 2,
        np.array([east - west, north - south]) / 2,
    )
    grid = np.array([(x, y) for x in (-0.5, 0.0, 0.5) for y in (-0.5, 0.0, 0.5)])
    places = [middle + half * grid]
    for trajectory in world.trajectories:
        rows = np.linspace(0, len(trajectory.time) - 1, 9)[:-1].astype(int)
        yaw = trajectory.rpy[rows, 2]
        aside = np.stack([-np.sin(yaw), np.cos(yaw)], axis=-1)
        places += [trajectory.position[rows, :2] + side * aside for side in (-2.5, 2.5)]
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


def _score(world: World, scene: RayScene, camera: Camera, yaw: float) -> float:
    """How much a sketch of a view shows."""
    origins, directions = camera.rays()
    hits = scene.cast(origins, directions, coherent=True)
    hit = np.isfinite(hits.distance)
    if not hit.any():
        return -np.inf
    rocks = np.mean(hits.rock > GROUND)
    depth = np.log(hits.distance[hit])
    sun = np.pi / 2 - world.lighting.sun_azimuth
    aside = abs(np.sin(yaw - sun)) - 0.6 * max(0.0, np.cos(yaw - sun))
    crowded = max(0.0, 1.2 - float(depth.min()))
    sky = 1.0 - hit.mean()
    return float(
        4.0 * min(rocks, 0.2)
        + 0.5 * depth.std()
        + 0.4 * aside
        - 1.0 * crowded
        - 3.0 * abs(sky - 0.2)
        + 0.3 * _path_share(world, origins, directions, hits.distance)
    )


def _path_share(
    world: World, origins: Array, directions: Array, distance: NDArray[np.float32]
) -> float:
    return 0.0
