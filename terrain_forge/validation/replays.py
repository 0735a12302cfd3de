"""The paths as the exports replay them: between samples, through the consumer's own interpolation.

Gazebo's spline is ours (`terrain_forge.paths.interpolation`), which a test holds to Gazebo's own;
USD's is that of usd-core itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from terrain_forge.base import quaternion_from_rpy
from terrain_forge.model import Check, Trajectory, World, at_most, failed
from terrain_forge.paths import (
    ANGLE_LIMIT,
    POSITION_LIMIT,
    Deviation,
    angles_between,
    deviation,
    spline_places,
    times_between,
)
from terrain_forge.writers import file_name, identifier


def replay_checks(world: World, directory: Path) -> list[Check]:
    """How far the replays in each exported scene leave the world's paths between samples.

    Args:
        world: The world.
        directory: Its built folder, whose exports have `scene.sdf` or `scene.usda`.
    """
    if not world.trajectories:
        return []
    checks: list[Check] = []
    for scene in sorted([*directory.glob("*/scene.sdf"), *directory.glob("*/scene.usda")]):
        read = _gazebo_replays if scene.suffix == ".sdf" else _usd_replays
        title = f"{scene.parent.name}: paths between samples"
        try:
            found = list(read(world, scene))
        except (LookupError, ValueError) as error:
            checks.append(failed(title, f"{scene.name} has no replay: {error}"))
            continue
        place, angle = max(d.position for d in found), max(d.angle for d in found)
        note = f"largest distance of {len(found)} replays from their paths"
        checks += [
            at_most(title, place, POSITION_LIMIT, unit="m", note=note),
            at_most(f"{title}, turned", angle, ANGLE_LIMIT, unit="rad"),
        ]
    return checks


def _gazebo_replays(world: World, scene: Path) -> Iterator[Deviation]:
    actors = {actor.get("name"): actor for actor in ElementTree.parse(scene).iter("actor")}
    for trajectory in world.trajectories:
        stops = list(actors[file_name(trajectory.name)].iter("waypoint"))
        times = np.array([stop.findtext("time", "") for stop in stops], dtype=np.float64)
        poses = np.array([stop.findtext("pose", "").split() for stop in stops], dtype=np.float64)
        yield deviation(
            trajectory,
            times=times,
            position=poses[:, :3],
            quaternion=quaternion_from_rpy(poses[:, 3:]),
            places_between=spline_places,
        )


def _usd_replays(world: World, scene: Path) -> Iterator[Deviation]:
    from pxr import Usd

    stage = Usd.Stage.Open(str(scene), Usd.Stage.LoadNone)
    for trajectory in world.trajectories:
        prim = stage.GetPrimAtPath(f"/World/Paths/{identifier(trajectory.name)}")
        if not prim:
            raise LookupError(trajectory.name)
        yield _usd_deviation(trajectory, prim, rate=float(stage.GetTimeCodesPerSecond()))


def _usd_deviation(trajectory: Trajectory, prim: Any, *, rate: float) -> Deviation:
    """Of a prim's `xformOp:translate` and `xformOp:orient`, as usd-core interpolates them."""
    from pxr import Vt

    translate, orient = (prim.GetAttribute(f"xformOp:{name}") for name in ("translate", "orient"))
    codes = np.array(translate.GetTimeSamples())
    asked = times_between(codes / rate)
    codes_between = (asked * rate).tolist()
    # USD's own arrays become NumPy's twenty times as fast as lists of its values do.
    places = np.array(Vt.Vec3dArray([translate.Get(code) for code in codes_between]))
    turns = np.array(Vt.QuatfArray([orient.Get(code) for code in codes_between]), np.float64)
    quaternion = np.roll(turns, 1, axis=1)  # its memory holds x, y, z, w
    wanted = trajectory.at(asked)
    return Deviation(
        position=float(np.linalg.norm(places - wanted.position, axis=1).max()),
        angle=float(angles_between(quaternion, wanted.quaternion).max()),
    )
