"""The rover in a loaded MuJoCo scene: its parts, how it is set down, what it touches."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from terrain_forge.errors import SimulationError
from terrain_forge.rovers.description import Rover

Array = NDArray[np.float64]

_PAIR_LIMIT = 50
"""Contacts of one pair of geoms that MuJoCo keeps; it drops more without a warning."""
_SETTLE_TIME = 1.5
_HIGHEST_LIFT, _LIFT_STEP = 0.3, 0.02
_FARTHEST_SETTLING = 0.5


class Vehicle:
    """A rover's handles into a MuJoCo model and its state.

    Raises:
        SimulationError: if the scene does not hold this rover.
    """

    def __init__(self, model: Any, rover: Rover) -> None:
        self.model = model
        self.data = mujoco.MjData(model)
        self._body = self._find(mujoco.mjtObj.mjOBJ_BODY, rover.links[0].name)
        self._qpos = int(model.jnt_qposadr[model.body_jntadr[self._body]])
        self._motors = [
            self._find(mujoco.mjtObj.mjOBJ_ACTUATOR, wheel.link) for wheel in rover.wheels
        ]
        self._rocks = _rock_names(model)
        self._is_rock = np.array([bool(name) for name in self._rocks])
        self._is_rover = model.body_rootid[model.geom_bodyid] == self._body
        # Stepping only what is awake: rocks then cost next to nothing.
        if hasattr(mujoco.mjtEnableBit, "mjENBL_SLEEP"):
            model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_SLEEP)

    def _find(self, kind: Any, name: str) -> int:
        index = mujoco.mj_name2id(self.model, kind, name)
        if index < 0:
            raise SimulationError(f"the scene has no {kind.name[6:].lower()} named {name!r}")
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
        while self._is_in_something():
            data.qpos[self._qpos + 2] += _LIFT_STEP
            if data.qpos[self._qpos + 2] > position[2] + _HIGHEST_LIFT:
                raise SimulationError(f"the rover's start at {_place(position)} is not free")
            mujoco.mj_forward(self.model, data)
        data.ctrl[self._motors] = 0.0
        mujoco.mj_step(self.model, data, round(_SETTLE_TIME / self.model.opt.timestep))
        if not np.linalg.norm(self.position - position) < _FARTHEST_SETTLING:
            raise SimulationError(f"the rover does not stand at its start, {_place(position)}")
        data.time = 0.0

    def _is_in_something(self) -> bool:
        """Whether a part of the rover reaches into the ground or a rock."""
        own = self._is_rover[self.data.contact.geom].any(axis=1)
        return bool((self.data.contact.dist[own] < 0.0).any())

    def step(self, wheel_rates: Array, count: int) -> None:
        """Command the wheels [rad/s] and take so many time steps."""
        self.data.ctrl[self._motors] = wheel_rates
        mujoco.mj_step(self.model, self.data, count)

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

    def rock_forces(self) -> dict[str, float]:
        """Rocks that the rover touches now, with the largest normal force at each [N]."""
        data, forces = self.data, dict[str, float]()
        pairs = data.contact.geom
        touched = self._is_rover[pairs].any(axis=1) & self._is_rock[pairs].any(axis=1)
        wrench = np.zeros(6)
        for contact in touched.nonzero()[0]:
            one, other = data.contact.geom[contact]
            name = self._rocks[one] or self._rocks[other]
            mujoco.mj_contactForce(self.model, data, int(contact), wrench)
            forces[name] = max(forces.get(name, 0.0), float(wrench[0]))
        return forces

    def fault(self) -> str:
        """What makes the simulation meaningless; empty if nothing does."""
        data = self.data
        for warning in (mujoco.mjtWarning.mjWARN_CONTACTFULL, mujoco.mjtWarning.mjWARN_CNSTRFULL):
            if data.warning[warning].number:
                return "contacts were dropped (MuJoCo's memory is full)"
        bad = ("BADQPOS", "BADQVEL", "BADQACC")
        if any(data.warning[getattr(mujoco.mjtWarning, f"mjWARN_{b}")].number for b in bad):
            return "the simulation became unstable"
        if not np.isfinite(data.qpos).all():
            return "the simulation became unstable"
        if data.ncon >= _PAIR_LIMIT:
            own = data.contact.geom[self._is_rover[data.contact.geom].any(axis=1)]
            _, counts = np.unique(own, axis=0, return_counts=True)
            if counts.max(initial=0) >= _PAIR_LIMIT:
                return f"contacts were dropped (a pair of geoms has {_PAIR_LIMIT})"
        return ""


def _place(position: Array) -> str:
    return "({:.2f}, {:.2f}, {:.2f}) m".format(*position)


def _rock_names(model: Any) -> list[str]:
    """The rock that each geom is part of, `rock_<id>`; empty for other geoms."""
    names = [model.geom(n).name for n in range(model.ngeom)]
    return ["_".join(name.split("_")[:2]) if name.startswith("rock_") else "" for name in names]
