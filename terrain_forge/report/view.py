"""The 3-D view of the report page: a model, the library that shows it, and what one can choose."""

from __future__ import annotations

import zlib
from base64 import b64encode

from terrain_forge.report.lines import ground_lines
from terrain_forge.report.model.overlays import Overlay, overlays
from terrain_forge.report.model.relief import MOST_CELLS
from terrain_forge.report.model.rocks import MOST, picture_gain, shown_rocks
from terrain_forge.report.model.scene import page_model
from terrain_forge.report.section import Built, Section
from terrain_forge.report.style import Html, html, part, thousands

_EFFORT = 5
_HINT = (
    "Drag to turn, two fingers or the right button to move, wheel or pinch to come closer; touch "
    "the view first."
)
_MISSING = (
    "This browser does not draw in 3-D (no WebGL 2 or no scripts): the pictures of this page show "
    "the same world."
)


def view_section(built: Built) -> Section:
    """The world in 3-D, which stands after a picture of it.

    Where a browser cannot draw in 3-D a line says so; on paper it is left out.
    """
    painted = overlays(built.world.ground)
    lines = ground_lines(built)
    model = page_model(built.world, picture=built.map, overlays=painted, lines=lines)
    keys = "".join(f" {line.key}" for line in lines)
    gain = picture_gain(built.map, built.world)
    figure = (
        f'<figure id="view" data-gain="{gain:.4f}"><p class="undrawn note">{_MISSING}</p>'
        f'<canvas tabindex="0" role="img" aria-label="The world in 3-D"></canvas>'
        f"{_controls(built, painted, has_lines=bool(lines))}"
        f"<figcaption>{html(_HINT)} {html(_shown(built))}{keys}</figcaption></figure>"
    )
    packed = b64encode(zlib.compress(model, _EFFORT)).decode()
    content = f'<script type="text/plain" id="model">{packed}</script>'
    run = "".join(f"<script>{script}</script>\n" for script in scripts())
    return Section("In 3-D", (Html(figure), Html(content), Html(run)))


def _controls(built: Built, painted: tuple[Overlay, ...], *, has_lines: bool) -> str:
    """What is shown, how the ground is painted, how high it is drawn, from where."""
    parts = {"rocks": ("Rocks", len(built.world.field) > 0), "lines": ("Paths", has_lines),
             "rover": ("Rover", bool(built.world.rover.links))}  # fmt: skip
    boxes = "".join(
        f'<label{"" if there else " hidden"}><input type="checkbox" name="{name}" checked> '
        f"{words}</label>"
        for name, (words, there) in parts.items()
    )
    options = "".join(
        f'<option value="{number}">{name}</option>'
        for number, name in enumerate(["Picture", *(overlay.name for overlay in painted)])
    )
    scales = "".join(_scale(number, overlay) for number, overlay in enumerate(painted, 1))
    return (
        f'<div class="controls">{boxes}<label>Ground <select name="ground">{options}</select>'
        f'</label>{scales}<label>Height <input type="range" name="stretch" min="1" max="5" '
        f'step="0.5" value="1"> <output>×1</output></label><button type="button" name="start">'
        f'From the south</button><button type="button" name="above">From above</button></div>'
    )


def _scale(number: int, overlay: Overlay) -> str:
    colours = ", ".join(f"rgb{colour}" for colour in overlay.colours)
    low, high = overlay.ends
    return (
        f'<span class="scale" data-of="{number}" hidden>{low} '
        f'<i style="background: linear-gradient(90deg, {colours})"></i> {high}</span>'
    )


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


def library() -> str:
    """three.js, under its licence."""
    return f"/*\n{part('LICENSE.three')}*/\n{part('three.js')}"


def scripts() -> tuple[str, ...]:
    """The scripts that the page runs, to the letter: it forbids all others."""
    return library(), part("view.js")
