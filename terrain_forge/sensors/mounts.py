"""Whether sensors that see sit where they can see anything."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from terrain_forge.base import Array, RecipeError, portable
from terrain_forge.geometry import shape_triangles
from terrain_forge.model import Rover, Sensor, simple_sensors
from terrain_forge.sensors.instrument import Frames, Instrument, Setting, instrument_kinds
from terrain_forge.sensors.links import RoverLinks
from terrain_forge.sensors.motion import Curve, Motion

_STEP = 0.1
"""Time between the places that are looked at [s]."""
_MOST = 20_000
_MOMENTS = 16
"""Moments at which a sensor is compared with the links that move against it."""
_INSIDE = 0.75
"""Part of all directions that a closed surface fills around a point within it: 1; on it: 0.5."""

_SKIN = 1e-3
"""How deep within a surface a sensor on it may be [m]."""


def check_mounts(setting: Setting, sensors: Iterable[Sensor] | None = None) -> None:
    """Refuse sensors that look from within the rover's own shapes or from below the ground.

    Args:
        setting: The recording.
        sensors: Which; by default those of the rover that make pictures or sweeps.

    Raises:
        RecipeError: naming the sensor, and what to change.
    """
    if sensors is None:
        kinds = instrument_kinds()
        sensors = [
            sensor
            for sensor in setting.world.rover.sensors
            if issubclass(kinds.get(sensor.kind, Instrument), Frames)
        ]
    for sensor in simple_sensors(sensors):
        _require_outside(sensor, setting.world.rover, setting.motion)
        _require_above(sensor, setting)


def require_carried(sensor: Sensor, rover: Rover) -> None:
    """Refuse a sensor on a wheel: no motion of a recording says how one moves that turns with it.

    Raises:
        RecipeError: says what to change.
    """
    link = sensor.seated.link
    if any(wheel.link == link for wheel in rover.wheels):
        raise RecipeError(
            f"{sensor.name!r} sits on the wheel {link!r}, with which nothing is recorded: give it "
            "another link",
            key=("sensors",),
        )


def require_free(sensor: Sensor, rover: Rover) -> None:
    """Refuse a sensor that looks from within the rover at rest, or from below the level it is on.

    Raises:
        RecipeError: says what to change.
    """
    still = Curve(begin=0.0, step=1.0, samples=np.zeros((2, 6)))
    if not issubclass(instrument_kinds().get(sensor.kind, Instrument), Frames):
        return
    for part in sensor.simple:
        _require_outside(part, rover, Motion(path="", source="path", base=still))
        height = float(rover.origins[part.link][2] + part.position[2])
        if height <= 0.0:
            below = f"{-height:.2g} m below the level of" if height < 0.0 else "at the level of"
            raise RecipeError(
                f"{part.name!r} is {below} the ground that the rover stands on: raise it "
                "by its position_m",
                key=("sensors",),
            )


def _require_outside(sensor: Sensor, rover: Rover, motion: Motion) -> None:
    links = RoverLinks(rover, motion)
    near = getattr(sensor, "near_m", 0.0)
    moments = np.linspace(0.0, motion.end, _MOMENTS) if motion.links else np.zeros(1)
    for time in moments.tolist():
        places = links.at(time)
        origin, turn = places[sensor.link]
        place = origin + (turn * sensor.position).sum(axis=-1)
        for link in rover.links:
            start, rotation = places[link.name]
            within = ((place - start)[:, None] * rotation).sum(axis=0)
            for shape in link.shapes:
                triangles = shape_triangles(shape) if shape.visible else np.empty((0, 3, 3))
                if not _holds(triangles, within):
                    continue
                if (reach := portable.norm((triangles - within).reshape(-1, 3)).max()) > near:
                    raise RecipeError(
                        f"{sensor.name!r} sits inside a {shape.kind} of the rover's link "
                        f"{link.name!r} and would see nothing else: move it out by its position_m, "
                        "or, where that is its housing, "
                        f"give it near_m: {math.ceil(100.0 * reach) / 100.0:g}",
                        key=("sensors",),
                    )


def _require_above(sensor: Sensor, setting: Setting) -> None:
    motion, world = setting.motion, setting.world
    count = min(int(motion.end / _STEP) + 2, _MOST)
    times = np.linspace(0.0, motion.end, count)
    places = Instrument(sensor, setting).state(times).position  # type: ignore[abstract]
    ground = setting.scenery.height_at(places[:, 0], places[:, 1])
    depth = ground - places[:, 2]
    if (worst := int(np.argmax(depth))) >= 0 and depth[worst] > 0.0:
        raise RecipeError(
            f"{sensor.name!r} is {depth[worst]:.2g} m below the ground after {times[worst]:.1f} s "
            f"of {motion.path!r}, at ({places[worst, 0]:.2f}, {places[worst, 1]:.2f}) m of "
            f"{world.site.name!r}: raise it by its position_m",
            key=("sensors",),
        )


def _holds(triangles: Array, point: Array) -> bool:
    """Whether a surface goes round a point, also if that is moved a little."""
    nudges = _SKIN * np.vstack([np.eye(3), -np.eye(3)])
    return all(abs(_winding(triangles, point + nudge)) > _INSIDE for nudge in nudges)


def _winding(triangles: Array, point: Array) -> float:
    """How often a surface goes round a point: 1 within a closed one, 0 without.

    The solid angles of its triangles, van Oosterom & Strackee 1983
    (doi:10.1109/TBME.1983.325207), are added up.
    """
    a, b, c = np.moveaxis(triangles - point, 1, 0)
    la, lb, lc = (np.sqrt((v * v).sum(axis=1)) for v in (a, b, c))
    volume = (a * np.cross(b, c)).sum(axis=1)
    ab, bc, ca = ((u * v).sum(axis=1) for u, v in ((a, b), (b, c), (c, a)))
    angle = np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb)
    return float(angle.sum() / (2.0 * np.pi))
