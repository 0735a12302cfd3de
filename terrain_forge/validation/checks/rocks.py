"""Whether rocks lie apart, are whole, have the sizes that were asked for, and are embedded."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from terrain_forge.base import Array, stage_key, uniforms
from terrain_forge.model import (
    Check,
    Heightfield,
    RockField,
    RockPrototype,
    World,
    at_least,
    at_most,
    rotations,
)
from terrain_forge.rocks import DAYLIGHT, find_overlaps, foot_of
from terrain_forge.truth import shape_figures
from terrain_forge.validation.inspection import BuiltFolder, Inspection, content_of
from terrain_forge.validation.outlines import heights_above

SIGNIFICANCE = 0.001
"""A correct sampler's rocks fall below this p-value once in a thousand worlds."""
UNSETTLED_LIMIT = 0.1
"""Part of the dynamic rocks that may find no rest, so that they are fixed."""
UNPLACED_LIMIT = 0.001
"""Part of the rocks that may find no free place."""
_ROCKS = 2000
_UPPER = 40
_NAMED = 3
_LIMIT = 0.005
"""Part of the rocks that may do so all the same, where the ground is too rough for them."""


class Rocks(Inspection):
    """Rocks apart from each other, all placed, whole, and of the sizes asked for."""

    kind = "rocks"
    group = "rocks"

    def checks(self, built: BuiltFolder) -> list[Check]:
        """Of all rocks, and of the truth's verification where there is one."""
        world = built.world
        verification = content_of(built.directory / "truth" / "size_frequency.json")
        return [
            *_place_checks(world, [part["name"] for part in verification.get("lists", ())]),
            *_size_checks(verification),
            *_population_checks(verification),
            *_shape_checks(world, verification.get("shapes", {})),
        ]


def _place_checks(world: World, lists: list[str]) -> list[Check]:
    """No two rocks overlap but listed ones, and all have found a place."""
    count, unplaced = len(world.field), sum(world.unplaced)
    overlaps = find_overlaps(world, lists=lists)
    note = f"pairs of {count} rocks, seen from above"
    if overlaps.scattered:
        note += f"; first: {overlaps.scattered[0][0]}, {overlaps.scattered[0][1]}"
    if overlaps.listed:
        note += f"; besides {len(overlaps.listed)} of listed rocks"
    limit = float(max(math.ceil(UNPLACED_LIMIT * (count + unplaced)), 1))
    return [
        at_most("rocks: overlaps", float(len(overlaps.scattered)), 0.0, note=note),
        at_most("rocks: without a free place", float(unplaced), limit, note=f"besides {count}"),
        *_left_out(world),
    ]


def _left_out(world: World) -> list[Check]:
    """How many rocks the ground does not hold, where there are any."""
    if not (number := sum(world.unsupported_number)):
        return []
    note = f"besides {len(world.field)}; the ground falls away beneath them, however deep they lie"
    return [at_most("rocks: left out", float(number), None, note=note)]


def _population_checks(verification: dict[str, Any]) -> list[Check]:
    """Dynamic rocks that found no rest, burial, and laws that were fitted to counts."""
    checks = []
    for population in verification.get("populations", ()):
        name, dynamic, burial = (population.get(key) for key in ("name", "dynamic", "burial"))
        if dynamic and dynamic["expected"]:
            fixed, asked = dynamic["fixed"], dynamic["expected"]
            limit = float(max(math.floor(UNSETTLED_LIMIT * asked), 1))
            note = f"of {asked} that were to be dynamic; these are fixed in the ground"
            if fixed > limit:
                note += "; max_slope_deg keeps a population off ground that is too steep"
            title = f"rocks: dynamic ones of {name} without rest"
            checks.append(at_most(title, float(fixed), limit, note=note))
        if burial:
            note = (
                f"mean buried part of the height, asked {burial['expected']:.3f} ± "
                f"{burial['standard_deviation']:.3f}; {burial['deeper']} lie deeper than asked"
            )
            checks.append(at_most(f"rocks: burial of {name}", burial["observed"], None, note=note))
        if fit := population.get("fit_to_counts"):
            note = "; ".join([fit["summary"], *fit["warnings"]])
            title = f"rocks: law of {name} against its counts"
            p = Check(
                name=title, figure=fit["p_value"], unit="", limit=None, passed=True, note=note
            )
            checks.append(p)
    return checks


def _size_checks(verification: dict[str, Any]) -> list[Check]:
    """Kolmogorov–Smirnov p-values of the populations, as the truth bundle has them."""
    return [
        at_least(
            f"rocks: sizes of {population['name']}",
            population["kolmogorov_smirnov"]["p_value"],
            SIGNIFICANCE,
            note=f"p-value of the size law, {population['count']['observed']} rocks",
        )
        for population in verification.get("populations", ())
        if population["kolmogorov_smirnov"]
    ]


def _shape_checks(world: World, wanted: dict[str, Any]) -> list[Check]:
    """The library's meshes are closed, and its collision parts as near as the recipe asks."""
    if not len(world.field):
        return []
    found = shape_figures(world.library)
    return [
        at_most("shapes: open meshes", float(found["count"] - found["watertight"]), 0.0,
                note=f"of {found['count']} shapes, all levels of detail and collision parts"),
        at_most("shapes: collision volume in excess", found["largest_hull_excess"],
                wanted.get("hull_excess_limit"), note="largest, as a part of the shape's volume"),
        at_most("shapes: collision surface off", found["largest_hull_distance"],
                wanted.get("hull_distance_limit"),
                note="largest distance, as a part of the shape's mean axis"),
        at_most("shapes: outlines of coarse levels off", found["largest_outline_error"], None,
                note="largest distance, as a part of the shape's mean axis"),
    ]  # fmt: skip


class Resting(Inspection):
    """Whether static rocks lie in the ground."""

    kind = "resting"
    group = "rocks"

    def checks(self, built: BuiltFolder) -> list[Check]:
        """Daylight under static rocks, and tops below the ground, over a sample of the rocks.

        A rock shows no daylight where its foot, the cross-section at a twentieth of its extent,
        lies below the ground all around.
        """
        world = built.world
        if not len(world.field):
            return []
        static = world.field.select(~world.field.dynamic)
        if len(static) > _ROCKS:
            drawn = uniforms(stage_key(world.site.seed, "resting"), _ROCKS)
            static = static.select(np.unique((drawn * len(static)).astype(np.intp)))
        foot, top = np.zeros(len(static)), np.ones(len(static))
        for number, prototype in enumerate(world.library.prototypes):
            rows = np.flatnonzero(static.prototype == number)
            foot[rows], top[rows] = foot_and_top(static.select(rows), prototype, world.ground)
        limit = float(max(1, round(_LIMIT * len(static))))
        note = f"of {len(static)}, by more than {DAYLIGHT:.0%} of the diameter"
        if (hanging := float(np.count_nonzero(foot > DAYLIGHT))) > limit:
            highest = ", ".join(map(str, static.id[np.argsort(-foot)[:_NAMED]].tolist()))
            note += f"; most beneath {highest}: listed or added rocks stay where they are"
        return [
            at_most("rocks: daylight beneath", hanging, limit, note=note),
            at_most("rocks: tops below the ground", float(np.count_nonzero(top <= 0.0)), 0.0,
                    note=f"of {len(static)}"),
        ]  # fmt: skip


def foot_and_top(
    field: RockField, prototype: RockPrototype, ground: Heightfield
) -> tuple[Array, Array]:
    """How rocks of one shape stand above the ground, over their diameters, shape [rocks] each.

    Largest height of the foot's outer corners, above 0 there is daylight, and of the rock's upper
    vertices. Points beside the ground do not count.
    """
    from scipy.spatial import ConvexHull

    vertices, outline = prototype.meshes[0].vertices, foot_of(prototype.meshes[0])
    loop = outline[ConvexHull(outline[:, :2]).vertices]  # hollows of the underside are hidden
    pose = rotations(field) * field.scale[:, None, None]
    feet = heights_above(ground, np.einsum("nij,pj->npi", pose, loop) + field.position[:, None])
    upper = vertices[np.argsort(vertices[:, 2])[-_UPPER:]]
    tops = heights_above(ground, np.einsum("nij,pj->npi", pose, upper) + field.position[:, None])
    return (
        np.nan_to_num(feet, nan=-np.inf).max(axis=1, initial=-np.inf) / field.diameter,
        np.nan_to_num(tops, nan=-np.inf).max(axis=1) / field.diameter,
    )
