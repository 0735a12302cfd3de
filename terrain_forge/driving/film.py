"""A drive as an animated picture, and a picture of the place where one failed."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from terrain_forge.base import Array
from terrain_forge.driving.result import DriveResult
from terrain_forge.driving.rover_picture import photograph
from terrain_forge.model import World
from terrain_forge.writers import write_png

FRAMES = 24
"""Frames of an animated picture, at equal times."""
_SIZE, _LARGE = (400, 225), (960, 540)
_FRAME_MS, _LAST_MS, _QUALITY = 180, 1500, 60
_INSET, _EDGE = 72, 6
_PATH, _TRACK, _TEXT, _SHADE = (242, 194, 48), (120, 190, 255), (255, 255, 255), (0, 0, 0, 120)


def write_film(world: World, result: DriveResult, path: Path) -> Path:
    """Write the drive as an animated WebP, seen from behind the rover, with a map of the path."""
    poses = np.unique(np.linspace(0, len(result.time) - 1, FRAMES).round().astype(int)).tolist()
    planned = next(t for t in world.trajectories if t.name == result.path).position[:, :2]
    with ThreadPoolExecutor(2) as pool:
        # While one frame's rays are cast, the next one's scene is made.
        frames = list(pool.map(partial(_frame, world, result, planned), poses))
    times = [_FRAME_MS] * (len(frames) - 1) + [_LAST_MS]
    frames[0].save(
        path, format="WEBP", save_all=True, append_images=frames[1:], duration=times, loop=0,
        quality=_QUALITY, method=3,
    )  # fmt: skip
    return path


def write_end(world: World, result: DriveResult, path: Path) -> Path:
    """Write a picture of the place where the drive ended."""
    width, height = _LARGE
    last = len(result.time) - 1
    write_png(path, photograph(world, result, last, width=width, height=height))
    return path


def _frame(world: World, result: DriveResult, planned: Array, pose: int) -> Image.Image:
    width, height = _SIZE
    image = Image.fromarray(photograph(world, result, pose, width=width, height=height))
    draw = ImageDraw.Draw(image, "RGBA")
    travelled = np.linalg.norm(np.diff(result.position[: pose + 1], axis=0), axis=1).sum()
    draw.rectangle((0, height - 18, width, height), fill=_SHADE)
    text = (
        f"{result.path}   {result.time[pose]:.0f} s   {travelled:.1f} m   "
        f"tilt {math.degrees(result.tilt[pose]):.0f}°   "
        f"slip {100 * np.abs(result.wheel_slip[pose]).mean():.0f} %"
    )
    draw.text((_EDGE, height - 16), text, fill=_TEXT)
    _draw_inset(draw, planned, result.position[: pose + 1, :2], width)
    return image


def _draw_inset(draw: ImageDraw.ImageDraw, planned: Array, driven: Array, width: int) -> None:
    """A small map in the upper right corner, north up: the path, and how far it is driven."""
    low, high = planned.min(0), planned.max(0)
    scale = _INSET / max(float((high - low).max()), 1e-6)
    corner = np.array([width - _INSET - 2 * _EDGE, 0.0])
    draw.rectangle((corner[0], 0, width, _INSET + 2 * _EDGE), fill=_SHADE)
    middle = corner + _EDGE + 0.5 * _INSET

    def on_map(points: Array) -> list[tuple[float, float]]:
        offset = (points - 0.5 * (low + high)) * scale * (1.0, -1.0)
        return [(east, south) for east, south in (middle + offset).tolist()]

    draw.line(on_map(planned), fill=_PATH, width=3)
    if len(driven) > 1:
        draw.line(on_map(driven), fill=_TRACK, width=1)
    east, south = on_map(driven[-1:])[0]
    draw.ellipse((east - 3, south - 3, east + 3, south + 3), fill=_TEXT)
