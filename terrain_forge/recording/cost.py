"""What a recording costs on the machine at hand, by its sensors' figures: time and disk."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from terrain_forge.base import RecipeError, size_text
from terrain_forge.building import pace
from terrain_forge.model import CameraSensor, LidarSensor, Sensor, Site
from terrain_forge.paths import duration
from terrain_forge.recipe import DatasetSpec
from terrain_forge.recording.rig import QUICK
from terrain_forge.recording.setting import as_recorded
from terrain_forge.sensors import Frames, instrument_kinds

_INERTIAL = "imu", "inclinometer"
"""Kinds that measure the motion's second derivatives."""
_BEYOND = 200.0
"""A rate so many times the highest frequency of a motion is far above it."""
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


@dataclass(frozen=True, kw_only=True)
class RecordingCost:
    """About what a recording costs on this machine."""

    length: float
    """How long the motion is that is recorded [s]."""
    frames: int
    """Measurements with files of their own."""
    seconds: float
    """Time that it takes [s]."""
    size: float
    """Bytes of its files, those of further formats too."""


def recording_cost(
    site: Site, sensors: Sequence[Sensor], *, begin: float = 0.0, end: float | None = None
) -> RecordingCost | None:
    """About what a site's recording costs; None where its path is planned on the finished ground.

    Args:
        site: The planned site.
        sensors: The rover's.
        begin: From when it is recorded [s].
        end: Until when [s]; None for all that follows.
    """
    spec = site.recipe.dataset or DatasetSpec()
    kinds = instrument_kinds()
    recorded = _recorded(sensors, spec)
    length = _length(site, spec)
    if length is None:
        return None
    length = max(min(length, length if end is None else end) - begin, 0.0)
    counts = [int(length * _rate(one, spec)) + 1 for one in recorded]
    costs = [measurement_cost(one) for one in recorded]
    size = sum(n * cost[1] for n, cost in zip(counts, costs, strict=True))
    size += TRUTH_RATE * TRUTH_ROW * length
    size *= 1 + len({*spec.formats} - {"euroc"})  # a further format is about as large
    return RecordingCost(
        length=length,
        frames=sum(
            n
            for n, one in zip(counts, recorded, strict=True)
            if issubclass(kinds[one.kind], Frames)
        ),
        seconds=pace() * sum(n * cost[0] for n, cost in zip(counts, costs, strict=True)),
        size=size,
    )


def require_long_enough(site: Site, sensors: Sequence[Sensor]) -> None:
    """Refuse a recording that ends before one of its pictures or sweeps is done.

    Raises:
        RecipeError: names the path and the sensor.
    """
    spec, kinds = site.recipe.dataset, instrument_kinds()
    length = None if spec is None else _length(site, spec)
    if spec is None or length is None:
        return
    for one in _recorded(sensors, spec):
        takes = 1.0 / _rate(one, spec)
        if issubclass(kinds[one.kind], Frames) and length < takes:
            raise RecipeError(
                f"the recording along {_path(site, spec)!r} lasts {length:.3g} s, sensor "
                f"{one.name!r} takes {takes:.3g} s for one measurement",
                key=("dataset",),
            )


def _length(site: Site, spec: DatasetSpec) -> float | None:
    """How long the motion lasts [s]; None along a path that is planned on the finished ground."""
    length = next((duration(one) for one in site.routes if one.name == _path(site, spec)), None)
    return None if length is None else length + 2.0 * spec.still_s + spec.ramp_s


def _recorded(sensors: Sequence[Sensor], spec: DatasetSpec) -> list[Sensor]:
    kinds = instrument_kinds()
    return [one for one in as_recorded(sensors, spec) if one.kind in kinds]


def _path(site: Site, spec: DatasetSpec) -> str:
    return spec.path or next((path.name for path in site.recipe.paths), "")


def recording_lines(site: Site, sensors: Sequence[Sensor]) -> Iterator[str]:
    """Lines that say what a recipe's recording will be, and what it costs.

    Args:
        site: The planned site.
        sensors: The rover's.
    """
    spec = site.recipe.dataset or DatasetSpec()
    recorded = _recorded(sensors, spec)
    warnings = _warnings(site, recorded, spec)
    if site.recipe.dataset is None:
        yield from warnings
        return
    names = ", ".join(one.name for one in recorded)
    yield f"recording      path {_path(site, spec)}, {spec.motion}: {names}"
    yield from warnings
    cost = recording_cost(site, sensors)
    if cost is None:
        yield "  cost         known when its path is planned on the finished ground"
        return
    yield (
        f"  cost         {cost.length:,.0f} s, {cost.frames:,.0f} measurements: about "
        f"{cost.seconds / 60:,.1f} min, {size_text(int(cost.size))} on disk"
    )


def _warnings(site: Site, sensors: Sequence[Sensor], spec: DatasetSpec) -> Iterator[str]:
    """Lines that name sensors whose rate is far above what the motion along the path holds."""
    path = next((path for path in site.recipe.paths if path.name == _path(site, spec)), None)
    if path is None or spec.motion != "path":
        return
    highest = 0.5 * path.rate_hz
    for one in sensors:
        if one.kind in _INERTIAL and one.rate_hz > _BEYOND * highest:
            yield (
                f"  warning      {one.name}: {one.rate_hz:g} Hz, the motion along a path of "
                f"rate_hz {path.rate_hz:g} holds nothing above {highest:g} Hz: a smooth curve "
                "and noise; motion: drive has the suspension's jolts"
            )


def _rate(sensor: Sensor, spec: DatasetSpec) -> float:
    """Measurements that are recorded per second [Hz]."""
    few = spec.profile == "quick" and issubclass(instrument_kinds()[sensor.kind], Frames)
    return min(sensor.rate_hz, QUICK) if few else sensor.rate_hz
