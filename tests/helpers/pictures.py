"""Pictures of built worlds, small in tests: what is in them is tested where they are made.

Else they would be most of what the tests cost."""

from __future__ import annotations

import sys

import matplotlib
import numpy as np
import pytest
from matplotlib.axis import Axis

PREVIEW = (96, 54)
"""Width and height of the preview."""
SHEET = (96, 34)
"""Width and height of the page's picture of the rocks' shapes."""
MAP = 96
"""Pixels along the longer side of the page's picture from above."""
TEXTURED = ("drake", "glb", "mesh", "mjcf", "sdf", "usd")
TEXTURE = 72
"""Most pixels along a side of the ground's texture, where a test chooses none."""
FILM = 2
"""Pictures of a drive's film."""
END = (96, 54)
"""Width and height of the picture of a drive's end."""
DPI = 20
"""Of figures."""
DRAW_AXIS = Axis.draw
"""What figures of tests leave out, unless they are about it."""


def make_small(patch: pytest.MonkeyPatch) -> None:
    """Let whatever builds a world take small pictures of it."""
    from terrain_forge.model import exporter
    from terrain_forge.rocks import render_contact_sheet
    from terrain_forge.scene import render_preview

    for picture, (width, height) in ((render_preview, PREVIEW), (render_contact_sheet, SHEET)):
        patch.setitem(picture.__kwdefaults__, "width", width)
        patch.setitem(picture.__kwdefaults__, "height", height)
    for kind in TEXTURED:
        options = exporter(kind).Options
        patch.setitem(options.__init__.__kwdefaults__, "texture_pixels", TEXTURE)
        patch.setattr(options.__dataclass_fields__["texture_pixels"], "default", TEXTURE)

    def sheet(*shapes, width, height, **others):
        rows, columns = np.arange(height) * SHEET[1] // height, np.arange(width) * SHEET[0] // width
        return render_contact_sheet(*shapes, **others)[rows[:, None], columns]

    patch.setattr("terrain_forge.rocks.render_contact_sheet", sheet)
    patch.setattr("terrain_forge.report.section.MAP_PIXELS", MAP)
    patch.setattr("terrain_forge.driving.film.FRAMES", FILM)
    patch.setattr("terrain_forge.driving.film.END_SIZE", END)
    patch.setitem(matplotlib.rcParams, "savefig.dpi", DPI)
    patch.setattr(Axis, "draw", lambda *_: None)  # most of what a figure costs


if __name__ == "__main__":  # the command line in a process of its own, with the same pictures
    from terrain_forge.cli import run

    with pytest.MonkeyPatch.context() as patch:
        make_small(patch)
        sys.exit(run())
