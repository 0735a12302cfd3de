"""A lidar, whose beams turn about its z axis or are steered by two prisms."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from annotated_types import Interval, Len

from terrain_forge.base import Array, Fraction, Idle, NotNegative
from terrain_forge.model.lidar_presets import LIDAR_PRESETS
from terrain_forge.model.sensor import Angle, Form, Near, Sdf, Sensor, Topic, white_noise

Elevation = Annotated[float, Interval(ge=-90, le=90)]
Speed = Annotated[float, Interval(ge=-1e6, le=1e6)]
Deviation = Annotated[float, Interval(ge=0, le=85)]
_MOST = 4_000_000
"""Points of a sweep."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LidarSensor(Sensor):
    """A lidar; by default one of evenly spread beams, its figures nominal.

    Seen from above it turns clockwise and begins behind the sensor (-x), so that the seam of a
    sweep does not lie ahead. Beam n of its table is ring n.
    """

    title: ClassVar[str] = "lidar"
    topics: ClassVar[tuple[Topic, ...]] = (Topic("points", "PointCloudPacked", "PointCloud2"),)
    PRESETS: ClassVar[Mapping[str, Mapping[str, Any]]] = LIDAR_PRESETS

    kind: Literal["lidar"] = "lidar"
    """A lidar."""
    rate_hz: Annotated[float, Interval(ge=0.1, le=100)] = 10.0
    """Sweeps per second, for a lidar that turns its turns [Hz]."""
    channels: Annotated[int, Interval(ge=1, le=1024)] = 16
    """Beams above each other, evenly spread, where no elevations are given."""
    vertical_fov_deg: Annotated[float, Interval(ge=0, le=180)] = 30.0
    """Angle between the lowest and the highest beam [degrees], where no elevations are given."""
    elevations_deg: Annotated[tuple[Elevation, ...], Len(0, 1024)] = ()
    """Each beam's angle above the xy plane [degrees]; none: `channels` beams, evenly spread from
    the lowest up."""
    azimuth_offsets_deg: tuple[Angle, ...] = ()
    """How far each beam points clockwise of its column, seen from above [degrees]; none: not."""
    firing_times_us: tuple[NotNegative, ...] = ()
    """When each beam fires after the first of its column [µs]; none: all at once."""
    horizontal_samples: Annotated[int, Interval(ge=1, le=100_000)] = 1800
    """Columns of a sweep, where no firing period is given."""
    firing_period_us: NotNegative = 0.0
    """Time from column to column [µs]; a sweep has as many as go into it. 0: a sweep has
    `horizontal_samples`."""
    prism_rpm: tuple[Speed, Speed] | None = None
    """Turns per minute of two prisms that steer the beams about the x axis along a rosette that
    never closes; none: the lidar turns."""
    prism_deviations_deg: tuple[Deviation, Deviation] = (0.0, 0.0)
    """How far each prism bends the beams [degrees]."""
    beam_origin_m: NotNegative = 0.0
    """Distance from the axis at which the beams begin, in the direction of their column [m]; it is
    a part of the range."""
    snapshot: bool = False
    """Whether all points of a sweep are measured at one time, as simulators do."""
    range_min_m: NotNegative = 0.5
    """Nearest point [m]."""
    range_max_m: Annotated[float, Interval(ge=0.1, le=10_000)] = 100.0
    """Farthest point [m]."""
    range_at_tenth_m: NotNegative = 0.0
    """Range from which half of the returns of a surface that reflects a tenth and faces the lidar
    are too weak [m]; 0: no return is too weak."""
    dropout: Fraction = 0.0
    """Share of all other returns that are lost by chance."""
    sun_blinding_deg: Annotated[float, Interval(ge=0, le=180)] = 0.0
    """Beams within this angle of the Sun return nothing [degrees]."""
    noise_m: NotNegative = 0.01
    """Standard deviation of a range [m]."""
    quantum_m: NotNegative = 0.0
    """Step of a range [m]; 0: none."""
    divergence_mrad: Annotated[float, Interval(ge=0, le=200)] = 0.0
    """Angle of a beam's cone, within which a Gaussian one has 86 % of its power [mrad]; 0: beams
    are lines. A VLP-16 has 3; seven rays a beam take seven times as long."""
    echo_separation_m: NotNegative = 0.5
    """Echoes of a beam that are nearer to each other than this merge into one between them [m]."""
    returns: Literal["strongest", "first", "last"] = "strongest"
    """Which echo of a beam is returned."""
    intensity: Literal["reflectivity", "power"] = "reflectivity"
    """What a white surface that faces the lidar has 100 of: `reflectivity` is reflectance times the
    cosine of incidence, the range made up for as in the devices themselves; `power` is that over
    the square of the range, 100 at 10 m."""
    near_m: Near = 0.005
    """What of the rover is nearer than this is not seen, such as the sensor's own housing [m]."""
    sees_rover: bool = True
    """Whether points on the rover itself are kept; else beams that it blocks return nothing."""

    def __post_init__(self) -> None:
        super().__post_init__()
        beams = len(self.elevations_deg) or self.channels
        for name in ("azimuth_offsets_deg", "firing_times_us"):
            if getattr(self, name) and len(getattr(self, name)) != beams:
                raise ValueError(f"{name} has {len(getattr(self, name))} numbers, not {beams}")
        if self.range_min_m >= self.range_max_m:
            raise ValueError("range_min_m must be below range_max_m")
        period = self.firing_period_us
        if period and not 0.05 <= period <= 1e6 / self.rate_hz:
            raise ValueError("firing_period_us must be 0.05 at least, and 1 / rate_hz at most")
        if min(self.firing_times_us, default=0.0) > 0.0:
            raise ValueError("firing_times_us must count from the first beam: none is 0")
        if not self.snapshot and max(self.firing_times_us, default=0.0) >= 1e6 * self.column_s:
            raise ValueError(
                f"firing_times_us must end before the next column, {1e6 * self.column_s:.6g} µs"
            )
        if beams * self.columns > _MOST:
            raise ValueError(f"a sweep has more than {_MOST} points")
        for name, why, _ in self.idle():
            if not self.is_default(name):
                raise ValueError(f"{name} has no effect: {why}")

    def idle(self) -> Iterator[Idle]:
        """What has no effect beside other figures of it."""
        given = "{} is given".format
        if self.elevations_deg:
            yield Idle("channels", given("elevations_deg"), refused=True)
            yield Idle("vertical_fov_deg", given("elevations_deg"), refused=True)
        if self.firing_period_us > 0.0:
            yield Idle("horizontal_samples", given("firing_period_us"), refused=True)
        if self.prism_rpm is None:
            yield Idle("prism_deviations_deg", "there is no prism_rpm", refused=True)
        if self.divergence_mrad == 0.0:
            why = "beams are lines; give divergence_mrad"
            yield Idle("returns", why, refused=True)
            yield Idle("echo_separation_m", why, refused=True)

    @property
    def elevations(self) -> Array:
        """The beams' angles above the xy plane [rad], shape [beams]."""
        if self.elevations_deg:
            return np.radians(self.elevations_deg)
        half = 0.5 * math.radians(self.vertical_fov_deg)
        return np.asarray(np.linspace(-half, half, self.channels))

    @property
    def column_s(self) -> float:
        """Time from column to column [s]."""
        if self.firing_period_us:
            return 1e-6 * self.firing_period_us
        return 1.0 / (self.rate_hz * self.horizontal_samples)

    @property
    def columns(self) -> int:
        """Columns of a sweep."""
        if self.firing_period_us:
            return math.floor(1.0 / (self.rate_hz * self.column_s) + 1e-6)
        return self.horizontal_samples

    @property
    def rays(self) -> int:
        """Rays of a sweep."""
        return len(self.elevations) * self.columns * (7 if self.divergence_mrad else 1)

    def unsaid(self, form: Form) -> tuple[str, ...]:
        """What a format does not say; SDF has a scan of even steps."""
        if form != "sdf":
            return super().unsaid(form)
        lost = {
            "a rosette of prisms": self.prism_rpm is not None,
            "unevenly spread beams": not _even(self.elevations),
            "azimuth offsets": any(self.azimuth_offsets_deg),
            "firing times": not self.snapshot,
            "a beam origin beside the axis": self.beam_origin_m > 0.0,
            "steps of the range": self.quantum_m > 0.0,
            "lost returns": any((self.range_at_tenth_m, self.dropout, self.sun_blinding_deg)),
            "divergent beams": self.divergence_mrad > 0.0,
        }
        return tuple(what for what, is_lost in lost.items() if is_lost)

    def sdf(self, *, classic: bool, far: float) -> Sdf:  # noqa: ARG002
        """A scan of a full turn by evenly spread beams, its last column a step short of the first.

        That of prisms is the rectangle around their rosette, of as many points.
        """
        low, high = float(self.elevations.min()), float(self.elevations.max())
        beams, columns = len(self.elevations), self.columns
        right, left = -math.pi, math.pi - 2 * math.pi / columns
        if self.prism_rpm is not None:
            reach = math.radians(sum(self.prism_deviations_deg))
            points, low, high = beams * columns, low - reach, high + reach
            beams = max(1, round(math.sqrt(points * (high - low) / max(2 * reach, 1e-3))))
            columns, right, left = max(1, round(points / beams)), -reach, reach
        scan = {
            "horizontal": _angles(columns, right, left),
            "vertical": _angles(beams, low, high),
        }
        span = {"min": self.range_min_m, "max": self.range_max_m}
        kind, tag = ("ray", "ray") if classic else ("gpu_lidar", "lidar")
        return kind, {tag: {"scan": scan, "range": span} | white_noise(self.noise_m)}


def _even(angles: Array) -> bool:
    """Whether angles are evenly spread, to a thousandth of a degree."""
    line = np.linspace(angles.min(), angles.max(), len(angles))
    return bool(np.abs(np.sort(angles) - line).max() < math.radians(1e-3))


def _angles(samples: int, low: float, high: float) -> dict[str, float]:
    return {"samples": samples, "resolution": 1, "min_angle": low, "max_angle": high}
