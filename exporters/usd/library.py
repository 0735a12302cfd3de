"""The rock shapes, once for the whole world: meshes to look at and hulls to collide with."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdPhysics, Vt

from terrain_forge.base import Array
from terrain_forge.model import Mesh, RockLibrary
from terrain_forge.writers import vertex_normals

from .layer import add_reference, define_mesh, make_collider, new_stage, save

FILE = "rock_library.usdc"
LAYER = f"./{FILE}"
"""The library as the layers beside it write it."""
_ROOT = "rock_library"


def write_library(library: RockLibrary, assets: Path) -> None:
    """Write all levels of detail and convex parts of every shape, in the prototypes' frames."""
    stage = new_stage(assets / FILE, _ROOT)
    for number, shape in enumerate(library.prototypes):
        for level, mesh in enumerate(shape.meshes):
            path = visual_path(number, level)
            UsdGeom.Xform.Define(stage, path)
            _define_visual(stage, f"{path}/shape", mesh, shape.uvs[level])
        UsdGeom.Xform.Define(stage, hull_path(number))
        for part, hull in enumerate(shape.hulls):
            path = f"{hull_path(number)}/part_{part}"
            collider = define_mesh(stage, path, hull.vertices, hull.faces)
            make_collider(collider, UsdPhysics.Tokens.convexHull)
    save(stage)


def _define_visual(stage: Usd.Stage, path: str, mesh: Mesh, uvs: Array) -> None:
    visual = define_mesh(stage, path, mesh.vertices, mesh.faces)
    normals = vertex_normals(mesh.vertices, mesh.faces).astype(np.float32)
    visual.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(normals))
    visual.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    # Per corner of a face, since the texture has seams.
    coordinates = UsdGeom.PrimvarsAPI(visual).CreatePrimvar(
        "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying
    )
    corners = np.ascontiguousarray(uvs.reshape(-1, 2), dtype=np.float32)
    coordinates.Set(Vt.Vec2fArray.FromNumpy(corners))


def visual_path(prototype: int, level: int) -> str:
    """The prim of a shape's level of detail (0: finest)."""
    return f"/{_ROOT}/shape_{prototype:03}_{level}"


def hull_path(prototype: int) -> str:
    """The prim of a shape's convex parts."""
    return f"/{_ROOT}/hull_{prototype:03}"


def specify_instance(parent: Sdf.PrimSpec, name: str, source: str) -> Sdf.PrimSpec:
    """The spec of a child prim that is an instance of a prim of the library."""
    child = Sdf.PrimSpec(parent, name, Sdf.SpecifierDef, "Xform")
    child.instanceable = True
    add_reference(child, LAYER, source)
    return child
