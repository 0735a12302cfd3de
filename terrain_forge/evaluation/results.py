"""Results of systems as tables: of each the median over its runs, and the range of its errors."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from terrain_forge.base import Record, write_whole
from terrain_forge.evaluation.adapter import Run
from terrain_forge.evaluation.loops import LoopScore
from terrain_forge.evaluation.paper import SETUP, paper_figure
from terrain_forge.evaluation.score import Score
from terrain_forge.evaluation.tables import score_plain, table_lines, write_table

_HEAD = (
    "system", "runs", "length [m]", "tracked [%]", "ATE [m]", "ATE of runs [m]",
    "TDr median [%]", "TDr rms [%]", "loops right", "processor [s/frame]", "memory [MB]",
    "TDr of runs [%]", "RPE median [m]", "yaw drift [deg]", "KITTI t [%]", "KITTI r [deg/m]",
)  # fmt: skip
_BRIEF = {
    "system": "system", "runs": "runs", "tracked [%]": "tracked [%]", "ATE [m]": "ATE [m]",
    "ATE of runs [m]": "of runs [m]", "TDr median [%]": "TDr [%]", "loops right": "loops right",
    "processor [s/frame]": "s/frame", "memory [MB]": "MB",
}  # fmt: skip
"""Columns that a terminal is wide enough for, and what they are called there."""
_PAPER = "in the paper", "its ATE [m]", "its TDr [%]"
_LAST = "result"
_DEGREES = 180.0 / math.pi


@dataclass(frozen=True, kw_only=True, eq=False)
class Result(Record):
    """One run of a system, and how well it localised."""

    run: Run
    """The run."""
    number: int
    """Which of the system's runs, from 1."""
    score: Score | None = None
    """Its score; None where it failed."""
    loops: LoopScore | None = None
    """How good its loop closures are; None where it tells none."""
    frame: str
    """Whose motion was compared."""
    world: str
    """The world that was recorded."""
    recording: str = ""
    """Digest of the recording's index, which changes where it grows."""
    frames: int = 0
    """Sweeps or pictures that the system was given; 0 where it looks at neither."""

    @property
    def processor_s_per_frame(self) -> float:
        """Processor time for each frame, or each pose where it looks at none [s]."""
        poses = self.score.poses if self.score else 0
        return self.run.processor_s / max(self.frames or poses, 1)


def result_plain(result: Result) -> dict[str, Any]:
    """A result as JSON values in SI units."""
    run = result.run
    paper = paper_figure(run.system, result.world)
    return {
        "system": run.system,
        "world": result.world,
        "recording": result.recording,
        "run": result.number,
        "status": run.status,
        "why": run.why,
        "frame": result.frame,
        "seconds": run.seconds,
        "processor_s": run.processor_s,
        "frames": result.frames,
        "memory_bytes": run.memory,
        "score": score_plain(result.score) if result.score else None,
        "loops": vars(result.loops).copy() if result.loops else None,
        "paper": paper and vars(paper).copy(),
    }


def result_rows(results: Sequence[Result]) -> list[list[str]]:
    """The cells of the table, its heading first; the paper's figures where there are any."""
    names = list(dict.fromkeys(one.run.system for one in results))
    paper = {one.run.system: paper_figure(one.run.system, one.world) for one in results}
    beside = any(paper.values())
    rows = [[*_HEAD, *(_PAPER if beside else ()), _LAST]]
    for name in names:
        mine = [one for one in results if one.run.system == name]
        row = [name, *_figures(mine)]
        if beside:
            told = paper[name]
            row += [told.system, f"{told.ate:.4g}", _percent(told.drift)] if told else [""] * 3
        rows.append([*row, _outcome(mine)])
    return rows


def _outcome(results: Sequence[Result]) -> str:
    """What went wrong in a system's runs, the first of each kind, or that they are done."""
    failures = [f"{one.run.status}: {one.run.why}" for one in results if one.score is None]
    faults = [one.run.why for one in results if one.score and one.run.why]  # of loop closures, maps
    notes = [one.score.note for one in results if one.score and one.score.note]
    return "; ".join(kind[0] for kind in (failures, faults, notes) if kind) or "done"


def _figures(results: Sequence[Result]) -> list[str]:
    """Cells of a system's runs."""
    good = [(one.score, one.run) for one in results if one.score is not None]
    runs = f"{len(good)} of {len(results)}"
    if not good:
        return [runs, *[""] * (len(_HEAD) - 2)]
    ate = np.array([score.ate.rms for score, _ in good])
    drifts = [score.drift for score, _ in good if score.drift]
    return [
        runs,
        f"{_median(score.length for score, _ in good):.4g}",
        _percent(_median(score.tracked for score, _ in good)),
        f"{np.median(ate):.4g}",
        _range(ate.tolist()),
        _percent(_median(one.median for one in drifts)) if drifts else "",
        _percent(_median(one.rms for one in drifts)) if drifts else "",
        next((one.loops.told for one in results if one.loops), ""),
        f"{_median(one.processor_s_per_frame for one in results if one.score):.3g}",
        f"{_median(run.memory / 1e6 for _, run in good):.0f}",
        _range([one.median for one in drifts], 100.0),
        _middle([s.rpe.median for s, _ in good if s.rpe]),
        _middle([s.yaw_drift.median for s, _ in good if s.yaw_drift], _DEGREES),
        _middle([s.kitti[0] for s, _ in good if s.kitti], 100.0),
        _middle([s.kitti[1] for s, _ in good if s.kitti], _DEGREES),
    ]


def _middle(values: Sequence[float], factor: float = 1.0) -> str:
    """The median; empty of none."""
    return f"{factor * float(np.median(values)):.3g}" if values else ""


def _range(values: Sequence[float], factor: float = 1.0) -> str:
    """The least and the largest of some runs; empty of one."""
    scaled = factor * np.array(values)
    return f"{scaled.min():.3g} to {scaled.max():.3g}" if len(scaled) > 1 else ""


def _median(values: Any) -> float:
    return float(np.median(list(values)))


def _percent(part: float) -> str:
    return f"{100.0 * part:.3g}"


def result_lines(results: Sequence[Result]) -> list[str]:
    """The columns of the table that fit on a terminal, as text; below it what else is to be told.

    Columns that are empty in all rows are left out; the paper's figures come after.
    """
    head, *rows = result_rows(results)
    lines = table_lines(_columns([head, *rows], _BRIEF))
    lines += [f"{row[0]}: {row[-1]}" for row in rows if row[-1] != "done"]
    if _PAPER[0] not in head:
        return lines
    beside = [row for row in rows if row[head.index(_PAPER[0])]]
    names = {name: name for name in (_HEAD[0], *_PAPER)}
    return [*lines, *table_lines(_columns([head, *beside], names)), SETUP]


def _columns(rows: Sequence[Sequence[str]], names: Mapping[str, str]) -> list[list[str]]:
    """Some columns of a table, under other names."""
    kept = [rows[0].index(name) for name in names]
    return [list(names.values()), *([row[n] for n in kept] for row in rows[1:])]


def write_results(results: Sequence[Result], folder: Path) -> list[Path]:
    """Write evaluation.json, evaluation.csv, evaluation.tex and evaluation.txt; returns them."""
    plain = [result_plain(one) for one in results]
    paths = write_table(result_rows(results), plain, folder)
    text = folder / "evaluation.txt"
    write_whole(text, "\n".join(result_lines(results)) + "\n")
    return [*paths, text]
