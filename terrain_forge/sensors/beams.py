"""When a lidar's beams fire, and where they then point."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array
from terrain_forge.model import LidarSensor

NANOSECONDS = 1_000_000_000
_RING, _CORE = 6, 0.5
_RING_RADIUS = 0.72
"""Where the rays of a beam's outer part run, as a part of the cone's half angle: its power lies
there on average."""

(
    COS_ELEVATION, SIN_ELEVATION, COS_AZIMUTH, SIN_AZIMUTH, COS_TURN, SIN_TURN, DELAY, ELEVATION,
    OFFSET,
) = range(9)  # fmt: skip
"""Columns of `Beams.table`: elevation; how far the beam points clockwise of its column's beginning,
and how far the lidar has turned until it fires, as cosine and sine; when it fires after its column
[s]; elevation and azimuth offset [rad]."""


class Beams(NamedTuple):
    """The beams of a lidar."""

    table: Array
    """Shape [beams, 9]."""
    rank: NDArray[np.int64]
    """Which of its column's points each beam makes, by time, shape [beams]."""
    rays: Array
    """The rays of a beam: sideways, upwards [rad], share of the power, shape [rays, 3]."""


def make_beams(lidar: LidarSensor) -> Beams:
    """The beams of a lidar."""
    elevation = lidar.elevations
    none = np.zeros(len(elevation))
    offset = np.radians(lidar.azimuth_offsets_deg) if lidar.azimuth_offsets_deg else none
    delay = 1e-6 * np.array(lidar.firing_times_us) if lidar.firing_times_us else none
    if lidar.snapshot:
        delay = none
    turned = 2.0 * np.pi * lidar.rate_hz * delay
    angles = (elevation, turned + offset, turned)
    waves = [wave(angle) for angle in angles for wave in (np.cos, np.sin)]
    rank = np.empty(len(delay), np.int64)
    rank[np.argsort(delay, kind="stable")] = np.arange(len(delay))
    return Beams(
        table=np.stack([*waves, delay, elevation, offset], axis=-1), rank=rank, rays=_rays(lidar)
    )


def _rays(lidar: LidarSensor) -> Array:
    """A ray for the core of a Gaussian beam, and six around it, by the power of each."""
    half = 0.5e-3 * lidar.divergence_mrad
    if half == 0.0:
        return np.array([[0.0, 0.0, 1.0]])
    core, whole = -np.expm1(-2.0 * _CORE**2), -np.expm1(-2.0)
    angle = 2.0 * np.pi * np.arange(_RING) / _RING
    around = _RING_RADIUS * half * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    share = np.full((_RING, 1), (whole - core) / (whole * _RING))
    return np.vstack([[0.0, 0.0, core / whole], np.hstack([around, share])])


def sweep_begin(lidar: LidarSensor, number: int) -> int:
    """When the first beam of a sweep fires [ns]."""
    return round(number * NANOSECONDS / lidar.rate_hz)


def sweep_columns(lidar: LidarSensor, number: int) -> Array:
    """The columns of a sweep, shape [columns, 3].

    Time after the first [s], and how far the lidar has turned, or each of its prisms [turns].
    """
    step = np.arange(lidar.columns)
    after = lidar.column_s * step
    if lidar.prism_rpm is not None:
        since = 1e-9 * sweep_begin(lidar, number) + after
        turns = [np.mod(since * (rpm / 60.0), 1.0) for rpm in lidar.prism_rpm]
    else:
        turns = [lidar.rate_hz * after] * 2
    return np.stack([0.0 * after if lidar.snapshot else after, *turns], axis=-1)
