"""A sweep of a lidar, as it is measured."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import (
    Array,
    Record,
    linear_from_srgb,
    mix,
    over_chunks,
    shaped,
)
from terrain_forge.model import LidarSensor, merge
from terrain_forge.scene import COHERENT, INCOHERENT, LANES, packet_memory
from terrain_forge.sensors.beams import DELAY, NANOSECONDS, make_beams, sweep_begin, sweep_columns
from terrain_forge.sensors.course import Course, follow
from terrain_forge.sensors.instrument import Instrument, Setting
from terrain_forge.sensors.labels import labels_of
from terrain_forge.sensors.motion import State
from terrain_forge.sensors.picture import tracked
from terrain_forge.sensors.returns import (
    FIRST,
    FOUND,
    LAST,
    STRONGEST,
    Points,
    Rules,
    Surfaces,
    gather,
    scan,
)

_STEP = 1e-3
"""Time between the states that poses are interpolated from [s]."""
_RED = 0
"""The channel of colours that is nearest to a lidar's near infrared."""
_ECHOES = {"first": FIRST, "strongest": STRONGEST, "last": LAST}


@dataclass(frozen=True, kw_only=True, eq=False)
class Sweep(Record):
    """The points of one sweep, by time; each where the lidar saw it from its place at that time."""

    number: int
    """Its place in the row of sweeps."""
    begin: int
    """When its first beam fired [ns]."""
    points: NDArray[np.float32] = field(metadata=shaped("points", 3, dtype=np.float32))
    """In the lidar's own frame at each point's own time [m], shape [points, 3]."""
    distance: NDArray[np.float32] = field(metadata=shaped("points", dtype=np.float32))
    """Range [m], shape [points]."""
    intensity: NDArray[np.float32] = field(metadata=shaped("points", dtype=np.float32))
    """Power of the return, or reflectivity, as the lidar's `intensity` says, shape [points]."""
    ring: NDArray[np.uint16] = field(metadata=shaped("points", dtype=np.uint16))
    """Beam, by the lidar's table, shape [points]."""
    column: NDArray[np.int32] = field(metadata=shaped("points", dtype=np.int32))
    """Column of the sweep, shape [points]."""
    time: NDArray[np.float32] = field(metadata=shaped("points", dtype=np.float32))
    """Time after `begin` [s], shape [points]."""
    instance: NDArray[np.int32] = field(metadata=shaped("points", dtype=np.int32))
    """Id of a rock, or -1 ground, -3 what lies beyond the site, -4 the rover, shape [points]."""


def take_sweep(setting: Setting, lidar: LidarSensor, number: int) -> Sweep:
    """A sweep, which depends on nothing but these."""
    begin, columns, beams = (
        sweep_begin(lidar, number),
        sweep_columns(lidar, number),
        make_beams(lidar),
    )
    course = _course(setting, lidar, begin, columns)
    count = len(columns) * len(beams.table)
    measured = Points(
        xyz=np.empty((count, 3), np.float32),
        distance=np.empty(count, np.float32),
        intensity=np.empty(count, np.float32),
        instance=np.empty(count, np.int32),
    )
    rover = setting.scenery.rover_at(1e-9 * begin + 0.5 * float(columns[-1, 0]))
    over_chunks(
        scan,
        len(beams.table),
        setting.scenery.scene.handle,
        COHERENT if lidar.prism_rpm is None else INCOHERENT,
        rover.beyond(lidar.near_m),
        course,
        beams,
        _surfaces(setting),
        _rules(setting, lidar),
        np.uint64(mix(setting.key(lidar), np.uint64(number))),
        packet_memory(2 * len(beams.table)),
        np.empty((len(beams.table), FOUND + 3 * len(beams.rays), LANES)),
        measured,
    )
    ring, column = np.empty(count, np.uint16), np.empty(count, np.int32)
    kept = gather(measured, np.argsort(beams.rank), ring, column)
    delay = beams.table[:, DELAY]
    return Sweep(
        number=number,
        begin=begin,
        points=measured.xyz[:kept],
        distance=measured.distance[:kept],
        intensity=measured.intensity[:kept],
        ring=ring[:kept],
        column=column[:kept],
        time=(columns[:, :1] + delay).astype(np.float32)[column[:kept], ring[:kept]],
        instance=measured.instance[:kept],
    )


def deskewed_points(setting: Setting, lidar: LidarSensor, sweep: Sweep) -> Array:
    """The points of a sweep in the world [m], each moved by the exact pose at its own time."""
    times, which = np.unique(sweep.time, return_inverse=True)
    moments = 1e-9 * sweep.begin + times.astype(np.float64)
    state = Instrument(lidar, setting).state(moments)  # type: ignore[abstract]
    turned = (state.rotation[which] * sweep.points[:, None, :]).sum(axis=-1)
    return np.asarray(state.position[which] + turned)


def point_classes(setting: Setting, lidar: LidarSensor, sweep: Sweep) -> NDArray[np.uint8]:
    """Numbers of `CLASSES` of a sweep's points; tracks are those that there are as it begins."""
    behind = tracked(setting, 1e-9 * sweep.begin)
    points = deskewed_points(setting, lidar, sweep)
    return labels_of(setting).of(points, sweep.instance, behind)


def sweep_count(lidar: LidarSensor, end: float) -> int:
    """How many whole sweeps there are until a time [s]."""
    until, more = round(end * NANOSECONDS), 0 if lidar.snapshot else 1
    count = math.ceil(end * lidar.rate_hz) + 1
    while count and sweep_begin(lidar, count - 1 + more) > until:
        count -= 1
    return count


def _course(setting: Setting, lidar: LidarSensor, begin: int, columns: Array) -> Course:
    """Poses at the columns of a sweep, between exact ones a millisecond apart."""
    lasts = float(columns[-1, 0])
    count = max(2, math.ceil(lasts / _STEP) + 1)
    times = 1e-9 * begin + np.linspace(0.0, lasts, count)
    instrument = Instrument(lidar, setting)  # type: ignore[abstract]
    origin = setting.scenery.scene.origin
    states = (instrument.state(times), setting.motion.base.at(times))
    nodes, slopes = (
        np.hstack(parts) for parts in zip(*(_flat(state, origin) for state in states), strict=True)
    )
    course = Course(
        turns=np.empty((len(columns), 4)),
        place=np.empty((len(columns), 12)),
        speed=np.empty((len(columns), 12)),
        base=np.empty((len(columns), 3, 4)),
    )
    follow(columns, nodes, slopes, lasts / (count - 1) or 1.0, *course)
    return course


def _flat(state: State, origin: Array) -> tuple[Array, Array]:
    """Place and rotation, and their derivatives, shape [times, 12] each."""
    turning = np.cross(state.rotation, state.rate[:, None, :])
    count = len(state.position)
    return (
        np.hstack([state.position - origin, state.rotation.reshape(count, 9)]),
        np.hstack([state.velocity, turning.reshape(count, 9)]),
    )


def _rules(setting: Setting, lidar: LidarSensor) -> Rules:
    east, north, up = setting.world.lighting.towards_sun.tolist()
    first, second = np.radians(lidar.prism_deviations_deg).tolist()
    return Rules(
        near=lidar.range_min_m,
        far=lidar.range_max_m,
        origin=lidar.beam_origin_m,
        prisms=(-1.0, -1.0) if lidar.prism_rpm is None else (first, second),
        limit=0.1 / lidar.range_at_tenth_m**2 if lidar.range_at_tenth_m else 0.0,
        lost=lidar.dropout,
        sun=(east, north, up),
        blinding=math.cos(math.radians(lidar.sun_blinding_deg)) if lidar.sun_blinding_deg else 2.0,
        noise=lidar.noise_m,
        quantum=lidar.quantum_m,
        separation=lidar.echo_separation_m,
        echo=_ECHOES[lidar.returns],
        levelled=lidar.intensity == "reflectivity",
        sees_rover=lidar.sees_rover,
    )


_KNOWN: WeakKeyDictionary[Setting, Surfaces] = WeakKeyDictionary()


def _surfaces(setting: Setting) -> Surfaces:
    """What surfaces reflect, made once for each setting."""
    if (known := _KNOWN.get(setting)) is not None:
        return known
    world, scene = setting.world, setting.scenery.scene
    subject = scene.subject
    linear = linear_from_srgb(np.arange(256) / 255.0)
    reflectance = linear.astype(np.float32)[subject.ground_rgb[..., _RED]]
    sides = (reflectance[0], reflectance[-1], reflectance[:, 0], reflectance[:, -1])
    west, south = subject.ground.origin
    found = Surfaces(
        reflectance=reflectance,
        corner=(west - float(scene.origin[0]), south - float(scene.origin[1])),
        spacing=subject.ground.spacing,
        beyond=float(np.concatenate(sides).mean(dtype=np.float64)),
        rocks=subject.instances.rgb[:, _RED].copy(),
        ids=merge(world.field, world.neighbours).id,
        turns=subject.instances.rotation,
        rover=setting.scenery.rover_parts.rgb[:, _RED].copy(),
    )
    _KNOWN[setting] = found
    return found
