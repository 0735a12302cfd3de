"""The ground on the report page: from above, its slopes, how it continues its DTM, its craters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from terrain_forge.report.blocks import (
    Block,
    Shown,
    facts,
    heading,
    jpeg,
    paragraph,
    plot,
    signed,
    source,
    table,
    thousands,
)
from terrain_forge.report.lines import Line, ground_lines
from terrain_forge.report.section import Built, Section
from terrain_forge.terrain import slope_statistics

_CRATER_HEADINGS = ("Diameter", "Expected", "95 % range", "Observed")


class Ground(Section):
    """Map and slopes side by side; below them the ground at all scales, and its DTM."""

    kind, title, place = "ground", "The ground", 40

    def blocks(self, built: Built) -> Sequence[Block]:
        """A pair of columns, then pictures and facts."""
        return [Block(kind="pair", columns=([_map(built)], _slopes(built))), *_scales(built)]


def _map(built: Built) -> Block:
    """The picture from above with the lines over it, which stay sharp at any size."""
    height, width, _ = built.map.shape
    east, north = built.extent
    return Block(
        kind="map",
        width=width,
        height=height,
        source=source(jpeg(built.map, quality=82), "image/jpeg"),
        lines=[_stroke(line, built, width, height) for line in ground_lines(built)],
        caption=f"From above, north up, {east:g} × {north:g} m; light from the north-west.",
    )


def _stroke(line: Line, built: Built, width: int, height: int) -> dict[str, Any]:
    """A line with its points in the picture, and its first one."""
    west, south, east, north = built.world.ground.bounds
    across = (line.points[:, 0] - west) / (east - west) * width
    down = (north - line.points[:, 1]) / (north - south) * height
    points = [f"{x:.1f},{y:.1f}" for x, y in zip(across, down, strict=True)]
    return {**vars(line), "points": " ".join(points), "start": points[0].split(",")}


def _slopes(built: Built) -> list[Block]:
    ground = built.world.ground
    slopes = slope_statistics(ground)
    heights = ground.elevation
    listed: list[tuple[str, Shown]] = [
        ("Height", f"{heights.min():.2f} m to {heights.max():.2f} m".replace("-", "\u2212")),
        ("Median slope", f"{slopes.median_deg:.2f}°"),
        ("RMS slope", f"{slopes.rms_deg:.2f}°"),
        ("95 % are flatter than", f"{slopes.percentile_95_deg:.2f}°"),
        ("Steepest", f"{slopes.steepest_deg:.1f}°"),
    ]
    return [
        facts(listed),
        paragraph(f"Slopes over {ground.spacing:g} m, the grid's spacing.", "note"),
    ]


def _scales(built: Built) -> list[Block]:
    """The ground at all scales beside its DTM, and what is to be said of that."""
    terrain: dict[str, Any] = built.validation.get("terrain", {})
    if not terrain:
        return []
    ends = "where the DTM's end, at the dotted line, the ground's go on; "
    joint = ends if terrain.get("dtm_state") else ""
    law = "no layer makes detail."
    if terrain["hurst"] is not None:
        law = f"the Hurst exponent of the detail is {terrain['hurst']:.2f} ({terrain['source']})."
    caption = f"Structure function, power spectrum and slopes: {joint}{law}"
    description = "Structure function, spectrum and slopes of the ground and of its DTM"
    pictures = [
        plot(path, description=description, caption=caption) for path in built.pictures("terrain")
    ]
    above = [heading("The ground at all scales")] if pictures else []
    return [*above, *pictures, *dtm_part(terrain)]


_PROVEN = (
    "height differences are within 12 % of real ones down to a quarter of the posting, within 15 % "
    "to an eighth, on Jezero; dunes and ground whose craters end are up to half too rough "
    "(docs/terrain.md)"
)


def dtm_part(terrain: dict[str, Any]) -> list[Block]:
    """What the report's `terrain` says of a world's DTM; nothing of a flat site or without one."""
    state = terrain.get("dtm_state")
    if not state:
        return []
    warnings = [paragraph(f"Warning: {text}.", "note") for text in state.get("warnings", [])]
    rows, columns = state["samples"]
    error, worst = state["scale_error_at_the_edge"], terrain["worst_pixel_mean_m"]
    scale = "as given" if error is None else f"{1e6 * error:.2g} ppm"
    listed: list[tuple[str, Shown]] = [
        ("Samples read", f"{columns} × {rows}"),
        ("Repairs", "; ".join(state["repairs"]) or "none"),
        ("In exact planes", f"{100.0 * state['planar_fraction']:.1f} % of the samples"),
        ("Scale error", scale),
        ("Exponent at the joint", _with_error(terrain["exponent_at_the_joint"])),
        ("Exponent of the spectrum", _with_error(terrain["exponent_of_the_spectrum"])),
        *_detail(terrain),
        ("Means over pixels", "–" if worst is None else f"{1000.0 * worst:.2g} mm off at most"),
    ]
    return [heading("The terrain model"), *warnings, facts(listed)]


def _detail(terrain: dict[str, Any]) -> list[tuple[str, Shown]]:
    if terrain["hurst"] is None:
        return [("Exponent of the detail", "none is made")]
    rise = terrain.get("hurst_rise_per_octave", 0.0)
    rising = f", rising by {rise:.2f} an octave to 0.95" if rise else ""
    return [
        ("Exponent of the detail", f"{terrain['hurst']:.2f}{rising}"),
        ("Detail, where proven", _PROVEN),
    ]


def _with_error(found: dict[str, float] | None) -> str:
    return f"{found['value']:.2f} ± {found['standard_error']:.2f}" if found else "not fitted"


class Craters(Section):
    """The numbers of craters that truth/crater_counts.json has."""

    kind, title, place = "craters", "The craters", 50

    def blocks(self, built: Built) -> Sequence[Block]:
        """Facts and a table for each layer."""
        shown = []
        for layer in built.json("truth/crater_counts.json").get("layers", ()):
            shown += [heading(f"Layer {layer['name']}"), facts(_facts(layer))]
            if "cumulative" in layer:
                shown.append(table(_CRATER_HEADINGS, _rows(layer["cumulative"]), figures="lrrr"))
        return shown


def _facts(layer: dict[str, Any]) -> list[tuple[str, Shown]]:
    """What a layer was made of, and its number and sizes against that."""
    listed: list[tuple[str, Shown]] = [("Listed in the recipe", thousands(layer["listed"]))]
    if "number" not in layer:
        return listed
    number, sizes = layer["number"], layer["sizes"]
    smallest, largest = layer["diameter_m"]
    erased = "; ".join(
        f"below {event['below_m']:g} m, {event['age_ga']:g}·10⁹ years ago"
        for event in layer.get("resurfaced", ())
    )
    return [
        *listed,
        ("Production function", str(layer["production"])),
        ("Age of the surface", f"{layer['age_ga']:g}·10⁹ years"),
        ("Resurfaced", erased or "never"),
        ("Equilibrium", str(layer["equilibrium"])),
        ("Diameters", f"{smallest:g} to {largest:g} m"),
        ("Expected number", f"{number['expected']:.1f}"),
        ("Observed number", thousands(number["found"])),
        ("z of the number", signed(number["z"])),
        ("p of the sizes", f"{sizes['p_value']:.3f}" if sizes else "–"),
    ]


def _rows(cumulative: dict[str, list[float]]) -> list[list[Shown]]:
    columns = (cumulative[name] for name in ("diameter_m", "expected", "low", "high", "found"))
    return [
        [f"≥ {diameter:g} m", f"{expected:.1f}", f"{low:.0f}–{high:.0f}", thousands(found)]
        for diameter, expected, low, high, found in zip(*columns, strict=True)
    ]
