"""Drake worlds in Drake, in an interpreter of its own where ours does not have it."""

from __future__ import annotations

import json
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from terrain_forge.base import python_words
from terrain_forge.model import Opening
from terrain_forge.validation import (
    SETTLING,
    Consumer,
    Reading,
    Sample,
    highest_on,
    is_ground,
    python_with,
    read_answer,
    read_mesh,
    read_probe,
    run,
)

VARIABLE = "TERRAIN_FORGE_DRAKE_PYTHON"
"""The environment variable that names a Python with Drake."""


def read_drake(sample: Sample, folder: Path, options: Any, scratch: Path) -> Reading:
    """A Drake export as Drake's parser, contact geometry and solver have it.

    Raises:
        NotRun: if there is no Python with Drake.
        SimulationError: if Drake fails, as its strict parser does on any complaint.
    """
    python = python_with("pydrake", VARIABLE)
    with tempfile.TemporaryDirectory(dir=scratch) as temporary:
        binary, ground = Path(temporary) / "meshes.bin", Path(temporary) / "ground.sdf"
        _write_ground(folder / "world.sdf", ground)
        order = {
            "world": str((folder / "world.sdf").absolute()),
            "ground": str(ground),
            "binary": str(binary),
            "gravity": sample.world.site.body.gravity,
            "balls": sample.balls.start.tolist(),
            "radius": sample.balls.radius,
            "seconds": SETTLING,
        }
        command = python_words(read_probe(__file__, "probe.py"), python)
        text = run(command, text=json.dumps(order), log=scratch / "drake.log")
        reading = read_answer(sample, text, binary)
    reasons = {"gravity": "Drake takes none from files", "path": "Drake has no actors"}
    error = options.merged_error(sample.world)
    return replace(reading, tracks=None, rock_error=error, reasons=reasons)


def _write_ground(world: Path, path: Path) -> None:
    """Write a world file without its rocks: no ball is near one, and they would only take time."""
    tree = ElementTree.parse(world)
    for parent in tree.getroot().iter("world"):
        for model in parent.findall("model"):
            if not is_ground(model.get("name", "")):
                parent.remove(model)
    for uri in tree.getroot().iter("uri"):
        uri.text = (world.parent.absolute() / (uri.text or "")).as_uri()
    ElementTree.register_namespace("drake", "http://drake.mit.edu")
    tree.write(path, encoding="utf-8", xml_declaration=True)


def read_ground(sample: Sample, folder: Path, options: Any, scratch: Path) -> Reading:
    """The ground's collision meshes that world.sdf names."""
    del options, scratch
    root = ElementTree.parse(folder / "world.sdf").getroot()
    grounds = [c for c in root.iter("collision") if is_ground(c.get("name", ""))]
    meshes = (read_mesh(folder / c.findtext("geometry/mesh/uri", "")) for c in grounds)
    return Reading(consumer="files", heights=highest_on(meshes, sample.points))


def opening(folder: Path, options: Any) -> Opening:
    """How the folder is opened."""
    del options
    return Opening(
        title="Drake",
        commands="from pydrake.multibody.parsing import Parser\n"
        f'Parser(plant).AddModels("{folder.name}/world.sdf")   '
        "# contact: see docs/exporters/drake.md",
    )


CONSUMERS = (
    Consumer(name="files", read=read_ground, quick=True, full=False),
    Consumer(name="Drake", read=read_drake),
)
"""What reads these exports back."""
