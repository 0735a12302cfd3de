"""Pictures for people: what a camera sees of a scene, developed to sRGB."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import portable, srgb_from_linear
from terrain_forge.model import Lighting
from terrain_forge.scene.aiming import Rover
from terrain_forge.scene.camera import Camera
from terrain_forge.scene.looking import look
from terrain_forge.scene.scene import RayScene
from terrain_forge.scene.stage import Stage, prepare_stage, prepare_wheels

_CLEAR = np.float32(1e30)
_AWAY = 100.0
"""From how many widths of a map it is looked at: relief then leans by a thousandth of it."""

_BRIGHT, _BRIGHT_GROUND = 0.7, 0.35
"""Median of what shines in a picture above which it is exposed less, over white level ground: with
a sky, and where a part of it is black."""


def take_picture(
    scene: RayScene,
    camera: Camera,
    lighting: Lighting | None = None,
    *,
    tracks: bool = False,
    stage: Stage | None = None,
    rover: Rover | None = None,
) -> NDArray[np.uint8]:
    """A scene through a camera, sRGB, shape [height, width, 3]; in its own light by default.

    With `tracks` the wheels have driven the first of the subject's paths; `stage` is the scene made
    ready for three channels in this light, and `rover` what moves in it.
    """
    radiance = radiance_seen(scene, camera, lighting, tracks=tracks, stage=stage, rover=rover)
    # Towards the Sun, a dusty sky is many times brighter than ground, and away from it bare ground
    # under a low Sun: a camera exposes for that.
    bright = radiance.mean(axis=-1)
    shines = bright[bright > 0.0]
    most = _BRIGHT if shines.size == bright.size else _BRIGHT_GROUND
    median = float(np.median(shines)) if shines.size else 0.0
    return develop(radiance * np.float32(min(1.0, most / max(median, 1e-6))))


def radiance_seen(
    scene: RayScene,
    camera: Camera,
    lighting: Lighting | None = None,
    *,
    tracks: bool = False,
    stage: Stage | None = None,
    rover: Rover | None = None,
) -> NDArray[np.float32]:
    """What comes to a camera from a scene, 1 for white level ground, shape [height, width, 3].

    A camera of parallel rays is taken for one that is far away. The rest is as `take_picture` says.
    """
    facing = 0.35 if camera.pinhole else 1.0
    if stage is None:
        lighting = lighting or scene.subject.lighting
        stage = prepare_stage(scene, lighting, 3, facing=facing, camera=camera)
    right, down = (float(portable.norm(axis)) for axis in (camera.right, camera.down))
    turn = np.column_stack([camera.right / right, camera.down / down, camera.forward])
    place, ahead = camera.position, 1.0
    if not camera.pinhole:
        ahead = _AWAY * max(right * camera.width, down * camera.height)
        place = place - ahead * camera.forward
        if stage.haze < np.inf:  # there is air, but none of it is so high
            stage = stage._replace(haze=_CLEAR)
    x = (np.arange(camera.width) + 0.5 - 0.5 * camera.width) * right
    y = (np.arange(camera.height) + 0.5 - 0.5 * camera.height) * down
    paths = scene.subject.tracks if tracks else ()
    seen = look(
        scene,
        stage,
        rays=_rays(x, y, ahead),
        position=np.broadcast_to(place, (camera.height, 3)),
        rotation=np.broadcast_to(turn, (camera.height, 3, 3)),
        wheels=prepare_wheels(scene, paths[0]) if paths else None,
        behind=np.inf if paths else -np.inf,
        rover=rover,
    )
    return seen.radiance


def _rays(x: NDArray[np.floating], y: NDArray[np.floating], ahead: float) -> NDArray[np.float32]:
    """Unit directions through columns and rows at a distance ahead, shape [rows, columns, 3]."""
    rays = np.empty((len(y), len(x), 3), np.float32)
    for row, down in zip(rays, y, strict=True):
        line = np.stack([x, np.full_like(x, down), np.full_like(x, ahead)], axis=-1)
        row[:] = line / np.sqrt((line * line).sum(axis=1, keepdims=True))
    return rays


def develop(image: NDArray[np.float32]) -> NDArray[np.uint8]:
    """The sRGB bytes of a linear picture; from half white on it is compressed, not clipped."""
    steps = 4096
    exposure = np.linspace(0.0, 4.0, steps)
    shoulder = np.where(exposure < 0.5, exposure, 1.0 - 0.5 * np.exp(1.0 - 2.0 * exposure))
    table = (255.0 * np.clip(srgb_from_linear(shoulder), 0.0, 1.0)).astype(np.float32)
    index = np.minimum(image * ((steps - 1) / 4.0), steps - 1).astype(np.int32)
    # Interleaved gradient noise (Jimenez 2014) hides the steps of a smooth sky.
    rows, columns = image.shape[:2]
    noise = 0.06711056 * np.arange(columns)[None, :] + 0.00583715 * np.arange(rows)[:, None]
    whole = np.empty_like(noise)
    for factor in (52.9829189, 0.999):
        noise -= np.floor(noise, out=whole)
        noise *= factor
    dithered = table[index] + noise.astype(np.float32)[:, :, None]
    return np.asarray(dithered, dtype=np.uint8)
