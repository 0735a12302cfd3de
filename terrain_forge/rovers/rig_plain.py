"""A rover's own sensors as a recipe would write them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from terrain_forge.rovers.catalogue import RoverChoice, resolve_rover
from terrain_forge.rovers.rig import AnySensor


def rig_of(choice: RoverChoice, folder: Path) -> list[dict[str, Any]]:
    """The sensors that a rover brings, as the `sensors` of a recipe: what presets say is left out.

    Args:
        choice: What the recipe says of its rover.
        folder: What its paths are relative to.

    Raises:
        RecipeError: if there is no such rover.
    """
    adapter: TypeAdapter[Any] = TypeAdapter(AnySensor)
    found = []
    for sensor in resolve_rover(choice, folder).rover.sensors:
        told = json.loads(adapter.dump_json(sensor))
        named = {key: told[key] for key in ("kind", "name", "preset") if told[key]}
        plain = json.loads(adapter.dump_json(adapter.validate_json(json.dumps(named))))
        differing = {key: value for key, value in told.items() if plain[key] != value}
        found.append({**named, **differing})
    return found
