"""Prims as bare specs of a layer: faster than a stage where there are thousands."""

from __future__ import annotations

from typing import Any

from pxr import Gf, Sdf, Vt

from terrain_forge.base import Array

from .layer import gf_quaternion


def specify_place(
    prim: Sdf.PrimSpec,
    *,
    position: Array | None = None,
    quaternion: Array | None = None,
    scale: float | None = None,
) -> None:
    """Give a prim a position [m], a rotation (w, x, y, z) and a size, as far as they are given."""
    operations: list[tuple[str, Any, Any]] = []
    if position is not None:
        place = Gf.Vec3d(*position.tolist())
        operations.append(("xformOp:translate", Sdf.ValueTypeNames.Double3, place))
    if quaternion is not None:
        turn = gf_quaternion(quaternion)
        operations.append(("xformOp:orient", Sdf.ValueTypeNames.Quatf, turn))
    if scale is not None:
        operations.append(("xformOp:scale", Sdf.ValueTypeNames.Float3, Gf.Vec3f(scale)))
    for name, kind, value in operations:
        specify(prim, name, kind, value)
    order = Vt.TokenArray([name for name, _, _ in operations])
    names = Sdf.ValueTypeNames.TokenArray
    specify(prim, "xformOpOrder", names, order, Sdf.VariabilityUniform)


def specify(
    prim: Sdf.PrimSpec,
    name: str,
    kind: Sdf.ValueTypeName,
    value: Any,
    variability: Sdf.Variability = Sdf.VariabilityVarying,
) -> None:
    """Give a prim an attribute with a value."""
    Sdf.AttributeSpec(prim, name, kind, variability).default = value


def apply_schemas(prim: Sdf.PrimSpec, *names: str) -> None:
    """Apply API schemas to a prim."""
    prim.SetInfo("apiSchemas", Sdf.TokenListOp.Create(prependedItems=list(names)))
