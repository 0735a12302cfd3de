"""The motion of a simulated drive, as one smooth curve that all sensors measure."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from terrain_forge.base import (
    Array,
    RecipeError,
    hint_at,
    matrix_from_quaternion,
    portable,
    rpy_from_matrix,
    rpy_from_quaternion,
)
from terrain_forge.driving import DriveLog, Logger, drive
from terrain_forge.model import Rover, World, exporter
from terrain_forge.recipe import DriveSpec
from terrain_forge.sensors import Curve, Motion

_log = logging.getLogger(__name__)

_WIDTH = 0.004
"""Standard deviation of the Gaussian that the low-pass is made of [s]."""
STEP = 0.004
"""Time between a curve's samples, as near as whole looks come [s]."""
_REACH = 4.0
"""Standard deviations after which the Gaussian is cut off."""


def motion_of_drive(
    world: World,
    path: str,
    *,
    still: float = 0.0,
    progress: Callable[[float], None] | None = None,
) -> Motion:
    """How the rover moves when it drives along a path in MuJoCo; it takes a tenth of that time.

    A drive that does not arrive is the motion until its end, which `Motion.ended` tells. Rocks that
    it pushes stay where they are for rays.

    Args:
        world: The world.
        path: Name of the path.
        still: How long it stands, settled, before it starts [s].
        progress: Told the share of the path that is done, 0 to 1, now and then.

    Raises:
        RecipeError: if the world has no such path.
        SimulationError: if the drive cannot begin.
    """
    names = [one.name for one in world.trajectories]
    if path not in names:
        raise RecipeError(
            f"no path is called {path!r}{hint_at(path, names)}, the world has: "
            f"{', '.join(names) or 'none'}",
            key=("dataset", "path"),
        )
    logger = Logger()
    with TemporaryDirectory() as folder:
        mjcf = exporter("mjcf")
        mjcf.export(world, Path(folder), options=mjcf.Options())
        result = drive(
            scene=Path(folder) / "scene.xml",
            trajectory=world.trajectories[names.index(path)],
            rover=world.rover,
            spec=_limits(world, path),
            progress=progress,
            logger=logger,
        )
    ended = "" if result.completed else result.reason
    if ended:
        _log.warning("the drive of %r ends early, and its recording too: %s", path, ended)
    return motion_of_log(logger.log(), world.rover, path=path, still=still, ended=ended)


def motion_of_log(
    log: DriveLog, rover: Rover, *, path: str, still: float = 0.0, ended: str = ""
) -> Motion:
    """The motion that a log holds, without what is faster than about 50 Hz.

    The low-pass is 2 G - G² of a Gaussian G: flat up to 20 Hz, and a jolt swings over by 3 %, once.
    """
    every = max(round(STEP / log.step), 1)
    # What the low-pass and the curve foretell of the start does not reach into the standing.
    looks = round((still + 2.0 * _REACH * _WIDTH) / log.step) + 3 * every if still > 0.0 else 0
    turning = np.unwrap(rpy_from_quaternion(log.quaternion), axis=0)
    poses = {rover.links[0].name: (log.position, turning), **_moving_links(rover, log)}

    def calm(values: Array) -> Array:
        return _low_passed(values, log.step, looks)[::every]

    curves = {
        name: Curve(begin=0.0, step=every * log.step, samples=calm(np.column_stack(pose)))
        for name, pose in poses.items()
    }
    base = curves.pop(rover.links[0].name)
    return Motion(
        path=path,
        source="drive",
        base=base,
        links=tuple(curves.items()),
        wheels=calm(log.wheel_angle),
        ended=ended,
    )


def _limits(world: World, path: str) -> DriveSpec:
    """Those of the recipe's own drive along the path, so that it ends as that does."""
    asked = world.site.recipe.validate
    spec = asked.drive_spec if asked else None
    return spec if spec and spec.path == path else DriveSpec(path=path, film=False)


def _low_passed(values: Array, step: float, before: int) -> Array:
    """Values without their fast part, shape [looks, columns]; the first holds for some looks."""
    half = int(np.ceil(_REACH * _WIDTH / step))
    gauss = portable.exp(-0.5 * (np.arange(-half, half + 1) * step / _WIDTH) ** 2)
    gauss /= gauss.sum()
    taps = 2.0 * np.pad(gauss, half) - np.convolve(gauss, gauss)
    ahead = np.arange(1, 2 * half + 1)[:, None]
    after = values[-1:] + ahead * (values[-1:] - values[-2:-1])  # it ends in motion
    padded = np.concatenate([np.repeat(values[:1], before + 2 * half, axis=0), values, after])
    result = np.zeros((before + len(values), values.shape[1]))
    for number, tap in enumerate(taps.tolist()):
        result += tap * padded[number : number + len(result)]
    return result


def _moving_links(rover: Rover, log: DriveLog) -> dict[str, tuple[Array, Array]]:
    """Place [m] and continuous roll, pitch, yaw [rad] in base_link's frame of links that move.

    Wheels are left out: they turn by `Motion.wheels`.
    """
    angles = dict(zip(log.joints, log.joint_angle.T, strict=True))
    wheels = {wheel.link for wheel in rover.wheels}
    frames: dict[str, tuple[Array, Array]] = {}
    for link in rover.links[1:]:
        if link.name in wheels or not (link.name in angles or link.parent in frames):
            continue
        at_rest = rover.origins[link.parent][None], np.eye(3)[None]
        origin, turn = frames.get(link.parent, at_rest)
        place = origin + (turn * link.origin).sum(axis=-1)
        if (angle := angles.get(link.name)) is not None:
            half = 0.5 * angle
            spin = np.column_stack([np.cos(half), np.sin(half)[:, None] * link.axis])
            turn = np.einsum("nij,njk->nik", turn, matrix_from_quaternion(spin))
        frames[link.name] = place, turn
    count = len(log.position)
    return {
        name: (
            np.broadcast_to(place, (count, 3)),
            _going_on(rpy_from_matrix(np.broadcast_to(turn, (count, 3, 3)))),
        )
        for name, (place, turn) in frames.items()
    }


def _going_on(rpy: Array) -> Array:
    """The same turns without jumps, shape [looks, 3]; pitch goes on beyond 90° as a wheel does.

    Each turn has two triples of angles; of both the one next to the look before is taken.
    """
    other = np.pi + rpy * np.array([1.0, -1.0, 1.0])

    def apart(now: Array) -> Array:
        steps = (now[1:] - rpy[:-1] + np.pi) % (2.0 * np.pi) - np.pi
        return np.asarray((steps * steps).sum(axis=1))

    over = np.cumsum(apart(other) < apart(rpy)) % 2 == 1
    return np.unwrap(np.where(np.append(False, over)[:, None], other, rpy), axis=0)
