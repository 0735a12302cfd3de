"""Layers with the conventions of all files of this export, and what every concept writes alike."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Kind, Sdf, Usd, UsdGeom, UsdPhysics, UsdSemantics, Vt

from terrain_forge.base import Array, ExportError


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
    """A mesh of triangles that no renderer subdivides.

    Args:
        stage: Where to.
        path: Path of the prim.
        vertices: Positions [m], shape [vertices, 3]; stored as float32.
        faces: Corner indices, counter-clockwise from outside, shape [faces, 3].
    """
    mesh = UsdGeom.Mesh.Define(stage, path)
    points = Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(vertices, dtype=np.float32))
    mesh.CreatePointsAttr(points)
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(faces.reshape(-1)))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(faces), 3, dtype=np.int32)))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(points))
    return mesh


def make_collider(mesh: UsdGeom.Mesh, approximation: str) -> None:
    """Let physics collide with a mesh: `none` takes the triangles, `convexHull` their hull."""
    UsdPhysics.CollisionAPI.Apply(mesh.GetPrim())
    UsdPhysics.MeshCollisionAPI.Apply(mesh.GetPrim()).CreateApproximationAttr(approximation)


def label(prim: Usd.Prim, name: str) -> None:
    """Say what a prim is, for segmentation."""
    UsdSemantics.LabelsAPI.Apply(prim, "class").CreateLabelsAttr([name])


def gf_quaternion(quaternion: Array) -> Gf.Quatf:
    """The USD quaternion of (w, x, y, z)."""
    w, x, y, z = (float(value) for value in quaternion)
    return Gf.Quatf(w, x, y, z)


def asset(name: str) -> str:
    """The path of one of the export's assets, as the files beside `assets/` write it."""
    return f"./assets/{name}"


def add_reference(spec: Sdf.PrimSpec, layer: str, prim: str) -> None:
    """Make a prim spec reference a prim of another layer."""
    spec.referenceList.prependedItems = [Sdf.Reference(layer, prim)]
