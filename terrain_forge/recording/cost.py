"""What a recording costs on the machine at hand, by its sensors' figures: time and disk."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from terrain_forge.base import size_text
from terrain_forge.building import pace
from terrain_forge.model import CameraSensor, LidarSensor, Sensor, Site
from terrain_forge.paths import duration
from terrain_forge.recipe import DatasetSpec
from terrain_forge.recording.rig import QUICK
from terrain_forge.recording.setting import as_recorded
from terrain_forge.sensors import Frames, instrument_kinds

PIXEL = 1.2e-7, 0.45
"""Time to make a pixel of a grey picture of 8 bits [s], and its bytes, on the machine of
`building.pace`."""
CHANNEL = 4e-8, 0.7
"""Time and bytes that a further channel takes for each pixel."""
RAY, POINT = 1.2e-7, 15.0
"""Time of a lidar's ray [s], and bytes of its point, of which about half come back."""
ROW = 1e-6, 130.0
"""Of a row of a table."""
TRUTH_RATE, TRUTH_ROW = 200.0, 500.0
"""Rows of the body's truth [Hz], and their bytes."""


def measurement_cost(sensor: Sensor) -> tuple[float, float]:
    """About the time [s] that a measurement takes, and the bytes of its files."""
    parts = [_picture(p) for p in sensor.simple if isinstance(p, CameraSensor)]
    parts += [_sweep(p) for p in sensor.simple if isinstance(p, LidarSensor)]
    seconds, size = zip(ROW, *parts, strict=True)
    return sum(seconds), sum(size)


def _picture(camera: CameraSensor) -> tuple[float, float]:
    pixels, pictures = camera.width_px * camera.height_px, len(camera.images)
    seen = pictures * camera.motion_blur
    values = pictures * (3 if camera.colour else 1) * (1 if camera.bits == 8 else 2)
    more = len(camera.channels)
    seconds = pixels * (PIXEL[0] * seen + CHANNEL[0] * more)
    return seconds, pixels * (PIXEL[1] * values + CHANNEL[1] * more)


def _sweep(lidar: LidarSensor) -> tuple[float, float]:
    points = len(lidar.elevations) / (lidar.column_s * lidar.rate_hz)
    return RAY * lidar.rays, POINT * points


def seconds_of(sensor: Sensor) -> float:
    """About the time that a measurement takes on this machine [s]."""
    return pace() * measurement_cost(sensor)[0]


def recording_lines(site: Site, sensors: Sequence[Sensor]) -> Iterator[str]:
    """Lines that say what a recipe's recording will be, and what it costs.

    Args:
        site: The planned site.
        sensors: The rover's.
    """
    spec = site.recipe.dataset
    if spec is None:
        return
    kinds = instrument_kinds()
    named = spec.path or next((path.name for path in site.recipe.paths), "")
    recorded = [one for one in as_recorded(sensors, spec) if one.kind in kinds]
    yield f"recording      path {named}, {spec.motion}: {', '.join(one.name for one in recorded)}"
    length = next((duration(route) for route in site.routes if route.name == named), None)
    if length is None:
        yield "  cost         known when its path is planned on the finished ground"
        return
    length += 2.0 * spec.still_s + spec.ramp_s
    counts = [int(length * _rate(one, spec)) + 1 for one in recorded]
    costs = [measurement_cost(one) for one in recorded]
    seconds = pace() * sum(n * cost[0] for n, cost in zip(counts, costs, strict=True))
    size = sum(n * cost[1] for n, cost in zip(counts, costs, strict=True))
    size += TRUTH_RATE * TRUTH_ROW * length
    size *= 1 + len({*spec.formats} - {"euroc"})  # a further format is about as large
    frames = sum(
        n for n, one in zip(counts, recorded, strict=True) if issubclass(kinds[one.kind], Frames)
    )
    yield (
        f"  cost         {length:,.0f} s, {frames:,.0f} measurements: about "
        f"{seconds / 60:,.1f} min, {size_text(int(size))} on disk"
    )


def _rate(sensor: Sensor, spec: DatasetSpec) -> float:
    """Measurements that are recorded per second [Hz]."""
    few = spec.profile == "quick" and issubclass(instrument_kinds()[sensor.kind], Frames)
    return min(sensor.rate_hz, QUICK) if few else sensor.rate_hz
