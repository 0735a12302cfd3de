"""What a recording costs on the machine at hand, by its sensors' figures: time and disk."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from terrain_forge.base import size_text
from terrain_forge.building import pace
from terrain_forge.model import Sensor, Site
from terrain_forge.paths import duration
from terrain_forge.recording.setting import as_recorded
from terrain_forge.sensors import Frames, instrument_kinds

PIXEL = 1.2e-7, 0.65
"""Time to make a pixel of a picture [s], and its bytes, on the machine of `building.pace`."""
CHANNEL = 4e-8, 0.7
"""Time and bytes that a further channel takes for each pixel."""
POINT = 1.5e-7, 30.0
"""Of a lidar's point."""
ROW = 1e-6, 130.0
"""Of a row of a table."""
TRUTH_RATE, TRUTH_ROW = 200.0, 500.0
"""Rows of the body's truth [Hz], and their bytes."""


def measurement_cost(sensor: Sensor) -> tuple[float, float]:
    """About the time [s] that a measurement takes, and the bytes of its files."""
    seconds, size = ROW
    for part in sensor.simple:
        pixels = part.view.width_px * part.view.height_px if part.view else 0
        points = getattr(part, "rays", 0)
        channels = getattr(part, "channels", ())
        more = len(channels) if isinstance(channels, tuple) else 0
        seconds += pixels * (PIXEL[0] + more * CHANNEL[0]) + points * POINT[0]
        size += pixels * (PIXEL[1] + more * CHANNEL[1]) + points * POINT[1]
    return seconds, size


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
    counts = [one.rate_hz * length for one in recorded]
    costs = [measurement_cost(one) for one in recorded]
    seconds = pace() * sum(n * cost[0] for n, cost in zip(counts, costs, strict=True))
    size = sum(n * cost[1] for n, cost in zip(counts, costs, strict=True))
    size += TRUTH_RATE * TRUTH_ROW * length
    frames = sum(
        n for n, one in zip(counts, recorded, strict=True) if issubclass(kinds[one.kind], Frames)
    )
    yield (
        f"  cost         {length:,.0f} s, {frames:,.0f} measurements: about "
        f"{seconds / 60:,.1f} min, {size_text(int(size))} on disk"
    )
