"""What of a recipe's recording can be refused before there is a world."""

from __future__ import annotations

from terrain_forge.base import RecipeError
from terrain_forge.model import Rover
from terrain_forge.recipe import Recipe
from terrain_forge.recording.formats import formats_of
from terrain_forge.rovers import MoreSensors
from terrain_forge.sensors import require_free


def require_recordable(recipe: Recipe, rover: Rover) -> None:
    """Refuse sensors of a recipe that would see the rover's inside or the soil, and formats.

    Args:
        recipe: The recipe.
        rover: Its rover, which carries them.

    Raises:
        RecipeError: for the first that is wrong.
    """
    if recipe.dataset is not None:
        formats_of(recipe.dataset)
    listed = recipe.sensors or ()
    key: tuple[str, ...] = ("sensors",)
    if isinstance(listed, MoreSensors):
        listed, key = listed.add, ("sensors", "add")
    for number, sensor in enumerate(listed):
        try:
            require_free(sensor, rover)
        except RecipeError as error:
            raise RecipeError(str(error), key=(*key, number, "position_m")) from None
