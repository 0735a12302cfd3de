"""The rover's sensors: cameras that render, frames with the figures of the others."""

from __future__ import annotations

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdRender

from terrain_forge.base import Array, quaternion_from_rpy
from terrain_forge.model import Rover, Sensor
from terrain_forge.writers import identifier

from .layer import gf_quaternion

# A USD camera looks along -z with y up; ours looks along x with z up. (w, x, y, z)
_CAMERA_AXES = np.array([0.5, 0.5, -0.5, -0.5])
_CLIPPING = (0.05, 10000.0)
"""What cameras see [m]."""


def define_rig(stage: Usd.Stage, base: str, rover: Rover, origins: dict[str, Array]) -> None:
    """A frame per sensor below `base`, with its kind and figures as custom data.

    Cameras have a render product each, which holds the size of their images.

    Args:
        stage: Where to.
        base: Path of the prim that is base_link.
        rover: The rover.
        origins: Each link's origin in base_link's frame at rest [m].
    """
    sides = _stereo_sides(rover)
    for sensor in rover.sensors:
        path = f"{base}/{identifier(sensor.name)}"
        frame = UsdGeom.Xform.Define(stage, path)
        place = origins[sensor.link] + sensor.position
        frame.AddTranslateOp().Set(Gf.Vec3d(*place.tolist()))
        frame.AddOrientOp().Set(gf_quaternion(quaternion_from_rpy(sensor.rpy)))
        frame.GetPrim().SetCustomData({"kind": sensor.kind, "figures": dict(sensor.properties)})
        if sensor.kind == "camera":
            _define_camera(stage, f"{path}/camera", sensor, sides.get(sensor.name, "mono"))


def _stereo_sides(rover: Rover) -> dict[str, str]:
    """Which of the two cameras with a baseline is the left one and which the right one."""
    pair = [s for s in rover.sensors if s.kind == "camera" and "baseline" in dict(s.properties)]
    if len(pair) != 2:
        return {}
    right, left = sorted(pair, key=lambda sensor: float(sensor.position[1]))
    return {left.name: "left", right.name: "right"}


def _define_camera(stage: Usd.Stage, path: str, sensor: Sensor, side: str) -> None:
    camera = UsdGeom.Camera.Define(stage, path)
    camera.AddOrientOp().Set(gf_quaternion(_CAMERA_AXES))
    camera.CreateClippingRangeAttr(Gf.Vec2f(*_CLIPPING))
    camera.CreateStereoRoleAttr(side)
    figures = dict(sensor.properties)
    across, down = round(figures["width_px"]), round(figures["height_px"])
    width = float(camera.GetHorizontalApertureAttr().Get())
    camera.CreateHorizontalApertureAttr(width)
    camera.CreateVerticalApertureAttr(width * down / across)
    camera.CreateFocalLengthAttr(float(width / (2 * np.tan(figures["horizontal_fov"] / 2))))
    name = identifier("_".join(Sdf.Path(path).GetParentPath().pathString.split("/")[-2:]))
    product = UsdRender.Product.Define(stage, f"/Render/{name}")
    product.CreateCameraRel().SetTargets([path])
    product.CreateResolutionAttr(Gf.Vec2i(across, down))
