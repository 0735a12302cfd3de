"""Which worlds are too much for what reads SDF, known before they are made."""

from __future__ import annotations

from terrain_forge.base import ExportError

from .options import Options

PART_MB, PART_MS = 0.27, 0.8
"""Memory [MB] and time [ms] that libsdformat takes for each visual and each collision: it copies
the description of all that an element could hold. Measured with libsdformat 12, as the next."""
BODY_MB, BODY_MS = 2.3, 9.0
"""The same for the model and link of a dynamic rock."""
MOST_MB = 8192.0
"""What loading may take [MB]."""
ADVICE = "a larger individual_min_m merges more of them, or make fewer rocks dynamic"


def check_capacity(options: Options, *, nodes: float, rocks: float) -> None:
    """Refuse, before the world is made, more rocks of their own than libsdformat loads.

    How many are above `individual_min_m` is known only then; if all are, they can be told now.

    Raises:
        ExportError: if there are too many; says what to choose instead.
    """
    del nodes
    if options.individual_min_m == 0.0:  # each is seen and touched
        require_bearable(
            f"some {rocks:,.0f} rocks are elements of their own",
            2 * PART_MB * rocks,
            key=("individual_min_m",),
        )


def require_bearable(found: str, megabytes: float, *, key: tuple[str, ...] = ()) -> None:
    """Refuse what libsdformat would fill the memory with.

    Raises:
        ExportError: if it would take more than is allowed; says what to choose instead.
    """
    if megabytes > MOST_MB:
        raise ExportError(
            f"{found}: Gazebo's parser would take {megabytes / 1024:.0f} GB to load them, at most "
            f"{MOST_MB / 1024:.0f} GB are allowed; {ADVICE}",
            key=key,
        )
