"""Placing rocks on the ground: static ones are embedded, dynamic ones settle by physics.

Each dynamic rock settles alone, on its own piece of ground.

A geometrically stable pose is not one on rough ground: of rocks that are laid down on their stable
side most begin to rock or roll. So each is let go in MuJoCo, damped, until it hardly moves, and is
given its exact size in that very pose. Then gravity leans a little to all sides in turn, and the
rock is spun a little, undamped: one that is not where it was settles anew from where it then is.
One that leaves its space, or does not come to rest, is tried again: half turned about each of its
axes, then the same a little beside its place.

Meanwhile it has no rolling friction, though simulators that know of it are given some: a rock that
needs it to stay would roll away in all others.

The piece of ground is cut around the rock's own node of the lattice, so the result depends on
nothing but the rock and the ground beneath it: a window's rocks are those of the whole site.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import get_num_threads
from numpy.typing import NDArray

from terrain_forge.base import (
    Array,
    matrix_from_quaternion,
    mix,
    portable,
    uniforms,
    worker_threads,
)
from terrain_forge.model import Heightfield, RockField, RockLibrary, RockPrototype, Site
from terrain_forge.rocks.embedding.burial import burial_ranges
from terrain_forge.rocks.embedding.dynamic import dynamic_contact
from terrain_forge.rocks.embedding.embed import Lattice, embed, lattice, piece
from terrain_forge.rocks.embedding.footprint import fits, footprints
from terrain_forge.rocks.embedding.outline import mean_width
from terrain_forge.rocks.scattering.corridor import in_corridor
from terrain_forge.rocks.scattering.scatter import Scattered
from terrain_forge.rocks.scattering.size_classes import DYNAMIC_SPACE

TIMESTEP = 0.002
"""Time step in which rocks are tested [s]."""
TRIES = 8
"""How often a rock is let go: by each half turn at its place, then by each a little beside it."""

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
_TESTS = 8
_SHIFT = 0.003  # part of the diameter, in a test
_TURN = np.radians(0.3)  # in a test
_BASE = 1.0  # thickness of the ground [m]
_HALF_TURNS = np.array([np.eye(4)[0], np.eye(4)[3], np.eye(4)[1], np.eye(4)[2]])
"""None, then about z, x and y of the prototype."""
_BESIDE = 0.1  # part of the diameter, at most, east and north


def place_rocks(
    scattered: Scattered,
    *,
    site: Site,
    library: RockLibrary,
    ground: Heightfield,
    bare: Heightfield | None = None,
    settled: bool = True,
    progress: Callable[[float], None] | None = None,
) -> RockField:
    """The scattered rocks on the ground: static ones embedded, dynamic ones settled.

    Args:
        scattered: rocks with their places on the plane.
        site: the place.
        library: their shapes.
        ground: the ground under all of them.
        bare: the same without the soil that lies at rocks; by default `ground`.
        settled: whether to settle the dynamic ones; else they are embedded too.
        progress: called with the share of the dynamic ones that are settled, 0 to 1.
    """
    groups = site.recipe.rocks.groups
    density = np.array([group.density_kg_m3 or site.body.rock_density for group in groups])
    embedded = embed(
        scattered=scattered,
        library=library,
        ground=ground,
        density=density,
        burial=burial_ranges(site),
        bare=bare,
    )
    if not settled:
        return embedded
    reach = np.array([prototype.reach for prototype in library.prototypes])[embedded.prototype]
    near = DYNAMIC_SPACE * reach * embedded.diameter
    return settle(
        rocks=embedded,
        low=in_corridor(site, embedded.position[:, :2], reach=near),
        library=library,
        ground=ground,
        gravity=site.body.gravity,
        progress=progress,
    )


def settle(
    *,
    rocks: RockField,
    library: RockLibrary,
    ground: Heightfield,
    gravity: float,
    low: NDArray[np.bool_] | None = None,
    progress: Callable[[float], None] | None = None,
) -> RockField:
    """Settle dynamic rocks on the ground where they stay; their exposed diameters stay exact.

    A rock that comes to rest in none of its tries, or only outside its `DYNAMIC_SPACE`, stays a
    fixed one.

    Args:
        rocks: All rocks, embedded as static ones; `dynamic` tells which ones to settle.
        library: Their shapes.
        ground: Bare ground under all of them, with a margin of `scatter.margin` around the window.
        gravity: Gravity [m/s²].
        low: Which rocks may stand no higher than their prototype's rise, which is what keeps
            corridors clear, shape [rocks]; by default none. On rough ground others rest on humps.
        progress: Told the share of the dynamic rocks that have settled, now and then.

    Returns:
        The same rocks; of those that are `dynamic`, pose and size are the settled ones.
    """
    wanted = np.flatnonzero(rocks.dynamic)
    grid, supports = lattice(ground), footprints(library.prototypes, rocks.prototype[wanted])

    def settled(row: int) -> tuple[Pose, float] | None:
        n = int(rocks.prototype[row])
        rock = DynamicRock.of(rocks, row, library.prototypes[n], supports[n], gravity)
        if low is not None and low[row]:
            rock = rock._replace(highest=rock.prototype.rise * rock.diameter)
        return _settled(rock, grid, np.uint64(rocks.id[row]))

    found = []
    with worker_threads(get_num_threads()) as pool:
        for outcome in pool.map(settled, wanted.tolist()):
            found.append(outcome)
            if progress and len(found) % 16 == 0:
                progress(len(found) / len(wanted))
    columns = ("position", "quaternion", "scale", "height", "buried_fraction", "volume", "mass")
    new = {name: getattr(rocks, name).copy() for name in (*columns, "dynamic")}
    for row, outcome in zip(wanted.tolist(), found, strict=True):
        new["dynamic"][row] = outcome is not None
        if outcome is None:
            continue
        pose, new["height"][row] = outcome
        for name, value in pose._asdict().items():
            new[name][row] = value
        new["buried_fraction"][row] = 0.0
        new["volume"][row] = library.prototypes[rocks.prototype[row]].volume * pose.scale**3
        new["mass"][row] *= new["volume"][row] / rocks.volume[row]
    return rocks.replace(**new)


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


def _settled(rock: DynamicRock, grid: Lattice, key: np.uint64) -> tuple[Pose, float] | None:
    """The pose in the world in which a rock stays on its own, with its exact diameter.

    And its top above the ground's tangent plane [m]; None if it finds no such pose. `key` addresses
    where beside its place it is tried.
    """
    reach = DYNAMIC_SPACE * rock.prototype.reach * rock.diameter
    ground, place = piece(grid, centre=rock.position[:2], half_width=reach + grid.spacing)
    for attempt in range(TRIES):
        beside = np.zeros(3)
        if attempt >= len(_HALF_TURNS):
            beside[:2] = (
                _BESIDE * rock.diameter * (2.0 * uniforms(np.uint64(mix(key, attempt)), 2) - 1.0)
            )
        quaternion = _product(rock.quaternion, _HALF_TURNS[attempt % len(_HALF_TURNS)])
        start = _upright(rock, ground, rock.position + beside - place, quaternion)
        found = _rest(rock, ground, place, start)
        if found is not None:
            return found
    return None


def _rest(
    rock: DynamicRock, ground: Heightfield, place: Array, pose: Pose
) -> tuple[Pose, float] | None:
    """Where a rock that is let go on its piece of ground stays, in the world, and its top."""
    for _ in range(_TESTS):
        model, data = simulation(rock, ground, pose)
        _calm(rock, model, data)
        pose = _sized(rock, ground, _moved(pose, data))
        height = _top(rock, ground, pose)
        if not _in_its_space(rock, pose, place) or height > rock.highest:
            return None
        after = after_test(rock, ground, pose)
        if stays_put(rock, pose, after):
            return pose._replace(position=pose.position + place), height
        pose = after
    return None


def _product(a: Array, b: Array) -> Array:
    """The rotation `b`, then `a`, as quaternions."""
    w, x, y, z = a.tolist()
    left = np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])
    return np.asarray(portable.product(left, b))


def _upright(rock: DynamicRock, ground: Heightfield, position: Array, quaternion: Array) -> Pose:
    """The rock at a place, turned so, none of it below the ground."""
    turned = _turned(rock, quaternion)
    scale = rock.diameter / float(mean_width(turned[:, :2].copy()))
    corners = position + scale * turned
    sunk = float((_height(ground, corners) - corners[:, 2]).max())
    raised = np.array([*position[:2], position[2] + sunk])
    return Pose(position=raised, quaternion=quaternion, scale=scale)


def _turned(rock: DynamicRock, quaternion: Array) -> Array:
    """Vertices of a rock's prototype, turned, shape [vertices, 3]."""
    return portable.product(rock.prototype.meshes[0].vertices, matrix_from_quaternion(quaternion).T)


def _sized(rock: DynamicRock, ground: Heightfield, pose: Pose) -> Pose:
    """The rock with its exact diameter, grown from the ground under its centre of mass."""
    plan = _turned(rock, pose.quaternion)[:, :2]
    scale = rock.diameter / float(mean_width(plan.copy()))
    floor = float(_height(ground, pose.position[None])[0])
    raised = floor + (pose.position[2] - floor) * scale / pose.scale
    return pose._replace(position=np.array([*pose.position[:2], raised]), scale=scale)


def _in_its_space(rock: DynamicRock, pose: Pose, place: Array) -> bool:
    """Whether a rock is within the area that was kept free for it, and its reach of its place."""
    reach = rock.prototype.reach
    plan = pose.scale / rock.diameter * _turned(rock, pose.quaternion)[:, :2]
    moved = (pose.position + place - rock.position)[:2] / rock.diameter
    yaw = 2.0 * math.atan2(rock.quaternion[3], rock.quaternion[0])
    space = DYNAMIC_SPACE * rock.support
    near = fits(plan + moved, yaw=yaw, support=space, reach=DYNAMIC_SPACE * reach)
    return near and bool(np.hypot(plan[:, 0], plan[:, 1]).max() <= reach)


def stays_put(rock: DynamicRock, before: Pose, after: Pose) -> bool:
    """Whether a rock has hardly moved in a test."""
    shift = portable.norm(after.position - before.position)
    cosine = min(abs(float(portable.product(after.quaternion, before.quaternion))), 1.0)
    return bool(shift <= _SHIFT * rock.diameter and 2.0 * portable.arccos(cosine) <= _TURN)


def _moved(pose: Pose, data: Any) -> Pose:
    """The pose that a rock has come to."""
    return pose._replace(position=data.qpos[:3].copy(), quaternion=data.qpos[3:].copy())


def _calm(rock: DynamicRock, model: Any, data: Any) -> None:
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
    _calm(rock, model, data)
    leaned = _moved(pose, data)
    if not stays_put(rock, pose, leaned):
        return leaned
    model.dof_damping[:], model.opt.timestep = 0.0, TIMESTEP
    for spin in (_SPIN, -_SPIN):
        upward = matrix_from_quaternion(data.qpos[3:])[2]
        data.qvel[3:] = spin * np.sqrt(rock.gravity / rock.diameter) * upward
        mujoco.mj_step(model, data, nstep=round(_FREE_TIME / TIMESTEP))
    return _moved(pose, data)


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


def _height(ground: Heightfield, points: Array) -> Array:
    """Height of the ground under points [m], of its border beyond it."""
    west, south, east, north = ground.bounds
    x, y = np.clip(points[:, 0], west, east), np.clip(points[:, 1], south, north)
    return ground.height_at(x, y)


def _top(rock: DynamicRock, ground: Heightfield, pose: Pose) -> float:
    """Top of a rock above the ground's tangent plane under its centre of mass [m]."""
    normal = matrix_from_quaternion(rock.quaternion)[:, 2]
    vertices = pose.scale * rock.prototype.meshes[0].vertices
    turned = portable.product(vertices, matrix_from_quaternion(pose.quaternion).T)
    above = pose.position[2] - float(_height(ground, pose.position[None])[0])
    return float((portable.product(turned, normal)).max() / normal[2] + above)
