"""A recipe without its paths, and without what it says of them elsewhere."""

from __future__ import annotations

from dataclasses import replace

from terrain_forge.base import FARTHEST
from terrain_forge.recipe.idle import NEAR_PATHS
from terrain_forge.recipe.schema import Recipe
from terrain_forge.terrain import HeightBand, Mask

OF_PATHS = ("paths", "validate", "dataset")
"""Parts of a recipe that are of its paths, or of what is done along them."""
_NEAR = (*NEAR_PATHS, "pebbles_within_m")
_NOWHERE = HeightBand(above_m=FARTHEST)


def without_paths(recipe: Recipe) -> Recipe:
    """The recipe of the same ground without paths, nor drives and recordings along them.

    Masks by the distance to a path are as they are far away from any; what exports have near paths
    is left out. `worlds` stays as it is: its keys may be of paths.
    """
    terrain = recipe.terrain
    terrain = replace(
        terrain,
        layers=tuple(replace(one, mask=_far(one.mask)) for one in terrain.layers),
        materials=tuple(replace(one, mask=_far(one.mask)) for one in terrain.materials),
    )
    return replace(away_from_paths(recipe), paths=(), terrain=terrain, validate=None, dataset=None)


def away_from_paths(recipe: Recipe) -> Recipe:
    """The recipe whose exports have nothing of what lies near paths alone."""
    if not isinstance(recipe.exports, dict):
        return recipe
    exports = {
        folder: {key: value for key, value in options.items() if key not in _NEAR}
        for folder, options in recipe.exports.items()
    }
    return replace(recipe, exports=exports)


def _far(mask: Mask | None) -> Mask | None:
    """What becomes of a mask far away from any path."""
    if mask is None or mask.route is None:
        return mask
    if mask.route.within_m is not None:
        return replace(mask, route=None, height=_NOWHERE)
    others = (mask.slope, mask.height, mask.hollow, mask.roughness, mask.image)
    if any(part is not None for part in others):
        return replace(mask, route=None)
    return Mask(height=_NOWHERE) if mask.invert else None
