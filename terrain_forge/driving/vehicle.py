"""The rover in a loaded MuJoCo scene: its parts, how it is set down, what it does and touches."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, SimulationError, portable
from terrain_forge.driving.log import Logger
from terrain_forge.driving.result import EnergyBalance, longitudinal_slip
from terrain_forge.model import Rover

_PAIR_LIMIT = 50
"""Contacts of one pair of geoms that MuJoCo keeps; it drops more without a warning."""
_SETTLE_TIME = 1.5
_HIGHEST_LIFT, _LIFT_STEP = 0.3, 0.02
_FARTHEST_SETTLING = 0.5
_AT_LIMIT = 0.999
_EARTH_GRAVITY = 9.80665
_ROCK, _ROVER = 1, 2
_DROPPED, _UNSTABLE = (
    {int(getattr(mujoco.mjtWarning, f"mjWARN_{name}")) for name in names}
    for names in (("CONTACTFULL", "CNSTRFULL"), ("BADQPOS", "BADQVEL", "BADQACC"))
)

TOLERANCE = 0.1
"""How far mechanical energy may rise above the motors' work, as a part of the energy that lifts the
rover by the radius of a wheel on Earth. A contact gives back what it stored while it was
compressed: up to 1.8 J of a rover of 50 kg whose wheels press against rocks with all their torque
(docs/driving.md), on any body. An instability makes many times that within a second."""


class EnergyAudit:
    """Follows the work of the motors and the mechanical energy.

    What the motors put in less what the bodies hold is what friction has taken, and friction gives
    nothing back: that difference may never fall, but for what contacts store.
    """

    def __init__(self, *, reference: float, energy: float) -> None:
        """Begin with the energy that lifts the rover by a wheel's radius on Earth, and its own."""
        self.limit = TOLERANCE * reference
        """Largest rise that passes [J]."""
        self._start = self._energy = energy
        self._driving = self._braking = self._taken = self._unexplained = 0.0

    def add(self, *, driving: float, braking: float, energy: float) -> None:
        """Note the work of the motors [J] since the last time, and the energy now [J]."""
        self._driving += driving
        self._braking += braking
        self._energy = energy
        taken = self._driving + self._braking - (energy - self._start)
        self._taken = max(self._taken, taken)
        self._unexplained = max(self._unexplained, self._taken - taken)

    def go_on(self, energy: float) -> None:
        """Go on in another scene, whose other bodies hold more or less energy [J]."""
        self._start += energy - self._energy
        self._energy = energy

    def fault(self) -> str:
        """What is wrong with the energy; empty if nothing is."""
        if self._unexplained <= self.limit:
            return ""
        return (
            f"energy grew without cause, by {self._unexplained:.3g} J more than the motors' work "
            f"(at most {self.limit:.3g} J)"
        )

    def balance(self) -> EnergyBalance:
        """The balance from the start until now."""
        return EnergyBalance(
            driving=self._driving,
            braking=self._braking,
            gained=self._energy - self._start,
            unexplained=self._unexplained,
        )


class Vehicle:
    """A rover's handles into a MuJoCo model and its state.

    Raises:
        SimulationError: if the scene does not hold this rover.
    """

    def __init__(self, model: Any, rover: Rover) -> None:
        self.model = model
        self.data = mujoco.MjData(model)
        self.rover = rover
        if not rover.wheels:
            raise SimulationError(f"the rover {rover.name!r} has no wheels, it cannot drive")
        body, joint, actuator = (
            getattr(mujoco.mjtObj, f"mjOBJ_{kind}") for kind in ("BODY", "JOINT", "ACTUATOR")
        )
        self._body = self._find(body, rover.links[0].name)
        self._qpos = int(model.jnt_qposadr[model.body_jntadr[self._body]])
        names = [wheel.link for wheel in rover.wheels]
        self.motors = np.array([self._find(actuator, name) for name in names])
        """The wheels' actuators."""
        self._wheel_bodies = np.array([self._find(body, name) for name in names])
        self._axles = np.array([self._find(joint, name) for name in names])
        self.axle_rates = model.jnt_dofadr[self._axles]
        """Where `qvel` holds the wheels' rates."""
        self._radii = rover.wheel_radii
        self.joints = tuple(link.name for link in rover.links if link.joint == "passive")
        """Names of the passive joints."""
        found = [self._find(joint, name) for name in self.joints]
        self._angles = model.jnt_qposadr[np.array(found, dtype=np.int64)]
        self.coordinates = np.concatenate(
            [self._qpos + np.arange(7), model.jnt_qposadr[self._axles], self._angles]
        )
        """Where `qpos` holds base_link's pose, the wheels' angles and those of passive joints."""
        dofs = model.jnt_dofadr[model.body_jntadr[self._body]] + np.arange(6)
        self._velocities = np.concatenate(
            [dofs, self.axle_rates, model.jnt_dofadr[np.array(found, dtype=np.int64)]]
        )
        self.logger: Logger | None = None
        """Told of each time step."""
        axes = {link.name: link.axis for link in rover.links}
        # Forwards is a turn about the left; an axle may point to either side.
        self.sides = np.array([1.0 if axes[name][1] > 0.0 else -1.0 for name in names])
        """1 for wheels whose axle points left, -1 for the others."""
        self._torque_limits = model.actuator_forcerange[self.motors, 1]
        self._reach = self._torque_limits / model.actuator_gainprm[self.motors, 0]
        self._activations = model.actuator_actadr[self.motors]
        if (self._activations < 0).any():
            raise SimulationError(
                "the rover's motors are those of an older export: export it again"
            )
        self._damping = -model.actuator_biasprm[self.motors, 2]
        self._lag = self._damping / model.actuator_gainprm[self.motors, 0]
        self._mark_geoms()
        # Stepping only what is awake, where MuJoCo can: rocks then cost next to nothing.
        for flag in ("mjENBL_ENERGY", "mjENBL_SLEEP"):
            model.opt.enableflags |= int(getattr(mujoco.mjtEnableBit, flag, 0))

    def _mark_geoms(self) -> None:
        """Tell rocks, `rock_<id>`, wheels and the rest of the rover from other geoms."""
        model = self.model
        names = [model.geom(n).name for n in range(model.ngeom)]
        self._rocks = [
            "_".join(name.split("_")[:2]) if name.startswith("rock_") else "" for name in names
        ]
        is_rock = np.array([bool(name) for name in self._rocks])
        self._is_rover = model.body_rootid[model.geom_bodyid] == self._body
        self._is_wheel = np.isin(model.geom_bodyid, self._wheel_bodies)
        self._kind = _ROCK * is_rock + _ROVER * self._is_rover

    def _find(self, kind: Any, name: str) -> int:
        index = mujoco.mj_name2id(self.model, kind, name)
        if index < 0:
            raise SimulationError(
                f"the scene does not hold the rover {self.rover.name!r}: it has no "
                f"{kind.name[6:].lower()} named {name!r}"
            )
        return int(index)

    def set_down(self, position: Array, quaternion: Array) -> None:
        """Put base_link at a pose, raise it until it is free, let it settle with wheels locked.

        Raises:
            SimulationError: if it is not free within 0.3 m above, or does not stay there.
        """
        data = self.data
        mujoco.mj_resetData(self.model, data)
        data.qpos[self._qpos : self._qpos + 7] = (*position, *quaternion)
        mujoco.mj_forward(self.model, data)
        while inside := self._what_it_is_in():
            data.qpos[self._qpos + 2] += _LIFT_STEP
            if data.qpos[self._qpos + 2] > position[2] + _HIGHEST_LIFT:
                raise SimulationError(
                    f"the rover's start at {_place(position)} is not free: it lies in {inside}"
                )
            mujoco.mj_forward(self.model, data)
        data.ctrl[self.motors] = 0.0
        mujoco.mj_step(self.model, data, round(_SETTLE_TIME / self.model.opt.timestep))
        if not portable.norm(self.position - position) < _FARTHEST_SETTLING:
            raise SimulationError(f"the rover does not stand at its start, {_place(position)}")
        data.time = 0.0
        lift = self.rover.mass * _EARTH_GRAVITY * float(self._radii.mean())
        self.audit = EnergyAudit(reference=lift, energy=float(data.energy.sum()))
        self._rates, self._forces = data.actuator_velocity.copy(), data.actuator_force.copy()
        self.saturated_steps = self.steps = 0

    def moved_to(self, model: Any) -> Vehicle:
        """The vehicle in another scene with the same ground here, as it stands and moves now.

        Raises:
            SimulationError: if that scene does not hold this rover.
        """
        other = Vehicle(model, self.rover)
        here, there = self.data, other.data
        mujoco.mj_resetData(model, there)
        there.qpos[other.coordinates] = here.qpos[self.coordinates]
        there.qvel[other._velocities] = here.qvel[self._velocities]
        there.act[other._activations] = here.act[self._activations]
        there.ctrl[other.motors] = here.ctrl[self.motors]
        there.time = here.time
        mujoco.mj_forward(model, there)
        self.audit.go_on(float(there.energy.sum()))
        other.audit, other.logger = self.audit, self.logger
        other._rates, other._forces = self._rates.copy(), self._forces.copy()
        other.saturated_steps, other.steps = self.saturated_steps, self.steps
        return other

    def _what_it_is_in(self) -> str:
        """The rocks that a part of the rover reaches into, or else the ground; empty if neither."""
        contact = self.data.contact
        own = self._is_rover[contact.geom].any(axis=1) & (contact.dist < 0.0)
        touched = contact.geom[own]
        others = np.where(self._is_rover[touched[:, 0]], touched[:, 1], touched[:, 0])
        names = sorted({self._rocks[geom] for geom in others.tolist()})
        return ", ".join(name or "the ground" for name in names)

    def step(self, wheel_rates: Array, count: int) -> None:
        """Command the wheels, forwards positive [rad/s], and take so many time steps.

        The command is reached by even changes over these steps.
        """
        data, model, motors = self.data, self.model, self.motors
        control, velocity, force = data.ctrl, data.actuator_velocity, data.actuator_force
        before, after = control[motors], self.sides * wheel_rates
        parts = np.arange(1, count + 1)[:, None] * (1.0 / count)
        commands = np.empty((count, len(control)))
        commands[:] = control
        commands[:, motors] = before + parts * (after - before)
        rates, forces = np.empty((2, count + 1, len(control)))
        rates[0], forces[0] = self._rates, self._forces
        step, logger = mujoco.mj_step, self.logger
        for n, command in enumerate(commands, 1):
            control[:] = command
            step(model, data)
            # MuJoCo now shows rates and forces as they were when the step began.
            rates[n] = velocity
            forces[n] = force
            if logger is not None:
                logger.note(self)
        self._rates, self._forces = rates[-1], forces[-1]
        self._audit(forces[:-1, motors], rates[:, motors])
        # The angles that the servos follow run ahead of wheels that are held, which would spin to
        # catch up once they are free: they stay within the reach of the motors' torques.
        held = data.actuator_length[motors] + self._lag * self._rates[motors]
        low, high = held - self._reach, held + self._reach
        data.act[self._activations] = np.maximum(low, np.minimum(data.act[self._activations], high))
        self.saturated_steps += bool(
            (np.abs(self._forces[motors]) >= _AT_LIMIT * self._torque_limits).any()
        )
        self.steps += 1

    def _audit(self, forces: Array, rates: Array) -> None:
        """Note the work of the servos over steps, by the force as each began and the rates around.

        The implicit integrator applies the damping that belongs to the rate at a step's end, unless
        the motor is at its limit, which then acts throughout.
        """
        limited = np.abs(forces) >= _AT_LIMIT * self._torque_limits
        change = np.where(limited, 0.0, self._damping * (rates[1:] - rates[:-1]))
        work = 0.5 * self.model.opt.timestep * (forces - change) * (rates[:-1] + rates[1:])
        driving = float(np.maximum(work, 0.0).sum())
        braking = float(np.minimum(work, 0.0).sum())
        self.audit.add(driving=driving, braking=braking, energy=float(self.data.energy.sum()))

    @property
    def position(self) -> Array:
        """Origin of base_link in the world frame [m], shape [3]."""
        return np.array(self.data.xpos[self._body])

    @property
    def quaternion(self) -> Array:
        """Rotation (w, x, y, z) of base_link, shape [4]."""
        return np.array(self.data.xquat[self._body])

    @property
    def rotation(self) -> Array:
        """Rotation matrix of base_link, shape [3, 3]."""
        return np.array(self.data.xmat[self._body]).reshape(3, 3)

    @property
    def turn_rate(self) -> float:
        """Turn rate of base_link about the vertical [rad/s]."""
        return float(self.data.cvel[self._body, 2])

    @property
    def joint_angles(self) -> Array:
        """Angles of the passive joints [rad], shape [joints]."""
        return np.array(self.data.qpos[self._angles])

    @property
    def wheel_rates(self) -> Array:
        """Rates of the wheels about their axles, forwards positive [rad/s], shape [wheels]."""
        return np.asarray(self.sides * self.data.qvel[self.axle_rates])

    def wheel_states(self) -> dict[str, NDArray[Any]]:
        """What the wheels do now, as `DriveResult` names it, each of shape [wheels]."""
        data = self.data
        turning = data.cvel[self._wheel_bodies, :3]
        arm = data.xpos[self._wheel_bodies] - data.subtree_com[self._body]
        moving = data.cvel[self._wheel_bodies, 3:] + _cross(turning, arm)
        left = data.xaxis[self._axles] * self.sides[:, None]
        forward = _cross(left, self.rotation[None, :, 2])
        forward /= np.linalg.norm(forward, axis=1, keepdims=True)
        rim = (turning * left).sum(1) * self._radii
        slip, moves = longitudinal_slip(rim, (moving * forward).sum(1))
        torque = self.sides * data.actuator_force[self.motors]
        return {
            "wheel_rate": self.wheel_rates,
            "wheel_torque": torque,
            "wheel_slip": slip,
            "wheel_moves": moves,
        }

    def rock_forces(self) -> dict[str, tuple[float, bool]]:
        """Rocks that the rover touches now: largest normal force [N], whether its body touches."""
        data, forces = self.data, dict[str, tuple[float, bool]]()
        pairs = data.contact.geom
        touched = self._kind[pairs].sum(axis=1) == _ROCK + _ROVER
        wrench = np.zeros(6)
        for contact in touched.nonzero()[0].tolist():
            one, other = pairs[contact]
            name = self._rocks[one] or self._rocks[other]
            mujoco.mj_contactForce(self.model, data, contact, wrench)
            force, by_body = forces.get(name, (0.0, False))
            by_wheel = self._is_wheel[one] or self._is_wheel[other]
            forces[name] = max(force, float(wrench[0])), bool(by_body or not by_wheel)
        return forces

    def fault(self) -> str:
        """What makes the simulation meaningless; empty if nothing does."""
        data = self.data
        warned = set(data.warning.number.nonzero()[0].tolist())
        if warned & _DROPPED:
            return "contacts were dropped (MuJoCo's memory is full)"
        if warned & _UNSTABLE:
            return "the simulation became unstable (a number is not finite or far too large)"
        if not np.isfinite(data.qpos).all():
            return "the simulation became unstable (a position is not finite)"
        if data.ncon >= _PAIR_LIMIT:
            own = data.contact.geom[self._is_rover[data.contact.geom].any(axis=1)]
            _, counts = np.unique(own, axis=0, return_counts=True)
            if counts.max(initial=0) >= _PAIR_LIMIT:
                return f"contacts were dropped (a pair of geoms has {_PAIR_LIMIT})"
        return self.audit.fault()


def _cross(one: Array, other: Array) -> Array:
    """Cross products of rows; NumPy's own takes five times as long for a few."""
    (a, b, c), (x, y, z) = one.T, other.T
    return np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=1)


def _place(position: Array) -> str:
    return "({:.2f}, {:.2f}, {:.2f}) m".format(*position)
