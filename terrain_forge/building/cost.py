"""What a build costs on the machine at hand: time stage by stage, memory, disk.

The rates are those of one machine of two cores, of which `pace` tells how much slower this one is.
"""

from __future__ import annotations

import json
import os
import platform
import time
import zlib
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from tempfile import NamedTemporaryFile

import numpy as np

from terrain_forge.base import cache_folder
from terrain_forge.model import Site
from terrain_forge.paths import duration
from terrain_forge.recipe import (
    ExportOrder,
    Recipe,
    expected_nodes,
    memory_needed,
    rocks_of,
    tile_cells,
)
from terrain_forge.rocks import LibrarySpec, expected_dynamic
from terrain_forge.validation import MOST_WATCHED

SETTLING = 0.035
"""Time to settle a dynamic rock [s]."""
WATCHING = 0.06
"""Time to watch a dynamic rock in the exported world [s]."""
DRIVING = 1 / 20
"""Time to simulate a second of driving [s]; of many drives two are made at once."""
TEXEL, USUAL_SIDE = 1e-6, 1024
"""Time for each pixel of a larger texture [s] than one of so many pixels a side."""
SHAPE = 0.1
"""Time to make each shape of a library [s] beyond the usual number."""
WRITING, READING = 1 / 2.5e8, 1 / 4e8
"""Time to write a byte of an export [s], and to read it again."""
CONSUMER = 3.0
"""Time that an export's own programs take to begin [s]."""
OTHER_SIZE = (100, 4000)
"""Bytes of an export for each node and rock whose options have no `bytes_each`."""
WORLD_SIZE, WORLD_SIZES = 12e6, (30, 400)
"""Bytes of all but the exports, and what each node and rock adds to them."""
CALIBRATED = 0.021
"""How long the machine of the rates takes for the work of `pace` [s]."""


def pace() -> float:
    """How much slower this machine is; measured once, in a tenth of a second, and kept."""
    folder, machine = cache_folder(), f"{platform.node()} {platform.machine()} {os.cpu_count()}"
    kept = folder / "pace.json" if folder else None
    with suppress(OSError, ValueError, KeyError, TypeError):
        found = json.loads(kept.read_text(encoding="utf-8")) if kept else {}
        if found["machine"] == machine and 0.0 < float(found["pace"]) < 1e3:
            return float(found["pace"])
    measured = min(_work() for _ in range(5)) / CALIBRATED
    with suppress(OSError):
        if kept:
            _keep(kept, {"machine": machine, "pace": round(measured, 3)})
    return measured


def _work() -> float:
    """Processor time [s] of a bit of all that a build does."""
    since = time.process_time()
    counts: dict[int, int] = {}
    for number in range(60_000):
        counts[number % 977] = counts.get(number % 977, 0) + number
    wave = np.sort(np.sin(np.arange(200_000.0)))
    zlib.compress(wave[:40_000].tobytes(), 6)
    return time.process_time() - since


def _keep(path: Path, content: dict[str, object]) -> None:
    """Write a file that others see all of or nothing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with NamedTemporaryFile("w", dir=path.parent, delete=False, encoding="utf-8") as file:
        json.dump(content, file)
    Path(file.name).replace(path)


def stage_seconds(site: Site, orders: Sequence[ExportOrder]) -> dict[str, float]:
    """Time that each stage of a build takes on this machine [s], its kernels being compiled."""
    recipe = site.recipe
    nodes, rocks = expected_nodes(recipe), rocks_of(site)
    dynamic = expected_dynamic(recipe.rocks.populations, size=site.size)
    exported = sum(export_bytes(order, nodes=nodes, rocks=rocks) for order in orders)
    watched = min(dynamic, MOST_WATCHED) * WATCHING
    stages = {
        "plan": 1.0,
        "rock library": 0.3 + _library(recipe),
        "ground": nodes / 4e6,
        "rocks": 0.2 + rocks / 60e3 + dynamic * SETTLING,
        "writing": 1.0 + nodes / 1.4e6 + exported * WRITING + _pictures(orders),
        "validation": 1.2 + nodes / 2e6 + exported * READING + watched + _drives(site),
        "report page": 0.5 + nodes / 5e6,
    }
    if recipe.validate and recipe.validate.consumers == "all":
        stages["validation"] += CONSUMER * len(orders) + 2 * exported * READING
    slower = pace()
    return {stage: slower * seconds for stage, seconds in stages.items()}


def export_bytes(order: ExportOrder, *, nodes: float, rocks: float) -> float:
    """About how large an export becomes [bytes]."""
    each_node, each_rock = getattr(order.options, "bytes_each", OTHER_SIZE)
    return each_node * nodes + each_rock * rocks


def cost_line(site: Site, orders: Sequence[ExportOrder]) -> str:
    """Size, time, memory and disk of a build, as a line."""
    recipe = site.recipe
    nodes, rocks = expected_nodes(recipe), rocks_of(site)
    dynamic = expected_dynamic(recipe.rocks.populations, size=site.size)
    seconds = sum(stage_seconds(site, orders).values())
    disk = WORLD_SIZE + WORLD_SIZES[0] * nodes + WORLD_SIZES[1] * rocks
    disk += sum(export_bytes(order, nodes=nodes, rocks=rocks) for order in orders)
    settled = f" ({dynamic:.0f} dynamic)" if dynamic else ""
    told = f"{nodes / 1e6:.2g} M nodes, {rocks / 1e3:.2g} k rocks{settled}: about "
    if recipe.tiles is not None:
        share = min((tile_cells(recipe) + 1) ** 2 / nodes, 1.0)
        memory = memory_needed(nodes * share, rocks * share)
        return (
            f"{told}{seconds:.0f} s of a core, {memory / 1e9:.1f} GB of memory for each worker, "
            f"{disk / 1e9:,.2g} GB on disk"
        )
    return (
        f"{told}{seconds:.0f} s, "
        f"{memory_needed(nodes, rocks) / 1e9:.1f} GB of memory, {disk / 1e6:,.0f} MB on disk"
    )


def _pictures(orders: Sequence[ExportOrder]) -> float:
    """Time that the exports' textures take [s]."""
    sides = [getattr(order.options, "texture_pixels", 0) for order in orders]
    return TEXEL * sum(side**2 for side in sides if side > USUAL_SIDE)


def _library(recipe: Recipe) -> float:
    """Time that the library takes where it is not in the cache [s]."""
    spec = recipe.rocks.library
    return SHAPE * max(spec.shapes - LibrarySpec().shapes, 0)


def _drives(site: Site) -> float:
    """Time that driving takes [s]."""
    spec = site.recipe.validate
    starts, drive = (spec.starts_spec, spec.drive_spec) if spec else (None, None)
    seconds = 0.5 * starts.count * starts.length_m / starts.speed_m_s if starts else 0.0
    seconds += sum(duration(r) for r in site.routes if drive and r.name == drive.path)
    return DRIVING * seconds
