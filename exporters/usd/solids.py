"""Shapes of a rover's links as USD's own solids and meshes."""

from __future__ import annotations

from pxr import Gf, Usd, UsdGeom

from terrain_forge.base import linear_from_srgb, quaternion_from_rpy
from terrain_forge.model import Shape

from .layer import define_mesh, gf_quaternion


def define_shape(stage: Usd.Stage, path: str, shape: Shape) -> UsdGeom.Gprim:
    """The prim of a shape in its link's frame, with its colour."""
    solid = _define_solid(stage, path, shape)
    solid.AddTranslateOp().Set(Gf.Vec3d(*shape.position.tolist()))
    solid.AddOrientOp().Set(gf_quaternion(quaternion_from_rpy(shape.rpy)))
    if shape.kind == "box":
        solid.AddScaleOp().Set(Gf.Vec3f(*shape.size))
    if shape.mesh is None:
        extent = UsdGeom.Boundable.ComputeExtentFromPlugins(solid, Usd.TimeCode(0))
        solid.CreateExtentAttr(extent)
    solid.CreateDisplayColorAttr([Gf.Vec3f(*linear_from_srgb(shape.rgb).tolist())])
    return solid


def _define_solid(stage: Usd.Stage, path: str, shape: Shape) -> UsdGeom.Gprim:
    if shape.mesh is not None:
        return define_mesh(stage, path, shape.mesh.vertices, shape.mesh.faces)
    if shape.kind == "box":
        cube = UsdGeom.Cube.Define(stage, path)
        cube.CreateSizeAttr(1.0)
        return cube
    if shape.kind == "sphere":
        sphere = UsdGeom.Sphere.Define(stage, path)
        sphere.CreateRadiusAttr(shape.size[0])
        return sphere
    cylinder = UsdGeom.Cylinder.Define(stage, path)
    cylinder.CreateAxisAttr(UsdGeom.Tokens.z)
    cylinder.CreateRadiusAttr(shape.size[0])
    cylinder.CreateHeightAttr(shape.size[1])
    return cylinder
