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
import pickle
from collections.abc import Callable
from contextlib import suppress
from dataclasses import fields
from hashlib import blake2b

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import (
    Array,
    kernel_threads,
    matrix_from_quaternion,
    mix,
    portable,
    remembered,
    silent_mujoco,
    uniforms,
    worker_threads,
)
from terrain_forge.model import Heightfield, RockField, RockLibrary, RockPrototype, Site
from terrain_forge.rocks.embedding.burial import burial_ranges
from terrain_forge.rocks.embedding.embed import embed
from terrain_forge.rocks.embedding.footprint import fits, footprints
from terrain_forge.rocks.embedding.lattice import Lattice, lattice, piece
from terrain_forge.rocks.embedding.outline import mean_width
from terrain_forge.rocks.scattering.corridor import in_corridor
from terrain_forge.rocks.scattering.scatter import Scattered
from terrain_forge.rocks.scattering.size_classes import DYNAMIC_SPACE
from terrain_forge.rocks.stability import (
    DynamicRock,
    Pose,
    after_test,
    calm,
    moved,
    simulation,
    stays_put,
)

TRIES = 8
"""How often a rock is let go: by each half turn at its place, then by each a little beside it."""

_TESTS = 8
_HALF_TURNS = np.array([np.eye(4)[0], np.eye(4)[3], np.eye(4)[1], np.eye(4)[2]])
"""None, then about z, x and y of the prototype."""
_MOST_KNOWN = 100_000
_known: dict[bytes, tuple[Pose, float] | None] = {}
"""Where rocks came to rest, by all that it depends on: tiles beside a path are made again."""
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
    with worker_threads(kernel_threads()) as pool:
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


def _settled(rock: DynamicRock, grid: Lattice, key: np.uint64) -> tuple[Pose, float] | None:
    """The pose in the world in which a rock stays on its own, with its exact diameter.

    And its top above the ground's tangent plane [m]; None if it finds no such pose. `key` addresses
    where beside its place it is tried.
    """
    reach = DYNAMIC_SPACE * rock.prototype.reach * rock.diameter
    ground, place = piece(grid, centre=rock.position[:2], half_width=reach + grid.spacing)
    land = ground.elevation, ground.origin, ground.spacing, place
    shape, *rest = rock
    name = _hash((_shape_hash(shape), rest, land, key, TRIES))
    with suppress(KeyError):  # another thread may empty it at any time
        return _known[name]
    found = _tried(rock, ground, place, key)
    if len(_known) >= _MOST_KNOWN:
        _known.clear()
    _known[name] = found
    return found


@remembered
def _shape_hash(prototype: RockPrototype) -> bytes:
    """Of a shape's own fields: what else is remembered of it comes and goes."""
    return _hash([getattr(prototype, field.name) for field in fields(prototype)])


def _hash(what: object) -> bytes:
    return blake2b(pickle.dumps(what), digest_size=16).digest()


def _tried(
    rock: DynamicRock, ground: Heightfield, place: Array, key: np.uint64
) -> tuple[Pose, float] | None:
    """As `_settled`, by letting the rock go on its piece of ground, which lies at `place`."""
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


@silent_mujoco()
def _rest(
    rock: DynamicRock, ground: Heightfield, place: Array, pose: Pose
) -> tuple[Pose, float] | None:
    """Where a rock that is let go on its piece of ground stays, in the world, and its top."""
    for _ in range(_TESTS):
        model, data = simulation(rock, ground, pose)
        calm(rock, model, data)
        pose = _sized(rock, ground, moved(pose, data))
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
