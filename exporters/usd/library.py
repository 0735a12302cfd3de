"""The rock shapes, once for the whole world: meshes to look at and hulls to collide with."""

from __future__ import annotations

from pathlib import Path

from pxr import UsdGeom, UsdPhysics, Vt

from terrain_forge.world import RockLibrary
from terrain_forge.writers.mesh import vertex_normals

from .layer import define_mesh, make_collider, new_stage, save

FILE = "rock_library.usdc"
_ROOT = "rock_library"


def write_library(library: RockLibrary, assets: Path) -> None:
    """Write all levels of detail and convex parts of every shape, in the prototypes' frames."""
    stage = new_stage(assets / FILE, _ROOT)
    for number, shape in enumerate(library.prototypes):
        for level, mesh in enumerate(shape.meshes):
            path = visual_path(number, level)
            UsdGeom.Xform.Define(stage, path)
            visual = define_mesh(stage, f"{path}/shape", mesh.vertices, mesh.faces)
            normals = vertex_normals(mesh.vertices, mesh.faces).astype("float32")
            visual.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(normals))
            visual.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
        UsdGeom.Xform.Define(stage, hull_path(number))
        for part, hull in enumerate(shape.hulls):
            path = f"{hull_path(number)}/part_{part}"
            collider = define_mesh(stage, path, hull.vertices, hull.faces)
            make_collider(collider, UsdPhysics.Tokens.convexHull)
    save(stage)


def visual_path(prototype: int, level: int) -> str:
    """The prim of a shape's level of detail (0: finest)."""
    return f"/{_ROOT}/shape_{prototype:03}_{level}"


def hull_path(prototype: int) -> str:
    """The prim of a shape's convex parts."""
    return f"/{_ROOT}/hull_{prototype:03}"
