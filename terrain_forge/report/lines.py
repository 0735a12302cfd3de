"""Where rovers are to drive and where they drove: the lines that map and 3-D view draw."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from terrain_forge.base import Array, read_lines
from terrain_forge.report.section import Built

_PATHS = ("#f2c230", "#ff82dc", "#82f078", "#ff9a4d")
_TRACK = "#4db8ff"
_MOST = 1500
_TRACK_BEGINS = ["time_s", "x_m", "y_m"]


@dataclass(frozen=True, eq=False)
class Line:
    """A line over the ground."""

    name: str
    """What a legend calls it."""
    colour: str
    """As `#rrggbb`, sRGB."""
    points: Array
    """East and north of its points [m], shape [points, 2]."""
    driven: bool
    """Whether it was driven; otherwise it was planned."""


def ground_lines(built: Built) -> list[Line]:
    """The paths, and above them the tracks that drives have left in validation/drive*.csv."""
    paths = [
        Line(f"path {path.name}", _PATHS[n % len(_PATHS)], _thinned(path.position[:, :2]), False)
        for n, path in enumerate(built.world.trajectories)
    ]
    tracks = []
    for table in sorted((built.directory / "validation").glob("drive*.csv")):
        points, which = _places(table), table.stem.removeprefix("drive").strip("_-. ")
        if len(points) > 1:
            tracks.append(Line(f"driven {which}".strip(), _TRACK, _thinned(points), True))
    return paths + tracks


def _places(table: Path) -> Array:
    """Columns x_m and y_m of a track's table; none of a table of something else."""
    lines = read_lines(table, table.name)
    if next(lines, "").strip().split(",")[:3] != _TRACK_BEGINS:
        return np.empty((0, 2))
    return np.loadtxt(lines, delimiter=",", usecols=(1, 2), ndmin=2)


def _thinned(points: Array) -> Array:
    """At most so many points of a line, the last one among them."""
    rows = np.unique(np.linspace(0, len(points) - 1, _MOST).astype(np.int64))
    return np.asarray(points[rows], np.float64)
