"""Loose rocks come to rest: each one settles by physics, alone on its own piece of ground.

A geometrically stable pose is not one on rough ground: of rocks that are laid down on their stable
side most begin to rock or roll. So each is let go in MuJoCo, damped first, until it stays where it
is for as long as the test lasts. Then it is given its exact size in that very pose, and tested
again from standstill, as a simulator will find it.

The piece of ground is cut around the rock's own node of the lattice, so the result depends on
nothing but the rock and the ground beneath it: a window's rocks are those of the whole site.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import get_num_threads
from numpy.typing import NDArray

from terrain_forge.errors import RecipeError
from terrain_forge.frames import matrix_from_quaternion
from terrain_forge.records import Record
from terrain_forge.rocks.contact import LooseContact, loose_contact
from terrain_forge.rocks.lattice import Lattice, lattice, piece
from terrain_forge.rocks.outline import FOOTPRINT_DIRECTIONS, fits, footprint, mean_width
from terrain_forge.rocks.size_classes import LOOSE_ROOM
from terrain_forge.world import Heightfield, RockField, RockLibrary, RockPrototype

if TYPE_CHECKING:
    from terrain_forge.recipe import Recipe

Array = NDArray[np.float64]

MOST_LOOSE = 5000
"""Loose rocks of a site; each takes about 50 ms of a processor's core."""
LARGEST_LOOSE = 8.0
"""Largest diameter of a loose rock, in spacings of the ground: MuJoCo takes 50 contacts between a
rock and the ground, and a wider rock can have more, of which it then loses some."""
TIMESTEP = 0.002
"""Time step in which rocks settle [s]."""

_DAMPING = 5.0  # [1/s]
_DAMPED_TIME = 4.0  # [s]
_LOOK = 0.25  # [s]
_TEST_TIME = 2.0  # [s]
_TESTS = 8
_STILL = 2e-4  # part of the diameter, in a look
_SHIFT = 0.004  # part of the diameter, in a test
_TURN = np.radians(0.6)  # in a test
_BASE = 1.0  # thickness of the ground [m]


def require_loose(recipe: Recipe) -> None:
    """Refuse loose rocks that are too large for the ground's lattice, or too many.

    Raises:
        RecipeError: with what was found and what is allowed.
    """
    area = recipe.dtm.size_m[0] * recipe.dtm.size_m[1]
    spacing = recipe.terrain.spacing_m
    count = 0.0
    for number, population in enumerate(recipe.rocks.populations):
        if population.loose_m is None:
            continue
        key = ("rocks", "populations", number, "loose_m")
        smallest, largest = population.diameter_range(area)
        low, high = max(smallest, population.loose_m[0]), min(largest, population.loose_m[1])
        if high > LARGEST_LOOSE * spacing:
            raise RecipeError(
                f"loose rocks of up to {high:.3g} m, at most {LARGEST_LOOSE:g} times the ground's "
                f"spacing, {LARGEST_LOOSE * spacing:.3g} m: larger ones lose contacts in MuJoCo",
                key=key,
            )
        law = population.size_frequency
        count += area * float(law.cumulative_number(low) - law.cumulative_number(high))
        if count > MOST_LOOSE:
            raise RecipeError(
                f"about {count:.3g} loose rocks, at most {MOST_LOOSE}: settling one takes about "
                "50 ms; raise the smallest diameter",
                key=key,
            )


def settle(
    *,
    rocks: RockField,
    library: RockLibrary,
    ground: Heightfield,
    gravity: float,
    progress: Callable[[float], None] | None = None,
) -> RockField:
    """Lay loose rocks on the ground where they stay; their exposed diameters stay exact.

    A rock that does not come to rest, or only outside its room (`size_classes.LOOSE_ROOM`), stays
    as it is, a fixed one.

    Args:
        rocks: All rocks, laid down as fixed ones (`rest`); `loose` tells which ones to settle.
        library: Their shapes.
        ground: Bare ground under all of them, with a margin of `scatter.margin` around the window.
        gravity: Gravity [m/s²].
        progress: Told the share of the loose rocks that have settled, now and then.

    Returns:
        The same rocks; of those that are `loose`, pose and size are the settled ones.
    """
    wanted = np.flatnonzero(rocks.loose)
    grid = lattice(ground)
    supports = {
        n: footprint(library.prototypes[n].meshes[0])
        for n in np.unique(rocks.prototype[wanted]).tolist()
    }

    def settled(row: int) -> _Settled | None:
        prototype = int(rocks.prototype[row])
        rock = _rock(rocks, row, library.prototypes[prototype], supports[prototype], gravity)
        return _settled(rock, grid)

    found = []
    with ThreadPoolExecutor(get_num_threads()) as pool:
        for outcome in pool.map(settled, wanted.tolist()):
            found.append(outcome)
            if progress and len(found) % 16 == 0:
                progress(len(found) / len(wanted))
    return _with_poses(rocks, library, wanted, found)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Rock(Record):
    """A rock that is to be settled."""

    prototype: RockPrototype
    """Its shape."""
    diameter: float
    """Exposed diameter that it must have [m]."""
    density: float
    """Density [kg/m³]."""
    position: Array
    """Centre of mass as a fixed rock, in the world frame [m], shape [3]."""
    quaternion: Array
    """Rotation as a fixed rock, shape [4]."""
    support: Array
    """Support function of its footprint over the diameter, as `outline.footprint` has it."""
    gravity: float
    """Gravity [m/s²]."""

    def __post_init__(self) -> None:
        self.freeze("position", np.float64, (3,))
        self.freeze("quaternion", np.float64, (4,))
        self.freeze("support", np.float64, (FOOTPRINT_DIRECTIONS,))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Pose(Record):
    """A rock on its piece of ground, in that piece's coordinates."""

    position: Array
    """Centre of mass [m], shape [3]."""
    quaternion: Array
    """Rotation from the prototype's axes, shape [4]."""
    scale: float
    """Size in units of the prototype."""

    def __post_init__(self) -> None:
        self.freeze("position", np.float64, (3,))
        self.freeze("quaternion", np.float64, (4,))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Settled(Record):
    """A rock that has come to rest."""

    pose: _Pose
    """How it lies on its piece of ground."""
    place: Array
    """Where the origin of that piece is in the world frame [m], shape [3]."""
    height: float
    """Top of the rock above the ground's tangent plane [m]."""

    def __post_init__(self) -> None:
        self.freeze("place", np.float64, (3,))


def _rock(
    rocks: RockField, row: int, prototype: RockPrototype, support: Array, gravity: float
) -> _Rock:
    return _Rock(
        prototype=prototype,
        diameter=float(rocks.diameter[row]),
        density=float(rocks.mass[row] / rocks.volume[row]),
        position=rocks.position[row],
        quaternion=rocks.quaternion[row],
        support=support,
        gravity=gravity,
    )


def _settled(rock: _Rock, grid: Lattice) -> _Settled | None:
    """The pose in which a rock stays on its own, with its exact diameter; None if it finds none."""
    room = LOOSE_ROOM * rock.prototype.reach * rock.diameter
    ground, place = piece(grid, centre=rock.position[:2], half_width=room + grid.spacing)
    pose = _laid_down(rock, ground, rock.position - place)
    pose = _run(rock, ground, pose, seconds=_DAMPED_TIME, damping=_DAMPING)
    for _ in range(_TESTS):
        pose = _sized(rock, ground, pose)
        height = _top(rock, ground, pose)
        # No rock stands higher than its rise, which keeps corridors clear.
        if not _in_room(rock, pose, place) or height > rock.prototype.rise * rock.diameter:
            return None
        after = _run(rock, ground, pose, seconds=_TEST_TIME)
        if _stays(rock, pose, after):
            return _Settled(pose=pose, place=place, height=height)
        pose = after
    return None


def _laid_down(rock: _Rock, ground: Heightfield, position: Array) -> _Pose:
    """The rock upright on its tangent plane, none of it below the ground."""
    turn = matrix_from_quaternion(rock.quaternion)
    turned = rock.prototype.meshes[0].vertices @ turn.T
    scale = rock.diameter / float(mean_width(turned[:, :2].copy()))
    corners = position + scale * turned
    sunk = float((_height(ground, corners) - corners[:, 2]).max())
    raised = np.array([*position[:2], position[2] + sunk])
    return _Pose(position=raised, quaternion=rock.quaternion, scale=scale)


def _sized(rock: _Rock, ground: Heightfield, pose: _Pose) -> _Pose:
    """The rock with its exact diameter, grown from the ground under its centre of mass.

    A rock at rest has the centre of what carries it there.
    """
    turn = matrix_from_quaternion(pose.quaternion)
    plan = rock.prototype.meshes[0].vertices @ turn[:2].T
    scale = rock.diameter / float(mean_width(plan))
    floor = float(_height(ground, pose.position[None])[0])
    raised = floor + (pose.position[2] - floor) * scale / pose.scale
    return pose.replace(position=np.array([*pose.position[:2], raised]), scale=scale)


def _in_room(rock: _Rock, pose: _Pose, place: Array) -> bool:
    """Whether a rock, seen from above, is within the area that was kept free for it.

    It must also be within its prototype's reach of where it now is, which windows go by.
    """
    reach = rock.prototype.reach
    turned = rock.prototype.meshes[0].vertices @ matrix_from_quaternion(pose.quaternion)[:2].T
    plan = pose.scale / rock.diameter * turned
    moved = (pose.position + place - rock.position)[:2] / rock.diameter
    yaw = 2.0 * np.arctan2(rock.quaternion[3], rock.quaternion[0])
    room = LOOSE_ROOM * rock.support
    near = fits(plan + moved, yaw=yaw, support=room, reach=LOOSE_ROOM * reach)
    return near and bool(np.hypot(plan[:, 0], plan[:, 1]).max() <= reach)


def _stays(rock: _Rock, before: _Pose, after: _Pose) -> bool:
    """Whether a rock has hardly moved in a test."""
    shift = np.linalg.norm(after.position - before.position)
    cosine = min(abs(float(after.quaternion @ before.quaternion)), 1.0)
    return bool(shift <= _SHIFT * rock.diameter and 2.0 * np.arccos(cosine) <= _TURN)


def _run(
    rock: _Rock, ground: Heightfield, pose: _Pose, *, seconds: float, damping: float = 0.0
) -> _Pose:
    """Let a rock go from standstill; while damped, until it hardly moves."""
    import mujoco

    model = _model(rock, ground, pose, damping)
    data = mujoco.MjData(model)
    last = data.qpos.copy()
    for _ in range(round(seconds / _LOOK)):
        mujoco.mj_step(model, data, nstep=round(_LOOK / TIMESTEP))
        moved = np.abs(data.qpos - last).max()
        if damping and moved < _STILL * rock.diameter:
            break
        last = data.qpos.copy()
    return pose.replace(position=data.qpos[:3], quaternion=data.qpos[3:])


def _model(rock: _Rock, ground: Heightfield, pose: _Pose, damping: float) -> Any:
    """The rock on its piece of ground, as a compiled MuJoCo model."""
    import mujoco

    spec = mujoco.MjSpec()
    contact = loose_contact(rock.diameter)
    spec.option.timestep = TIMESTEP
    spec.option.gravity = (0.0, 0.0, -rock.gravity)
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = contact.impratio
    _add_ground(spec, ground, contact)
    body = spec.worldbody.add_body(pos=pose.position, quat=pose.quaternion)
    mass = rock.density * rock.prototype.volume * pose.scale**3
    inertia = rock.density * rock.prototype.inertia * pose.scale**5
    body.explicitinertial, body.ipos, body.mass = True, (0.0, 0.0, 0.0), mass
    body.fullinertia = [inertia[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
    body.add_freejoint()
    for n, hull in enumerate(rock.prototype.hulls):
        spec.add_mesh(
            name=f"hull_{n}",
            uservert=pose.scale * hull.vertices.ravel(),
            userface=hull.faces.ravel(),
        )
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=f"hull_{n}",
            contype=1,
            conaffinity=0,
            condim=contact.condim,
            friction=contact.friction,
            solref=contact.solref,
        )
    model = spec.compile()
    model.dof_damping[:3] = damping * mass
    model.dof_damping[3:] = damping * np.trace(inertia) / 3.0
    return model


def _add_ground(spec: Any, ground: Heightfield, contact: LooseContact) -> None:
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
        friction=contact.friction,
        solref=contact.solref,
    )


def _height(ground: Heightfield, points: Array) -> Array:
    """Height of the ground under points [m], of its border beyond it."""
    west, south, east, north = ground.bounds
    x, y = np.clip(points[:, 0], west, east), np.clip(points[:, 1], south, north)
    return ground.height_at(x, y)


def _top(rock: _Rock, ground: Heightfield, pose: _Pose) -> float:
    """Top of a rock above the ground's tangent plane under its centre of mass [m]."""
    normal = matrix_from_quaternion(rock.quaternion)[:, 2]
    turned = (
        pose.scale * rock.prototype.meshes[0].vertices @ matrix_from_quaternion(pose.quaternion).T
    )
    above = pose.position[2] - float(_height(ground, pose.position[None])[0])
    return float((turned @ normal).max() / normal[2] + above)


def _with_poses(
    rocks: RockField,
    library: RockLibrary,
    rows: NDArray[np.intp],
    outcomes: list[_Settled | None],
) -> RockField:
    """The rocks with the poses that were found; those without one are fixed."""
    columns = ("position", "quaternion", "scale", "height", "buried_fraction", "volume", "mass")
    new = {name: getattr(rocks, name).copy() for name in (*columns, "loose")}
    for row, found in zip(rows.tolist(), outcomes, strict=True):
        new["loose"][row] = found is not None
        if found is None:
            continue
        volume = library.prototypes[rocks.prototype[row]].volume * found.pose.scale**3
        new["position"][row] = found.pose.position + found.place
        new["quaternion"][row] = found.pose.quaternion
        new["scale"][row], new["height"][row] = found.pose.scale, found.height
        new["buried_fraction"][row] = 0.0
        new["mass"][row] *= volume / rocks.volume[row]
        new["volume"][row] = volume
    return rocks.replace(**new)
