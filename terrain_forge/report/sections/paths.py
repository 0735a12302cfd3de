"""Paths and drives on the report page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from terrain_forge.model import Trajectory
from terrain_forge.report.blocks import ANIMATED, Block, Shown, paragraph, plot, table
from terrain_forge.report.describe import describe
from terrain_forge.report.section import Built, Section
from terrain_forge.report.sections.checks import check_blocks, is_drive

_TOLD = (
    *("path", "completed", "reason", "time_s", "distance_m", "planned_distance_m", "energy"),
    *("rocks_touched", "share_arrived", "mean_slip"),
)
"""What the report says of drives that their checks say too."""
_OVER_TIME = (
    "Path and driven track; then, over time: the cross-track error (to the left), the tilt, slip "
    "and torque of the wheels, and how much room is left under the rover's belly."
)


class Paths(Section):
    """The planned paths; what they ask of the rover is among the checks."""

    kind, title, place = "paths", "Paths", 70

    def blocks(self, built: Built) -> Sequence[Block]:
        """A row for each path."""
        world = built.world
        if not world.trajectories:
            return [paragraph("This world has no paths.")]
        rows = [_path_row(trajectory) for trajectory in world.trajectories]
        return [table(_HEADINGS, rows, figures="lrrrrrl")]


_HEADINGS = ("Path", "Length", "Duration", "Mean speed", "Height range", "Spot turns", "Kind")


def _path_row(trajectory: Trajectory) -> list[Shown]:
    duration = float(trajectory.time[-1] - trajectory.time[0])
    return [
        trajectory.name,
        f"{trajectory.length:.1f} m",
        f"{duration:.1f} s",
        f"{trajectory.length / duration:.3f} m/s",
        f"{np.ptp(trajectory.position[:, 2]):.2f} m",
        str(len(trajectory.spot_turns)),
        "closed" if trajectory.closed else "open",
    ]


class Drive(Section):
    """The validation drive: what it looked like, its checks and figures."""

    kind, title, place = "drive", "The drive", 80

    def blocks(self, built: Built) -> Sequence[Block]:
        """Film and plots, checks, then what they do not say."""
        said = [said for name, said in built.validation.items() if name.startswith("drive")]
        checks = [check for check in built.validation.get("checks", []) if is_drive(check)]
        files = sorted(built.pictures("drive"), key=lambda path: path.suffix not in ANIMATED)
        pictures = [_picture(path) for path in files]
        more = list[Block]()
        for content in filter(None, said):
            one = content if isinstance(content, dict) else {"drives": content}
            more += describe({name: value for name, value in one.items() if name not in _TOLD})
        return [*pictures, *check_blocks(checks), *more]


def _picture(path: Path) -> Block:
    """A film, or plots; what is drawn over time has a caption."""
    name = path.stem.replace("_", " ")
    if path.suffix in ANIMATED:
        return plot(path, description=f"Film of the {name}")
    over_time = name != "drives" and not name.endswith(" end")
    return plot(path, description=f"Plots of the {name}", caption=_OVER_TIME if over_time else "")
