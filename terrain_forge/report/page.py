"""The report page of a built world: one HTML file that shows and proves what was made."""

from __future__ import annotations

import logging
import re
from base64 import b64encode
from collections.abc import Iterable, Sequence
from functools import cache
from hashlib import sha256
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup
from numpy.typing import NDArray

from terrain_forge import __version__
from terrain_forge.base import (
    FOREIGN_FAILURES,
    failure_words,
    is_ours,
    parts,
    place_of,
    read_bytes,
    write_whole,
)
from terrain_forge.model import Export, World
from terrain_forge.report.blocks import Block, Cell, photograph, read_picture, thousands
from terrain_forge.report.glossary import explained, explained_in
from terrain_forge.report.section import Built, Section
from terrain_forge.report.sections.view import bundled, scripts
from terrain_forge.validation import checks_of

_log = logging.getLogger(__name__)

SECTIONS = "terrain_forge.report_sections"
"""Entry points of other packages' sections."""
_PREVIEW = (
    "What a camera sees from a rover's height, before any has driven. Soil finer than the ground's "
    "grid is in pictures alone; exports show it as far as their textures go."
)


@cache
def section_types() -> tuple[type[Section], ...]:
    """All kinds of sections, of ours and of other packages."""
    return parts(Section, "terrain_forge.report.sections", SECTIONS)


def write_report_page(
    world: World,
    directory: Path,
    *,
    exports: tuple[Export, ...] = (),
    above: NDArray[np.uint8] | None = None,
    dataset: Path | None = None,
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
        dataset: The folder of its recording; by default `directory`/dataset.

    Returns:
        The page's path.

    Raises:
        TerrainForgeError: where Embree is missing, which takes the pictures.
    """
    built = Built(world, directory, exports, above, dataset)
    sections = [
        _shown(kind.title, body)
        for kind in sorted(section_types(), key=attrgetter("place"))
        if (body := _body(kind, built))
    ]
    # The colour of the body's ground, dark enough to read on white.
    red, green, blue = (round(200 * part) for part in world.site.body.ground_rgb)
    preview = directory / "preview.png"
    picture = None
    if preview.is_file():
        picture = photograph(read_picture(read_bytes(preview, preview.name)), _PREVIEW)
    text = render(
        "page.html",
        accent=f"#{red:02x}{green:02x}{blue:02x}",
        policy=_policy(scripts()),
        style=bundled("page.css"),
        title=world.site.name,
        lead=_lead(built),
        **_verdict(built),
        sections=sections,
        preview=picture,
        scripts=scripts(),
        version=__version__,
    )
    report = directory / "report.html"
    report.write_text(text, encoding="utf-8", newline="\n")
    return report


def write_page(
    path: Path,
    *,
    title: str,
    lead: str,
    verdict: Cell,
    sections: Sequence[tuple[str, Sequence[Block]]],
) -> Path:
    """Write a page of some headed sections, one file that loads nothing; returns it."""
    text = render(
        "page.html",
        accent="#5f6b73",
        policy=_policy(()),
        style=bundled("page.css"),
        title=title,
        lead=lead,
        verdict=verdict,
        failed=[],
        sections=[_shown(title, _rendered(blocks)) for title, blocks in sections],
        preview=None,
        scripts=(),
        version=__version__,
    )
    return write_whole(path, text)


def _shown(title: str, body: Markup) -> dict[str, Any]:
    """A section as the page's template finds it."""
    return {"title": title, "anchor": _anchor(title), "body": body}


def _body(kind: type[Section], built: Built) -> Markup:
    """What a section shows, empty where it says nothing.

    One of another package that raises, or whose blocks cannot be shown, is left out with a warning.
    """
    try:
        return _rendered(kind().blocks(built))
    except FOREIGN_FAILURES as error:
        if is_ours(kind.__module__):
            raise
        told = kind.title, place_of(kind, error), failure_words(error)
        _log.warning("section %r of the report (%s) is left out: %s", *told)
        return Markup()


def _rendered(blocks: Iterable[Block]) -> Markup:
    """Blocks as they stand in the page.

    Raises:
        TypeError: for what is no block.
    """
    made = list(blocks)
    for block in made:
        if not isinstance(block, Block):
            raise TypeError(f"its blocks must be Blocks, found {block!r:.40}")
    return Markup(render("blocks.html", blocks=made))


def render(template: str, **values: Any) -> str:
    """A template with values, all of which it escapes."""
    return _environment().get_template(template).render(**values)


@cache
def _environment() -> Environment:
    made = Environment(
        loader=FileSystemLoader(Path(__file__).parent / "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters.update(explained=explained, explained_in=explained_in)
    return made


def _anchor(title: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")


def _policy(run: Sequence[str]) -> str:
    """What a browser may do: show what is in the page and run its own scripts."""
    digests = (b64encode(sha256(script.encode()).digest()).decode() for script in run)
    allowed = " ".join(f"'sha256-{digest}'" for digest in digests)
    return (
        "default-src 'none'; img-src data: blob:; connect-src blob:; "
        f"style-src 'unsafe-inline'; script-src {allowed}"
    )


def _lead(built: Built) -> str:
    site = built.world.site
    east, north = built.extent
    rocks = len(built.world.field)
    return (
        f"{site.body.name.capitalize()} · {east:g} × {north:g} m at {site.spacing:g} m · "
        f"{thousands(rocks)} rock{'s' * (rocks != 1)} · seed {site.seed}"
    )


def _verdict(built: Built) -> dict[str, Any]:
    """Whether the world is as it should be, and which checks failed."""
    judged = checks_of(built.directory)
    failed = [check.told() for check in judged if not check.passed]
    if failed:
        verdict = Cell(f"{len(failed)} of {len(judged)} checks failed", "bad")
    elif judged:
        verdict = Cell(f"all {len(judged)} checks passed", "good")
    else:
        verdict = Cell("not validated", "open")
    return {"verdict": verdict, "failed": failed}
