"""The report page of a built world: one HTML file that shows and proves what was made."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from terrain_forge import __version__
from terrain_forge.model import Export, World
from terrain_forge.report.checks import checks_section, conformance_section, further_section
from terrain_forge.report.craters import craters_section
from terrain_forge.report.ground import ground_section
from terrain_forge.report.paths import drive_section, paths_section
from terrain_forge.report.rocks import rocks_section
from terrain_forge.report.section import Built, Section
from terrain_forge.report.style import Html, join, page, section
from terrain_forge.report.summary import built_section, header, preview
from terrain_forge.report.usage import files_section, usage_section
from terrain_forge.report.view import scripts, view_section


def write_report_page(
    world: World,
    directory: Path,
    *,
    exports: tuple[Export, ...] = (),
    above: NDArray[np.uint8] | None = None,
) -> Path:
    """Write `directory`/report.html from the world and from what lies in its built folder.

    The page is one file: pictures, the 3-D model and the library that shows it are inside it, and
    its own policy forbids it to load anything. What the folder does not (yet) hold, such as a
    validation, is said to be missing.

    Args:
        world: The world.
        directory: Its built folder.
        exports: The exports in it.
        above: The picture of `take_map`, where it was taken already.

    Returns:
        The page's path.

    Raises:
        TerrainForgeError: where Embree is missing, which takes the pictures.
    """
    built = Built(world, directory, exports, above)
    sections = [part for make in SECTIONS if (part := make(built))]
    body = join(
        [
            header(built, sections),
            preview(built),
            *(section(part.title, *part.html, anchor=part.anchor) for part in sections),
            _footer(),
        ]
    )
    report = directory / "report.html"
    text = page(world.site.name, accent=_accent(world), body=body, scripts=scripts())
    report.write_text(text, encoding="utf-8", newline="\n")
    return report


def _craters(built: Built) -> Section | None:
    counts = built.json("truth/crater_counts.json")
    return Section("The craters", tuple(craters_section(counts))) if counts else None


def _rocks(built: Built) -> Section:
    proof = built.json("truth/size_frequency.json")
    return Section("The rocks", tuple(rocks_section(built.world, proof, built.directory / "truth")))


SECTIONS: tuple[Callable[[Built], Section | None], ...] = (
    view_section,
    usage_section,
    built_section,
    ground_section,
    _craters,
    _rocks,
    paths_section,
    drive_section,
    checks_section,
    conformance_section,
    further_section,
    files_section,
)
"""The page's sections in their order."""


def _accent(world: World) -> str:
    """The colour of the body's ground, dark enough to read on white."""
    red, green, blue = (round(200 * part) for part in world.site.body.ground_rgb)
    return f"#{red:02x}{green:02x}{blue:02x}"


def _footer() -> Html:
    frame = "World frame: x east, y north, z up, in metres; angles in radians unless marked with °."
    return Html(f"<footer>{frame} Made by terrain-forge {__version__}.</footer>")
