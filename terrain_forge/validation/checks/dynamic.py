"""Whether dynamic rocks stay where they lie when a simulator loads the exported world."""

from __future__ import annotations

from copy import copy
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, SimulationError, kernel_threads, silent_mujoco, worker_threads
from terrain_forge.driving import load_scene
from terrain_forge.model import Check, World, at_least, failed
from terrain_forge.validation.inspection import BuiltFolder, Inspection
from terrain_forge.validation.reading import rock_of

TIME = 5.0
"""How long dynamic rocks are watched [s]."""
MOST_SHIFT = 0.02
"""Part of its diameter by which a rock that stays may move."""
MOST_TURN = np.radians(3.0)
"""Angle by which a rock that stays may turn [rad]."""
STAYING = 0.95
"""Part of the dynamic rocks that must stay."""
MOST_WATCHED = 200
"""Dynamic rocks that are watched; of more, so many are taken evenly from all."""


class Stay(NamedTuple):
    """How far dynamic rocks moved under gravity alone."""

    id: NDArray[np.int32]
    """Ids of the dynamic rocks, shape [rocks]."""
    shift: Array
    """How far the centre of mass moved, over the diameter, shape [rocks]."""
    turn: Array
    """How far the rock turned [rad], shape [rocks]."""

    @property
    def stayed(self) -> NDArray[np.bool_]:
        """Which rocks stayed, shape [rocks]."""
        return np.asarray((self.shift <= MOST_SHIFT) & (self.turn <= MOST_TURN))


class Dynamic(Inspection):
    """Dynamic rocks of the exported MJCF after 5 s under gravity."""

    kind = "dynamic"
    group = "rocks"

    def checks(self, built: BuiltFolder) -> list[Check]:
        """How many dynamic rocks stay where they lie, where the world has any."""
        every = int(np.count_nonzero(built.world.field.dynamic))
        if not every:
            return []
        title = f"rocks: dynamic ones that stay for {TIME:g} s"
        try:
            if (folder := built.mjcf) is None:
                return []
            stay = watch(built.world, folder / "world.xml")
        except SimulationError as error:
            return [failed(title, str(error))]
        count, gone = len(stay.id), int(np.count_nonzero(~stay.stayed))
        worst = int(np.argmax(np.maximum(stay.shift / MOST_SHIFT, stay.turn / MOST_TURN)))
        note = (
            f"part of {count} of {every} within {MOST_SHIFT:.0%} of the diameter and "
            f"{np.degrees(MOST_TURN):g} deg; {gone} do not stay; rock {stay.id[worst]} moves most, "
            f"{stay.shift[worst]:.2%} and {np.degrees(stay.turn[worst]):.2g} deg"
        )
        return [at_least(title, 1.0 - gone / count, STAYING, note=note)]


@silent_mujoco()
def watch(world: World, scene: Path) -> Stay:
    """Let at most `MOST_WATCHED` dynamic rocks of an exported world.xml be for 5 s.

    Raises:
        SimulationError: if MuJoCo cannot load it, a dynamic rock is missing in it, or the
            simulation diverges.
    """
    model = load_scene(scene)
    rocks = world.field.select(world.field.dynamic)
    body = {rock_of(model.body(n).name): n for n in range(model.nbody)}
    missing = [rock for rock in rocks.id.tolist() if rock not in body]
    if missing:
        raise SimulationError(f"the exported world has no body of rock {missing[0]}")
    bodies = np.array([body[rock] for rock in rocks.id.tolist()])
    watched = np.unique(np.linspace(0, len(rocks) - 1, MOST_WATCHED).round().astype(np.intp))
    parts = np.array_split(watched, min(kernel_threads(), len(watched)))
    with worker_threads(len(parts)) as pool:
        moved = list(pool.map(lambda part: _let_be(model, bodies, part, scene), parts))
    shift, turn = np.concatenate(moved, axis=1)
    return Stay(id=rocks.id[watched], shift=shift / rocks.diameter[watched], turn=turn)


def _let_be(
    whole: Any, bodies: NDArray[np.intp], watched: NDArray[np.intp], scene: Path
) -> tuple[Array, Array]:
    """How far some of the dynamic rocks move [m] and turn [rad] where the others are not."""
    import mujoco

    model = copy(whole)
    absent = np.isin(model.geom_bodyid, np.delete(bodies, watched))
    model.geom_contype[absent] = model.geom_conaffinity[absent] = 0
    data, bodies = mujoco.MjData(model), bodies[watched]
    mujoco.mj_forward(model, data)
    position, quaternion = data.xpos[bodies].copy(), data.xquat[bodies].copy()
    mujoco.mj_step(model, data, nstep=round(TIME / model.opt.timestep))
    if data.warning.number.any():
        raise SimulationError(f"{scene}: MuJoCo warns while the dynamic rocks rest")
    cosine = np.abs((data.xquat[bodies] * quaternion).sum(axis=1))
    shift = np.linalg.norm(data.xpos[bodies] - position, axis=1)
    return shift, 2.0 * np.arccos(np.minimum(cosine, 1.0))
