"""The recording on the report page: a film, a sweep, the IMU, figures of the dataset."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from terrain_forge.base import DataError, size_text
from terrain_forge.datasets import RecordedSensor, Recording
from terrain_forge.report.blocks import (
    Block,
    Cell,
    Shown,
    animation,
    drawing,
    facts,
    heading,
    paragraph,
    table,
    thousands,
)
from terrain_forge.report.describe import measured
from terrain_forge.report.recorded.film import FARTHEST, NEAREST, main_camera, make_film
from terrain_forge.report.recorded.measures import (
    first_sweep,
    imu_errors,
    picture_statistics,
    ring_counts,
    stereo_coverage,
)
from terrain_forge.report.recorded.plots import imu_plot, sweep_plot
from terrain_forge.report.section import Built, Section
from terrain_forge.validation import content_of

_BELOW = {"depth": "true depth", "class": "labels"}
_TOLD = {"path": "as the path says", "drive": "as the drive went"}
_HEADINGS = ("Sensor", "Kind", "Rate", "Measurements", "From", "To", "Size")


class Recorded(Section):
    """What lies in OUT/dataset."""

    kind, title, place = "recording", "Recording", 85

    def blocks(self, built: Built) -> Sequence[Block]:
        """Film, table of sensors, sweep, IMU, figures; no section where nothing was recorded."""
        try:
            found = built.recording
            some = found and any(_extent(found, sensor)[0] for sensor in found.sensors)
            return list(_blocks(found)) if found and some else []
        except DataError as error:
            return [paragraph(f"The recording in dataset/ cannot be shown: {error}")]


def _blocks(recording: Recording) -> Iterator[Block]:
    yield from _film(recording)
    extents = {sensor.key: _extent(recording, sensor) for sensor in recording.sensors}
    there = [sensor for sensor in recording.sensors if extents[sensor.key][0]]
    begin = min(first for count, first, _ in extents.values() if count)
    end = max(last for *_, last in extents.values())
    yield facts(_about(recording, 1e-9 * (end - begin)))
    rows = [_row(recording, sensor, begin) for sensor in there]
    yield table(_HEADINGS, rows, figures="llrrrrr")
    yield from _channels(recording)
    yield from _pictures(recording)
    yield from _lidar(recording)
    yield from _imu(recording)


def _film(recording: Recording) -> Iterator[Block]:
    camera = main_camera(recording)
    if camera is None or not len(camera.stamps):
        return
    film = make_film(recording, camera)
    below = " and ".join(_BELOW[part] for part in film.parts)
    depth = (
        f" Depth from {NEAREST:g} m (yellow) to {FARTHEST:g} m (violet)."
        if "depth" in film.parts
        else ""
    )
    speed = f", {film.speed:.3g} times as fast" if film.frames > 1 else ""
    caption = (
        f"{camera.name}{f'; below it {below}' if below else ''}. {film.frames} of "
        f"{thousands(len(camera.stamps))} pictures{speed}.{depth}"
    )
    yield animation(
        film.content,
        "webp",
        film.still,
        description=f"Film of {camera.name}",
        caption=caption,
        keys=film.keys,
    )


def _about(recording: Recording, seconds: float) -> list[tuple[str, Shown]]:
    about = recording.about
    motion = about.get("motion", {})
    formats = sorted(content_of(recording.folder / "formats.json"))
    found: list[tuple[str, Shown]] = [
        ("Path", f"{motion.get('path', '–')}, {_TOLD.get(motion.get('source', ''), '–')}"),
        ("Recorded", f"{seconds:.1f} s of {motion.get('duration_s', 0.0):.1f} s"),
        ("Stands still at first", f"{motion.get('still_s', 0.0):g} s"),
        ("Gravity that IMUs feel", f"{recording.gravity:g} m/s²"),
        ("Frame of the truth", recording.body_name),
        ("Formats", ", ".join(["EuRoC", *formats])),
    ]
    if about.get("profile") == "quick":
        found.append(("Profile", "quick: small pictures, few of them"))
    return found


def _row(recording: Recording, sensor: RecordedSensor, begin: int) -> list[Shown]:
    count, *ends = _extent(recording, sensor)
    size = sum(path.stat().st_size for path in sensor.folder.rglob("*") if path.is_file())
    return [
        Cell(sensor.name, note=f"mav0/{sensor.key}"),
        str(_told(recording, sensor)["kind"]),
        f"{sensor.rate:g} Hz",
        thousands(count),
        *(f"{1e-9 * (stamp - begin):.3f} s" for stamp in ends),
        size_text(size),
    ]


def _told(recording: Recording, sensor: RecordedSensor) -> Mapping[str, Any]:
    streams: list[Mapping[str, Any]] = recording.about["streams"]
    return next(one for one in streams if one["folder"].endswith(f"/{sensor.key}"))


def _extent(recording: Recording, sensor: RecordedSensor) -> tuple[int, int, int]:
    """Measurements of a sensor, first and last stamp [ns]: as the index has them, or as found."""
    told = _told(recording, sensor)
    if "count" in told:
        return told["count"], told.get("first_ns", 0), told.get("last_ns", 0)
    first, last = sensor.span
    return len(sensor.stamps), first, last


def _channels(recording: Recording) -> Iterator[Block]:
    """What is true of the pictures, and of which cameras."""
    found: dict[str, list[str]] = {}
    for camera in recording.cameras:
        channels = ", ".join(name for name in camera.channels if name != "data")
        found.setdefault(channels, []).append(camera.name)
    for channels, names in found.items():
        if channels:
            yield paragraph(f"Beside the pictures of {' and '.join(names)}: {channels}.", "note")


def _pictures(recording: Recording) -> Iterator[Block]:
    camera = main_camera(recording)
    if camera is None or not len(camera.stamps):
        return
    found: list[tuple[str, Shown]] = []
    if min(camera.size[0], camera.size[1] // 2) >= 32:
        seen = picture_statistics(recording, camera)
        found += [
            (
                "Slope of the power spectrum",
                Cell(measured(seen.slope), note="photographs: about −2"),
            ),
            ("Kurtosis of log gradients", Cell(f"{seen.kurtosis:.1f}", note="Gaussian: 3")),
            ("FAST corners per 1000 px", f"{seen.corners:.1f}"),
            ("Dark pixels", Cell(f"{seen.dark:.1%}", note="below a quarter of the median")),
        ]
    for pair in recording.pairs[:1]:
        cover = stereo_coverage(recording, pair)
        if cover:
            found.append(("Stereo coverage", Cell(f"{cover.share:.1%}", note=f"by {cover.by}")))
            if cover.wrong is not None:
                wrong = Cell(f"{cover.wrong:.1%}", note="of what was matched")
                found.append(("Disparity a pixel off", wrong))
    if found:
        yield heading("Pictures of the ground")
        yield facts(found)


def _lidar(recording: Recording) -> Iterator[Block]:
    for lidar in recording.lidars:
        if not len(lidar.stamps):
            continue
        counts = ring_counts(lidar)
        sweep = first_sweep(recording) if lidar is recording.lidars[0] else None
        shown = "The first sweep, each point by the true pose at its own time." if sweep else ""
        in_3d = " It is in the 3-D view above, too." if sweep else ""
        yield heading(f"Sweeps of {lidar.name}")
        mean = counts.ground.sum() + counts.rover.sum()
        yield drawing(
            sweep_plot(sweep, counts),
            description=f"Plots of the sweeps of {lidar.name}",
            caption=(f"{shown}{in_3d} Returns are means of sweeps, {mean:,.0f} each."),
        )


def _imu(recording: Recording) -> Iterator[Block]:
    for imu in recording.imus:
        if not _extent(recording, imu)[0]:
            continue
        found = imu_errors(recording, imu)
        if found is None:
            continue
        densities = [
            (
                float(imu.about.get(f"{name}_noise_density", 0.0)),
                float(imu.about.get(f"{name}_random_walk", 0.0)),
            )
            for name in ("gyroscope", "accelerometer")
        ]
        yield heading(f"Readings of {imu.name}")
        beside = (
            " The overlapping Allan deviation is of what they are off the motion's own; with it "
            "goes that of the spec."
            if found.errors is not None
            else ""
        )
        yield drawing(
            imu_plot(found, densities=densities),
            description=f"Plots of {imu.name}",
            caption=f"Rates and specific forces over time.{beside}",
        )
