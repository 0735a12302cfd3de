"""The rock shapes, once for the whole world: meshes to look at and hulls to collide with."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pxr import Sdf, Usd, UsdGeom, UsdPhysics, Vt

from terrain_forge.base import Array
from terrain_forge.model import Mesh, RockLibrary
from terrain_forge.writers import vertex_normals

from .layer import define_mesh, define_st, make_collider, new_stage, save

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
    define_st(visual, uvs.reshape(-1, 2), UsdGeom.Tokens.faceVarying)


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
    child.referenceList.prependedItems = [Sdf.Reference(LAYER, source)]
    return child
