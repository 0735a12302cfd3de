"""The report page of a built world: one HTML file that shows and proves what was made."""

from __future__ import annotations

import json
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge import __version__
from terrain_forge.motion import Trajectory
from terrain_forge.report.craters import craters_section
from terrain_forge.report.rocks import rocks_section
from terrain_forge.report.style import (
    Cell,
    Html,
    bars,
    chip,
    facts,
    html,
    join,
    page,
    paragraph,
    picture,
    section,
    table,
    thousands,
)
from terrain_forge.report.usage import usage
from terrain_forge.terrain.statistics import slope_statistics
from terrain_forge.validation.conformance.table import table_rows
from terrain_forge.world import World

_MAP_PIXELS = 560
_SCALES = "terrain.png"


def write_report_page(world: World, directory: Path) -> Path:
    """Write `directory`/report.html from the world and from what lies in its built folder.

    The page is one file: pictures are inside it, and it needs neither network nor scripts. What the
    folder does not (yet) hold, such as a validation, is said to be missing.
    """
    proof = _read_json(directory / "truth" / "size_frequency.json")
    validation = _read_json(directory / "validation" / "report.json")
    body = join(
        [
            _header(world, validation),
            _preview(directory / "preview.png"),
            section("What was built", _built(world)),
            section("The ground", _ground(world), *_scales(validation, directory / "validation")),
            *_craters(directory / "truth" / "crater_counts.json"),
            section("The rocks", *rocks_section(world, proof, directory / "truth")),
            section("Paths", _paths(world)),
            section("Checks", *_checks(validation, directory / "validation")),
            _conformance(validation),
            *usage(world, directory),
            _footer(),
        ]
    )
    report = directory / "report.html"
    report.write_text(
        page(world.site.name, accent=_accent(world), body=body), encoding="utf-8", newline="\n"
    )
    return report


def _craters(path: Path) -> list[Html]:
    counts = _read_json(path)
    return [section("The craters", *craters_section(counts))] if counts else []


def _read_json(path: Path) -> dict[str, Any]:
    """The file's content, or nothing where it was not written."""
    if not path.is_file():
        return {}
    content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return content


def _accent(world: World) -> str:
    """The colour of the body's ground, dark enough to read on white."""
    red, green, blue = (round(200 * part) for part in world.site.body.ground_rgb)
    return f"#{red:02x}{green:02x}{blue:02x}"


def _header(world: World, validation: dict[str, Any]) -> Html:
    site = world.site
    east, north = _extent(world)
    lead = (
        f"{site.body.name.capitalize()} · {east:g} × {north:g} m at {site.spacing:g} m · "
        f"{thousands(len(world.field))} rocks · seed {site.seed}"
    )
    return Html(
        f"<header><h1>{html(site.name)}</h1>{paragraph(lead, 'lead').text}"
        f"<p>{_verdict(validation).text}</p></header>"
    )


def _verdict(validation: dict[str, Any]) -> Html:
    checks = validation.get("checks", [])
    failed = sum(not check["passed"] for check in checks)
    if not checks:
        return chip("not validated", "open")
    if failed:
        return chip(f"{failed} of {len(checks)} checks failed", "bad")
    return chip(f"all {len(checks)} checks passed", "good")


def _preview(path: Path) -> Html:
    if not path.is_file():
        return Html("")
    from PIL import Image

    with Image.open(path) as image:
        shown = _photograph(
            np.asarray(image.convert("RGB")), "The world seen from a rover's height"
        )
    return Html(f"<section>{shown.text}</section>")


def _photograph(pixels: NDArray[np.uint8], description: str, caption: str = "") -> Html:
    """A picture as JPEG, a tenth of its PNG."""
    from PIL import Image

    buffer = BytesIO()
    Image.fromarray(pixels).save(buffer, "JPEG", quality=88)
    return picture(
        buffer.getvalue(), media_type="image/jpeg", description=description, caption=caption
    )


def _built(world: World) -> Html:
    site, ground = world.site, world.ground
    dtm: dict[str, Any] = json.loads(site.recipe_json).get("dtm", {})
    rows, columns = ground.shape
    east, north = _extent(world)
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
    return facts(listed)


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


def _ground(world: World) -> Html:
    from terrain_forge.preview import render_map

    elevation = world.ground.elevation
    slopes = slope_statistics(world.ground)
    shown = max(10, int(np.ceil(slopes.percentile_95_deg * 1.5)))
    shares = [*slopes.shares[: shown - 1], slopes.shares[shown - 1 :].sum()]
    every = 5 if shown <= 30 else 10
    edges = [f"{n}°" if n % every == 0 else "" for n in range(shown)] + [f"{shown}° +"]
    listed: list[tuple[str, Cell]] = [
        ("Height", f"{elevation.min():.2f} m to {elevation.max():.2f} m"),
        ("Median slope", f"{slopes.median_deg:.2f}°"),
        ("RMS slope", f"{slopes.rms_deg:.2f}°"),
        ("95 % are flatter than", f"{slopes.percentile_95_deg:.2f}°"),
        ("Steepest", f"{slopes.steepest_deg:.1f}°"),
    ]
    east, north = _extent(world)
    overhead = _photograph(
        render_map(world, _MAP_PIXELS),
        "Shaded map of the world with its paths",
        f"From above, north up, {east:g} × {north:g} m; light from the north-west.",
    )
    histogram = join(
        [
            Html("<h3>Share of the ground by slope</h3>"),
            bars(shares, labels=edges, description="Histogram of slopes"),
            paragraph(f"Slopes over {world.ground.spacing:g} m, the grid's spacing.", "note"),
            facts(listed),
        ]
    )
    return Html(f'<div class="pair"><div>{overhead.text}</div><div>{histogram.text}</div></div>')


def _paths(world: World) -> Html:
    if not world.trajectories:
        return paragraph("This world has no paths.")
    headings = ("Path", "Length", "Duration", "Mean speed", "Height range", "Largest tilt", "Kind")
    rows = [_path_row(trajectory) for trajectory in world.trajectories]
    return table(headings, rows, figures="lrrrrrl")


def _path_row(trajectory: Trajectory) -> list[Cell]:
    duration = float(trajectory.time[-1] - trajectory.time[0])
    roll, pitch = trajectory.rpy[:, 0], trajectory.rpy[:, 1]
    tilt = float(np.degrees(np.arccos(np.cos(roll) * np.cos(pitch)).max()))
    return [
        trajectory.name,
        f"{trajectory.length:.1f} m",
        f"{duration:.1f} s",
        f"{trajectory.length / duration:.3f} m/s",
        f"{np.ptp(trajectory.position[:, 2]):.2f} m",
        f"{tilt:.1f}°",
        "closed" if trajectory.closed else "open",
    ]


def _scales(validation: dict[str, Any], folder: Path) -> list[Html]:
    """The ground at all scales beside its DTM, and what the DTM needed."""
    terrain = validation.get("terrain")
    if not terrain or not (folder / _SCALES).is_file():
        return []
    exponent = f"Hurst exponent of the detail {terrain['hurst']:.2f} ({terrain['source']})"
    for name, where in (
        ("exponent_at_the_joint", "the DTM's own at the joint"),
        ("exponent_of_the_spectrum", "that of its spectrum"),
    ):
        if found := terrain[name]:
            exponent += f"; {where} {found['value']:.2f} ± {found['standard_error']:.2f}"
    shown = picture(
        (folder / _SCALES).read_bytes(),
        media_type="image/png",
        description="Structure function, spectrum and slopes of the ground and of its DTM",
        caption=exponent + ".",
    )
    return [Html("<h3>The ground at all scales</h3>"), shown]


def _checks(validation: dict[str, Any], folder: Path) -> list[Html]:
    checks = validation.get("checks", [])
    if not checks:
        return [paragraph("This world has not been validated: terrain-forge validate does it.")]
    rows = [
        [
            check["name"],
            _measured(check.get("figure"), check.get("unit", "")),
            _measured(check.get("limit"), check.get("unit", "")),
            chip("pass", "good") if check["passed"] else chip("fail", "bad"),
            check.get("note") or "",
        ]
        for check in checks
    ]
    pictures = [
        picture(file.read_bytes(), media_type="image/png", description=file.stem)
        for file in sorted(folder.glob("*.png"))
        if file.name != _SCALES
    ]
    headings = ("Check", "Figure", "Limit", "", "Note")
    return [table(headings, rows, figures="lrrll"), *pictures]


def _conformance(validation: dict[str, Any]) -> Html:
    """Exports by consumers: the largest error of each aspect over its limit."""
    rows = table_rows(validation.get("conformance", []))
    if len(rows) == 1:
        return Html("")
    note = (
        "Each export as the programs that read it have it: largest error / limit. A program that "
        "is not installed was not run, which says nothing. – : the format or the program does not "
        "have it."
    )
    shown = table(rows[0], rows[1:], figures="l" * len(rows[0]))
    return section("In other programs", paragraph(note, "note"), shown)


def _measured(value: Any, unit: str) -> str:
    """A figure or a limit as people write it."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, str):
        return value
    text = thousands(value) if isinstance(value, int) else f"{value:.4g}"
    return f"{text} {unit}".strip()


def _footer() -> Html:
    frame = "World frame: x east, y north, z up, in metres; angles in radians unless marked with °."
    return Html(f"<footer>{frame} Made by terrain-forge {__version__}.</footer>")


def _extent(world: World) -> tuple[float, float]:
    west, south, east, north = world.ground.bounds
    return east - west, north - south
