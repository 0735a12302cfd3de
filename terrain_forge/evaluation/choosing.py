"""Which systems are run over a recording."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from terrain_forge.base import DataError
from terrain_forge.datasets import open_recording
from terrain_forge.evaluation.adapter import Adapter
from terrain_forge.evaluation.catalogue import (
    find_system,
    known_systems,
    require_ready,
    with_binaries,
)
from terrain_forge.evaluation.needs import require_frame, require_sensors


def chosen_systems(
    names: str | None, dataset: Path | str, binaries: Sequence[str] = ()
) -> list[Adapter]:
    """The systems of some names, or all that are installed and find their sensors.

    Args:
        names: Names or files with commas between them.
        dataset: The recording's folder, or the world's.
        binaries: `NAME=PATH` of programs that the user has; these systems are run too.

    Raises:
        DataError: for an unknown name, or if there is no recording.
    """
    if names is not None:
        named = [find_system(name.strip()) for name in names.split(",")]
        recording = open_recording(dataset)
        for adapter in named:
            require_frame(recording, adapter)
        return with_binaries(named, binaries)
    recording = open_recording(dataset)
    found = []
    for adapter in known_systems().values():
        try:
            require_sensors(recording, adapter)
            require_ready(adapter)
        except DataError:
            continue
        if not adapter.needs_binary:
            found.append(adapter)
    return with_binaries(found, binaries)


def system_lines() -> list[str]:
    """A line for each known system: whether it can be run, and what it is."""
    lines = []
    for name, adapter in known_systems().items():
        try:
            if not adapter.needs_binary:
                require_ready(adapter)
            state = "your binary" if adapter.needs_binary else "ready"
        except DataError:
            state = "not installed"
        lines.append(f"{name:<18} {state:<14} {adapter.about}")
    return lines
