"""One world to drive in: its MuJoCo model, and what is asked of its ground at each step."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import (
    Array,
    Mask,
    OutputError,
    load_model,
    quaternion_from_rpy,
    silent_mujoco,
)
from terrain_forge.building import exports_in, read_manifest
from terrain_forge.model import MANIFEST, Rover, World
from terrain_forge.paths import IMPASSABLE, stand
from terrain_forge.truth import rate_world, rock_rasters
from terrain_forge.variation import read_summary

KEPT = 32
"""Worlds that a process keeps loaded."""
_LIFT, _HIGHEST = 0.02, 0.4


@dataclass(frozen=True, kw_only=True, eq=False)
class Arena:
    """A built world, loaded."""

    folder: Path
    """Folder of the world."""
    written: int
    """When its manifest was written [ns]; a world made anew in its folder is another one."""
    model: Any
    """MuJoCo's model of its scene."""
    data: Any
    """MuJoCo's state, which no other environment has."""
    rover: Rover
    """Who drives."""
    world: World
    """The world."""
    top: NDArray[np.float32]
    """Height of ground and rocks at the nodes [m], shape [rows, columns]."""
    ways: NDArray[np.int32]
    """Connected areas where the rover's centre can be, from 1; 0 elsewhere; as `top`."""
    difficulty: float | None
    """The difficulty that was wished, where there is one."""

    @property
    def origin(self) -> tuple[float, float]:
        """East and north of the first node [m]."""
        return self.world.ground.origin

    @property
    def spacing(self) -> float:
        """Distance of nodes [m]."""
        return self.world.ground.spacing

    def place_of(self, node: NDArray[np.int64]) -> Array:
        """East and north of a node's row and column [m], shape [2]."""
        return np.asarray(np.array(self.origin) + self.spacing * node[::-1])

    def set_down(self, parts: Parts, place: Array, heading: float) -> None:
        """Reset the simulation with the rover at a place [m] and heading [rad], on the ground."""
        data, model = self.data, self.model
        height, rpy = stand(self.world.ground, self.rover, place[None], np.array([heading]))
        mujoco.mj_resetData(model, data)
        quaternion = quaternion_from_rpy(rpy[0])
        data.qpos[parts.pose] = (*place, float(height[0]), *quaternion)
        lifted = 0.0
        mujoco.mj_forward(model, data)
        while lifted < _HIGHEST and self._is_inside(parts):
            lifted += _LIFT
            data.qpos[parts.pose.start + 2] += _LIFT
            mujoco.mj_forward(model, data)

    @silent_mujoco()
    def advance(self, steps: int) -> None:
        """Simulate so many time steps, with bodies where `qpos` then has them."""
        mujoco.mj_step(self.model, self.data, steps)
        mujoco.mj_kinematics(self.model, self.data)  # a step leaves them where it began

    def _is_inside(self, parts: Parts) -> bool:
        contact = self.data.contact
        own = parts.is_rover[contact.geom].any(axis=1)
        return bool((own & (contact.dist < 0.0)).any())


@dataclass(frozen=True, kw_only=True, eq=False)
class Parts:
    """Where MuJoCo's arrays hold what is the rover's."""

    body: int
    """Its root."""
    pose: slice
    """Its pose in `qpos`."""
    velocity: slice
    """Its velocity in `qvel`: linear in the world's axes, then angular in its own."""
    motors: NDArray[np.int64]
    """Its wheels' actuators."""
    wheels: NDArray[np.int64]
    """Its wheels' bodies, whose origins lie on the axles."""
    axles: NDArray[np.int64]
    """Their rates in `qvel`."""
    sides: Array
    """1 for wheels whose axle points left, -1 for the others."""
    activations: NDArray[np.int64]
    """Their angles in `act`."""
    reach: Array
    """How far these may run ahead of the wheels [rad]."""
    lag: Array
    """Damping over stiffness of the servos [s]."""
    is_rover: Mask
    """Which geoms are its."""


def find_parts(model: Any, rover: Rover) -> Parts:
    """The rover in a model.

    Raises:
        OutputError: if the model has no such rover.
    """
    try:
        body = model.body(rover.links[0].name).id
        names = [wheel.link for wheel in rover.wheels]
        motors = np.array([model.actuator(name).id for name in names], np.int64)
        axles = np.array([model.joint(name).dofadr[0] for name in names], np.int64)
    except (KeyError, IndexError) as error:
        raise OutputError(f"the scene does not hold the rover {rover.name!r}: {error}") from None
    axes = {link.name: link.axis for link in rover.links}
    joint = model.body_jntadr[body]
    pose, velocity = int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
    stiffness = model.actuator_gainprm[motors, 0]
    return Parts(
        body=int(body),
        pose=slice(pose, pose + 7),
        velocity=slice(velocity, velocity + 6),
        motors=motors,
        wheels=np.array([model.body(name).id for name in names], np.int64),
        axles=axles,
        sides=np.array([1.0 if axes[name][1] > 0.0 else -1.0 for name in names]),
        activations=np.asarray(model.actuator_actadr[motors], np.int64),
        reach=model.actuator_forcerange[motors, 1] / stiffness,
        lag=-model.actuator_biasprm[motors, 2] / stiffness,
        is_rover=np.asarray(model.body_rootid[model.geom_bodyid] == body),
    )


def load_arena(folder: Path) -> Arena:
    """A built world with an MJCF export, loaded, with a state of its own.

    Raises:
        OutputError: if the folder holds no such world, or not all of it, or its rover has no
            wheels.
    """
    manifest = folder / MANIFEST
    loaded = _load(folder, manifest.stat().st_mtime_ns if manifest.is_file() else 0)
    return replace(loaded, data=mujoco.MjData(loaded.model))


@lru_cache(maxsize=KEPT)
def _load(folder: Path, written: int) -> Arena:
    """The world, which a process keeps, without a state: environments share the rest."""
    from scipy.ndimage import label

    kinds = {export.kind: export.folder for export in exports_in(read_manifest(folder))}
    if "mjcf" not in kinds:
        raise OutputError(f"{folder} has no MJCF export: make the worlds with exports: [mjcf]")
    world = World.load(folder)
    if not world.rover.wheels:
        raise OutputError(f"{folder}: the rover {world.rover.name!r} has no wheels")
    try:
        model = load_model(folder / kinds["mjcf"] / "scene.xml")
    except ValueError as error:
        why = " ".join(str(error).split())
        raise OutputError(f"{folder} is not whole, make it again: MuJoCo says {why}") from None
    model.opt.enableflags |= int(getattr(mujoco.mjtEnableBit, "mjENBL_SLEEP", 0))
    cost = rate_world(world).cost
    ways, _ = label((cost >= 0.0) & (cost < IMPASSABLE))
    drawn = (folder / "drawn.json").is_file()
    return Arena(
        folder=folder,
        written=written,
        model=model,
        data=None,
        rover=world.rover,
        world=world,
        top=rock_rasters(world)[0],
        ways=np.asarray(ways, np.int32),
        difficulty=read_summary(folder)["difficulty"] if drawn else None,
    )
