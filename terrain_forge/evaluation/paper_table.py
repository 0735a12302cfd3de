"""Tables II and III of Giubilato et al. 2020 beside our figures, and what differs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from terrain_forge.datasets import ORB_FEATURES, Recording
from terrain_forge.evaluation.paper import (
    PAPER_LENGTHS,
    PAPER_SYSTEMS,
    PAPER_TABLES,
    paper_figure,
    table_of,
)
from terrain_forge.evaluation.results import Result
from terrain_forge.evaluation.tables import (
    PAPER,
    csv_table,
    latex_table,
    text_table,
    write_texts,
)

_HEAD = (
    "system", "ATE in the paper [m]", "ATE here [m]", "TDr in the paper [%]", "TDr here [%]",
    "tracked here [%]", "here by",
)  # fmt: skip
_CAMERA = {"width_px": 1280, "height_px": 720, "rate_hz": 30.0, "baseline_m": 0.12}
_LIDAR = {"rate_hz": 10.0, "noise_m": 0.01, "snapshot": True}
_UNITS = {"width_px": "px wide", "height_px": "px high", "rate_hz": "Hz", "baseline_m": "m apart"}
_FEATURES = 2400
"""ORB features of a picture."""
_FOV = 80.0
"""Horizontal angle of the cameras in the paper's repository [degrees]; its text says 90."""
_BEAMS, _COLUMNS, _HALF = 64, 1800, 16.0


def paper_rows(results: Sequence[Result], world: str) -> list[list[str]]:
    """The cells of the table of a world that has one of the paper's paths, its heading first.

    The paper's six systems come first, whether they were run here or not; then those that it did
    not have.
    """
    names = list(dict.fromkeys(one.run.system for one in results))
    rows = [list(_HEAD)]
    for system, (ate, drift) in PAPER_TABLES[table_of(world)].items():
        told = [f"{ate:.2f}", f"{drift:.2f}"]
        mine = [n for n in names if (f := paper_figure(n, world)) and f.system == system]
        for number, name in enumerate(mine or [""]):
            rows.append(_row(system if not number else "", told, results, name))
    for name in names:
        if paper_figure(name, world) is None:
            rows.append(_row(name, ["–", "–"], results, name))
    return rows


def _row(system: str, paper: Sequence[str], results: Sequence[Result], name: str) -> list[str]:
    ate, drift, tracked = _ours([one for one in results if one.run.system == name])
    by = name if name and name != system else ""
    return [system, paper[0], ate, paper[1], drift, tracked, by]


def _ours(results: Sequence[Result]) -> tuple[str, str, str]:
    """ATE, TDr and what was tracked: the median of the runs, and the range of the ATE."""
    scores = [one.score for one in results if one.score]
    if not scores:
        return (results[0].run.status if results else "not run"), "", ""
    ate = np.array([score.ate.rms for score in scores])
    drift = [100.0 * score.drift.median for score in scores if score.drift]
    span = f" ({ate.min():.2g} to {ate.max():.2g})" if len(ate) > 1 else ""
    return (
        f"{np.median(ate):.3g}{span}",
        f"{np.median(drift):.3g}" if drift else "",
        f"{100.0 * float(np.median([score.tracked for score in scores])):.3g}",
    )


def differences(recording: Recording, results: Sequence[Result]) -> Iterator[str]:
    """What differs between the paper's set-up and a recording's, a line each."""
    yield "ground, rocks and pictures: of this world's own, made after the paper's description"
    yield from _motion(recording, results)
    yield from _sensors(recording)
    names = dict.fromkeys(one.run.system for one in results)
    if {"orb-slam2", "orb-slam3"} & names.keys() and ORB_FEATURES != _FEATURES:
        yield f"ORB-SLAM: {ORB_FEATURES} features of a picture, not {_FEATURES}"
    for name in names:
        told = paper_figure(name, recording.name)
        if told and (why := PAPER_SYSTEMS[name][1]):
            yield f"{name} stands for {told.system}: {why}"
    options = next((dict(one.score.options) for one in results if one.score), {})
    if options:
        yield (
            f"scores: alignment {options['align']} by {options['third_by']}, TDr at stations of "
            f"{options['stations_m']:g} m, median; the paper does not say by what it takes the "
            "third, nor at which poses it looks"
        )
    yield from dict.fromkeys(one.score.note for one in results if one.score and one.score.note)
    runs = max((one.number for one in results), default=1)
    yield f"runs: {runs} here, one in the paper"


def _motion(recording: Recording, results: Sequence[Result]) -> Iterator[str]:
    motion = recording.about.get("motion", {})
    if motion.get("source") == "drive":
        yield "motion: a simulated drive with suspension, in the paper an actor on the path"
    lengths = [one.score.length for one in results if one.score]
    about = PAPER_LENGTHS[table_of(recording.name)]
    if lengths and abs(max(lengths) - about) > 0.1 * about:
        yield f"path: {max(lengths):.3g} m of it, in the paper about {about:g} m"
    if recording.about.get("profile") == "quick":
        yield "recorded quickly: small pictures, and few of them"


_NEEDED = {
    "stereo": {*_CAMERA, "horizontal_fov_deg"},
    "lidar": {
        *(*_LIDAR, "elevations_deg", "channels", "vertical_fov_deg"),
        *("firing_period_us", "horizontal_samples"),
    },
}
"""Figures of sensors that a comparison needs; recordings of others may lack them."""


def _sensors(recording: Recording) -> Iterator[str]:
    told: list[Mapping[str, Any]] = [
        one
        for one in recording.about.get("sensors", [])
        if _NEEDED.get(one["kind"], set()) <= {*one}
    ]
    there = {one["name"] for one in recording.about["streams"]}
    cameras = [one for one in told if one.get("kind") == "stereo" and recording.cameras]
    for one in cameras[:1]:
        shown = [
            f"{one[key]:g} {_UNITS[key]}, not {value:g}"
            for key, value in _CAMERA.items()
            if not math.isclose(one[key], value)
        ]
        if one.get("focal_px") is None and not math.isclose(one["horizontal_fov_deg"], _FOV):
            shown.append(f"{one['horizontal_fov_deg']:g} deg, not {_FOV:g}")
        shown.append("noise of photons and chip, flare and exposure, not of one deviation")
        yield f"cameras: {'; '.join(shown)}"
    for one in [one for one in told if one.get("kind") == "lidar" and one["name"] in there][:1]:
        yield from _lidar(one)
    extra = [kind for kind in ("imu", "odometry") if recording.series(kind)]
    if extra:
        yield f"{' and '.join(extra)}: here, the paper had none"


def _lidar(one: Mapping[str, Any]) -> Iterator[str]:
    shown = []
    elevations = one["elevations_deg"]
    beams = len(elevations) or one["channels"]
    half = 0.5 * one["vertical_fov_deg"] if not elevations else 0.0
    low, high = (min(elevations), max(elevations)) if elevations else (-half, half)
    if beams != _BEAMS or max(abs(low + _HALF), abs(high - _HALF)) > 0.1:
        shown.append(f"{beams} beams from {low:g} to {high:g} deg, not {_BEAMS} of ±{_HALF:g}")
    firing = 1e-6 * one["firing_period_us"]
    columns = int(1.0 / (one["rate_hz"] * firing) + 1e-6) if firing else one["horizontal_samples"]
    if columns != _COLUMNS:
        shown.append(f"{columns} columns, not {_COLUMNS}")
    for key, unit in (("rate_hz", "Hz"), ("noise_m", "m of noise")):
        if not math.isclose(one[key], _LIDAR[key]):
            shown.append(f"{one[key]:g} {unit}, not {_LIDAR[key]:g}")
    if not one["snapshot"]:
        shown.append("each point at its own time, not all of a sweep at one")
    if shown:
        yield f"lidar: {'; '.join(shown)}"


def write_paper_table(recording: Recording, results: Sequence[Result], folder: Path) -> list[Path]:
    """Write paper.txt, paper.csv and paper.tex where the world has one of the paper's paths."""
    if table_of(recording.name) not in PAPER_TABLES:
        return []
    number = {"gale-long": "II (Long)", "gale-short": "III (Short)"}[table_of(recording.name)]
    title = f"Table {number} of Giubilato et al. 2020, and this recording"
    rows = paper_rows(results, recording.name)
    differs = [f"differs: {line}" for line in differences(recording, results)]
    text = "\n".join([title, "", *text_table(rows), "", *differs, ""])
    comments = "".join(f"% {line}\n" for line in (title, *differs))
    latex = comments + latex_table(rows)
    return write_texts(PAPER, folder, txt=text, csv=csv_table(rows), tex=latex)
