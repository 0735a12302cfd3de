"""The page of a study: one HTML file with its tables and plots."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from terrain_forge.report import Block, Cell, drawing, facts, paragraph, table, write_page
from terrain_forge.studies.cells import Study
from terrain_forge.studies.effects import (
    MAIN,
    Outcome,
    effect_rows,
    effects_of,
    outcome_rows,
)
from terrain_forge.studies.figures import effect_plot

PAGE = "study.html"
_HOW = (
    "A dot is a world, the line joins the medians, a bar goes from the least to the largest; a "
    "cross is a world in which the system gave no figure."
)


def write_study_page(study: Study, outcomes: Sequence[Outcome], out: Path) -> list[Path]:
    """Write `out`/study.html, and each plot as PNG beside it; returns the files."""
    effects = effects_of(study, outcomes)
    sections: list[tuple[str, list[Block]]] = [("Study", _about(study, outcomes))]
    paths = []
    for number, factor in enumerate(study.factors, 1):
        picture = effect_plot(study, factor, effects)
        paths.append(out / f"effect_{number}.png")
        paths[-1].unlink(missing_ok=True)  # a link would be written through
        paths[-1].write_bytes(picture)
        mine = [one for one in effects if one.factor == factor.name]
        blocks = [drawing(picture, description=f"{MAIN} over {factor.name}", caption=_HOW)]
        head, *rows = effect_rows(mine)
        shown = [row[1:] for row in rows if row[5]]
        if shown:
            blocks.append(_table([head[1:], *shown], "lll"))
        sections.append((factor.name, blocks))
    head, *rows = outcome_rows(study, outcomes)
    words = "l" * (len(study.factors) + 2)
    sections.append(("All worlds", [_table([head, *rows], words, last="l", folded=len(rows) > 40)]))
    scored = sum(one.runs > 0 for one in outcomes)
    whole = scored == len(outcomes)
    verdict = Cell(
        f"{scored} of {len(outcomes)} evaluations gave a figure", "good" if whole else ""
    )
    page = out / PAGE
    write_page(page, title=study.file.name, lead=study.file.spec.about, verdict=verdict,
               sections=sections)  # fmt: skip
    return [page, *paths]


def _about(study: Study, outcomes: Sequence[Outcome]) -> list[Block]:
    spec = study.file.spec
    told = [
        ("Recipe", ", ".join(path.name for path in study.file.recipes)),
        ("Worlds", str(len({one.cell.digest for one in outcomes}))),
        ("Systems", ", ".join(adapter.name for adapter in study.file.systems)),
        ("Runs of each", str(spec.runs)),
        ("Design", "all levels with all others" if spec.design == "all" else "one factor each"),
    ]
    lengths = [one.length for one in outcomes if one.length]
    if lengths:
        told.append(("Length of the path", f"{min(lengths):.3g} to {max(lengths):.3g} m"))
    found = [facts(told)]
    if spec.set:
        changed = ", ".join(f"{key} = {value}" for key, value in spec.set.items())
        found.append(paragraph(f"Beside the recipe: {changed}.", "note"))
    return found


def _table(
    rows: Sequence[Sequence[str]], words: str, last: str = "r", folded: bool = False
) -> Block:
    head, *rest = rows
    figures = words + "r" * (len(head) - len(words) - 1) + last
    return table(head, rest, figures=figures, folded=folded)
