"""A slow stand-in for `sensors.picture`: rays by `RayScene.cast`, Lambert's law."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass
class Exposure:
    radiance: np.ndarray
    depth: np.ndarray
    distance: np.ndarray
    instance: np.ndarray
    normal: np.ndarray
    sunlit: np.ndarray


def take_exposure(setting, *, rays, position, rotation, time, colour, tracks_behind):
    height, width = rays.shape[:2]
    position = np.broadcast_to(position, (height, 3))
    rotation = np.broadcast_to(rotation, (height, 3, 3))
    towards = np.einsum("hij,hwj->hwi", rotation, rays.astype(np.float64)).reshape(-1, 3)
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    start = np.repeat(position, width, axis=0)
    hits = setting.scenery.cast(start, towards, time)
    met = np.isfinite(hits.distance)
    light = setting.world.lighting
    cosine = np.maximum(hits.normal @ light.towards_sun, 0.0)
    points = start + np.where(met, hits.distance, 0.0)[:, None] * towards + 1e-3 * hits.normal
    sun = np.tile(light.towards_sun, (len(points), 1))
    clear = np.isinf(setting.scenery.cast(points, sun, time).distance) & met & (cosine > 0.0)
    albedo = np.where(hits.rock >= 0, 0.12, 0.25)
    radiance = albedo * light.irradiance / np.pi * (np.where(clear, cosine, 0.0) + 0.1)
    radiance = np.where(met, radiance, 12.0)
    channels = np.array([1.3, 1.0, 0.7]) if colour else np.ones(1)
    shape = height, width
    depth = np.where(met, hits.distance * (rays.reshape(-1, 3)[:, 2]), np.inf)
    return Exposure(
        radiance=(radiance[:, None] * channels).reshape(*shape, -1).astype(np.float32),
        depth=depth.reshape(shape).astype(np.float32),
        distance=hits.distance.reshape(shape),
        instance=hits.rock.reshape(shape),
        normal=hits.normal.reshape(*shape, 3),
        sunlit=clear.reshape(shape),
    )
