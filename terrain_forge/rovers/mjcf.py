"""Reading an MJCF, as MuJoCo compiles it, into an assembly."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, load_model, matrix_from_quaternion, portable
from terrain_forge.rovers.assembly import Assembly, Body, Gear, Joint, Solid, placed, solid
from terrain_forge.rovers.bounds import (
    FARTHEST,
    HEAVIEST,
    MOST_LINKS,
    MOST_SHAPES,
    MOST_TRIANGLES,
    FileError,
    check_name,
    require_below,
)
from terrain_forge.rovers.mesh_files import hull_of, mesh_solid
from terrain_forge.rovers.mjcf_files import check_mjcf
from terrain_forge.rovers.packages import Packages

_SEEN_GROUPS = 3
"""Geoms of groups below are drawn by default."""
_Hulls = dict[int, tuple[Array, NDArray[np.int32]]]
"""Convex hulls by the numbers of their meshes."""


def read_mjcf(file: Path, packages: Packages) -> tuple[Assembly, list[Path]]:
    """The assembly of the largest moving tree of bodies in a model, and all files of the model.

    Raises:
        DataError: if MuJoCo cannot load the model, or nothing in it moves.
    """
    files = check_mjcf(file, packages)
    try:
        mujoco.set_mju_user_warning(lambda _: None)  # it would print, and write a log
        model = load_model(file)
    except ValueError as error:
        why = " ".join(str(error).split())
        raise FileError(f"{file.name}: MuJoCo cannot load it: {why}") from None
    finally:
        mujoco.set_mju_user_warning(None)
    if model.nbody < 2:
        raise FileError(f"{file.name} holds no body")
    _require_sane(model, file.name)
    trees, sizes = np.unique(model.body_rootid[1:], return_counts=True)
    root = int(trees[np.argmax(sizes)])
    driven = _driven_joints(model)
    bodies, hulls = list[Body](), _Hulls()
    for body in np.flatnonzero(model.body_rootid == root).tolist():
        bodies += _bodies(model, body, root, driven, hulls)
    gears = [gear for n in range(model.neq) if (gear := _gear(model, n)) is not None]
    name = check_name(file.stem, "robot")
    return Assembly(name=name, bodies=tuple(bodies), gears=tuple(gears), notes=()), files


def _require_sane(model: Any, name: str) -> None:
    """Refuse what no rover has: too much of everything, or numbers beyond all measure."""
    require_below(model.nbody, MOST_LINKS, "bodies", name)
    require_below(model.ngeom, MOST_SHAPES, "geoms", name)
    meshes = model.geom_dataid[model.geom_type == mujoco.mjtGeom.mjGEOM_MESH]
    require_below(int(model.mesh_facenum[meshes].sum()), MOST_TRIANGLES, "triangles", name)
    lengths = ("body_pos", "body_ipos", "geom_pos", "geom_size", "jnt_pos", "mesh_vert")
    masses = ("body_mass", "body_inertia", "dof_damping", "dof_frictionloss")
    limits = {**dict.fromkeys(lengths, FARTHEST), **dict.fromkeys(masses, HEAVIEST)}
    for what, most in limits.items():
        values = np.abs(getattr(model, what))
        if values.size and not values.max() <= most:
            raise FileError(f"{name}: a {what} of MuJoCo's is above {most:g}")


def _bodies(
    model: Any, body: int, root: int, driven: dict[int, float | None], hulls: _Hulls
) -> list[Body]:
    """A body; where several joints hold it, a massless body for each joint but the last.

    MuJoCo's joints may turn about any point of the body: frames are moved there.
    """
    name = _name(model, mujoco.mjtObj.mjOBJ_BODY, body)
    first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
    joints = [j for j in range(first, first + count) if body != root]
    placement = _placement(model.body_pos[body], model.body_quat[body])
    if body == root:
        parent, placement = "", np.eye(4)
    else:
        above = int(model.body_parentid[body])
        parent = _name(model, mujoco.mjtObj.mjOBJ_BODY, above)
        placement = portable.product(placed(-_anchor(model, above, root), np.eye(3)), placement)
    made: list[Body] = []
    at = np.zeros(3)
    for joint in joints:
        anchor = np.array(model.jnt_pos[joint])
        placement = portable.product(placement, placed(anchor - at, np.eye(3)))
        at, last = anchor, joint == joints[-1]
        own = name if last else f"{name}_{_name(model, mujoco.mjtObj.mjOBJ_JOINT, joint)}"
        held = _joint(model, joint, driven)
        made.append(Body(name=own, parent=parent, placement=placement, joint=held))
        parent, placement = own, np.eye(4)
    made = made or [Body(name=name, parent=parent, placement=placement)]
    return [*made[:-1], _massive(model, body, made[-1], at, hulls)]


def _anchor(model: Any, body: int, root: int) -> Array:
    """Where our frame of a body is in MuJoCo's: at its last joint, shape [3] [m]."""
    count = int(model.body_jntnum[body])
    if body == root or not count:
        return np.zeros(3)
    return np.array(model.jnt_pos[int(model.body_jntadr[body]) + count - 1])


def _massive(model: Any, body: int, bare: Body, at: Array, hulls: _Hulls) -> Body:
    """A body with its mass and geometry, its frame `at` a point of MuJoCo's."""
    rotation = matrix_from_quaternion(model.body_iquat[body])
    geoms = range(model.body_geomadr[body], model.body_geomadr[body] + model.body_geomnum[body])
    return replace(
        bare,
        mass=float(model.body_mass[body]),
        centre_of_mass=model.body_ipos[body] - at,
        inertia=portable.product(
            portable.product(rotation, np.diag(model.body_inertia[body])), rotation.T
        ),
        solids=tuple(solid for geom in geoms for solid in _solids(model, geom, at, hulls)),
    )


def _joint(model: Any, joint: int, driven: dict[int, float | None]) -> Joint:
    limited = bool(model.jnt_limited[joint])
    turning = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE
    address = int(model.jnt_dofadr[joint])
    low, high = model.jnt_range[joint].tolist()
    kind = ("revolute" if limited else "continuous") if turning else "sliding"
    return Joint(
        name=_name(model, mujoco.mjtObj.mjOBJ_JOINT, joint),
        kind=kind,
        axis=np.array(model.jnt_axis[joint]),
        limits=(low, high) if limited else None,
        damping=float(model.dof_damping.reshape(model.nv, -1)[address, 0]),
        friction=float(model.dof_frictionloss[address]),
        effort=driven.get(joint),
        driven=joint in driven,
    )


def _driven_joints(model: Any) -> dict[int, float | None]:
    """Joints with an actuator, and its largest torque [N m] where it is limited."""
    driven: dict[int, float | None] = {}
    for actuator in range(model.nu):
        if model.actuator_trntype[actuator] == mujoco.mjtTrn.mjTRN_JOINT:
            limited = bool(model.actuator_forcelimited[actuator])
            most = float(np.abs(model.actuator_forcerange[actuator]).max())
            driven[int(model.actuator_trnid[actuator, 0])] = most if limited and most else None
    return driven


def _gear(model: Any, number: int) -> Gear | None:
    """A joint equality with a slope, as a gear."""
    if model.eq_type[number] != mujoco.mjtEq.mjEQ_JOINT or model.eq_obj2id[number] < 0:
        return None
    return Gear(
        joint=_name(model, mujoco.mjtObj.mjOBJ_JOINT, int(model.eq_obj1id[number])),
        leader=_name(model, mujoco.mjtObj.mjOBJ_JOINT, int(model.eq_obj2id[number])),
        ratio=float(model.eq_data[number, 1]),
        offset=float(model.eq_data[number, 0]),
    )


def _solids(model: Any, geom: int, at: Array, hulls: _Hulls) -> list[Solid]:
    """A geom as solids; nothing for planes and height fields, which no rover has."""
    kind = mujoco.mjtGeom(int(model.geom_type[geom]))
    placement = _placement(model.geom_pos[geom] - at, model.geom_quat[geom])
    collides = bool(model.geom_contype[geom] or model.geom_conaffinity[geom])
    rgba = _rgba(model, geom)
    visible = bool(model.geom_group[geom] < _SEEN_GROUPS and rgba[3] > 0)
    rgb = (rgba[0], rgba[1], rgba[2])
    x, y, z = model.geom_size[geom].tolist()
    simple = {
        mujoco.mjtGeom.mjGEOM_BOX: ("box", (2 * x, 2 * y, 2 * z)),
        mujoco.mjtGeom.mjGEOM_CYLINDER: ("cylinder", (x, 2 * y)),
        mujoco.mjtGeom.mjGEOM_SPHERE: ("sphere", (x,)),
    }
    if kind in simple:
        named, size = simple[kind]
        return [solid(placement, named, size, collides=collides, visible=visible, rgb=rgb)]
    triangles = _triangles(model, geom, kind)
    if triangles is None:
        return []
    vertices, faces = triangles
    made = []
    if visible:
        made.append(mesh_solid(vertices, faces, placement, collides=False, rgb=rgb))
    if collides:
        number = int(model.geom_dataid[geom])
        if number < 0 or number not in hulls:
            hulls[number] = hull_of(vertices, _name(model, mujoco.mjtObj.mjOBJ_GEOM, geom))
        made.append(mesh_solid(*hulls[number], placement, collides=True, rgb=rgb))
    return made


def _triangles(model: Any, geom: int, kind: Any) -> tuple[Array, NDArray[np.int32]] | None:
    """Vertices [m] and faces of a mesh, a capsule or an ellipsoid; None for anything else."""
    import trimesh

    x, y, z = model.geom_size[geom].tolist()
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = int(model.geom_dataid[geom])
        first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
        start, faces = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
        vertices = np.array(model.mesh_vert[first : first + count], np.float64)
        return vertices, np.array(model.mesh_face[start : start + faces], np.int32)
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        shape = trimesh.creation.capsule(height=2 * y, radius=x, count=[24, 24])
        shape.apply_translation(-shape.bounds.mean(axis=0))
    elif kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
        shape = trimesh.creation.icosphere(subdivisions=3)
        shape.apply_scale((x, y, z))
    else:
        return None
    return np.array(shape.vertices, np.float64), np.array(shape.faces, np.int32)


def _rgba(model: Any, geom: int) -> tuple[float, ...]:
    material = int(model.geom_matid[geom])
    rgba = model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]
    return tuple(round(float(value), 4) for value in rgba)


def _placement(position: Array, quaternion: Array) -> Array:
    return placed(np.array(position), matrix_from_quaternion(np.array(quaternion)))


def _name(model: Any, kind: Any, index: int) -> str:
    name = mujoco.mj_id2name(model, kind, index) or f"{kind.name[6:].lower()}_{index}"
    return check_name(name, kind.name[6:].lower())
