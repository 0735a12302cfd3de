"""What a recording costs on the machine at hand, by its sensors' figures: time and disk."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from terrain_forge.base import RecipeError, processors, size_text
from terrain_forge.building import calibrated
from terrain_forge.datasets import TRUTH, Footprint, format_size
from terrain_forge.model import CameraSensor, LidarSensor, Sensor, Site, StereoSensor
from terrain_forge.paths import duration
from terrain_forge.recipe import DatasetSpec
from terrain_forge.recording.formats import formats_of
from terrain_forge.recording.rig import folder_names, quick_step
from terrain_forge.recording.setting import as_recorded
from terrain_forge.sensors import Frames, instrument_kinds

_INERTIAL = "imu", "inclinometer"
"""Kinds that measure the motion's second derivatives."""
_BEYOND = 200.0
"""A rate so many times the highest frequency of a motion is far above it."""
VIEW, PIXEL, COLOURED = 0.022, (6e-7, 0.45), 1.5
"""Processor time of a look of a camera [s], and of each of its pixels, with the bytes of a grey one
of 8 bits; and by how much it is longer in colour. On the machine of `building.calibrated`, as all
times here; scenes differ by half."""
CHANNEL = 7e-8, 0.7
"""Processor time and bytes that a further channel takes for each pixel."""
EYES = "disparity", "occlusion"
"""Channels that disparity is for each eye: it, and what the other one does not see."""
SWEEP, RAY, POINT = 0.004, 2.8e-7, 15.0
"""Processor time of a sweep and of each of its rays [s], and bytes of its point, of which about
half come back."""
ROW = 1e-6, 130.0
"""Of a row of a table that is measured."""
LOAD, SCENE, REHEARSED, PAGE = 0.4, 0.8, 0.4, 1.5
"""Time to read the world, to make the scene, to try the formats, to write the report page [s]."""
DRIVEN = 0.1
"""Time to simulate a second of a drive [s]."""
LISTED, FORMAT = 1.5e-5, 1.8e-8
"""Time to write a row of a table or list [s], and what a format takes for each byte of the
recording."""
ALONE = 0.2
"""Part of the work that only one of several cores does at a time."""
TRUTH_RATE, TRUTH_ROW = 200.0, 500.0
"""Rows of the body's truth [Hz], and their bytes."""


def measurement_cost(sensor: Sensor) -> tuple[float, float]:
    """About the processor time [s] that a measurement takes, and the bytes of its files."""
    more = _further(sensor)
    seconds = [_picture(p, more) for p in sensor.simple if isinstance(p, CameraSensor)]
    seconds += [SWEEP + RAY * p.rays for p in sensor.simple if isinstance(p, LidarSensor)]
    sizes = [size for part in sensor.simple for size in _sizes(part, more).values()]
    return ROW[0] + sum(seconds), sum(sizes)


def _further(sensor: Sensor) -> tuple[str, ...]:
    """Channels that each eye of a pair has beside those of a camera alone."""
    both = isinstance(sensor, StereoSensor) and "disparity" in sensor.channels
    return EYES if both else ()


def _picture(camera: CameraSensor, more: Sequence[str]) -> float:
    pixels, pictures = camera.width_px * camera.height_px, len(camera.images)
    looks = pictures * (camera.motion_blur // 2 * 2 + 1)  # truth is of the middle
    each = VIEW + pixels * PIXEL[0] * (COLOURED if camera.colour else 1.0)
    return looks * each + pixels * CHANNEL[0] * (len(camera.channels) + len(more))


def _sizes(sensor: Sensor, more: Sequence[str]) -> dict[str, float]:
    """Bytes of a measurement by its streams."""
    if isinstance(sensor, LidarSensor):
        return {"data": POINT * len(sensor.elevations) / (sensor.column_s * sensor.rate_hz)}
    if not isinstance(sensor, CameraSensor):
        return {"data": ROW[1]}
    pixels = sensor.width_px * sensor.height_px
    values = (3 if sensor.colour else 1) * (1 if sensor.bits == 8 else 2)
    streams = ("data", "rectified")[: len({*sensor.images})]
    return dict.fromkeys(streams, PIXEL[1] * values * pixels) | dict.fromkeys(
        (*sensor.channels, *more), CHANNEL[1] * pixels
    )


def truth_footprint(count: int) -> Footprint:
    """What the truth takes, of so many rows."""
    sizes = {"data": TRUTH_ROW}
    return Footprint(key=TRUTH, name="", kind="truth", count=count, sizes=sizes)


def footprint(key: str, sensor: Sensor, count: int, sizes: Mapping[str, float]) -> Footprint:
    """What a sensor that is no pair takes in a folder."""
    camera = sensor if isinstance(sensor, CameraSensor) else None
    return Footprint(
        key=key,
        name=sensor.name,
        kind=sensor.kind,
        count=count,
        sizes=sizes,
        pixels=camera.width_px * camera.height_px if camera else 0,
        colours=3 if camera and camera.colour else 1,
        bits=camera.bits if camera else 8,
        preset=sensor.preset,
    )


def _footprints(sensors: Sequence[Sensor], counts: Sequence[int], rows: float) -> list[Footprint]:
    """What a recording of some sensors takes, each measuring so often."""
    kinds = instrument_kinds()
    parts = [
        (part, count, _sizes(part, _further(one)))
        for one, count in zip(sensors, counts, strict=True)
        for part in one.simple
    ]
    names = folder_names(kinds[part.kind] for part, _, _ in parts)
    found = [
        footprint(name, part, count, size)
        for name, (part, count, size) in zip(names, parts, strict=True)
    ]
    return [*found, truth_footprint(round(rows))]


def seconds_of(tasks: Iterable[tuple[Sensor, int]], workers: int | None = None) -> float:
    """About the time that numbers of measurements take on this machine [s]."""
    work = sum(count * measurement_cost(sensor)[0] for sensor, count in tasks)
    share = ALONE + (1.0 - ALONE) / (workers or processors())
    return calibrated({"recording": share * work})["recording"]


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
    rows = TRUTH_RATE * length
    taken = _footprints(recorded, counts, rows)
    formats = formats_of(spec).items()
    further = sum(format_size(name, options, taken) for name, options in formats)
    size = sum(one.size for one in taken)
    stages = {
        "load": LOAD,
        "scene": SCENE + (DRIVEN * length if spec.motion == "drive" else 0.0),
        "rehearsal": REHEARSED + sum(seconds for seconds, _ in costs),
        "tables": LISTED * (rows + 2.0 * sum(counts)),
        "formats": FORMAT * further,
        "report page": PAGE,
    }
    recording = seconds_of(zip(recorded, counts, strict=True))
    return RecordingCost(
        length=length,
        frames=sum(
            n * len(one.simple)
            for n, one in zip(counts, recorded, strict=True)
            if issubclass(kinds[one.kind], Frames)
        ),
        seconds=recording + sum(calibrated(stages).values()),
        size=size + further,
    )


def require_long_enough(site: Site, sensors: Sequence[Sensor]) -> None:
    """Refuse a recording that ends before one of its pictures or sweeps is done.

    Raises:
        RecipeError: names the path and the sensor, or how long it takes to start and to stop.
    """
    spec, kinds = site.recipe.dataset, instrument_kinds()
    length = None if spec is None else _length(site, spec)
    if spec is None or length is None:
        return
    alone = length - _beside(spec)
    if spec.motion == "path" and alone < spec.ramp_s:
        raise RecipeError(
            f"path {_path(site, spec)!r} lasts {alone:.3g} s, starting and stopping takes "
            f"{spec.ramp_s:g} s",
            key=("dataset", "ramp_s"),
        )
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
    return None if length is None else length + _beside(spec)


def _beside(spec: DatasetSpec) -> float:
    """What a motion lasts longer than its path [s]: a drive ends as it arrives."""
    return spec.still_s if spec.motion == "drive" else 2.0 * spec.still_s + spec.ramp_s


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
    return sensor.rate_hz / (quick_step(sensor.rate_hz) if few else 1)
