"""The rover's sensors: cameras that render, frames with the figures of the others."""

from __future__ import annotations

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdRender

from terrain_forge.base import portable, quaternion_from_rpy
from terrain_forge.model import Rover, View, titles
from terrain_forge.writers import identifier

from .layer import gf_quaternion

# A USD camera looks along -z with y up; ours looks along x with z up. (w, x, y, z)
_CAMERA_AXES = np.array([0.5, 0.5, -0.5, -0.5])
_CLIPPING = (0.05, 10000.0)
"""What cameras see [m]."""


def define_rig(stage: Usd.Stage, base: str, rover: Rover) -> None:
    """A frame per sensor below `base`, with its kind and figures as custom data.

    Cameras have a render product each, which holds the size of their images.

    Args:
        stage: Where to.
        base: Path of the prim that is base_link.
        rover: The rover.
    """
    sides, origins = _stereo_sides(rover), rover.origins
    for sensor in rover.sensors:
        path = f"{base}/{identifier(sensor.name)}"
        frame = UsdGeom.Xform.Define(stage, path)
        place = origins[sensor.link] + sensor.position
        frame.AddTranslateOp().Set(Gf.Vec3d(*place.tolist()))
        frame.AddOrientOp().Set(gf_quaternion(quaternion_from_rpy(sensor.rpy)))
        frame.GetPrim().SetCustomData({"kind": sensor.kind, "figures": sensor.figures})
        if sensor.view:
            _define_camera(stage, f"{path}/camera", sensor.view, sides.get(sensor.name, "mono"))


def rig_losses(rover: Rover) -> list[str]:
    """What USD does not say of a rig."""
    names = titles(sensor for sensor in rover.sensors if not sensor.view)
    if not names:
        return []
    told = " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))
    frames = "are bare frames" if len(names) > 1 else "is a bare frame"
    return [f"{told[0].upper()}{told[1:]} {frames}: no USD schema holds their figures."]


def _stereo_sides(rover: Rover) -> dict[str, str]:
    """Which of the two cameras with a baseline is the left one and which the right one."""
    pair = [sensor for sensor in rover.sensors if sensor.view and "baseline" in sensor.figures]
    if len(pair) != 2:
        return {}
    right, left = sorted(pair, key=lambda sensor: float(sensor.position[1]))
    return {left.name: "left", right.name: "right"}


def _define_camera(stage: Usd.Stage, path: str, view: View, side: str) -> None:
    camera = UsdGeom.Camera.Define(stage, path)
    camera.AddOrientOp().Set(gf_quaternion(_CAMERA_AXES))
    camera.CreateClippingRangeAttr(Gf.Vec2f(*_CLIPPING))
    camera.CreateStereoRoleAttr(side)
    width = float(camera.GetHorizontalApertureAttr().Get())
    camera.CreateHorizontalApertureAttr(width)
    camera.CreateVerticalApertureAttr(width * view.height_px / view.width_px)
    camera.CreateFocalLengthAttr(float(width / (2 * portable.tan(view.horizontal_fov / 2))))
    name = identifier("_".join(Sdf.Path(path).GetParentPath().pathString.split("/")[-2:]))
    product = UsdRender.Product.Define(stage, f"/Render/{name}")
    product.CreateCameraRel().SetTargets([path])
    product.CreateResolutionAttr(Gf.Vec2i(view.width_px, view.height_px))
