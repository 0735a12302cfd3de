"""scene.usda: the world with a rover that replays each trajectory, and its cameras."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom

from terrain_forge.base import Array
from terrain_forge.model import Link, Rover, Trajectory, World
from terrain_forge.paths import sample_times, straight_places
from terrain_forge.writers import identifier

from .layer import ROOT, gf_quaternion, label, new_layer, save, set_conventions
from .rig import define_rig
from .solids import define_shape


def write_scene(path: Path, world: World, *, base: str) -> None:
    """Write a stage that adds the trajectories to the world's layer `base`."""
    layer = new_layer(path)
    layer.subLayerPaths = [base]
    stage = Usd.Stage.Open(layer, Usd.Stage.LoadNone)
    set_conventions(stage)
    stage.SetDefaultPrim(stage.GetPrimAtPath(f"/{ROOT}"))
    rate = _rate(world.trajectories)
    stage.SetTimeCodesPerSecond(rate)
    stage.SetFramesPerSecond(rate)
    stage.SetStartTimeCode(0)
    last = max((trajectory.time[-1] for trajectory in world.trajectories), default=0.0)
    stage.SetEndTimeCode(float(last) * rate)
    for trajectory in world.trajectories:
        _define_replay(stage, trajectory, world.rover, rate)
    save(stage)


def _rate(trajectories: tuple[Trajectory, ...]) -> float:
    """Time codes per second, such that the samples of the first trajectory fall on whole ones."""
    if not trajectories:
        return 24.0
    return max(1.0, float(np.round(1 / np.median(np.diff(trajectories[0].time)))))


def _define_replay(stage: Usd.Stage, trajectory: Trajectory, rover: Rover, rate: float) -> None:
    """A rover that moves as the trajectory does.

    Where USD's straight lines between samples would leave the path, there are more than its own.
    """
    path = f"/{ROOT}/Paths/{identifier(trajectory.name)}"
    base = UsdGeom.Xform.Define(stage, path)
    translate = base.AddTranslateOp().GetAttr().GetPath()
    orient = base.AddOrientOp().GetAttr().GetPath()
    layer = stage.GetRootLayer()
    times = sample_times(trajectory, straight_places)
    poses = trajectory.at(times)
    codes = (times * rate).tolist()
    with Sdf.ChangeBlock():
        for code, position in zip(codes, poses.position.tolist(), strict=True):
            layer.SetTimeSample(translate, code, Gf.Vec3d(*position))
        for code, quaternion in zip(codes, poses.quaternion, strict=True):
            layer.SetTimeSample(orient, code, gf_quaternion(quaternion))
    label(base.GetPrim(), "rover")
    _define_rover(stage, path, rover)


def _define_rover(stage: Usd.Stage, path: str, rover: Rover) -> None:
    """The rover at rest: the shapes of its links and its sensors, all in base_link's frame."""
    for link in rover.links:
        _define_link(stage, f"{path}/{identifier(link.name)}", link, rover.origins[link.name])
    define_rig(stage, path, rover)


def _define_link(stage: Usd.Stage, path: str, link: Link, origin: Array) -> None:
    frame = UsdGeom.Xform.Define(stage, path)
    frame.AddTranslateOp().Set(Gf.Vec3d(*origin.tolist()))
    for number, shape in enumerate(link.shapes):
        if shape.visible:
            define_shape(stage, f"{path}/shape_{number}", shape)
