"""A consumer's reading against the world: every aspect with its largest error and its limit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, matrix_from_quaternion
from terrain_forge.geometry import inertias, outline_error
from terrain_forge.model import (
    Check,
    Heightfield,
    RockPrototype,
    Trajectory,
    at_most,
    failed,
    rotations,
)
from terrain_forge.paths import ANGLE_LIMIT, POSITION_LIMIT, Deviation
from terrain_forge.validation.outlines import rock_errors
from terrain_forge.validation.reading import Body, Reading, SolidsOfRocks, Track
from terrain_forge.validation.sample import Sample
from terrain_forge.validation.surface_mesh import highest_on
from terrain_forge.writers import file_name, identifier

GROUND_LIMIT, GROUND_LIMIT_OF_RANGE = 1e-3, 1e-5
"""A ground may be off by a millimetre, or by this part of its range of heights."""
ROCK_LIMIT = 0.01
"""A rock may be off by this part of its diameter, or by what the export's options allow it."""
MASS_LIMIT = 1e-5
"""Masses and inertia may be off by this part of them: some consumers compute in 32 bits."""
GRAVITY_LIMIT = 1e-6
"""Gravity may be off by this [m/s²]."""
PLACE_LIMIT = 1e-3
"""Frames may be off by this [m], and turned so that a point at 1 m is off by this."""
PATH_LIMIT = 1e-4
"""Samples of a path may be off by this [m], and turned so that a point at 1 m is off by this."""
TIME_LIMIT = 1e-3
"""Each sample of a path has one in a track that is off by no more than this [s]."""
BALL_LIMIT = 2e-3
"""A ball may rest this much too high or too low [m]."""
SUNK_STEPS = 4.0
"""How many steps of a ground of whole numbers a ball may sink besides: ODE misses contacts at the
edges of a heightmap's triangles (3.2 steps was the most of 300 balls on 8 bits in DART)."""


ASPECTS = (
    *("findings", "ground", "rock tops", "rock outlines", "masses", "gravity", "frames", "path"),
    "balls",
)
"""What is compared, in the order of the table's columns."""

Status = Literal["pass", "fail", "not carried", "not run"]


@dataclass(frozen=True, kw_only=True)
class Entry:
    """A cell of the conformance table: what was found of one aspect of an export in a consumer."""

    export: str
    """Folder of the export."""
    kind: str
    """The exporter."""
    consumer: str
    """The program that read it, with its version where it was run."""
    aspect: str
    """One of ASPECTS; empty where the consumer was not run at all."""
    status: Status
    """`pass`, `fail`, `not carried` (the format or the consumer does not have it), `not run`."""
    figure: float | None = None
    """The largest error."""
    unit: str = ""
    """Unit of figure and limit; empty for ratios and counts."""
    limit: float | None = None
    """The largest error that passes."""
    note: str = ""
    """What the figure means, or why there is none."""

    @property
    def check(self) -> Check | None:
        """The entry as a check; None where nothing was measured, which neither passes nor fails."""
        if self.status not in ("pass", "fail"):
            return None
        return Check(
            name=f"{self.export} in {self.consumer}: {self.aspect or 'reading'}",
            figure=self.figure,
            unit=self.unit,
            limit=self.limit,
            passed=self.status == "pass",
            note=self.note,
        )


def ground_limit(ground: Heightfield) -> float:
    """How far a format's ground may be off [m]."""
    extent = float(np.ptp(ground.elevation.astype(np.float64)))
    return max(GROUND_LIMIT, GROUND_LIMIT_OF_RANGE * extent)


def measure(
    sample: Sample, entry: Entry, reading: Reading, aspects: Sequence[str] = ASPECTS
) -> list[Entry]:
    """Some aspects of what a consumer made of the entry's export, in the order of the table."""
    entries = []
    for aspect in aspects:
        blank = replace(entry, consumer=reading.consumer, aspect=aspect)
        found = _MEASURES[aspect](sample, reading, blank)
        why = reading.reasons.get(aspect, "")
        entries.append(found or replace(blank, status="not carried", note=why))
    return entries


def replay_checks(title: str, replays: Sequence[Deviation | None]) -> list[Check]:
    """How far paths are left by replays between samples; None stands for one without a replay."""
    found = [replay for replay in replays if replay]
    if len(found) < len(replays):
        missing = len(replays) - len(found)
        return [failed(title, f"{missing} of {len(replays)} paths have no replay")]
    if not found:
        return []
    place, angle = max(d.position for d in found), max(d.angle for d in found)
    note = f"largest distance of {len(found)} replays from their paths"
    return [
        at_most(title, place, POSITION_LIMIT, unit="m", note=note),
        at_most(f"{title}, turned", angle, ANGLE_LIMIT, unit="rad"),
    ]


def _judged(entry: Entry, figure: float, limit: float, *, unit: str = "", note: str = "") -> Entry:
    status: Status = "pass" if figure <= limit else "fail"
    if not np.isfinite(figure):
        return replace(entry, status="fail", note=note)
    return replace(entry, status=status, figure=figure, limit=limit, unit=unit, note=note)


def _findings(_: Sample, reading: Reading, entry: Entry) -> Entry | None:
    if reading.findings is None:
        return None
    note = f"first: {reading.findings[0]}" if reading.findings else "complaints of the consumer"
    return _judged(entry, float(len(reading.findings)), 0.0, note=note)


def _ground(sample: Sample, reading: Reading, entry: Entry) -> Entry | None:
    heights = reading.heights
    if heights is None and not reading.ground:
        return None
    points = sample.points if reading.points is None else reading.points
    if heights is None:
        heights = highest_on(reading.ground, points)
    shown = np.ones(len(heights), np.bool_) if reading.hidden is None else ~reading.hidden
    heights, points = heights[shown], points[shown]
    missed = int(np.isnan(heights).sum())
    if missed or not len(points):
        why = f"no ground under {missed} of {len(points)} points"
        return replace(entry, status="fail", note=why)
    ground = sample.world.ground
    off = np.abs(heights - ground.height_at(points[:, 0], points[:, 1]))
    usual = max(ground_limit(ground), 0.5 * reading.quantum + reading.besides)
    limit = usual if reading.ground_limit is None else reading.ground_limit
    note = f"largest difference in height at {len(points)} points"
    return _judged(entry, float(off.max()), limit, unit="m", note=note)


def _rocks(sample: Sample, reading: Reading, entry: Entry, *, along: slice) -> Entry | None:
    """The rock that is worst for what it may be off, among those touched and those seen."""
    field = sample.world.field.select(sample.rows)
    if reading.touched is None and reading.seen is None:
        return None
    if not len(field):
        return replace(entry, status="not carried", note="there are no rocks")
    drawn = [_drawn_error(shape, reading) for shape in sample.world.library.prototypes]
    size = field.scale / field.diameter
    touched = np.maximum(ROCK_LIMIT, reading.rock_error * size)
    seen = np.maximum(touched, ROCK_LIMIT + np.array(drawn)[field.prototype] * size)
    looks: list[tuple[SolidsOfRocks | None, NDArray[np.bool_], Array]] = [
        (reading.touched, field.collides, touched),
        (reading.seen, np.ones(len(field), np.bool_), seen),
    ]
    worst, limit = np.zeros(len(field)), touched
    for solids, counts, allowed in looks:
        if solids is not None:
            off = rock_errors(sample, solids)[:, along]
            shown = np.where(np.isnan(off), 0.0, off).max(axis=1) / field.diameter
            shown = np.where(counts, shown, 0.0)
            worse = shown / allowed > worst / limit
            worst, limit = np.where(worse, shown, worst), np.where(worse, allowed, limit)
    first = int(np.argmax(worst / limit))
    if not np.isfinite(worst[first]):
        return replace(entry, status="fail", note=f"rock {field.id[first]} is missing or misplaced")
    kinds = " and ".join(
        name for name, look in zip(("touched", "seen"), looks, strict=True) if look[0] is not None
    )
    note = f"in diameters, worst of {len(field)} rocks as they are {kinds}"
    return _judged(entry, float(worst[first]), float(limit[first]), note=note)


def _drawn_error(shape: RockPrototype, reading: Reading) -> float:
    """How far the meshes that stand for a shape in pictures are off it, at most [mean axes]."""
    coarse = shape.outline_errors[min(reading.drawn_level, len(shape.outline_errors) - 1)]
    if not reading.close or shape.close is None:
        return coarse
    return max(coarse, outline_error(shape.close, shape.meshes[0]))


def _masses(sample: Sample, reading: Reading, entry: Entry) -> Entry | None:
    if reading.bodies is None:
        return None
    dynamic = sample.world.field.select(sample.dynamic)
    if not len(dynamic):
        return replace(entry, status="not carried", note="no rock is dynamic")
    missing = [rock for rock in dynamic.id.tolist() if rock not in reading.bodies]
    if missing or len(reading.bodies) != len(dynamic):
        first = f"rock {missing[0]}" if missing else "one too many"
        note = f"{len(reading.bodies)} bodies for {len(dynamic)} dynamic rocks; {first}"
        return replace(entry, status="fail", note=note)
    found = [reading.bodies[rock] for rock in dynamic.id.tolist()]
    tensors = inertias(dynamic, sample.world.library)
    off = np.abs(np.array([body.inertia for body in found]) - tensors).max(axis=(1, 2))
    off /= np.abs(tensors).max(axis=(1, 2))
    mass = np.abs(np.array([body.mass for body in found]) / dynamic.mass - 1.0)
    note = f"largest relative error of mass and inertia, {len(dynamic)} dynamic rocks"
    return _judged(entry, float(max(off.max(), mass.max())), MASS_LIMIT, note=note)


def _gravity(sample: Sample, reading: Reading, entry: Entry) -> Entry | None:
    if reading.gravity is None:
        return None
    off = abs(reading.gravity + sample.world.site.body.gravity)
    return _judged(entry, off, GRAVITY_LIMIT, unit="m/s²", note="difference to the body's")


def _frames(sample: Sample, reading: Reading, entry: Entry) -> Entry | None:
    extent = reading.extent
    if extent is None and not reading.ground:
        return None
    if extent is None:
        corners = np.concatenate([mesh.vertices[:, :2] for mesh in reading.ground])
        extent = *corners.min(axis=0).tolist(), *corners.max(axis=0).tolist()
    worst = float(np.abs(np.array(extent) - sample.world.ground.bounds).max())
    note = "edges of the ground"
    if reading.bodies:
        worst = max(worst, _body_error(sample, reading.bodies))
        note += " and poses of dynamic rocks"
    return _judged(entry, worst, PLACE_LIMIT, unit="m", note=note)


def _body_error(sample: Sample, bodies: Mapping[int, Body]) -> float:
    """How far bodies are off, and points at 1 m by their being turned [m]."""
    place = {rock: n for n, rock in enumerate(sample.world.field.id.tolist())}
    if not bodies.keys() <= place.keys():
        return float("inf")
    rocks = sample.world.field.select(np.array([place[rock] for rock in bodies]))
    positions, turns = ([body[n] for body in bodies.values()] for n in (2, 3))
    moved = np.linalg.norm(np.array(positions) - rocks.position, axis=1)
    turned = np.linalg.norm(np.array(turns) - rotations(rocks), axis=2)
    return float(max(moved.max(), turned.max()))


def _path(sample: Sample, reading: Reading, entry: Entry) -> Entry | None:
    if reading.tracks is None:
        return None
    trajectories = sample.world.trajectories
    if not trajectories:
        return replace(entry, status="not carried", note="there are no paths")
    worst, samples = 0.0, 0
    for trajectory in trajectories:
        name = trajectory.name
        names = (name, file_name(name), identifier(name))
        tracks = [track for track in reading.tracks if track.name in names]
        if not tracks:
            return replace(entry, status="fail", note=f"path {name} is missing")
        worst = max(worst, *(_track_error(trajectory, track) for track in tracks))
        samples += sum(len(track.position) for track in tracks)
    note = f"largest error of place, and at 1 m of turn, {samples} samples"
    return _judged(entry, worst, PATH_LIMIT, unit="m", note=note)


def _track_error(trajectory: Trajectory, track: Track) -> float:
    """How far a track's samples are off the trajectory at their times [m].

    Infinite where it lacks a sample of the trajectory; a track without times is places alone.
    """
    if track.time is None:
        from scipy.spatial import cKDTree

        return float(cKDTree(trajectory.position).query(track.position)[0].max(initial=0.0))
    first, last = trajectory.time[0], trajectory.time[-1]
    if abs(track.time[0] - first) > PLACE_LIMIT or abs(track.time[-1] - last) > PLACE_LIMIT:
        return float("inf")
    nearest = np.interp(trajectory.time, track.time, np.arange(len(track.time))).round().astype(int)
    if np.abs(track.time[nearest] - trajectory.time).max() > TIME_LIMIT:
        return float("inf")
    wanted = trajectory.at(np.clip(track.time, first, last))
    worst = float(np.linalg.norm(track.position - wanted.position, axis=1).max())
    if track.quaternion is not None:
        turns = matrix_from_quaternion(track.quaternion) - matrix_from_quaternion(wanted.quaternion)
        worst = max(worst, float(np.linalg.norm(turns, axis=2).max()))
    return worst


def _balls(sample: Sample, reading: Reading, entry: Entry) -> Entry | None:
    if reading.balls is None:
        return None
    if not len(sample.balls.rest):
        return replace(entry, status="not carried", note="no place is free of rocks")
    off = np.abs(reading.balls - sample.balls.rest)
    note = (
        f"{len(off)} balls of {sample.balls.radius:g} m on vertical sliders, largest difference of "
        "where they rest"
    )
    figure = float(off.max()) if np.isfinite(off).all() else float("inf")
    limit = BALL_LIMIT + SUNK_STEPS * reading.quantum + reading.besides
    return _judged(entry, figure, limit, unit="m", note=note)


_MEASURES: dict[str, Callable[[Sample, Reading, Entry], Entry | None]] = {
    "findings": _findings,
    "ground": _ground,
    "rock tops": partial(_rocks, along=slice(-1, None)),
    "rock outlines": partial(_rocks, along=slice(-1)),
    "masses": _masses,
    "gravity": _gravity,
    "frames": _frames,
    "path": _path,
    "balls": _balls,
}
