"""The rover: the shapes of its links, its sensors, and scene.usda, in which it replays paths."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdRender, Vt

from terrain_forge.base import linear_from_srgb, portable, quaternion_from_rpy
from terrain_forge.geometry import rover_looks
from terrain_forge.model import (
    Rover,
    Shape,
    Trajectory,
    View,
    World,
    figures_lost,
    simple_sensors,
    titles,
)
from terrain_forge.paths import sample_times, straight_places
from terrain_forge.writers import identifier

from .layer import ROOT, define_mesh, gf_turn, label, new_layer, save, set_conventions, turn_by
from .material import bind, define_paint

# A USD camera looks along -z with y up; ours looks along x with z up. (w, x, y, z)
_CAMERA_AXES = np.array([0.5, 0.5, -0.5, -0.5])
_SIDES = ("left", "right")
_LENSES = {"radtan": "opencvPinhole", "equidistant": "opencvFisheye"}
_COEFFICIENTS = {
    "radtan": ("k1", "k2", "p1", "p2", "k3"),
    "equidistant": ("k1", "k2", "k3", "k4"),
}
_USUAL_RATE = 24.0
"""Time codes a second where samples allow it: Blender plays so many whatever the file says."""
_CLIPPING = (0.05, 10000.0)
"""What cameras see [m]."""


def write_scene(path: Path, world: World, *, base: str) -> None:
    """Write a stage that adds the trajectories to the world's layer `base`."""
    layer = new_layer(path)
    layer.subLayerPaths = [base]
    stage = Usd.Stage.Open(layer, Usd.Stage.LoadNone)
    set_conventions(stage)
    stage.SetDefaultPrim(stage.GetPrimAtPath(f"/{ROOT}"))
    rate, last = _USUAL_RATE, 0.0
    if world.trajectories:
        rate = _time_codes(world.trajectories[0])
        last = max(float(trajectory.time[-1]) for trajectory in world.trajectories)
    stage.SetTimeCodesPerSecond(rate)
    stage.SetFramesPerSecond(rate)
    stage.SetStartTimeCode(0)
    stage.SetEndTimeCode(last * rate)
    for trajectory in world.trajectories:
        _define_replay(stage, trajectory, world.rover, rate)
    save(stage)


def _time_codes(trajectory: Trajectory) -> float:
    """Time codes a second, such that a trajectory's samples fall on whole ones."""
    rate = max(1.0, float(np.round(1 / np.median(np.diff(trajectory.time)))))
    return rate if _USUAL_RATE % rate else _USUAL_RATE


def _define_replay(stage: Usd.Stage, trajectory: Trajectory, rover: Rover, rate: float) -> None:
    """A rover that moves as the trajectory does: the shapes of its links at rest, and its sensors.

    All shapes are meshes: some programs give no others a material.
    Where USD's straight lines between samples would leave the path, there are more than its own.
    """
    path = f"/{ROOT}/Paths/{identifier(trajectory.name)}"
    base = UsdGeom.Xform.Define(stage, path)
    translate = base.AddTranslateOp().GetAttr().GetPath()
    orient = turn_by(base).GetAttr().GetPath()
    layer = stage.GetRootLayer()
    times = sample_times(trajectory, straight_places)
    poses = trajectory.at(times)
    codes = (times * rate).tolist()
    with Sdf.ChangeBlock():
        for code, position in zip(codes, poses.position.tolist(), strict=True):
            layer.SetTimeSample(translate, code, Gf.Vec3d(*position))
        for code, quaternion in zip(codes, poses.quaternion, strict=True):
            layer.SetTimeSample(orient, code, gf_turn(quaternion))
    label(base.GetPrim(), "rover")
    for link in rover.links:
        frame = UsdGeom.Xform.Define(stage, f"{path}/{identifier(link.name)}")
        frame.AddTranslateOp().Set(Gf.Vec3d(*rover.origins[link.name].tolist()))
    for number, look in enumerate(rover_looks(rover)):
        place = f"{path}/{identifier(look.link)}/look_{number}"
        _paint(define_mesh(stage, place, look.mesh.vertices, look.mesh.faces), look.rgb, path)
    define_rig(stage, path, rover)


def _paint(solid: UsdGeom.Gprim, rgb: Sequence[float], root: str) -> None:
    """Give a prim its colour: as display colour, and as a material below the rover's root."""
    solid.CreateDisplayColorAttr([Gf.Vec3f(*linear_from_srgb(np.array(rgb)).tolist())])
    prim = solid.GetPrim()
    bind(prim, define_paint(prim.GetStage(), f"{root}/Looks", rgb))


def define_shape(stage: Usd.Stage, path: str, shape: Shape, *, root: str) -> UsdGeom.Gprim:
    """The prim of a shape in its link's frame, with its colour; `root` is the rover's."""
    if shape.mesh is not None:
        solid: UsdGeom.Gprim = define_mesh(stage, path, shape.mesh.vertices, shape.mesh.faces)
    elif shape.kind == "box":
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
    turn_by(solid, quaternion_from_rpy(shape.rpy))
    if shape.kind == "box":
        solid.AddScaleOp().Set(Gf.Vec3f(*shape.size))
    if shape.mesh is None:
        extent = UsdGeom.Boundable.ComputeExtentFromPlugins(solid, Usd.TimeCode(0))
        solid.CreateExtentAttr(extent)
    _paint(solid, shape.rgb, root)
    return solid


def define_rig(stage: Usd.Stage, base: str, rover: Rover) -> None:
    """A frame per sensor below the prim that is base_link, with its figures as custom data.

    Cameras have a render product each, which holds the size of their images.
    """
    pairs = [sensor.simple for sensor in rover.sensors if len(sensor.simple) == 2]
    sides = {one.name: side for pair in pairs for one, side in zip(pair, _SIDES, strict=True)}
    for sensor in simple_sensors(rover.sensors):
        path = f"{base}/{identifier(sensor.name)}"
        frame = UsdGeom.Xform.Define(stage, path)
        place = rover.origins[sensor.link] + sensor.position
        frame.AddTranslateOp().Set(Gf.Vec3d(*place.tolist()))
        turn_by(frame, quaternion_from_rpy(sensor.rpy))
        frame.GetPrim().SetCustomData({"kind": sensor.kind, "figures": _held(sensor.figures)})
        if sensor.view:
            _define_camera(stage, f"{path}/camera", sensor.view, sides.get(sensor.name, "mono"))


def _held(told: Any) -> Any:
    """Plain data as custom data holds it: lists are arrays of one kind, or mappings from 0 on."""
    if isinstance(told, dict):
        return {name: _held(value) for name, value in told.items()}
    if not isinstance(told, list):
        return told
    if all(isinstance(value, int | float) for value in told):
        return Vt.DoubleArray(told)
    if all(isinstance(value, str) for value in told):
        return Vt.StringArray(told)
    return {str(number): _held(value) for number, value in enumerate(told)}


def _define_camera(stage: Usd.Stage, path: str, view: View, side: str) -> None:
    camera = UsdGeom.Camera.Define(stage, path)
    turn_by(camera, _CAMERA_AXES)
    camera.CreateClippingRangeAttr(Gf.Vec2f(*_CLIPPING))
    camera.CreateStereoRoleAttr(side)
    width = float(camera.GetHorizontalApertureAttr().Get())
    camera.CreateHorizontalApertureAttr(width)
    # One focal length for both ways: pixels that are not square make the picture lower or higher.
    height = width * view.height_px / view.width_px / view.aspect
    camera.CreateVerticalApertureAttr(height)
    camera.CreateFocalLengthAttr(float(width / (2 * portable.tan(view.horizontal_fov / 2))))
    if not view.centred:  # the window's middle, right of the axis and above it
        right, down = view.offset_px
        camera.CreateHorizontalApertureOffsetAttr(-width * right / view.width_px)
        camera.CreateVerticalApertureOffsetAttr(height * down / view.height_px)
    if view.lens:
        _bend(camera.GetPrim(), view)
    name = identifier("_".join(path.split("/")[-3:-1]))
    product = UsdRender.Product.Define(stage, f"/Render/{name}")
    product.CreateCameraRel().SetTargets([path])
    product.CreateResolutionAttr(Gf.Vec2i(view.width_px, view.height_px))


def _bend(prim: Usd.Prim, view: View) -> None:
    """OpenCV's distortion by the schemas that Omniverse and Isaac Sim have for it, RTX alone reads.

    They stand for the picture's focal lengths and middle too.
    """
    model = _LENSES[view.lens]
    schemas = Sdf.TokenListOp()
    schemas.prependedItems = [f"OmniLensDistortion{model[0].upper()}{model[1:]}API"]
    prim.SetMetadata("apiSchemas", schemas)
    names = ("fx", "fy", "cx", "cy", *_COEFFICIENTS[view.lens])
    told = zip(names, (*view.focal_px, *view.centre_px, *view.coefficients), strict=False)
    space, kinds = "omni:lensdistortion", Sdf.ValueTypeNames
    prim.CreateAttribute(f"{space}:model", kinds.Token, custom=False).Set(model)
    size = prim.CreateAttribute(f"{space}:{model}:imageSize", kinds.Int2, custom=False)
    size.Set(Gf.Vec2i(view.width_px, view.height_px))
    for name, value in told:
        prim.CreateAttribute(f"{space}:{model}:{name}", kinds.Float, custom=False).Set(value)


def rig_losses(rover: Rover) -> list[str]:
    """What USD does not say of a rig."""
    sensors = simple_sensors(rover.sensors)
    lost = [
        f"{sentence[:-1]} (custom data has it)."
        for sentence in figures_lost((s for s in sensors if s.view), "usd")
    ]
    names = titles(s for s in sensors if not s.view)
    if not names:
        return lost
    told = " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))
    frames = "are bare frames" if len(names) > 1 else "is a bare frame"
    return [f"{told[0].upper()}{told[1:]} {frames}: no USD schema holds their figures.", *lost]
