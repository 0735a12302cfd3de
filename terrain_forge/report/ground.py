"""The ground on the report page: from above, its slopes, and how it continues its DTM."""

from __future__ import annotations

from typing import Any

import numpy as np

from terrain_forge.report.lines import Line, ground_lines
from terrain_forge.report.section import Built, Section
from terrain_forge.report.style import Cell, Html, bars, facts, join, jpeg, paragraph, plot, source
from terrain_forge.report.terrain import dtm_part
from terrain_forge.terrain import slope_statistics


def ground_section(built: Built) -> Section:
    """Map and slopes side by side; below them the ground at all scales, and its DTM."""
    pair = f'<div class="pair"><div>{_map(built).text}</div><div>{_slopes(built).text}</div></div>'
    return Section("The ground", (Html(pair), *_scales(built)))


def _map(built: Built) -> Html:
    """The picture from above with the lines over it, which stay sharp at any size."""
    pixels = built.map
    height, width, _ = pixels.shape
    east, north = built.extent
    lines = ground_lines(built)
    shapes = "".join(_stroke(line, built, width, height) for line in lines)
    image = source(jpeg(pixels, quality=82), "image/jpeg")
    names = "".join(f" {line.key}" for line in lines)
    return Html(
        f'<figure><svg class="map" viewBox="0 0 {width} {height}" role="img" '
        f'aria-label="Shaded map of the world with paths and driven tracks">'
        f'<image href="{image}" width="{width}" height="{height}"/>{shapes}</svg>'
        f"<figcaption>From above, north up, {east:g} × {north:g} m; light from the north-west."
        f"{names}</figcaption></figure>"
    )


def _stroke(line: Line, built: Built, width: int, height: int) -> str:
    west, south, east, north = built.world.ground.bounds
    across = (line.points[:, 0] - west) / (east - west) * width
    down = (north - line.points[:, 1]) / (north - south) * height
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in zip(across, down, strict=True))
    start = "" if line.driven else f'<circle cx="{across[0]:.1f}" cy="{down[0]:.1f}" r="9"/>'
    wide = 4 if line.driven else 9
    return (
        f'<g style="--key:{line.colour}"><polyline points="{points}" stroke-width="{wide}"/>'
        f"{start}</g>"
    )


def _slopes(built: Built) -> Html:
    ground = built.world.ground
    slopes = slope_statistics(ground)
    shown = max(10, int(np.ceil(slopes.percentile_95_deg * 1.5)))
    shares = [*slopes.shares[: shown - 1], slopes.shares[shown - 1 :].sum()]
    every = 5 if shown <= 30 else 10
    room = 0.12 * shown  # for the last label
    labels = (f"{n}°" if n % every == 0 and n < shown - room else "" for n in range(shown))
    edges = [*labels, f"{shown}° +"]
    heights = ground.elevation
    listed: list[tuple[str, Cell]] = [
        ("Height", f"{heights.min():.2f} m to {heights.max():.2f} m".replace("-", "\u2212")),
        ("Median slope", f"{slopes.median_deg:.2f}°"),
        ("RMS slope", f"{slopes.rms_deg:.2f}°"),
        ("95 % are flatter than", f"{slopes.percentile_95_deg:.2f}°"),
        ("Steepest", f"{slopes.steepest_deg:.1f}°"),
    ]
    return join(
        [
            Html("<h3>Share of the ground by slope</h3>"),
            bars(shares, labels=edges, description="Histogram of slopes"),
            paragraph(f"Slopes over {ground.spacing:g} m, the grid's spacing.", "note"),
            facts(listed),
        ]
    )


def _scales(built: Built) -> list[Html]:
    """The ground at all scales beside its DTM, and what is to be said of that."""
    terrain: dict[str, Any] = built.validation.get("terrain", {})
    if not terrain:
        return []
    caption = f"Hurst exponent of the detail {terrain['hurst']:.2f} ({terrain['source']})."
    description = "Structure function, spectrum and slopes of the ground and of its DTM"
    pictures = [
        plot(path, description=description, caption=caption) for path in built.pictures("terrain")
    ]
    heading = [Html("<h3>The ground at all scales</h3>")] if pictures else []
    return [*heading, *pictures, *dtm_part(terrain)]
