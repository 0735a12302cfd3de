"""Whether a dynamic rock stays where it lies: alone on its piece of ground, in MuJoCo."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from terrain_forge.base import Array, matrix_from_quaternion, portable
from terrain_forge.model import Heightfield, RockField, RockPrototype
from terrain_forge.rocks.embedding.dynamic import dynamic_contact

TIMESTEP = 0.002
"""Time step in which rocks are tested [s]."""

_CONDIM = 3  # no rolling friction: it would hold a rock that rolls away where none is known
_DAMPED_TIMESTEP = 0.004  # [s]
_DAMPING = 5.0  # [1/s]
_DAMPED_TIME = 4.08  # [s], at most
_LOOK = 0.24  # [s]
_STILL = 2e-4  # part of the diameter, in a look
_LEAN = np.radians(2.0)  # of gravity in a test
_DIRECTIONS = 16  # of leaning
_LEAN_TIME = 0.1  # for each direction [s]
_SPIN = 0.05  # in √(gravity / diameter), either way
_FREE_TIME = 0.8  # after each spin [s]
_SHIFT = 0.003  # part of the diameter, in a test
_TURN = np.radians(0.3)  # in a test
_BASE = 1.0  # thickness of the ground [m]


class DynamicRock(NamedTuple):
    """A rock that is to be settled."""

    prototype: RockPrototype
    """Its shape."""
    diameter: float
    """Exposed diameter that it must have [m]."""
    density: float
    """Density [kg/m³]."""
    position: Array
    """Centre of mass as a static rock, in the world frame [m], shape [3]."""
    quaternion: Array
    """Rotation as a static rock, shape [4]."""
    support: Array
    """Support function of its footprint over the diameter, as `footprint` has it."""
    gravity: float
    """Gravity [m/s²]."""
    highest: float = math.inf
    """How high it may stand above its tangent plane [m]."""

    @classmethod
    def of(
        cls, rocks: RockField, row: int, prototype: RockPrototype, support: Array, gravity: float
    ) -> DynamicRock:
        """One of some embedded rocks."""
        density = float(rocks.mass[row] / rocks.volume[row])
        pose = rocks.position[row], rocks.quaternion[row]
        return cls(prototype, float(rocks.diameter[row]), density, *pose, support, gravity)


class Pose(NamedTuple):
    """How a rock lies, on its piece of ground in that piece's coordinates."""

    position: Array
    """Centre of mass [m], shape [3]."""
    quaternion: Array
    """Rotation from the prototype's axes, shape [4]."""
    scale: float
    """Size in units of the prototype."""


def stays_put(rock: DynamicRock, before: Pose, after: Pose) -> bool:
    """Whether a rock has hardly moved in a test."""
    shift = portable.norm(after.position - before.position)
    cosine = min(abs(float(portable.product(after.quaternion, before.quaternion))), 1.0)
    return bool(shift <= _SHIFT * rock.diameter and 2.0 * portable.arccos(cosine) <= _TURN)


def moved(pose: Pose, data: Any) -> Pose:
    """The pose that a rock has come to."""
    return pose._replace(position=data.qpos[:3].copy(), quaternion=data.qpos[3:].copy())


def calm(rock: DynamicRock, model: Any, data: Any) -> None:
    """Let time pass until a damped rock hardly moves."""
    import mujoco

    for _ in range(round(_DAMPED_TIME / _LOOK)):
        last = data.qpos.copy()
        mujoco.mj_step(model, data, nstep=round(_LOOK / _DAMPED_TIMESTEP))
        if np.abs(data.qpos - last).max() < _STILL * rock.diameter:
            break


def after_test(rock: DynamicRock, ground: Heightfield, pose: Pose) -> Pose:
    """Where a rock is after gravity has leaned to all sides, and it was spun a little both ways.

    It is damped while gravity leans, so that one that lies in a hollow comes back; then it is free.
    A rock that two contacts carry, or one, goes on spinning.
    """
    import mujoco

    model, data = simulation(rock, ground, pose)
    steps = round(_LEAN_TIME / _DAMPED_TIMESTEP)
    for direction in range(_DIRECTIONS):
        level, towards = np.sin(_LEAN), 2.0 * np.pi * direction / _DIRECTIONS
        down = level * np.cos(towards), level * np.sin(towards), -np.cos(_LEAN)
        model.opt.gravity = rock.gravity * np.array(down)
        mujoco.mj_step(model, data, nstep=steps)
    model.opt.gravity = 0.0, 0.0, -rock.gravity
    calm(rock, model, data)
    leaned = moved(pose, data)
    if not stays_put(rock, pose, leaned):
        return leaned
    model.dof_damping[:], model.opt.timestep = 0.0, TIMESTEP
    for spin in (_SPIN, -_SPIN):
        upward = matrix_from_quaternion(data.qpos[3:])[2]
        data.qvel[3:] = spin * np.sqrt(rock.gravity / rock.diameter) * upward
        mujoco.mj_step(model, data, nstep=round(_FREE_TIME / TIMESTEP))
    return moved(pose, data)


def simulation(rock: DynamicRock, ground: Heightfield, pose: Pose) -> tuple[Any, Any]:
    """The rock on its piece of ground, damped, as a MuJoCo model and its data."""
    import mujoco

    spec = mujoco.MjSpec()
    contact = dynamic_contact(rock.diameter)
    spec.option.timestep = _DAMPED_TIMESTEP
    spec.option.gravity = (0.0, 0.0, -rock.gravity)
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = contact.impratio
    touch = {"friction": contact.friction, "solref": contact.solref}
    _add_ground(spec, ground, touch)
    body = spec.worldbody.add_body(pos=pose.position, quat=pose.quaternion)
    mass = rock.density * rock.prototype.volume * pose.scale**3
    inertia = rock.density * rock.prototype.inertia * pose.scale**5
    body.explicitinertial, body.ipos, body.mass = True, (0.0, 0.0, 0.0), mass
    body.fullinertia = [inertia[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    body.add_freejoint()
    for n, hull in enumerate(rock.prototype.hulls):
        vertices, faces = pose.scale * hull.vertices.ravel(), hull.faces.ravel()
        spec.add_mesh(name=f"hull_{n}", uservert=vertices, userface=faces)
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=f"hull_{n}",
            contype=1,
            conaffinity=0,
            condim=_CONDIM,
            **touch,
        )
    model = spec.compile()
    model.dof_damping[:] = _DAMPING * np.repeat([mass, np.trace(inertia) / 3.0], 3)
    return model, mujoco.MjData(model)


def _add_ground(spec: Any, ground: Heightfield, touch: dict[str, Any]) -> None:
    import mujoco

    west, south, east, north = ground.bounds
    lowest, rise = float(ground.elevation.min()), float(np.ptp(ground.elevation))
    spec.add_hfield(
        name="ground",
        nrow=ground.shape[0],
        ncol=ground.shape[1],
        size=((east - west) / 2, (north - south) / 2, rise or 1.0, _BASE),
        userdata=(ground.elevation - lowest).ravel(),
    )
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_HFIELD,
        hfieldname="ground",
        pos=((west + east) / 2, (south + north) / 2, lowest),
        contype=0,
        conaffinity=1,
        **touch,
    )
