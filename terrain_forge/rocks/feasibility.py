"""What can be said of the wanted rocks before anything is read or drawn: whether they can be."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from math import inf

import numpy as np

from terrain_forge.base import Array, DataError, Key, RecipeError, is_ours, portable, returning
from terrain_forge.model import Table
from terrain_forge.rocks.around_craters import FARTHEST
from terrain_forge.rocks.arrangement import AroundCraters, crowding
from terrain_forge.rocks.laws.law import SizeLaw
from terrain_forge.rocks.library import LibrarySpec
from terrain_forge.rocks.populations import (
    MAX_POPULATIONS,
    MAX_ROCKS,
    MOST_ROCKS,
    ExclusionSpec,
    PopulationSpec,
    RockListSpec,
    RocksSpec,
    largest_diameter,
)

MAX_COVER = 0.4
"""Part of the ground that all rocks may cover, whatever their sizes: more was not tried."""

SMALLEST_LISTED = 1e-3
"""Diameter of the smallest rock that a list may give [m]."""
DEEPEST_LISTED = 0.5
"""Largest buried part that a list may give."""

ADVICE = "lower their numbers, raise the smallest diameter or have fewer dynamic ones"
_SAMPLES = 100

Populations = tuple[PopulationSpec, ...]
Size = tuple[float, float]
"""East and north extent of a site [m]."""


def check_rocks(rocks: RocksSpec, size: Size) -> None:
    """Refuse rocks that contradict themselves or that cannot lie on a site.

    Args:
        rocks: what is wanted.
        size: the site, east and north [m].

    Raises:
        RecipeError: for a name that is given twice, a law, range or shape that cannot be, too many
            populations or rocks, too much cover, or rocks kept out of everywhere.
    """
    _check_names(rocks)
    if not rocks.library.family_names():
        raise RecipeError("0 shapes and no meshes: a library needs one", key=("rocks", "library"))
    for number, population in enumerate(rocks.populations):
        key = ("rocks", "populations", number)
        _check_sizes(population, size, key)
        _check_dynamic(population, (*key, "dynamic_m"))
        _check_group(population, rocks.library, key)
        _check_craters(population, size, (*key, "arrangement", "craters"))
    for number, listed in enumerate(rocks.lists):
        _check_group(listed, rocks.library, ("rocks", "lists", number))
    together = sum(expected_count(population, size) for population in rocks.populations)
    if together > MOST_ROCKS and any(p.is_many(size) for p in rocks.populations):
        raise RecipeError(
            f"{together:.3g} rocks in all, at most {MOST_ROCKS:.3g}: raise the smallest diameters",
            key=("rocks", "populations"),
        )
    for cover, _, where, place in crowded_places(rocks.populations):
        if cover > MAX_COVER:
            raise RecipeError(
                f"the rocks would cover {cover:.3g} of the ground{where}, at most {MAX_COVER:g} "
                f"can be packed without overlap: {ADVICE}",
                key=place,
            )
    _check_exclusion_zones(rocks.exclusion_zones, size)


def expected_count(population: PopulationSpec, size: Size) -> float:
    """Rocks that a population is expected to have on a site, at most.

    Density images, slope limits, corridors and exclusion zones, which thin them out, are left
    aside.
    """
    smallest, largest = population.diameters
    if not isinstance(population.arrangement, AroundCraters):
        return size[0] * size[1] * population.density(smallest, largest)
    law = population.size_frequency
    craters = population.arrangement.craters
    ends = np.clip([crater.largest_rock_m for crater in craters], smallest, largest)
    number = law.cumulative_number(smallest) - law.cumulative_number(ends)
    return float(portable.product(number, population.arrangement.areas_within(size)))


def check_lists(rocks: RocksSpec, lists: tuple[Table, ...], *, size: Size) -> None:
    """Refuse listed rocks that cannot lie on a site.

    Args:
        rocks: what is wanted.
        lists: the tables of its lists.
        size: the site, east and north [m].

    Raises:
        DataError: names the first rock that is wrong, counted from 1, and what is allowed.
    """
    limits = {
        "x_m": (-0.5 * size[0], 0.5 * size[0]),
        "y_m": (-0.5 * size[1], 0.5 * size[1]),
        "diameter_m": (SMALLEST_LISTED, 0.5 * min(size)),
        "yaw_deg": (-360.0, 360.0),
        "buried_fraction": (0.0, DEEPEST_LISTED),
        "prototype": (0.0, rocks.library.shapes + len(rocks.library.meshes) - 1.0),
    }
    for number, table in enumerate(lists):
        for name in table.columns:
            (low, high), values = limits[name], table.column(name)
            good, allowed = (values >= low) & (values <= high), f"{low:g} to {high:g}"
            if name == "prototype" and good.all():
                good, allowed = values == np.floor(values), "whole numbers"
            if not good.all():
                row = int(np.argmin(good))
                raise DataError(
                    f"{table.path}: {name} of rock {row + 1} is {values[row]:g}, allowed: "
                    f"{allowed}",
                    key=("rocks", "lists", number, "file"),
                )


def largest_rock(rocks: RocksSpec, lists: tuple[Table, ...] = ()) -> float:
    """Exposed diameter [m] that no rock exceeds, scattered or listed; 0 without any.

    Args:
        rocks: what is wanted.
        lists: the tables of its lists.
    """
    scattered = [p.diameters[1] for p in rocks.populations]
    listed = [float(table.column("diameter_m").max()) for table in lists]
    return max([*scattered, *listed], default=0.0)


def _check_names(rocks: RocksSpec) -> None:
    count, part = len(rocks.groups), "lists" if rocks.lists else "populations"
    if count > MAX_POPULATIONS:
        raise RecipeError(
            f"{count} populations and lists, at most {MAX_POPULATIONS}", key=("rocks",)
        )
    for name, times in Counter(group.name for group in rocks.groups).items():
        if times > 1:
            noun = "populations or lists" if rocks.lists else part
            raise RecipeError(f"{times} {noun} are called {name!r}", key=("rocks", part))


def _require_numbers(law: SizeLaw, low: float, high: float) -> None:
    """Refuse a law of another package that does not answer with numbers.

    Raises:
        PluginError: naming the law and its method.
    """
    allowed = "numbers that are finite and fall with the diameter"
    for method in (law.cumulative_number, law.cumulative_area):
        with returning(law, f"size law {law.kind!r}: {method.__name__}", allowed):
            more, less = (float(method(diameter)) for diameter in (low, high))
            if not 0.0 <= more - less < inf:
                raise ValueError(f"found {more:g} at {low:g} m, {less:g} at {high:g} m")
    what, allowed = f"size law {law.kind!r}", "a variance that is finite and not negative"
    with returning(law, f"{what}: cover_variance", allowed):
        if not 0.0 <= (variance := float(law.cover_variance(low, high, 1.0))) < inf:
            raise ValueError(f"found {variance:g}")
    if is_ours(type(law).__module__):  # whose kernels take longer to load than the rest of a check
        return
    hashes = np.arange(1, 9, dtype=np.uint64) << np.uint64(60)
    with returning(
        law, f"{what}: sample", f"{len(hashes)} diameters between {low:g} and {high:g} m"
    ):
        drawn = law.sample(hashes, low, high)
        inside = np.shape(drawn) == hashes.shape and (drawn >= low) & (drawn <= high * (1 + 1e-9))
        if not np.all(inside):
            raise ValueError(f"found {drawn}")


def _check_sizes(population: PopulationSpec, size: Size, key: Key) -> None:
    law = population.size_frequency
    law.check((*key, "size_frequency"))
    law.told()  # refused now, not when all is made
    (low, high), key = population.diameters, (*key, "diameter_m")
    if law.kind == "table" and law.smallest_known is not None and low < law.smallest_known:
        raise RecipeError(f"from {low:g} m, the table begins at {law.smallest_known:g} m", key=key)
    # A range that nothing is expected in ends where it begins: see `with_diameters`.
    if high < low or high == low < largest_diameter(law, size[0] * size[1]):
        raise RecipeError(
            f"smallest {low:g} m, largest {high:g} m: the largest must be larger", key=key
        )
    if low < high:
        _require_numbers(law, low, high)
    limit = 0.5 * min(size)
    if isinstance(population.arrangement, AroundCraters):
        craters = population.arrangement.craters
        high = min(high, max((crater.largest_rock_m for crater in craters), default=low))
    if max(low, high) > limit:
        raise RecipeError(
            f"rocks of up to {max(low, high):.3g} m, at most half the site's shorter side, "
            f"{limit:g} m: give the largest diameter, or a smaller one",
            key=key,
        )
    count = expected_count(population, size)
    most = MOST_ROCKS if population.is_many(size) else 0.9 * MAX_ROCKS
    if count > most:
        raise RecipeError(
            f"{count:.3g} rocks on {size[0] * size[1]:.3g} m², at most {most:.3g}: "
            "raise the smallest diameter",
            key=key,
        )


def _check_dynamic(population: PopulationSpec, key: Key) -> None:
    """Refuse dynamic rocks that are none of the population's, or that cannot be touched."""
    if population.dynamic_m is None:
        return
    low, high = population.dynamic_m
    if high <= low:
        raise RecipeError(f"from {low:g} to {high:g} m: the smaller one comes first", key=key)
    smallest, largest = population.diameters
    if high < smallest or low > largest:
        raise RecipeError(
            f"from {low:g} to {high:g} m, but the rocks have {smallest:g} to {largest:g} m", key=key
        )
    if low < population.collision_min_m:
        raise RecipeError(
            f"from {low:g} m, but rocks below {population.collision_min_m:g} m cannot be touched",
            key=key,
        )


def _check_group(rocks: PopulationSpec | RockListSpec, library: LibrarySpec, key: Key) -> None:
    """Refuse a range of burial that ends before it begins, and families without a shape."""
    shallow, deep = rocks.buried_fraction
    if deep < shallow:
        raise RecipeError(
            f"from {shallow:g} to {deep:g}: the smaller one comes first",
            key=(*key, "buried_fraction"),
        )
    known = library.family_names()
    for number, family in enumerate(rocks.families or ()):
        if family not in known:
            raise RecipeError(
                f"the library has no family {family!r}, it has: {', '.join(known) or 'none'}",
                key=(*key, "families", number),
            )


def _check_craters(population: PopulationSpec, size: Size, key: Key) -> None:
    """Refuse craters of which none has rocks on the site."""
    arrangement = population.arrangement
    if not isinstance(arrangement, AroundCraters) or arrangement.layer is not None:
        return  # a layer's craters are not known yet
    craters = arrangement.craters
    if not any(_on_site(c.centre_m, 0.5 * FARTHEST * c.diameter_m, size) for c in craters):
        east, north = craters[0].centre_m
        raise RecipeError(
            f"no crater's rocks reach the site: they lie within {FARTHEST:g} radii, the first "
            f"crater at {east:g}, {north:g} m; the site ends at ±{0.5 * size[0]:g}, "
            f"±{0.5 * size[1]:g} m",
            key=key,
        )
    if expected_count(population, size) == 0.0:
        most = max(c.largest_rock_m * (c.strength > 0.0) for c in craters)
        why = f"their largest rocks of {most:.3g} m are smaller than {population.diameters[0]:g} m"
        if most == 0.0:
            why = "they are too old"
        raise RecipeError(f"no rock is left around these craters: {why}", key=key)


def _on_site(centre: tuple[float, float], radius: float, size: Size) -> bool:
    """Whether any place of a circle lies on the site."""
    beyond = np.maximum(np.abs(centre) - 0.5 * np.array(size), 0.0)
    return bool(np.hypot(*beyond) < radius)


def _check_exclusion_zones(circles: tuple[ExclusionSpec, ...], size: Size) -> None:
    for number, circle in enumerate(circles):
        if not _on_site(circle.centre_m, circle.radius_m, size):
            x, y = circle.centre_m
            raise RecipeError(
                f"a circle of {circle.radius_m:g} m about {x:g}, {y:g} m lies outside the "
                f"site, which ends at ±{0.5 * size[0]:g}, ±{0.5 * size[1]:g} m",
                key=("rocks", "exclusion_zones", number),
            )
    steps = (np.arange(_SAMPLES) + 0.5) / _SAMPLES - 0.5
    east, north = np.meshgrid(steps * size[0], steps * size[1])
    free = np.ones_like(east, np.bool_)
    for circle in circles:
        if circle.clearance_m == 0.0:
            away = np.hypot(east - circle.centre_m[0], north - circle.centre_m[1])
            free &= away > circle.radius_m
    if not free.any():
        raise RecipeError(
            "the circles leave no place for any rock", key=("rocks", "exclusion_zones")
        )


def crowded_places(populations: Populations) -> Iterator[tuple[float, Array, str, Key]]:
    """Cover on the whole, then where each population is densest; densities over the laws; where."""
    key, covers = ("rocks", "populations"), [population.cover for population in populations]
    yield sum(covers), np.ones(len(covers)), "", key
    for number, population in enumerate(populations):
        factors = np.ones(len(covers))
        factors[number] = crowding(population.arrangement)
        if factors[number] > 1.0:
            cover = float(portable.product(covers, factors))
            yield cover, factors, " where they are densest", (*key, number, "arrangement")
