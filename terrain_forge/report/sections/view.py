"""The 3-D view of the report page: a model, the library that shows it, and what one can choose."""

from __future__ import annotations

import zlib
from base64 import b64encode
from collections.abc import Sequence
from pathlib import Path

from terrain_forge.base import DataError
from terrain_forge.report.blocks import Block, thousands
from terrain_forge.report.lines import ground_lines
from terrain_forge.report.model.ground import MOST_CELLS, overlays
from terrain_forge.report.model.rocks import MOST, picture_gain, shown_rocks
from terrain_forge.report.model.scene import page_model
from terrain_forge.report.recorded.measures import WorldSweep, first_sweep
from terrain_forge.report.section import Built, Section

_EFFORT = 5


class View(Section):
    """The world in 3-D, at first from behind the start of its path.

    Where a browser cannot draw in 3-D a line says so; on paper it is left out.
    """

    kind, title, place = "view", "In 3-D", 20

    def blocks(self, built: Built) -> Sequence[Block]:
        """What is shown, how the ground is painted, how high it is drawn, from where."""
        world, painted, lines = built.world, overlays(built.world.ground), ground_lines(built)
        sweep = shown_sweep(built)
        model = page_model(world, picture=built.map, overlays=painted, lines=lines, sweep=sweep)
        parts = (
            ("rocks", "Rocks", len(world.field) > 0),
            ("lines", "Paths", bool(lines)),
            ("rover", "Rover", bool(world.rover.links)),
            ("sweep", "Lidar sweep", sweep is not None),
        )
        view = Block(
            kind="view",
            gain=f"{picture_gain(built.map, world):.4f}",
            parts=parts,
            overlays=painted,
            shown=_shown(built),
            lines=lines,
            model=b64encode(zlib.compress(model, _EFFORT)).decode(),
        )
        return [view]


def _shown(built: Built) -> str:
    """What the view leaves out."""
    field = built.world.field
    rows, columns = built.world.ground.shape
    nodes = f"Ground of at most {MOST_CELLS + 1}² of its {columns} × {rows} nodes."
    if len(field) <= MOST:
        return nodes
    smallest = shown_rocks(field).diameter.min()
    return (
        f"{nodes} The {thousands(MOST)} largest of {thousands(len(field))} rocks, from "
        f"{smallest:.2g} m; the picture of the ground shows all."
    )


def scripts() -> tuple[str, ...]:
    """The scripts that the page runs, to the letter, three.js first: it forbids all others."""
    library = f"/*\n{bundled('LICENSE.three')}*/\n{bundled('three.js')}"
    return library, bundled("view.js"), bundled("copy.js")


def bundled(name: str) -> str:
    """A file of the page's bundle: its style, its script, the library that draws in 3-D."""
    return (Path(__file__).parent.parent / "bundle" / name).read_text(encoding="utf-8")


def shown_sweep(built: Built) -> WorldSweep | None:
    """The first sweep of the recording; None without one, or where it cannot be read.

    The section of the recording says why.
    """
    try:
        return first_sweep(built.recording) if built.recording else None
    except DataError:
        return None
