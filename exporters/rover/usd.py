"""The rover as OpenUSD with physics: an articulation of rigid bodies, joints and drives."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics
from terrain_forge.exporters.mjcf.rover import servo_gain
from terrain_forge.exporters.usd.layer import gf_quaternion, make_collider, new_stage, save
from terrain_forge.exporters.usd.material import bind_friction, define_friction
from terrain_forge.exporters.usd.rover import define_rig, define_shape

from terrain_forge.base import Array, portable
from terrain_forge.geometry import principal_axes
from terrain_forge.model import Link, Rover
from terrain_forge.writers import identifier

_DEGREE = math.pi / 180
_X = np.array([1.0, 0.0, 0.0])


def write_usd(path: Path, rover: Rover, *, name: str, friction: float) -> None:
    """Write a stage whose default prim /NAME is the rover, its bodies side by side below it.

    `friction` is that of its colliders (Coulomb).
    """
    stage = new_stage(path, name)
    root = stage.GetDefaultPrim()
    UsdPhysics.ArticulationRootAPI.Apply(root)
    bind_friction(root, define_friction(stage, f"/{name}/Looks/friction", friction))
    for link in rover.links:
        _define_body(stage, name, link, rover.origins[link.name])
    UsdGeom.Scope.Define(stage, f"/{name}/Joints")
    for link in rover.links:
        if link.parent:
            _define_joint(stage, name, link, rover)
    define_rig(stage, _path(name, rover.links[0].name), rover)
    save(stage)


def _path(name: str, link: str) -> str:
    return f"/{name}/{identifier(link)}"


def _define_body(stage: Usd.Stage, name: str, link: Link, place: Array) -> None:
    path = _path(name, link.name)
    frame = UsdGeom.Xform.Define(stage, path)
    frame.AddTranslateOp().Set(Gf.Vec3d(*place.tolist()))
    UsdPhysics.RigidBodyAPI.Apply(frame.GetPrim())
    mass = UsdPhysics.MassAPI.Apply(frame.GetPrim())
    moments, axes = principal_axes(link.inertia[None])
    mass.CreateMassAttr(link.mass)
    mass.CreateCenterOfMassAttr(Gf.Vec3f(*link.centre_of_mass.tolist()))
    mass.CreateDiagonalInertiaAttr(Gf.Vec3f(*moments[0].tolist()))
    mass.CreatePrincipalAxesAttr(gf_quaternion(axes[0]))
    for number, shape in enumerate(link.shapes):
        solid = define_shape(stage, f"{path}/shape_{number}", shape, root=f"/{name}")
        if shape.collides:
            make_collider(solid, None if shape.mesh is None else UsdPhysics.Tokens.convexHull)
        if not shape.visible:
            solid.CreatePurposeAttr(UsdGeom.Tokens.guide)


def _define_joint(stage: Usd.Stage, name: str, link: Link, rover: Rover) -> None:
    path = f"/{name}/Joints/{identifier(link.name)}"
    joint: UsdPhysics.Joint
    if link.joint == "fixed":
        joint = UsdPhysics.FixedJoint.Define(stage, path)
    else:
        joint = UsdPhysics.RevoluteJoint.Define(stage, path)
        joint.CreateAxisAttr(UsdPhysics.Tokens.x)
        if link.limits:
            joint.CreateLowerLimitAttr(link.limits[0] / _DEGREE)
            joint.CreateUpperLimitAttr(link.limits[1] / _DEGREE)
        # A velocity servo on a motor; on a passive joint a drive to rest is its damping. USD counts
        # angles in degrees, and so damping per degree.
        motor = link.joint == "motor"
        drive = UsdPhysics.DriveAPI.Apply(joint.GetPrim(), UsdPhysics.Tokens.angular)
        drive.CreateTypeAttr(UsdPhysics.Tokens.force)
        drive.CreateStiffnessAttr(0.0)
        drive.CreateDampingAttr((servo_gain(rover) if motor else link.damping) * _DEGREE)
        drive.CreateTargetVelocityAttr(0.0)
        if motor:
            drive.CreateMaxForceAttr(rover.torque_limit)
    joint.CreateBody0Rel().SetTargets([Sdf.Path(_path(name, link.parent))])
    joint.CreateBody1Rel().SetTargets([Sdf.Path(_path(name, link.name))])
    turn = gf_quaternion(_turn_x_to(link.axis))
    joint.CreateLocalPos0Attr(Gf.Vec3f(*link.origin.tolist()))
    joint.CreateLocalPos1Attr(Gf.Vec3f(0.0))
    joint.CreateLocalRot0Attr(turn)
    joint.CreateLocalRot1Attr(turn)


def _turn_x_to(axis: Array) -> Array:
    """The shortest turn (w, x, y, z) that takes the x axis to a unit vector."""
    half = np.append(1.0 + portable.product(_X, axis), np.cross(_X, axis))
    length = float(portable.norm(half))
    if length < 1e-9:  # the opposite direction: half a turn about z
        return np.array([0.0, 0.0, 0.0, 1.0])
    return np.asarray(half / length)
