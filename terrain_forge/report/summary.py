"""The head of the page, and what was built."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from terrain_forge import __version__
from terrain_forge.model import World
from terrain_forge.report.section import Built, Section
from terrain_forge.report.style import (
    Cell,
    Html,
    chip,
    facts,
    html,
    paragraph,
    photograph,
    thousands,
)


def header(built: Built, sections: Sequence[Section]) -> Html:
    """What world it is, whether it is as it should be, and where to find what."""
    site = built.world.site
    east, north = built.extent
    lead = (
        f"{site.body.name.capitalize()} · {east:g} × {north:g} m at {site.spacing:g} m · "
        f"{thousands(len(built.world.field))} rocks · seed {site.seed}"
    )
    links = " ".join(f'<a href="#{part.anchor}">{html(part.title)}</a>' for part in sections)
    return Html(
        f"<header><h1>{html(site.name)}</h1>{paragraph(lead, 'lead').text}\n"
        f"{_verdict(built.validation).text}\n"
        f'<nav aria-label="Contents">{links}</nav></header>'
    )


def _verdict(validation: dict[str, Any]) -> Html:
    checks = validation.get("checks", [])
    failed = [check for check in checks if not check["passed"]]
    if not checks:
        return paragraph(chip("not validated", "open"))
    if not failed:
        return paragraph(chip(f"all {len(checks)} checks passed", "good"))
    verdict = chip(f"{len(failed)} of {len(checks)} checks failed", "bad")
    names = html("; ".join(check["name"] for check in failed))
    return paragraph(Html(f'{verdict.text} <span class="failed">{names}</span>'))


def preview(built: Built) -> Html:
    """The world as a rover's camera sees it, where the folder has that picture."""
    path = built.directory / "preview.png"
    if not path.is_file():
        return Html("")
    from PIL import Image

    with Image.open(path) as image:
        pixels = np.asarray(image.convert("RGB"))
    shown = photograph(pixels, "The world seen from a rover's height")
    return Html(f'<section class="hero">{shown.text}</section>')


def built_section(built: Built) -> Section:
    """The recipe's essentials and what came of them."""
    world = built.world
    site, ground = world.site, world.ground
    dtm: dict[str, Any] = built.recipe.get("dtm", {})
    rows, columns = ground.shape
    east, north = built.extent
    names = ", ".join(world.field.populations) or "none"
    listed: list[tuple[str, Cell]] = [
        ("Body", f"{site.body.name.capitalize()}, gravity {site.body.gravity:g} m/s²"),
        ("Place", _place(world)),
        ("Terrain model", str(dtm.get("source") or dtm.get("kind", "made by hand"))),
        ("Posting of the model", f"{site.dtm.posting:.4g} m" if site.dtm else "none"),
        ("Samples filled in", thousands(site.dtm.filled) if site.dtm else "none"),
        ("Height of z = 0", f"{site.datum_height:.3f} m above datum"),
        ("Level plane", _plane(site.slope)),
        ("Area", f"{east:g} × {north:g} m"),
        ("Ground", f"{columns} × {rows} nodes, {site.spacing:g} m apart"),
        ("Roughness", f"H {site.roughness.hurst:.2f}, {site.roughness.deviation:.3g} m at 1 m"),
        ("Rocks", f"{thousands(len(world.field))} ({names})"),
        ("Rock shapes", f"{len(world.library.prototypes)}, seed {world.library.seed}"),
        ("Rover", world.rover.name),
        ("Sun", _sun(world)),
        ("Seed", str(site.seed)),
        ("Made by", f"terrain-forge {__version__}"),
    ]
    return Section("What was built", (facts(listed), _recipe(built)))


def _recipe(built: Built) -> Html:
    """The whole recipe as it was resolved, folded away."""
    text = html(json.dumps(built.recipe, indent=1, ensure_ascii=False))
    return Html(
        "<details><summary>The whole recipe, with its defaults</summary>"
        f"<pre><code>{text}</code></pre></details>"
    )


def _place(world: World) -> str:
    site = world.site
    if site.lonlat is None:
        return "not georeferenced"
    longitude, latitude = np.degrees(site.lonlat)
    return f"{abs(latitude):.5f}° {'NS'[int(latitude < 0)]}, {longitude:.5f}° E"


def _plane(slope: tuple[float, float]) -> str:
    east, north = slope
    if east == north == 0.0:
        return "not levelled"
    return f"{np.degrees(np.arctan(np.hypot(east, north))):.2f}° taken away"


def _sun(world: World) -> str:
    azimuth, elevation = np.degrees([world.lighting.sun_azimuth, world.lighting.sun_elevation])
    return f"{elevation:.1f}° high, azimuth {azimuth % 360:.1f}°"
