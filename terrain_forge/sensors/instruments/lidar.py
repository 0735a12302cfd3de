"""Lidars."""

from __future__ import annotations

from functools import cached_property
from io import BytesIO
from typing import Any, ClassVar, cast

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import RecipeError
from terrain_forge.model import LidarSensor
from terrain_forge.sensors.beams import DELAY, make_beams, sweep_begin
from terrain_forge.sensors.instrument import Frames, Stream
from terrain_forge.sensors.sweep import sweep_count, take_sweep

POINT = np.dtype(
    [
        ("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4"), ("ring", "<u2"),
        ("time", "<f4"), ("instance", "<i4"),
    ]
)  # fmt: skip
"""A point of a sweep's file."""


class Lidar(Frames):
    """A lidar: its files are arrays of points in NumPy's format (`np.load`)."""

    kind: ClassVar[str] = "lidar"
    folder: ClassVar[str] = "lidar"

    @property
    def lidar(self) -> LidarSensor:
        """The sensor."""
        return cast(LidarSensor, self.sensor)

    @cached_property
    def times(self) -> NDArray[np.int64]:
        """When the sweeps begin that end before the motion does [ns], shape [sweeps]."""
        count = sweep_count(self.lidar, self.setting.motion.end)
        return np.array([sweep_begin(self.lidar, n) for n in range(count)], np.int64)

    def streams(self) -> tuple[Stream, ...]:
        """Its sweeps."""
        figures = {
            "fields": list(POINT.names or ()),
            "units": ["m", "m", "m", "", "", "s", ""],
            "frame": "the lidar's own at each point's own time",
            "time": "after the sweep's stamp, which is that of its first firing",
            "intensity": "100 is a white surface that faces the lidar"
            + (" at 10 m" if self.lidar.intensity == "power" else ""),
            "instance": {"rock": "its id", "ground": -1, "beyond the site": -3, "rover": -4},
        }
        return (Stream(name="data", suffix=".npy", figures=figures),)

    def calibration(self) -> dict[str, Any]:
        """The table of its beams, and how a sweep runs."""
        lidar, beams = self.lidar, make_beams(self.lidar)
        offsets = lidar.azimuth_offsets_deg or (0.0,) * len(beams.table)
        return {
            "scan": "turns clockwise seen from above, from behind (-x)"
            if lidar.prism_rpm is None
            else "two prisms",
            "rings": len(beams.table),
            "elevations_deg": np.degrees(lidar.elevations).round(9).tolist(),
            "azimuth_offsets_deg": [float(offset) for offset in offsets],
            "firing_times_s": beams.table[:, DELAY].tolist(),
            "column_period_s": lidar.column_s,
            "sweep_s": 1.0 / lidar.rate_hz,
            "prism_rpm": list(lidar.prism_rpm or ()),
            "prism_deviations_deg": list(lidar.prism_deviations_deg),
            "beam_origin_m": lidar.beam_origin_m,
            "snapshot": lidar.snapshot,
            "range_min_m": lidar.range_min_m,
            "range_max_m": lidar.range_max_m,
            "noise_m": lidar.noise_m,
            "quantum_m": lidar.quantum_m,
        }

    def check(self) -> None:
        """Refuse a motion that is too short for one sweep."""
        if not len(self.times):
            raise RecipeError(
                f"the sweep of lidar {self.lidar.name!r} lasts {1.0 / self.lidar.rate_hz:g} s, the "
                f"motion along {self.setting.motion.path!r} {self.setting.motion.end:g} s",
                key=("sensors", self.lidar.name, "rate_hz"),
            )

    def measure(self, number: int) -> dict[str, bytes]:
        """The points of a sweep."""
        self.require(number)
        sweep = take_sweep(self.setting, self.lidar, number)
        points = np.empty(len(sweep.points), POINT)
        for axis, name in enumerate("xyz"):
            points[name] = sweep.points[:, axis]
        for name in ("intensity", "ring", "time", "instance"):
            points[name] = getattr(sweep, name)
        file = BytesIO()
        np.save(file, points, allow_pickle=False)
        return {"data": file.getvalue()}
