"""Reading an MJCF, as MuJoCo compiles it, into an assembly."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import (
    Array,
    load_model,
    matrix_from_quaternion,
    placed,
    portable,
    silent_mujoco,
)
from terrain_forge.rovers import bounds
from terrain_forge.rovers.assembly import Assembly, Body, Joint, Solid, bare_shape
from terrain_forge.rovers.bounds import FileError
from terrain_forge.rovers.mesh_files import hull_of, mesh_solid
from terrain_forge.rovers.mjcf_files import check_mjcf
from terrain_forge.rovers.mjcf_motion import OF_JOINTS, Ties, called
from terrain_forge.rovers.packages import Packages

_INSTRUMENTS = {
    int(kind): name
    for kind, name in (
        (mujoco.mjtSensor.mjSENS_ACCELEROMETER, "accelerometer"),
        (mujoco.mjtSensor.mjSENS_GYRO, "gyro"),
        (mujoco.mjtSensor.mjSENS_VELOCIMETER, "velocimeter"),
        (mujoco.mjtSensor.mjSENS_MAGNETOMETER, "magnetometer"),
        (mujoco.mjtSensor.mjSENS_FORCE, "force"),
        (mujoco.mjtSensor.mjSENS_TORQUE, "torque"),
        (mujoco.mjtSensor.mjSENS_TOUCH, "touch"),
        (mujoco.mjtSensor.mjSENS_RANGEFINDER, "rangefinder"),
    )
}
_PLAIN = tuple(
    map(
        int, (mujoco.mjtDyn.mjDYN_NONE, mujoco.mjtDyn.mjDYN_FILTER, mujoco.mjtDyn.mjDYN_FILTEREXACT)
    )
)
"""Dynamics of actuators whose activation stays within the range of their control."""
_SEEN_GROUPS = 3
"""Geoms of groups below are drawn by default."""


def read_mjcf(file: Path, packages: Packages) -> tuple[Assembly, list[Path]]:
    """The assembly of the largest moving tree of bodies in a model, and all files of the model.

    Raises:
        DataError: if MuJoCo cannot load the model, or nothing in it moves.
    """
    files = check_mjcf(file, packages)
    try:
        with silent_mujoco():
            model = load_model(file)
    except ValueError as error:
        why = " ".join(str(error).split())
        raise FileError(f"{file.name}: MuJoCo cannot load it: {why}") from None
    if model.nbody < 2:
        raise FileError(f"{file.name} holds no body")
    _require_sane(model, file.name)
    trees, sizes = np.unique(model.body_rootid[1:], return_counts=True)
    root = int(trees[np.argmax(sizes)])
    reader, ties = _Reader(model, root), Ties(model, root)
    return Assembly(
        name=bounds.check_name(file.stem, "robot"),
        bodies=tuple(
            made
            for body in np.flatnonzero(model.body_rootid == root).tolist()
            for made in reader.bodies(body)
        ),
        gears=tuple(ties.gears),
        unread=tuple(ties.unread),
        sensors=_sensors(model, root),
    ), files


def _sensors(model: Any, root: int) -> tuple[str, ...]:
    """Kinds of the cameras on a tree, and of the instruments that a model has."""
    fixed = model.cam_mode == mujoco.mjtCamLight.mjCAMLIGHT_FIXED  # others are a viewer's
    cameras = int(np.count_nonzero(fixed & (model.body_rootid[model.cam_bodyid] == root)))
    types = (_INSTRUMENTS.get(int(kind)) for kind in model.sensor_type)
    return ("camera",) * cameras + tuple(kind for kind in types if kind)


def _require_sane(model: Any, name: str) -> None:
    """Refuse what no rover has: too much of everything, or numbers beyond all measure."""
    bounds.require_below(model.nbody, bounds.MOST_LINKS, "bodies", name)
    bounds.require_below(model.ngeom, bounds.MOST_SHAPES, "geoms", name)
    meshes = model.geom_dataid[model.geom_type == mujoco.mjtGeom.mjGEOM_MESH]
    bounds.require_below(
        int(model.mesh_facenum[meshes].sum()), bounds.MOST_TRIANGLES, "triangles", name
    )
    lengths = ("body_pos", "body_ipos", "geom_pos", "geom_size", "jnt_pos", "mesh_vert")
    masses = ("body_mass", "body_inertia", "dof_damping", "dof_frictionloss")
    limits = {**dict.fromkeys(lengths, bounds.FARTHEST), **dict.fromkeys(masses, bounds.HEAVIEST)}
    for what, most in limits.items():
        values = np.abs(getattr(model, what))
        if values.size and not values.max() <= most:
            raise FileError(f"{name}: a {what} of MuJoCo's is above {most:g}")


def _most_torque(model: Any, actuator: int) -> float | None:
    """An actuator's largest torque about its joint [N m], where force, control or joint limit it.

    A control is a limit of force only of an actuator whose force is a multiple of it: a motor.
    """
    joint = int(model.actuator_trnid[actuator, 0])
    gear = abs(float(model.actuator_gear[actuator, 0]))
    limits = list[float]()
    if model.actuator_forcelimited[actuator]:
        limits.append(gear * float(np.abs(model.actuator_forcerange[actuator]).max()))
    if model.actuator_ctrllimited[actuator] and _is_motor(model, actuator):
        gain = abs(float(model.actuator_gainprm[actuator, 0]))
        limits.append(gear * gain * float(np.abs(model.actuator_ctrlrange[actuator]).max()))
    if model.jnt_actfrclimited[joint]:
        limits.append(float(np.abs(model.jnt_actfrcrange[joint]).max()))
    return min((limit for limit in limits if limit), default=None)


def _is_motor(model: Any, actuator: int) -> bool:
    """Whether an actuator's force is its control by a fixed gain, perhaps delayed by a filter."""
    return (
        model.actuator_gaintype[actuator] == mujoco.mjtGain.mjGAIN_FIXED
        and model.actuator_biastype[actuator] == mujoco.mjtBias.mjBIAS_NONE
        and model.actuator_dyntype[actuator] in _PLAIN
    )


class _Reader:
    """Makes bodies of those of a model's tree; each hull of a mesh once."""

    def __init__(self, model: Any, root: int) -> None:
        self._model, self._root = model, root
        self._hulls: dict[int, tuple[Array, NDArray[np.int32]]] = {}
        self._driven: dict[int, float | None] = {}
        """Joints with an actuator, and its largest torque [N m] where it is limited."""
        for n in np.flatnonzero(np.isin(model.actuator_trntype, OF_JOINTS)).tolist():
            self._driven[int(model.actuator_trnid[n, 0])] = _most_torque(model, n)

    def bodies(self, body: int) -> list[Body]:
        """A body; where several joints hold it, a massless body for each joint but the last.

        MuJoCo's joints may turn about any point of the body: frames are moved there.
        """
        model, told = self._model, self._model.body(body)
        name, parent, placement = called(model, "body", body), "", np.eye(4)
        if body != self._root:
            above = int(model.body_parentid[body])
            parent, turn = called(model, "body", above), matrix_from_quaternion(np.array(told.quat))
            shift = placed(-self._anchor(above), np.eye(3))
            placement = portable.product(shift, placed(np.array(told.pos), turn))
        bare, made = Body(name=name, parent=parent, placement=placement), list[Body]()
        at, joints = np.zeros(3), self._joints(body)
        for joint in joints:
            anchor = np.array(model.jnt_pos[joint])
            placement = portable.product(placement, placed(anchor - at, np.eye(3)))
            at = anchor
            own = name if joint == joints[-1] else f"{name}_{called(model, 'joint', joint)}"
            bare = Body(name=own, parent=parent, placement=placement, joint=self._joint(joint))
            made.append(bare)
            parent, placement = own, np.eye(4)
        turn = matrix_from_quaternion(told.iquat)
        inertia = portable.product(portable.product(turn, np.diag(told.inertia)), turn.T)
        first = int(model.body_geomadr[body])
        geoms = range(first, first + int(model.body_geomnum[body]))
        whole = replace(
            bare,
            mass=float(model.body_mass[body]),
            centre_of_mass=told.ipos - at,
            inertia=inertia,
            told=placed(-at, np.eye(3)),
            solids=tuple(solid for geom in geoms for solid in self._solids(geom, at)),
        )
        return [*made[:-1], whole]

    def _joints(self, body: int) -> range:
        """Numbers of the joints that hold a body; none holds the root."""
        first, count = int(self._model.body_jntadr[body]), int(self._model.body_jntnum[body])
        return range(first, first + count) if body != self._root else range(0)

    def _anchor(self, body: int) -> Array:
        """Where our frame of a body is in MuJoCo's: at its last joint, shape [3] [m]."""
        joints = self._joints(body)
        return np.array(self._model.jnt_pos[joints[-1]]) if joints else np.zeros(3)

    def _joint(self, joint: int) -> Joint:
        model = self._model
        limited = bool(model.jnt_limited[joint])
        turning = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE
        address = int(model.jnt_dofadr[joint])
        at_rest = model.qpos0[model.jnt_qposadr[joint]]  # our angles are from the pose as written
        low, high = (model.jnt_range[joint] - at_rest).tolist()
        return Joint(
            name=called(model, "joint", joint),
            kind=("revolute" if limited else "continuous") if turning else "sliding",
            axis=np.array(model.jnt_axis[joint]),
            limits=(low, high) if limited else None,
            damping=float(model.dof_damping.reshape(model.nv, -1)[address, 0]),
            friction=float(model.dof_frictionloss[address]),
            effort=self._driven.get(joint),
            driven=joint in self._driven,
        )

    def _solids(self, geom: int, at: Array) -> list[Solid]:
        """A geom as solids; nothing for planes and height fields, which no rover has."""
        model, told = self._model, self._model.geom(geom)
        kind = mujoco.mjtGeom(int(model.geom_type[geom]))
        placement = placed(told.pos - at, matrix_from_quaternion(np.array(told.quat)))
        collides = bool(model.geom_contype[geom] or model.geom_conaffinity[geom])
        material = int(model.geom_matid[geom])
        rgba = model.mat_rgba[material] if material >= 0 else told.rgba
        red, green, blue, alpha = (round(float(value), 4) for value in rgba)
        rgb, visible = (red, green, blue), bool(model.geom_group[geom] < _SEEN_GROUPS and alpha > 0)
        x, y, z = told.size.tolist()
        simple = {
            mujoco.mjtGeom.mjGEOM_BOX: ("box", (2 * x, 2 * y, 2 * z)),
            mujoco.mjtGeom.mjGEOM_CYLINDER: ("cylinder", (x, 2 * y)),
            mujoco.mjtGeom.mjGEOM_SPHERE: ("sphere", (x,)),
        }
        if kind in simple:
            named, size = simple[kind]
            shape = bare_shape(kind=named, size=size, collides=collides, visible=visible, rgb=rgb)
            return [(placement, shape)]
        triangles = _triangles(model, geom, kind)
        if triangles is None:
            return []
        made, number = [], int(model.geom_dataid[geom])
        if visible:
            made.append(mesh_solid(*triangles, placement, collides=False, rgb=rgb))
        if collides:
            if number < 0 or number not in self._hulls:
                self._hulls[number] = hull_of(triangles[0], called(model, "geom", geom))
            made.append(mesh_solid(*self._hulls[number], placement, collides=True, rgb=rgb))
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
