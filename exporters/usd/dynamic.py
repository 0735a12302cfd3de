"""Dynamic rocks: rigid bodies that a rover can push, seen and touched through instances."""

from __future__ import annotations

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade
from terrain_forge.exporters.usd import library as shapes

from terrain_forge.base import Array
from terrain_forge.geometry import inertias, principal_axes
from terrain_forge.model import RockField, RockLibrary
from terrain_forge.rocks import dynamic_contact

from .layer import gf_quaternion, label
from .library import specify_instance
from .material import bind, bind_friction, define_friction
from .specs import apply_schemas, specify, specify_place


def define_dynamic_groups(
    stage: Usd.Stage, root: str, rocks: RockField, looks: dict[int, UsdShade.Material]
) -> None:
    """A group `dynamic_<population>` for each population's dynamic rocks, with its materials."""
    if not len(rocks):
        return
    sliding = dynamic_contact(float(rocks.diameter[0])).sliding  # the same for all sizes
    friction = define_friction(stage, f"{root}/Looks/dynamic", sliding)
    for population in np.unique(rocks.population).tolist():
        group = UsdGeom.Xform.Define(stage, _group(root, population)).GetPrim()
        label(group, "rock")
        bind(group, looks[population])
        bind_friction(group, friction)


def specify_dynamic(layer: Sdf.Layer, root: str, rocks: RockField, library: RockLibrary) -> None:
    """A body `rock_<id>` for each dynamic rock, in the groups of `define_dynamic_groups`.

    The body itself is not scaled, so that its mass properties are in metres and kilograms.
    """
    if not len(rocks):
        return
    moments, axes = principal_axes(inertias(rocks, library))
    with Sdf.ChangeBlock():
        for row in range(len(rocks)):
            parent = layer.GetPrimAtPath(_group(root, int(rocks.population[row])))
            body = Sdf.PrimSpec(parent, f"rock_{rocks.id[row]}", Sdf.SpecifierDef, "Xform")
            specify_place(body, position=rocks.position[row], quaternion=rocks.quaternion[row])
            apply_schemas(body, "PhysicsRigidBodyAPI", "PhysicsMassAPI")
            _specify_mass(body, float(rocks.mass[row]), moments[row], axes[row])
            scale, prototype = float(rocks.scale[row]), int(rocks.prototype[row])
            visual = specify_instance(body, "visual", shapes.visual_path(prototype, 0))
            specify_place(visual, scale=scale)
            hulls = specify_instance(body, "hulls", shapes.hull_path(prototype))
            specify_place(hulls, scale=scale)
            token = Sdf.ValueTypeNames.Token
            specify(hulls, "purpose", token, UsdGeom.Tokens.guide, Sdf.VariabilityUniform)


def _specify_mass(body: Sdf.PrimSpec, mass: float, moments: Array, axes: Array) -> None:
    specify(body, "physics:mass", Sdf.ValueTypeNames.Float, mass)
    specify(body, "physics:centerOfMass", Sdf.ValueTypeNames.Point3f, Gf.Vec3f(0.0))
    diagonal = Gf.Vec3f(*moments.tolist())
    specify(body, "physics:diagonalInertia", Sdf.ValueTypeNames.Float3, diagonal)
    specify(body, "physics:principalAxes", Sdf.ValueTypeNames.Quatf, gf_quaternion(axes))


def _group(root: str, population: int) -> str:
    return f"{root}/dynamic_{population}"
