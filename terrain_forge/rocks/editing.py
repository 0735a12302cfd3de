"""Changing a finished world by hand: rocks added and rocks taken away.

An edit returns a new World and leaves the old one as it was. Truth, exports and a saved world
follow the edit; the recipe does not know of it, so an edited world is kept by saving it
(`write_world`).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import MAX_NAME, DataError, Mask, checked, is_file_name
from terrain_forge.model import RockField, World, merge
from terrain_forge.rocks.embedding.embed import embed
from terrain_forge.rocks.embedding.outline import MAX_BURIED
from terrain_forge.rocks.populations import LAST_ID, MAX_ROCKS
from terrain_forge.rocks.scattering.overlap import overlapping_pairs
from terrain_forge.rocks.scattering.scatter import Scattered
from terrain_forge.rocks.settling import settle

BY_HAND = "by hand"
"""The population of rocks that were added by hand, unless they are given another."""


@checked
def add_rock(
    world: World,
    *,
    east: float,
    north: float,
    diameter: float,
    prototype: int = 0,
    yaw: float = 0.0,
    buried_fraction: float = 0.3,
    population: str = BY_HAND,
    density: float | None = None,
    dynamic: bool = False,
    may_overlap: bool = False,
) -> World:
    """The world with one more rock, laid on the ground as the scattered ones are.

    Its id follows those of all rocks of the site and of those added before, so no other rock's id
    changes. A population that the world does not have yet is appended, in the body's rock colour.

    Args:
        world: The world, which stays as it is.
        east: East coordinate of the centre of mass [m].
        north: North coordinate of the centre of mass [m].
        diameter: Exposed plan diameter [m].
        prototype: Index of the shape in the world's library.
        yaw: Turn about the ground's normal [rad].
        buried_fraction: Part of the rock's extent below the ground, 0 to 0.6; more where the ground
            falls away beneath it.
        population: Name of the population that it joins.
        density: Density [kg/m³]; by default that of the population or else of the body's rocks.
        dynamic: Whether it lies on the ground as a body that can be pushed, settled where it stays,
            rather than buried.
        may_overlap: Whether it may overlap other rocks, seen from above.

    Raises:
        DataError: for values out of range, a rock that could reach beyond the world's ground, one
            that overlaps another, or a dynamic one that finds no rest there.
    """
    last = len(world.library.prototypes) - 1
    for fine, found in (
        (0 <= prototype <= last, f"prototype {prototype}: the library's shapes are 0 to {last}"),
        (0.0 < diameter < np.inf, f"diameter {diameter:g} m: must be above 0"),
        (np.isfinite(yaw), f"yaw {yaw:g} rad: must be finite"),
        (
            density is None or 0.0 < density < np.inf,
            f"density {density or 0.0:g} kg/m³: must be above 0",
        ),
        (
            0.0 <= buried_fraction <= MAX_BURIED,
            f"buried fraction {buried_fraction:g}: 0 to {MAX_BURIED:g} is allowed",
        ),
    ):
        if not fine:
            raise DataError(found)
    _check_place(world, east, north, world.library.prototypes[prototype].reach * diameter)
    world = _with_population(world, population)
    scattered = Scattered(
        populations=(population,),
        id=np.array([_next_id(world)]),
        population=np.array([0]),
        prototype=np.array([prototype]),
        xy=np.array([[east, north]]),
        yaw=np.array([yaw]),
        buried=np.array([buried_fraction]),
        diameter=np.array([diameter]),
        dynamic=np.array([dynamic]),
        collides=np.array([True]),
        unplaced=(0,),
    )
    densities = {one.name: one.density_kg_m3 for one in world.site.recipe.rocks.populations}
    density = density or densities.get(population) or world.site.body.rock_density
    embedded = embed(
        scattered=scattered, library=world.library, ground=world.ground, density=[density]
    )
    settled = settle(
        rocks=embedded, library=world.library, ground=world.ground, gravity=world.site.body.gravity
    )
    if dynamic and not settled.dynamic[0]:
        raise DataError(f"a dynamic rock finds no rest at ({east:g}, {north:g}) m")
    populations = world.field.populations
    rock = settled.replace(
        populations=populations, population=np.array([populations.index(population)])
    )
    if not may_overlap:
        _refuse_overlap(world, rock)
    return world.replace(
        site=world.site.replace(largest_rock=max(world.site.largest_rock, diameter)),
        field=merge(world.field, rock),
    )


@checked
def remove_rocks(world: World, ids: Iterable[int] | Iterable[bool] | Mask) -> World:
    """The world without some rocks; the others keep their ids.

    Args:
        world: The world, which stays as it is.
        ids: Ids of rocks of the world, or of neighbours that reach into it; or a mask, true for
            each rock of `world.field` that goes.

    Raises:
        DataError: if the world has no rock of one of the ids, or the mask is of another length.
    """
    wanted = _ids(world, ids)
    everyone = np.concatenate([world.field.id, world.neighbours.id])
    missing = wanted[~np.isin(wanted, everyone)]
    if len(missing):
        raise DataError(f"the world has no rock with the id {missing[0]}")
    return world.replace(
        field=world.field.select(~np.isin(world.field.id, wanted)),
        neighbours=world.neighbours.select(~np.isin(world.neighbours.id, wanted)),
    )


def _ids(world: World, given: Iterable[int] | Iterable[bool] | Mask) -> NDArray[np.int64]:
    """The ids that are given, or those of the rocks of a mask."""
    found: NDArray[Any] = np.array(list(given))
    own = world.field.id
    if found.dtype == bool and found.shape == own.shape:
        found = own[found]
    elif len(found) and (found.ndim != 1 or found.dtype.kind not in "iu"):
        raise DataError(
            f"ids of the type {found.dtype} and shape {list(found.shape)}: whole numbers are "
            f"allowed, or a mask of the shape {list(own.shape)}, true for each rock that goes"
        )
    ids: NDArray[np.int64] = found.astype(np.int64)
    return ids


def _check_place(world: World, east: float, north: float, reach: float) -> None:
    if not world.ground.holds(np.array([[east, north]]), margin=reach):
        west, south, east_edge, north_edge = world.ground.bounds
        raise DataError(
            f"a rock at ({east:g}, {north:g}) m that reaches {reach:.3g} m far does not lie within "
            f"the ground, {west:g} to {east_edge:g} m east and {south:g} to {north_edge:g} m north"
        )


def _with_population(world: World, name: str) -> World:
    """The world with a population of that name, appended without rocks if it has none."""
    populations = world.field.populations
    if name in populations:
        return world
    if not is_file_name(name) or len(name) > MAX_NAME:
        raise DataError(
            f"population {name!r}: up to {MAX_NAME} characters without / \\ : and control ones"
        )
    populations = (*populations, name)
    colour = np.round(255.0 * np.array([world.site.body.rock_rgb])).astype(np.uint8)
    rock_rgb = np.concatenate([world.appearance.rock_rgb, colour])
    missed = world.unsupported
    return world.replace(
        appearance=world.appearance.replace(rock_rgb=rock_rgb),
        field=world.field.replace(populations=populations),
        neighbours=world.neighbours.replace(populations=populations),
        unplaced=(*world.unplaced, 0),
        unsupported=None if missed is None else missed.replace(populations=populations),
    )


def _next_id(world: World) -> int:
    """The id after those of all rocks that the site's populations can have, and of all others."""
    populations, size = world.site.recipe.rocks.populations, world.site.size
    many = any(population.is_many(size) for population in populations)
    planned = LAST_ID if many else len(populations) * MAX_ROCKS
    highest = max(int(field.id.max(initial=-1)) for field in (world.field, world.neighbours))
    following = max(planned, highest + 1)
    if following > np.iinfo(np.int32).max:
        raise DataError(f"no id is left beside {len(world.field.populations)} populations")
    return following


def _refuse_overlap(world: World, rock: RockField) -> None:
    everyone = merge(merge(world.field, world.neighbours), rock)
    reaches = np.array([prototype.reach for prototype in world.library.prototypes])
    reach = reaches[everyone.prototype] * everyone.diameter
    apart = np.hypot(*(everyone.position[:, :2] - rock.position[0, :2]).T)
    near = everyone.select(apart <= reach + reach[everyone.id == rock.id[0]])
    for pair in overlapping_pairs(near, world.library):
        if rock.id[0] in pair:
            other = min(pair)
            raise DataError(
                f"a rock of {rock.diameter[0]:g} m at ({rock.position[0, 0]:g}, "
                f"{rock.position[0, 1]:g}) m overlaps rock {other}"
            )
