"""One cell of a study in a process of its own.

Its folder holds job.json; what comes of it is written as result.json, and none where it is killed.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from terrain_forge.base import TerrainForgeError, write_whole
from terrain_forge.evaluation import ScoreOptions, evaluate_recording, result_plain
from terrain_forge.making import plan
from terrain_forge.model import Sensor
from terrain_forge.pipeline import realise, record
from terrain_forge.recipe import load_recipe
from terrain_forge.rovers import rover_of
from terrain_forge.sensors import Frames, instrument_kinds
from terrain_forge.studies.cells import adapter_of
from terrain_forge.studies.spec import RecordSpec

JOB, RESULT, LOG = "job.json", "result.json", "log.txt"
KEPT = "slam"
"""What is kept of an evaluation: trajectories, errors, tables."""
_EYES = "camera", "stereo"


def sensors_for(job: Mapping[str, Any], sensors: tuple[Sensor, ...]) -> tuple[str, ...]:
    """Names of the sensors that a cell records: those that its systems can use."""
    if only := RecordSpec(**job["record"]).only:
        return tuple(only)
    systems = [adapter_of(plain) for plain in job["systems"]]
    if not all(system.needs for system in systems):
        return ()  # one that says nothing may use anything
    needs = {need for system in systems for need in system.needs}
    wanted = {one.name for need in needs for one in serving(need, sensors)}
    kinds = instrument_kinds()
    known = [one for one in sensors if one.kind in kinds]
    return tuple(  # tables, such as an IMU's, cost next to nothing
        one.name for one in known if one.name in wanted or not issubclass(kinds[one.kind], Frames)
    )


def serving(need: str, sensors: tuple[Sensor, ...]) -> list[Sensor]:
    """The sensors that serve a system's need: for `stereo` pairs, or else cameras in plural."""
    eyes = [one for one in sensors if one.kind in _EYES]
    if need == "mono":
        return eyes
    if need == "rgbd":
        return [one for one in eyes if "depth" in getattr(one, "channels", ())]
    if need == "stereo":
        cameras = [one for one in eyes if one.kind == "camera"]
        found = [one for one in eyes if one.kind == "stereo"]
        return found or (cameras if len(cameras) > 1 else [])
    return [one for one in sensors if one.kind == need]


def lacking(job: Mapping[str, Any], sensors: tuple[Sensor, ...]) -> dict[str, list[str]]:
    """What systems need that none of a rover's sensors serves, by their names."""
    systems = [adapter_of(plain) for plain in job["systems"]]
    found = {
        one.name: [str(need) for need in one.needs if not serving(need, sensors)] for one in systems
    }
    return {name: needs for name, needs in found.items() if needs}


def carry_out(job: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Make the world, record it, evaluate the systems; whatever goes wrong is a result."""
    try:
        file = load_recipe(job["path"], changes=tuple(job["changes"]))
        site = plan(file.recipe, folder=file.folder)
        part, sensors = RecordSpec(**job["record"]), rover_of(site).sensors
        recorded = record(
            realise(site), folder, begin=part.from_s, end=part.to_s,
            only=sensors_for(job, sensors), workers=job["workers"], force=True,
            formats=("euroc",),  # adapters make of it what their systems read
        )  # fmt: skip
        results = evaluate_recording(
            recorded.folder,
            [adapter_of(plain) for plain in job["systems"]],
            runs=job["runs"],
            options=ScoreOptions(**job["score"]),
            force=True,
            progress=_log,
        )
    except TerrainForgeError as error:
        return {"status": "failed", "why": str(error), "results": []}
    _keep(recorded.folder / KEPT, folder / KEPT)
    return {"status": "done", "why": "", "results": [result_plain(one) for one in results]}


def _log(stage: str, share: float) -> None:
    """Say what begins, into the cell's log."""
    if not share:
        print(stage, flush=True)  # noqa: T201


def _keep(source: Path, target: Path) -> None:
    """Take over what an evaluation left, but for the recording in other formats."""
    if target.exists():
        shutil.rmtree(target)  # of this very cell, before it was done
    shutil.copytree(source, target, ignore=shutil.ignore_patterns("inputs"))


def main(place: str) -> None:
    """Carry out the job of a folder."""
    folder = Path(place)
    job = json.loads((folder / JOB).read_text(encoding="utf-8"))
    result = carry_out(job, folder)
    whole = {"digest": job["digest"], **result}
    write_whole(folder / RESULT, json.dumps(whole, indent=1) + "\n")
