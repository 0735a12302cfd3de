"""Further formats of a recording, each in a folder of the dataset, made anew where it has grown."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import partial
from typing import Any

from terrain_forge.base import Progress, RecipeError, hint_at, refuse_twice
from terrain_forge.datasets import (
    FORMATS,
    checked_options,
    dataset_kinds,
    made_formats,
    state_of,
    write_dataset,
)
from terrain_forge.recipe import DatasetSpec
from terrain_forge.recording.index import INDEX
from terrain_forge.recording.store import Store

MASTER, CALIBRATION = "euroc", "calibration"
"""What every recording is, and has."""


def formats_of(spec: DatasetSpec) -> dict[str, Mapping[str, Any]]:
    """The formats beside the recording's own, with their options.

    Raises:
        RecipeError: for one that is not installed, or an option that it does not have.
    """
    refuse_twice(spec.formats, ("dataset", "formats"))
    asked: Mapping[str, Mapping[str, Any]] = (
        spec.formats if isinstance(spec.formats, dict) else {name: {} for name in spec.formats}
    )
    known = dataset_kinds()
    for name, options in asked.items():
        if name in known:
            try:
                checked_options(name, options)
            except RecipeError as error:
                key = ("dataset", "formats", name, *error.key)
                raise RecipeError(str(error), key=key) from None
        elif name != MASTER or options:
            every = (MASTER, *known)
            raise RecipeError(
                f"unknown dataset format {name!r}{hint_at(name, every)}, installed: "
                f"{', '.join(every)}",
                key=("dataset", "formats"),
            )
    return {name: options for name, options in asked.items() if name != MASTER}


def write_formats(
    store: Store, formats: Mapping[str, Mapping[str, Any]], progress: Progress
) -> dict[str, tuple[str, ...]]:
    """Write the calibration and further formats, those that are there and still of it apart.

    Returns:
        What each that was written cannot say.
    """
    made = _made(store)
    of, sensors = _state(store)
    losses = {}
    wanted: dict[str, Mapping[str, Any]] = {CALIBRATION: _like_tum(made, formats), **formats}
    for name, options in wanted.items():
        told = {"options": dict(options), "of": of}
        same = all(made.get(name, {}).get(key) == value for key, value in told.items())
        if same and store.holds_folder(name):
            continue
        progress(f"formats: {name}", 0.0)
        store.free_folder(name)
        report = write_dataset(
            store.folder,
            name,
            store.folder / name,
            options,
            progress=partial(_tell, progress, name),
        )
        store.adopt(name)
        if report.losses:
            losses[name] = tuple(report.losses)
        made[name] = told | {"sensors": sensors}
        store.put(FORMATS, (json.dumps(dict(sorted(made.items())), indent=1) + "\n").encode())
    return losses


def stale_formats(store: Store) -> tuple[str, ...]:
    """A sentence on each format that is there and of an earlier state of the recording."""
    (of, sensors), found = _state(store), []
    for name, told in _made(store).items():
        if told["of"] == of or not store.holds_folder(name):
            continue
        lacking = [one for one in sensors if one not in told.get("sensors", sensors)]
        without = f" (without {', '.join(lacking)})" if lacking else ""
        how = f"the same command with --formats {name}"
        if told["options"]:
            how = f"tf.record(…, formats={ {name: told['options']} })"
        found.append(f"{name} is of an earlier state of this recording{without}: {how} renews it")
    return tuple(found)


def _state(store: Store) -> tuple[str, list[str]]:
    """What tells one state of a recording from another, and the folders that measured something."""
    streams = json.loads((store.folder / INDEX).read_bytes())["streams"]
    measured = [one["folder"].rpartition("/")[2] for one in streams if one["count"]]
    return state_of(store.folder), measured


def _like_tum(
    made: Mapping[str, Any], formats: Mapping[str, Mapping[str, Any]]
) -> Mapping[str, Any]:
    """Options of the calibration: camera and factor of `tum`, if that is or comes there."""
    options = formats.get("tum", made.get("tum", {}).get("options", {}))
    return {name: value for name, value in options.items() if name in ("camera", "depth_factor")}


def _tell(progress: Progress, name: str, _: str, share: float) -> None:
    progress(f"formats: {name}", share)


def _made(store: Store) -> dict[str, Any]:
    return made_formats(store.folder) if store.holds(FORMATS) else {}
