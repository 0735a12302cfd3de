"""How well systems localised on the recording: the paper's table, trajectories, errors."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from terrain_forge.base import Array, DataError, read_lines, read_text, reading
from terrain_forge.datasets import Recording
from terrain_forge.evaluation import ERRORS, MAPS, RESULTS, read_errors
from terrain_forge.report.blocks import Block, drawing, heading, paragraph, table
from terrain_forge.report.recorded.trajectories import error_plot, trajectory_plot
from terrain_forge.report.section import Built, Section

_DIFFERS = "differs: "
_HOW = (
    "Distances to the ground where no rock is; cells of the site's grid against the mean of what "
    "16 rays from above meet, right within 5 cm; a cell holds a rock if one of these meets it. "
    "What was not mapped is wrong. LAC: points of the Lunar Autonomy Challenge, of 300 each."
)
_MOST = 8
"""Systems that are drawn."""


class Localisation(Section):
    """What `terrain-forge evaluate` found."""

    kind, title, place = "localisation", "Localisation", 87

    def blocks(self, built: Built) -> Sequence[Block]:
        """Scores, the paper's table, trajectories over the map, errors; none without scores."""
        try:
            found = built.recording
            tables = ("evaluation.csv", f"{MAPS}.csv")
            if found is None or not any((found.folder / RESULTS / t).is_file() for t in tables):
                return []
            with reading(f"dataset/{RESULTS}"):
                return list(_blocks(built, found, found.folder / RESULTS))
        except DataError as error:
            return [paragraph(f"The evaluation in dataset/{RESULTS} cannot be shown: {error}")]


def _blocks(built: Built, recording: Recording, folder: Path) -> Iterator[Block]:
    if (folder / f"{MAPS}.csv").is_file():
        yield heading("Maps")
        yield _shown(folder / f"{MAPS}.csv", first="l")
        yield paragraph(_HOW, "note")
    if not (folder / "evaluation.csv").is_file():
        return
    names = [row[0] for row in _rows(folder / "evaluation.csv")[1:]]
    yield heading("Trajectories")
    yield _shown(folder / "evaluation.csv", first="l", last="l")
    if (folder / "paper.csv").is_file():
        text = read_text(folder / "paper.txt", "paper.txt", most=2**20).splitlines()
        yield heading(text[0])
        head, *rows = _rows(folder / "paper.csv")
        yield table(head, rows, figures="lrrrrrl")
        for line in text:
            if line.startswith(_DIFFERS):
                yield paragraph(line[0].upper() + line[1:], "note")
    runs = _runs(folder, names)
    if not runs:
        return
    truth = np.asarray(recording.base_poses.position)
    yield drawing(
        trajectory_plot(built.map, built.world.ground.bounds, truth, runs),
        description="Trajectories over the map",
        caption=(
            "Where systems say the rover went, after the alignment, over the world from above; "
            "each by its best run, of its sensor's own frame. The truth is base_link's."
        ),
    )
    yield drawing(
        error_plot(runs),
        description="Error over the length of the path",
        caption="Distance to the truth after the alignment; the largest of each piece is shown.",
    )


def _shown(path: Path, *, first: str, last: str = "r") -> Block:
    """A table without the columns that are empty in all rows."""
    head, *rows = _rows(path)
    kept = [n for n in range(len(head)) if any(row[n] for row in rows)]
    cells = [[row[n] for n in kept] for row in rows]
    figures = first + "r" * (len(kept) - 2) + last
    return table([head[n] for n in kept], cells, figures=figures)


def _rows(path: Path) -> list[list[str]]:
    """The rows of a table, its head first.

    Raises:
        DataError: if it has no row, or one that is not as long as its head.
    """
    rows = [row for row in csv.reader(read_lines(path, path.name)) if row]
    if not rows:
        raise DataError(f"{path.name} is empty")
    for number, row in enumerate(rows, 1):
        if len(row) != len(rows[0]):
            raise DataError(f"{path.name}: row {number} has {len(row)} of {len(rows[0])} fields")
    return rows


def _runs(folder: Path, systems: Sequence[str]) -> dict[str, Array]:
    """The rows of each system's best run, of the best systems."""
    best: dict[str, Array] = {}
    for name in systems:
        found = [read_errors(path) for path in sorted(folder.glob(f"{name}_*/{ERRORS}"))]
        if found:
            best[name] = min(found, key=_rms)
    return {name: best[name] for name in sorted(best, key=lambda one: _rms(best[one]))[:_MOST]}


def _rms(rows: Array) -> float:
    return float(np.sqrt((rows[:, 5] ** 2).mean()))
