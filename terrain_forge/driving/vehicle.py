"""The rover in a loaded MuJoCo scene: its parts, how it is set down, what it does and touches."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from mujoco.rollout import Rollout
from numpy.typing import NDArray

from terrain_forge.base import Array, SimulationError, portable
from terrain_forge.driving.energy import EnergyAudit
from terrain_forge.driving.log import Logger
from terrain_forge.driving.snapshot import Snapshot, pushes, wheel_states
from terrain_forge.model import Rover

_PAIR_LIMIT = 50
"""Contacts of one pair of geoms that MuJoCo keeps; it drops more without a warning."""
_SETTLE_TIME = 1.5
_HIGHEST_LIFT, _LIFT_STEP = 0.3, 0.02
_FARTHEST_SETTLING = 0.5
_AT_LIMIT = 0.999
_AUDITED = 10
"""Commands after which the work of their steps is added up: few calls for many steps."""
_EARTH_GRAVITY = 9.80665
_ROCK, _ROVER = 1, 2
_ENERGY = int(mujoco.mjtEnableBit.mjENBL_ENERGY)
_STATE = int(mujoco.mjtState.mjSTATE_FULLPHYSICS)
_DROPPED, _UNSTABLE = (
    {int(getattr(mujoco.mjtWarning, f"mjWARN_{name}")) for name in names}
    for names in (("CONTACTFULL", "CNSTRFULL"), ("BADQPOS", "BADQVEL", "BADQACC"))
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
        """Told of all time steps."""
        self.settled = np.empty(0)
        """MuJoCo's state before the last step of settling."""
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
        self._stiffness = model.actuator_gainprm[self.motors, 0]
        self._damping = -model.actuator_biasprm[self.motors, 2]
        # MuJoCo's states hold time, places, rates, activations.
        angles, rates = 1 + model.jnt_qposadr[self._axles], 1 + model.nq + self.axle_rates
        self._servos = np.stack([angles, rates, 1 + model.nq + model.nv + self._activations])
        lag, limits = self._damping / self._stiffness, _AT_LIMIT * self._torque_limits
        bounds = self.motors, self._activations, lag, self._reach, limits
        self._bounds = list(zip(*(part.tolist() for part in bounds), strict=True))
        self._parts: Array = np.empty((0, 1))
        self._change = np.zeros(int(model.nu))
        self._states = np.empty((1, mujoco.mj_stateSize(model, _STATE)))
        self._rollout = Rollout(nthread=0)
        self._mark_geoms()
        # Only what is awake is stepped, where MuJoCo can: rocks then cost next to nothing.
        model.opt.enableflags |= int(getattr(mujoco.mjtEnableBit, "mjENBL_SLEEP", 0))
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_SENSOR)  # nothing asks them

    def _mark_geoms(self) -> None:
        """Tell rocks, `rock_<id>`, wheels and the rest of the rover from other geoms."""
        model = self.model
        names = [model.geom(n).name for n in range(model.ngeom)]
        self._rocks = [
            "_".join(name.split("_")[:2]) if name.startswith("rock_") else "" for name in names
        ]
        is_rock = np.array([bool(name) for name in self._rocks])
        self._is_rover = model.body_rootid[model.geom_bodyid] == self._body
        of_body = np.full(model.nbody, -1)
        of_body[self._wheel_bodies] = np.arange(len(self._wheel_bodies))
        self._wheel_of = of_body[model.geom_bodyid]
        """Number of the wheel of each geom, -1 for the others."""
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
        mujoco.mj_step(self.model, data, round(_SETTLE_TIME / self.model.opt.timestep) - 1)
        self.settled = self._run(data.ctrl[None])[0].copy()
        self._noted = [self.settled[None, self._servos]]
        if not portable.norm(self.position - position) < _FARTHEST_SETTLING:
            raise SimulationError(f"the rover does not stand at its start, {_place(position)}")
        data.time = 0.0
        lift = self.rover.mass * _EARTH_GRAVITY * float(self._radii.mean())
        self._audit = EnergyAudit(reference=lift, energy=float(data.energy.sum()))
        self._energies = list[float]()
        self.saturated_steps = self.steps = 0

    def moved_to(self, model: Any) -> Vehicle:
        """The vehicle in another scene with the same ground here, as it stands and moves now.

        Raises:
            SimulationError: if that scene does not hold this rover.
        """
        other = Vehicle(model, self.rover)
        here, there = self.data, other.data
        mujoco.mj_resetData(model, there)
        mujoco.mj_setState(model, there, self._told_as_in(other, self.state), _STATE)
        there.ctrl[other.motors] = here.ctrl[self.motors]
        flags = model.opt.enableflags
        model.opt.enableflags = flags | _ENERGY
        mujoco.mj_forward(model, there)
        model.opt.enableflags = flags
        other._audit, other._noted, other._energies = self.audit, self._noted, []
        other._audit.go_on(float(there.energy.sum()))
        other.saturated_steps, other.steps = self.saturated_steps, self.steps
        if self.logger is not None:
            self.logger.go_on(other, lambda state: self._told_as_in(other, state))
            other.logger = self.logger
        return other

    def _told_as_in(self, other: Vehicle, state: Array) -> Array:
        """A state of this scene with the rover as it is told in another one's."""
        told = other.state
        for mine, theirs in zip(self._columns(), other._columns(), strict=True):
            told[theirs] = state[mine]
        return told

    def _columns(self) -> tuple[NDArray[np.int64], ...]:
        """Where states hold the time, and the rover's places, rates and activations."""
        places, rates = 1 + self.coordinates, 1 + self.model.nq + self._velocities
        activations = 1 + self.model.nq + self.model.nv + self._activations
        return np.zeros(1, np.int64), places, rates, activations

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
        data, motors = self.data, self.motors
        if len(self._parts) != count:
            self._parts = np.arange(1.0, count + 1.0)[:, None] * (1.0 / count)
        self._change[motors] = self.sides * wheel_rates - data.ctrl[motors]
        states = self._run(data.ctrl + self._parts * self._change)
        if self.logger is not None:
            self.logger.note(states)
        self._noted.append(states[:, self._servos])
        self._energies.append(float(data.energy[0] + data.energy[1]))
        if len(self._energies) >= _AUDITED:
            self._add_work()
        self._hold_back()
        self.steps += 1

    def _hold_back(self) -> None:
        """Keep the angles that the servos follow near wheels that are held.

        They run ahead of those, which would spin to catch up once they are free: they stay within
        the reach of the motors' torques. In plain numbers, which for a few wheels are quickest.
        """
        data = self.data
        angles, rates = data.actuator_length.tolist(), data.actuator_velocity.tolist()
        runs, forces, strained = data.act.tolist(), data.actuator_force.tolist(), False
        for motor, activation, lag, reach, limit in self._bounds:
            held = angles[motor] + lag * rates[motor]
            run = runs[activation]
            if not held - reach <= run <= held + reach:
                data.act[activation] = max(held - reach, min(run, held + reach))
            strained |= abs(forces[motor]) >= limit
        self.saturated_steps += strained

    def _run(self, commands: Array) -> Array:
        """Step with a row of controls at each step; the states before them, shape [steps, state].

        All steps but the last are one call; the last one finds the energy.
        """
        model, data = self.model, self.data
        if len(self._states) != len(commands):
            self._states = np.empty((len(commands), self._states.shape[1]))
        states = self._states
        mujoco.mj_getState(model, data, states[0], _STATE)
        if len(commands) > 1:
            self._rollout.rollout(
                [model],
                [data],
                states[None, 0],
                commands[None, :-1],
                initial_warmstart=data.qacc_warmstart[None],
                state=states[None, 1:],
                skip_checks=True,
                nstep=len(commands) - 1,
            )
        data.ctrl[:] = commands[-1]
        option = model.opt
        flags = option.enableflags
        option.enableflags = flags | _ENERGY
        mujoco.mj_step(model, data)
        option.enableflags = flags
        return states

    def _forces(self, servos: Array) -> Array:
        """The servos' torques at angles, rates and targets of wheels, shape [states, wheels]."""
        angles, rates, targets = servos[:, 0], servos[:, 1], servos[:, 2]
        held = -self._stiffness * angles - self._damping * rates
        limits = self._torque_limits
        return np.asarray(np.maximum(-limits, np.minimum(self._stiffness * targets + held, limits)))

    @property
    def audit(self) -> EnergyAudit:
        """The motors' work and the energy until now."""
        self._add_work()
        return self._audit

    def _add_work(self) -> None:
        """Tell the audit of the servos' work, by the force as each step began and rates around.

        The implicit integrator applies the damping that belongs to the rate at a step's end, unless
        the motor is at its limit, which then acts throughout.
        """
        if not self._energies:
            return
        noted = np.concatenate(self._noted)
        forces, rates = self._forces(noted[:-1]), noted[:, 1]
        limited = np.abs(forces) >= _AT_LIMIT * self._torque_limits
        change = np.where(limited, 0.0, self._damping * (rates[1:] - rates[:-1]))
        work = 0.5 * self.model.opt.timestep * (forces - change) * (rates[:-1] + rates[1:])
        begins = np.cumsum([0, *(len(states) for states in self._noted[1:-1])])
        driving, braking = (
            np.add.reduceat(part(work, 0.0).sum(axis=1), begins).tolist()
            for part in (np.maximum, np.minimum)
        )
        for pushed, braked, energy in zip(driving, braking, self._energies, strict=True):
            self._audit.add(driving=pushed, braking=braked, energy=energy)
        self._noted = [self._noted[-1][-1:]]
        self._energies.clear()

    @property
    def position(self) -> Array:
        """Origin of base_link in the world frame [m], shape [3]."""
        return np.array(self.data.xpos[self._body])

    @property
    def place(self) -> tuple[float, float]:
        """East and north of base_link's origin [m]."""
        east, north, _ = self.data.xpos[self._body].tolist()
        return east, north

    @property
    def turn_rate(self) -> float:
        """Turn rate of base_link about the vertical [rad/s]."""
        return float(self.data.cvel[self._body, 2])

    @property
    def wheel_rates(self) -> Array:
        """Rates of the wheels about their axles, forwards positive [rad/s], shape [wheels]."""
        return np.asarray(self.sides * self.data.qvel[self.axle_rates])

    @property
    def attitude(self) -> tuple[float, float]:
        """Yaw of base_link and its tilt from the vertical [rad]."""
        turn = self.data.xmat[self._body].tolist()
        return math.atan2(turn[3], turn[0]), math.acos(min(max(turn[8], -1.0), 1.0))

    @property
    def state(self) -> Array:
        """MuJoCo's state now, shape [state]."""
        state = np.empty(self._states.shape[1])
        mujoco.mj_getState(self.model, self.data, state, _STATE)
        return state

    def motion(self, states: Array) -> tuple[Array, Array, Array]:
        """Coordinates, rates of the axles [rad/s] and torques about them [N m] of some states."""
        angles, rates = states[:, 1 + self.coordinates], states[:, self._servos[1]]
        return angles, rates, self._forces(states[:, self._servos])

    def snapshot(self) -> Snapshot:
        """All that `states` needs, as it is now."""
        data, body, wheels = self.data, self._body, self._wheel_bodies
        return Snapshot(
            position=data.xpos[body].copy(),
            quaternion=data.xquat[body].copy(),
            centre=data.subtree_com[body].copy(),
            moving=data.cvel[wheels],
            wheel=data.xpos[wheels],
            push=pushes(data, self._wheel_of, len(wheels)),
            axle=data.xaxis[self._axles],
            rate=data.qvel[self.axle_rates],
            torque=data.actuator_force[self.motors],
            joint_angle=data.qpos[self._angles],
        )

    def states(self, taken: Sequence[Snapshot]) -> dict[str, NDArray[Any]]:
        """What rover and wheels did at some moments, as `DriveResult` names it."""
        return wheel_states(taken, sides=self.sides, radii=self._radii)

    def rock_forces(self) -> dict[str, tuple[float, bool]]:
        """Rocks that the rover touches now: largest normal force [N], whether its body touches."""
        data, forces = self.data, dict[str, tuple[float, bool]]()
        pairs = data.contact.geom
        kinds = self._kind.take(pairs)
        touched = (kinds[:, 0] + kinds[:, 1] == _ROCK + _ROVER).nonzero()[0].tolist()
        wrench = np.zeros(6)
        for contact in touched:
            one, other = pairs[contact]
            name = self._rocks[one] or self._rocks[other]
            mujoco.mj_contactForce(self.model, data, contact, wrench)
            force, by_body = forces.get(name, (0.0, False))
            by_wheel = max(self._wheel_of[one], self._wheel_of[other]) >= 0
            forces[name] = max(force, float(wrench[0])), bool(by_body or not by_wheel)
        return forces

    def fault(self) -> str:
        """What makes the simulation meaningless; empty if nothing does."""
        data = self.data
        warned = {kind for kind, times in enumerate(data.warning.number.tolist()) if times}
        if warned & _DROPPED:
            return "contacts were dropped (MuJoCo's memory is full)"
        if warned & _UNSTABLE:
            return "the simulation became unstable (a number is not finite or far too large)"
        if not math.isfinite(sum(data.qpos.tolist())):
            return "the simulation became unstable (a position is not finite)"
        if data.ncon >= _PAIR_LIMIT:
            own = data.contact.geom[self._is_rover[data.contact.geom].any(axis=1)]
            _, counts = np.unique(own, axis=0, return_counts=True)
            if counts.max(initial=0) >= _PAIR_LIMIT:
                return f"contacts were dropped (a pair of geoms has {_PAIR_LIMIT})"
        return self._audit.fault()


def _place(position: Array) -> str:
    return "({:.2f}, {:.2f}, {:.2f}) m".format(*position)
