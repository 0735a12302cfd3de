"""Scores as tables: for the terminal, as CSV, LaTeX and JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

from terrain_forge.base import OutputError, checked, storing, write_whole
from terrain_forge.evaluation.score import Score, Spread
from terrain_forge.writers import quoted

_DEGREES = 180.0 / math.pi
_COLUMNS = (
    ("trajectory", "", "trajectory"),
    ("tracked", "%", "tracked"),
    ("ATE rms", "m", "ate.rms"),
    ("ATE median", "m", "ate.median"),
    ("ATE max", "m", "ate.most"),
    ("TDr median", "%", "drift.median"),
    ("TDr rms", "%", "drift.rms"),
    ("RPE median", "m", "rpe.median"),
    ("RPE angle", "deg", "rpe_angle.median"),
    ("yaw drift", "deg", "yaw_drift.median"),
    ("KITTI t", "%", "kitti.translation"),
    ("KITTI r", "deg/m", "kitti.rotation"),
    ("note", "", "note"),
)
"""Heading, unit, and what stands in the column."""
_FACTORS = {"%": 100.0, "deg": _DEGREES, "deg/m": _DEGREES}
_STYLES = {"": ".4g", "%": ".3g"}
TABLE, MAPS, PAPER = "evaluation", "maps", "paper"
"""Names of the tables' files, without their endings."""

Failures = Sequence[tuple[str, str]]
"""Names of trajectories that could not be scored, and why."""


def score_rows(scores: Sequence[Score]) -> list[list[str]]:
    """The cells of a table, its heading first; empty where a figure could not be told."""
    rows = [[f"{name} [{unit}]" if unit else name for name, unit, _ in _COLUMNS]]
    for one in scores:
        cells = []
        for _, unit, what in _COLUMNS:
            value = one.name if what == "trajectory" else _figure(one, what)
            scaled = value * _FACTORS.get(unit, 1.0) if isinstance(value, float) else value
            form = _STYLES.get(unit, ".4g")
            told = "" if scaled is None else scaled
            cells.append(format(told, form) if isinstance(told, float) else told)
        rows.append(cells)
    return rows


def _figure(score: Score, what: str) -> float | None:
    name, _, part = what.partition(".")
    found = getattr(score, name)
    if name == "kitti":
        return None if found is None else float(found[part == "rotation"])
    return found if not part or found is None else float(getattr(found, part))


@checked
def score_lines(scores: Sequence[Score]) -> list[str]:
    """The table as text; columns that are empty in all rows are left out."""
    return table_lines(score_rows(scores))


def score_plain(score: Score) -> dict[str, Any]:
    """The figures of a score as JSON values in SI units, and how it was evaluated."""

    def plain(value: Spread | None) -> dict[str, float] | None:
        return vars(value).copy() if value is not None else None

    kitti = score.kitti and {"translation": score.kitti[0], "rotation_rad_m": score.kitti[1]}
    return {
        "trajectory": score.name,
        "options": dict(score.options),
        "poses": score.poses,
        "tracked": score.tracked,
        "length_m": score.length,
        "scale": score.scale,
        "alignment": score.alignment.ravel().tolist(),
        "ate_m": plain(score.ate),
        "drift": plain(score.drift),
        "rpe_m": plain(score.rpe),
        "rpe_rad": plain(score.rpe_angle),
        "yaw_drift_rad": plain(score.yaw_drift),
        "kitti": kitti,
    }


def require_no_tables(folder: Path) -> None:
    """Refuse a folder in which files lie that tables would be written over.

    Raises:
        OutputError: names them.
    """
    found = sorted(one.name for one in folder.glob("*") if one.stem in (TABLE, MAPS, PAPER))
    if found:
        raise OutputError(
            f"{folder} holds {', '.join(found)}; move them away, choose another folder with -o, or "
            "let --force write over them"
        )


def require_place(folder: Path) -> None:
    """Refuse a folder for tables that is none and cannot be made, before there is much to write.

    Raises:
        OutputError: if it is a file.
        StorageError: says why it cannot be made or written.
    """
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"{folder} is no folder")
    made = [place for place in (folder, *folder.parents) if not place.exists()]
    with storing(folder, folder):
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with TemporaryFile(dir=folder):
                pass
        finally:
            with suppress(OSError):
                for place in made:
                    place.rmdir()


@checked
def write_scores(scores: Sequence[Score], folder: Path, *, failures: Failures = ()) -> list[Path]:
    """Write evaluation.json, evaluation.csv and evaluation.tex; returns them."""
    whole = {
        "scores": [score_plain(one) for one in scores],
        "failed": [{"trajectory": name, "why": why} for name, why in failures],
    }
    return write_table(score_rows(scores), whole, folder)


def write_table(
    rows: list[list[str]], whole: Any, folder: Path, *, name: str = TABLE
) -> list[Path]:
    """Write a table as CSV and LaTeX, and all of it as JSON; returns the files, JSON first."""
    told = json.dumps(whole, indent=1) + "\n"
    return write_texts(name, folder, json=told, csv=csv_table(rows), tex=latex_table(rows))


def write_texts(name: str, folder: Path, **texts: str) -> list[Path]:
    """Write texts as files of a name, each by its ending; returns them."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f"{name}.{ending}" for ending in texts]
    for path, text in zip(paths, texts.values(), strict=True):
        write_whole(path, text)
    return paths


def csv_table(rows: Sequence[Sequence[str]]) -> str:
    """A table as CSV, its heading first."""
    return "".join(",".join(map(quoted, row)) + "\n" for row in rows)


def text_table(rows: Sequence[Sequence[str]]) -> list[str]:
    """A table as lines of text, all columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]


def table_lines(rows: Sequence[Sequence[str]]) -> list[str]:
    """A table as lines of text; columns that are empty in all rows are left out."""
    kept = [n for n in range(len(rows[0])) if any(row[n] for row in rows[1:])]
    widths = [max(len(row[n]) for row in rows) for n in kept]
    return [
        "  ".join(
            row[n].ljust(width) if n == 0 else row[n].rjust(width)
            for n, width in zip(kept, widths, strict=True)
        ).rstrip()
        for row in rows
    ]


_ESCAPED = str.maketrans(
    {
        **{mark: f"\\{mark}" for mark in "%_&#${}"},
        "\\": r"\textbackslash{}",
        "~": r"\textasciitilde{}",
        "^": r"\textasciicircum{}",
        "<": r"\textless{}",
        ">": r"\textgreater{}",
        "|": r"\textbar{}",
        "\n": " ",
    }
)


def latex_table(rows: Sequence[Sequence[str]]) -> str:
    """A table as LaTeX's tabular, its heading first."""

    def line(row: Sequence[str]) -> str:
        text = " & ".join(cell.translate(_ESCAPED) for cell in row) + r" \\"
        return "{}" + text if text[0] in "[*" else text  # else a part of the line break before

    first, *rest = map(line, rows)
    head = rf"\begin{{tabular}}{{l{'r' * (len(rows[0]) - 1)}}}"
    return "\n".join([head, r"\hline", first, r"\hline", *rest, r"\hline", r"\end{tabular}", ""])
