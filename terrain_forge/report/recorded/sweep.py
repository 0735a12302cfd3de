"""The sweep that the 3-D view shows."""

from __future__ import annotations

from terrain_forge.base import DataError
from terrain_forge.report.recorded.measures import WorldSweep, first_sweep
from terrain_forge.report.section import Built


def shown_sweep(built: Built) -> WorldSweep | None:
    """The first sweep of the recording; None without one, or where it cannot be read.

    The section of the recording says why.
    """
    try:
        return first_sweep(built.recording) if built.recording else None
    except DataError:
        return None
