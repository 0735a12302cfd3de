"""What a recording's folder is of, so that a later run knows whether it may go on there."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge import __version__
from terrain_forge.base import DataError, OutputError, read_text, to_plain
from terrain_forge.model import World
from terrain_forge.recipe import DatasetSpec

PLAN = "plan.json"
_FORMAT = 1
_MOST = 2**24
_NAMED = 3
"""Differences that a message names."""


def plan_of(world: World, spec: DatasetSpec) -> dict[str, Any]:
    """What the bytes of a recording hang on: the world, its sensors, how it is recorded, by what.

    Args:
        world: The world, whose rover carries what is recorded.
        spec: How it is recorded.
    """
    dataset = {name: value for name, value in asdict(spec).items() if name != "formats"}
    dataset["gravity_m_s2"] = spec.gravity(world.site.body.gravity)
    arrays: dict[str, NDArray[Any]] = {}
    bare = world.replace(rover=world.rover.replace(sensors=()))
    plain = to_plain(bare, arrays, "world")
    plain["site"].pop("recipe_json")  # what it says is in the world, or else below
    found = hashlib.sha256(json.dumps(plain, sort_keys=True).encode())
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        found.update(f"{name} {array.dtype.str} {array.shape}".encode())
        found.update(array.data)
    return {
        "format": _FORMAT,
        "terrain_forge": __version__,
        "name": world.site.name,
        "seed": world.site.seed,
        "dataset": dataset,
        "sensors": {sensor.name: to_plain(sensor, {}) for sensor in world.rover.sensors},
        "world": found.hexdigest(),
    }


def plan_text(plan: dict[str, Any]) -> bytes:
    """A plan as a file has it."""
    return (json.dumps(plan, indent=1, ensure_ascii=False) + "\n").encode()


def differences(folder: Path, plan: dict[str, Any]) -> list[str]:
    """How the recording that lies in a folder differs from a plan; nothing where there is none.

    Raises:
        OutputError: if the plan that lies there is none of ours.
    """
    path = folder / PLAN
    try:
        if not path.exists():
            return []
        there = json.loads(read_text(path, PLAN, most=_MOST))
    except (DataError, ValueError, RecursionError):
        there = None
    if not isinstance(there, dict) or "terrain_forge" not in there:
        raise OutputError(f"{path} is no plan of a recording: move it away")
    if there == plan:
        return []
    one, other = _leaves(there), _leaves(plan)
    names = [name for name in {**one, **other} if one.get(name) != other.get(name)]
    return [f"{name} {_told(one.get(name))}, not {_told(other.get(name))}" for name in names]


def require_same(folder: Path, differing: list[str]) -> None:
    """Refuse to go on in a folder of another recording.

    Raises:
        OutputError: says what differs.
    """
    if differing:
        more = " …" if len(differing) > _NAMED else ""
        raise OutputError(
            f"{folder} holds another recording, with {'; '.join(differing[:_NAMED])}{more}; "
            "--force replaces it"
        )


def _leaves(value: Any, path: str = "") -> dict[str, Any]:
    if not isinstance(value, dict) or not value:
        return {path: value}
    found: dict[str, Any] = {}
    for key, inner in value.items():
        found.update(_leaves(inner, f"{path}.{key}" if path else str(key)))
    return found


def _told(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 40 else f"{text[:36]} …"
