"""Renders docs/images/rocks_<family>.png: six shapes of each family, each at three sizes."""

from __future__ import annotations

from pathlib import Path

from PIL import Image

from terrain_forge.model import MARS, MOON
from terrain_forge.rocks import FAMILIES, LibrarySpec, make_library, render_contact_sheet

IMAGES = Path(__file__).parent / "images"
SHAPES = 6
COLOURS = 128


def main() -> None:
    """Write the pictures."""
    for family in FAMILIES:
        spec = LibrarySpec(shapes=SHAPES, seed=3, families=(family,))
        body = MOON if family == "breccia" else MARS
        sheet = render_contact_sheet(make_library(spec).prototypes, body=body)
        picture = Image.fromarray(sheet).quantize(COLOURS, dither=Image.Dither.NONE)
        picture.save(IMAGES / f"rocks_{family}.png", optimize=True)


if __name__ == "__main__":
    main()
