"""What a study found: figures of each cell's systems, and effects of the levels with spread."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from terrain_forge.evaluation import csv_table, latex_table, text_table, write_texts
from terrain_forge.studies.cells import Cell, Study

MEASURES = {
    "ATE": ("ate_m", "rms", 1.0, "m"),
    "TDr": ("drift", "median", 100.0, "%"),
    "RPE": ("rpe_m", "median", 1.0, "m"),
}
"""Figures of errors whose effects are told: key of the score, part of it, factor, unit."""
TRACKED = "tracked"
UNITS = {**{name: unit for name, (*_, unit) in MEASURES.items()}, TRACKED: "%"}
"""All measures whose effects are told, and their units."""
MAIN = "ATE"
"""The measure that is drawn."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What a system did in a cell: the median over its runs."""

    cell: Cell
    """The cell."""
    system: str
    """The system."""
    runs: int
    """Its runs that gave a score."""
    status: str
    """`done`, or what became of a run that gave none."""
    why: str
    """What was wrong."""
    length: float | None
    """Length of the true path [m]."""
    tracked: float | None
    """Part of the time in which it was not lost [%]: nothing of a run without a score; None where
    none was run."""
    figures: Mapping[str, float | None]
    """By the names of `MEASURES`, in their units."""

    def figure(self, measure: str) -> float | None:
        """The figure of a measure of `UNITS`, in its unit."""
        return self.tracked if measure == TRACKED else self.figures[measure]


def outcomes_of(study: Study, results: Sequence[Mapping[str, Any]]) -> list[Outcome]:
    """What each system did in each cell; a cell that failed is a failure of all of them."""
    found = []
    for cell, result in zip(study.cells, results, strict=True):
        for adapter in study.file.systems:
            runs = [one for one in result["results"] if one["system"] == adapter.name]
            found.append(_outcome(cell, adapter.name, runs, result))
    return found


def _outcome(
    cell: Cell, system: str, runs: Sequence[Mapping[str, Any]], result: Mapping[str, Any]
) -> Outcome:
    scores = [one["score"] for one in runs if one["score"]]
    wrong = next((one for one in runs if not one["score"]), None if runs else result)

    def median(values: Iterator[float | None]) -> float | None:
        there = [value for value in values if value is not None]
        return float(np.median(there)) if there else None

    figures = {
        name: median(
            factor * score[key][part] if score[key] else None for score in scores
        )
        for name, (key, part, factor, _) in MEASURES.items()
    }  # fmt: skip
    return Outcome(
        cell=cell,
        system=system,
        runs=len(scores),
        status=str(wrong["status"]) if wrong else "done",
        why=str(wrong["why"]) if wrong else "",
        length=median(score["length_m"] for score in scores),
        tracked=median(100.0 * one["score"]["tracked"] if one["score"] else 0.0 for one in runs),
        figures=figures,
    )


@dataclass(frozen=True, kw_only=True)
class Effect:
    """What a level of a factor does to a system, over all cells that have it."""

    factor: str
    """The factor."""
    level: str
    """Its level."""
    system: str
    """The system."""
    measure: str
    """One of `UNITS`."""
    values: tuple[float, ...]
    """The figures of the cells."""
    cells: int
    """Cells, those without a figure too."""
    ratios: tuple[float, ...]
    """Figures over those of the first level, the same else and of the same seed."""

    @property
    def told(self) -> list[str]:
        """Median, least and largest, and by how much the first level's figures are multiplied."""
        if not self.values:
            return ["", "", "", ""]
        values, ratios = np.array(self.values), np.array(self.ratios)
        times = f"{np.median(ratios):.3g}" if len(ratios) else ""
        span = f"{ratios.min():.3g} to {ratios.max():.3g}" if len(ratios) > 1 else ""
        return [
            f"{np.median(values):.4g}",
            f"{values.min():.3g} to {values.max():.3g}" if len(values) > 1 else "",
            times,
            span,
        ]


def effects_of(study: Study, outcomes: Sequence[Outcome]) -> list[Effect]:
    """The effects of all factors on all systems, in the order of factors, systems and levels."""
    found = []
    for factor in study.factors:
        first = factor.levels[0].name
        rest = {one.name: one.levels[0].name for one in study.factors if one is not factor}
        for adapter in study.file.systems:
            mine = [one for one in outcomes if one.system == adapter.name]
            if study.file.spec.design == "each":
                mine = [one for one in mine if rest.items() <= dict(one.cell.levels).items()]
            for level in factor.levels:
                for measure in UNITS:
                    found.append(
                        _effect(factor.name, level.name, first, adapter.name, measure, mine)
                    )
    return found


def _effect(
    factor: str, level: str, first: str, system: str, measure: str, outcomes: Sequence[Outcome]
) -> Effect:
    here = [one for one in outcomes if dict(one.cell.levels)[factor] == level]
    base = {
        _others(one, factor): one.figure(measure)
        for one in outcomes
        if dict(one.cell.levels)[factor] == first
    }
    ratios = []
    for one in here:
        figure, reference = one.figure(measure), base.get(_others(one, factor))
        if level != first and figure is not None and reference:
            ratios.append(figure / reference)
    values = [one.figure(measure) for one in here]
    return Effect(
        factor=factor,
        level=level,
        system=system,
        measure=measure,
        values=tuple(value for value in values if value is not None),
        cells=len(here),
        ratios=tuple(ratios),
    )


def _others(outcome: Outcome, factor: str) -> tuple[Any, ...]:
    """What a cell has in common with those that it is compared with."""
    return tuple(pair for pair in outcome.cell.levels if pair[0] != factor), outcome.cell.seed


def effect_rows(effects: Sequence[Effect], *measures: str) -> list[list[str]]:
    """The cells of the table of effects on some measures, or all, its heading first."""
    head = "factor", "level", "system", "measure", "scored", "median", "range"
    rows = [[*head, "times the first", "range of that"]]
    for measure in measures or UNITS:
        unit = UNITS[measure]
        for one in effects:
            if one.measure == measure:
                scored = f"{len(one.values)} of {one.cells}"
                named = [one.factor, one.level, one.system, f"{measure} [{unit}]", scored]
                rows.append([*named, *one.told])
    return rows


def outcome_rows(study: Study, outcomes: Sequence[Outcome]) -> list[list[str]]:
    """The cells of the table of all cells, its heading first."""
    names = [factor.name for factor in study.factors]
    head = [f"{name} [{unit}]" for name, (*_, unit) in MEASURES.items()]
    rows = [[*names, "seed", "system", "runs", "length [m]", "tracked [%]", *head, "result"]]
    for one in outcomes:
        levels = dict(one.cell.levels)
        figures = [one.length, one.tracked, *one.figures.values()]
        shown = ["" if figure is None else f"{figure:.4g}" for figure in figures]
        result = f"{one.status}: {one.why}" if one.why else one.status
        rows.append([*(levels[name] for name in names), str(one.cell.seed), one.system,
                     str(one.runs), *shown, result])  # fmt: skip
    return rows


def write_tables(study: Study, outcomes: Sequence[Outcome], out: Path) -> list[Path]:
    """Write cells and effects as text, CSV, LaTeX and JSON; returns the files."""
    effects = effects_of(study, outcomes)
    tables = {"cells": outcome_rows(study, outcomes)}
    if effects:
        tables["effects"] = effect_rows(effects)
    paths = []
    for name, rows in tables.items():
        text = "\n".join([study.file.spec.about, *text_table(rows), ""]).lstrip("\n")
        paths += write_texts(name, out, txt=text, csv=csv_table(rows), tex=latex_table(rows))
    plain = [vars(one) for one in effects]
    return paths + write_texts("effects", out, json=json.dumps(plain, indent=1) + "\n")
