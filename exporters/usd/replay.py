"""scene.usda: the world with a rover that replays each trajectory, and its cameras."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom

from terrain_forge.colour import linear_from_srgb
from terrain_forge.frames import Array, quaternion_from_rpy
from terrain_forge.motion import Trajectory
from terrain_forge.rovers.description import Link, Rover, Sensor, Shape
from terrain_forge.world import World
from terrain_forge.writers.naming import identifier

from .layer import gf_quaternion, new_layer, save, set_conventions
from .scenery import ROOT

# A USD camera looks along -z with y up; ours looks along x with z up. (w, x, y, z)
_CAMERA_AXES = np.array([0.5, 0.5, -0.5, -0.5])


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
    path = f"/{ROOT}/Paths/{identifier(trajectory.name)}"
    base = UsdGeom.Xform.Define(stage, path)
    translate = base.AddTranslateOp().GetAttr().GetPath()
    orient = base.AddOrientOp().GetAttr().GetPath()
    layer = stage.GetRootLayer()
    codes = (trajectory.time * rate).tolist()
    with Sdf.ChangeBlock():
        for code, position in zip(codes, trajectory.position.tolist(), strict=True):
            layer.SetTimeSample(translate, code, Gf.Vec3d(*position))
        for code, quaternion in zip(codes, trajectory.quaternion, strict=True):
            layer.SetTimeSample(orient, code, gf_quaternion(quaternion))
    _define_rover(stage, path, rover)


def _define_rover(stage: Usd.Stage, path: str, rover: Rover) -> None:
    """The rover at rest: the shapes of its links and its cameras, all in base_link's frame."""
    origins: dict[str, Array] = {}
    for link in rover.links:
        origins[link.name] = origins.get(link.parent, np.zeros(3)) + link.origin
        _define_link(stage, f"{path}/{identifier(link.name)}", link, origins[link.name])
    cameras = [sensor for sensor in rover.sensors if sensor.kind == "camera"]
    for camera in cameras:
        _define_camera(stage, f"{path}/{identifier(camera.name)}", camera, origins[camera.link])


def _define_link(stage: Usd.Stage, path: str, link: Link, origin: Array) -> None:
    frame = UsdGeom.Xform.Define(stage, path)
    frame.AddTranslateOp().Set(Gf.Vec3d(*origin.tolist()))
    for number, shape in enumerate(link.shapes):
        _define_shape(stage, f"{path}/shape_{number}", shape)


def _define_shape(stage: Usd.Stage, path: str, shape: Shape) -> None:
    solid: UsdGeom.Gprim
    if shape.kind == "box":
        solid = UsdGeom.Cube.Define(stage, path)
        solid.CreateSizeAttr(1.0)
    elif shape.kind == "sphere":
        solid = UsdGeom.Sphere.Define(stage, path)
        solid.CreateRadiusAttr(shape.size[0])
    else:
        solid = UsdGeom.Cylinder.Define(stage, path)
        solid.CreateAxisAttr(UsdGeom.Tokens.z)
        solid.CreateRadiusAttr(shape.size[0])
        solid.CreateHeightAttr(shape.size[1])
    solid.AddTranslateOp().Set(Gf.Vec3d(*shape.position.tolist()))
    solid.AddOrientOp().Set(gf_quaternion(quaternion_from_rpy(shape.rpy)))
    if shape.kind == "box":
        solid.AddScaleOp().Set(Gf.Vec3f(*shape.size))
    solid.CreateExtentAttr(UsdGeom.Boundable.ComputeExtentFromPlugins(solid, Usd.TimeCode(0)))
    colour = linear_from_srgb(shape.rgb).tolist()
    solid.CreateDisplayColorAttr([Gf.Vec3f(*colour)])


def _define_camera(stage: Usd.Stage, path: str, sensor: Sensor, origin: Array) -> None:
    frame = UsdGeom.Xform.Define(stage, path)
    frame.AddTranslateOp().Set(Gf.Vec3d(*(origin + sensor.position).tolist()))
    frame.AddOrientOp().Set(gf_quaternion(quaternion_from_rpy(sensor.rpy)))
    camera = UsdGeom.Camera.Define(stage, f"{path}/camera")
    camera.AddOrientOp().Set(gf_quaternion(_CAMERA_AXES))
    camera.CreateClippingRangeAttr(Gf.Vec2f(0.05, 10000.0))
    properties = dict(sensor.properties)
    view = properties.get("horizontal_fov")
    if view is not None:
        width = camera.GetHorizontalApertureAttr().Get()
        camera.CreateFocalLengthAttr(float(width / (2 * np.tan(view / 2))))
