"""Layers with the conventions of all files of this export, and what every concept writes alike."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdPhysics, UsdSemantics, UsdShade, Vt

from terrain_forge.base import Array, ExportError

ROOT = "World"
"""The default prim of the world and the scene."""


def new_stage(path: Path, root: str, *, kind: str = Kind.Tokens.component) -> Usd.Stage:
    """A new stage whose default prim is an Xform named `root`; the caller saves it."""
    # Without payloads: composing the assets again would only take time.
    stage = Usd.Stage.Open(new_layer(path), Usd.Stage.LoadNone)
    set_conventions(stage)
    prim = UsdGeom.Xform.Define(stage, f"/{root}").GetPrim()
    Usd.ModelAPI(prim).SetKind(kind)
    stage.SetDefaultPrim(prim)
    return stage


def new_layer(path: Path) -> Sdf.Layer:
    """An empty layer for a file.

    Raises:
        ExportError: if this process still has an older stage of that file open.
    """
    if Sdf.Layer.Find(str(path)):
        raise ExportError(f"{path}: open as a USD stage in this process, which must let go of it")
    return Sdf.Layer.CreateNew(str(path))


def set_conventions(stage: Usd.Stage) -> None:
    """Say that the stage is in metres and kilograms with z up."""
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, UsdGeom.LinearUnits.meters)
    UsdPhysics.SetStageKilogramsPerUnit(stage, UsdPhysics.MassUnits.kilograms)


def save(stage: Usd.Stage) -> None:
    """Write the stage's own layer to its file."""
    stage.GetRootLayer().Save()


def define_mesh(
    stage: Usd.Stage, path: str, vertices: NDArray[np.floating], faces: NDArray[np.int32]
) -> UsdGeom.Mesh:
    """A mesh of triangles that no renderer subdivides; positions [m] are stored as float32."""
    mesh = UsdGeom.Mesh.Define(stage, path)
    points = Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(vertices, dtype=np.float32))
    mesh.CreatePointsAttr(points)
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(faces.reshape(-1)))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(faces), 3, dtype=np.int32)))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(points))
    return mesh


def define_st(
    mesh: UsdGeom.Mesh, coordinates: Array, interpolation: str, *, name: str = "st"
) -> None:
    """Give a mesh texture coordinates, shape [n, 2], per vertex or per corner of a face."""
    kind = Sdf.ValueTypeNames.TexCoord2fArray
    primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(name, kind, interpolation)
    values = np.ascontiguousarray(coordinates, dtype=np.float32)
    primvar.Set(Vt.Vec2fArray.FromNumpy(values))


def make_collider(solid: UsdGeom.Gprim, approximation: str | None = None) -> None:
    """Let physics collide with a solid; of a mesh `none` takes the triangles, `convexHull` a hull.

    OpenUSD's reader of physics looks for the friction, even one that is bound further up, only of
    prims that materials may be bound to.
    """
    UsdPhysics.CollisionAPI.Apply(solid.GetPrim())
    UsdShade.MaterialBindingAPI.Apply(solid.GetPrim())
    if approximation:
        UsdPhysics.MeshCollisionAPI.Apply(solid.GetPrim()).CreateApproximationAttr(approximation)


def label(prim: Usd.Prim, name: str) -> None:
    """Say what a prim is, for segmentation."""
    UsdSemantics.LabelsAPI.Apply(prim, "class").CreateLabelsAttr([name])


def gf_quaternion(quaternion: Array) -> Gf.Quatf:
    """The USD quaternion of (w, x, y, z), for attributes that take no other."""
    return Gf.Quatf(gf_turn(quaternion))


def gf_turn(quaternion: Array) -> Gf.Quatd:
    """The USD quaternion of (w, x, y, z) for the places of things.

    OpenUSD turns by the arc cosine of w: of one in single precision less than half a milliradian is
    no turn at all.
    """
    w, x, y, z = (float(value) for value in quaternion)
    return Gf.Quatd(w, x, y, z)


def turn_by(thing: UsdGeom.Xformable, quaternion: Array | None = None) -> UsdGeom.XformOp:
    """Have a thing turned by (w, x, y, z), or as its time samples say."""
    turn = thing.AddOrientOp(UsdGeom.XformOp.PrecisionDouble)
    if quaternion is not None:
        turn.Set(gf_turn(quaternion))
    return turn


def specify_place(
    prim: Sdf.PrimSpec,
    *,
    position: Array | None = None,
    quaternion: Array | None = None,
    scale: float | None = None,
) -> None:
    """Give a prim a position [m], a rotation (w, x, y, z) and a size, as far as they are given."""
    kinds = Sdf.ValueTypeNames
    values: dict[str, tuple[Sdf.ValueTypeName, Any]] = {}
    if position is not None:
        values["xformOp:translate"] = kinds.Double3, Gf.Vec3d(*position.tolist())
    if quaternion is not None:
        values["xformOp:orient"] = kinds.Quatd, gf_turn(quaternion)
    if scale is not None:
        values["xformOp:scale"] = kinds.Float3, Gf.Vec3f(scale)
    for name, (kind, value) in values.items():
        specify(prim, name, kind, value)
    order = Vt.TokenArray(list(values))
    specify(prim, "xformOpOrder", kinds.TokenArray, order, Sdf.VariabilityUniform)


def specify(
    prim: Sdf.PrimSpec,
    name: str,
    kind: Sdf.ValueTypeName,
    value: Any,
    variability: Sdf.Variability = Sdf.VariabilityVarying,
) -> None:
    """Give a prim an attribute with a value."""
    Sdf.AttributeSpec(prim, name, kind, variability).default = value
