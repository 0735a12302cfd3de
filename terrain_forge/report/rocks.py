"""The rocks on the report page: size-frequency verification, shapes, stand-ins."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from terrain_forge.model import RockPrototype, World
from terrain_forge.report.style import (
    Cell,
    Html,
    chip,
    facts,
    join,
    paragraph,
    photograph,
    plot,
    signed,
    table,
    thousands,
)

_LIMIT_Z = 3.29
_LIMIT_P = 0.001
_SHOWN = 7
_SHEET = 900, 430
_FIRST_ROW, _LAST_ROW = 100, 300
_LIES = {"poisson": "anywhere", "clustered": "in clusters", "craters": "around craters"}
_SIGNS = {
    ("golombek", "q_per_m"): "q",
    ("exponential", "number_per_m2"): "N(>0)",
    ("exponential", "decay_per_m"): "λ",
    ("power_law", "number_per_m2"): "N(>1 m)",
    ("power_law", "exponent"): "m",
}


def rocks_section(world: World, verification: dict[str, Any], truth: Path) -> list[Html]:
    """What a page says of a world's rocks.

    Args:
        world: The world.
        verification: Content of truth/size_frequency.json, empty where it is missing.
        truth: The folder of truth.
    """
    if not len(world.field):
        return [paragraph("This world has no rocks.")]
    parts = []
    if (truth / "size_frequency.png").is_file():
        proven = "Cumulative number and cover of rocks over diameter"
        parts.append(plot(truth / "size_frequency.png", description=proven))
    if verification:
        rows = [*verification["populations"], *verification["lists"]]
        if len(verification["populations"]) > 1:
            rows.append({"name": "together", **verification["together"]})
        parts += [Html("<h3>Numbers and sizes</h3>"), _sizes(rows)]
        parts += [Html("<h3>Cover and places</h3>"), _places(rows)]
        parts.append(paragraph(_note(verification), "note"))
        parts += [
            paragraph(words, "note") for words in map(_source, verification["populations"]) if words
        ]
    parts += [Html("<h3>Shapes</h3>"), _sheet(world)]
    if verification:
        parts.append(_figures(verification))
    return parts


def _sizes(rows: list[dict[str, Any]]) -> Html:
    headings = (
        "Population",
        "Law",
        "D [m]",
        "Expected",
        "Found",
        "z",
        "K–S",
        "p",
        "Unplaced",
        "",
    )
    return table(headings, [_size_row(part) for part in rows], figures="llrrrrrrrl")


def _size_row(part: dict[str, Any]) -> list[Cell]:
    count, ks = part["count"], part.get("kolmogorov_smirnov")
    ends = part["diameter_m"]
    return [
        part["name"],
        _law(part),
        f"{ends[0]:.3g}–{ends[1]:.3g}" if ends else "–",
        thousands(round(count["expected"])) if "expected" in count else "–",
        thousands(count["observed"]),
        signed(count.get("z")),
        f"{ks['distance']:.4f}" if ks else "–",
        f"{ks['p_value']:.3f}" if ks else "–",
        thousands(part["unplaced"]) if "unplaced" in part else "–",
        _verdict(part),
    ]


def _verdict(part: dict[str, Any]) -> Html:
    """Whether number, cover and sizes are those of a right sampler."""
    count, cover, ks = part["count"], part["cover"], part.get("kolmogorov_smirnov")
    if "expected" not in count:
        return chip("as listed", "open")
    deviations = [count["z"] or 0.0, cover["z"] or 0.0]
    agrees = max(map(abs, deviations)) <= _LIMIT_Z and (ks is None or ks["p_value"] >= _LIMIT_P)
    return chip("agrees", "good") if agrees else chip("differs", "bad")


def _law(part: dict[str, Any]) -> str:
    law = part.get("law")
    if not law:
        return str(part.get("file", ""))
    named = law.get("fit", law)
    numbers = [
        f"{_SIGNS.get((named['kind'], name), name)} {value:.3g}"
        for name, value in named.items()
        if isinstance(value, int | float) and not isinstance(value, bool)
    ]
    fitted = f"fitted to {thousands(law['rocks'])} counted" if "fit" in law else law.get("site", "")
    return ", ".join(words for words in (f"{named['kind']} {fitted}".strip(), *numbers) if words)


def _source(part: dict[str, Any]) -> str:
    """Where a landing site's law comes from, and how sure that is."""
    law = part["law"]
    if "source" not in law:
        return ""
    doubt = "" if law["verified"] else " (commonly quoted, not read there)"
    note = f"; {law['note']}" if law["note"] else ""
    return f"{part['name']}: {law['source']}{doubt}{note}."


def _places(rows: list[dict[str, Any]]) -> Html:
    headings = ("Population", "Lies", "Cover expected", "±", "Found", "z", "Seen from above",
                "Clark–Evans", "Dynamic", "Visual only")  # fmt: skip
    return table(headings, [_place_row(part) for part in rows], figures="llrrrrrrrr")


def _place_row(part: dict[str, Any]) -> list[Cell]:
    cover, evenness, dynamic = part["cover"], part.get("clark_evans"), part.get("dynamic")
    wanted = "expected" in cover
    return [
        part["name"],
        _LIES.get(part.get("arrangement", ""), "as listed" if "file" in part else ""),
        _percent(cover["expected"]) if wanted else "–",
        _percent(cover["standard_deviation"]) if wanted else "–",
        _percent(cover["observed"]),
        signed(cover.get("z")),
        _percent(cover["outline"]),
        f"{evenness['ratio']:.3f}" if evenness else "–",
        f"{thousands(dynamic['dynamic'])} of {thousands(dynamic['expected'])}" if dynamic else "–",
        thousands(part["visual_only"]) if "visual_only" in part else "–",
    ]


def _percent(share: float) -> str:
    return f"{100.0 * share:.3f} %"


def _note(verification: dict[str, Any]) -> str:
    note = (
        "z: deviation in standard deviations of a right sampler. K–S: Kolmogorov–Smirnov distance "
        f"of the diameters from the law, and its p. Agrees: |z| ≤ {_LIMIT_Z} and p ≥ {_LIMIT_P}. "
        "Cover: Σ πD²/4; ±: its standard deviation; seen from above: where a rock is the highest "
        "thing, less since a rock's outline is no disc. Clark–Evans: distance to the nearest rock "
        "over that of random points; rocks that cannot overlap lie a little more evenly (above 1), "
        "clustered ones closer (below 1)."
    )
    if verification["corridor_area_m2"] > 0:
        note += (
            f" Over {thousands(round(verification['area_m2']))} m²: corridors and exclusion zones "
            f"({thousands(round(verification['corridor_area_m2']))} m²) are left out."
        )
    return note


def _sheet(world: World) -> Html:
    """Some of the library's shapes, each family once before any comes twice."""
    from terrain_forge.rocks import SIZES, render_contact_sheet

    shapes = _chosen(world.library.prototypes)
    width, height = _SHEET
    pixels = render_contact_sheet(shapes, body=world.site.body, width=width, height=height)
    sizes = ", ".join(f"{size:g}" for size in SIZES)
    families = ", ".join(shape.family for shape in shapes)
    caption = (
        f"{len(shapes)} of the library's {len(world.library.prototypes)} shapes at {sizes} m, in "
        f"coarser levels of detail towards the front; from the left: {families}."
    )
    shown = pixels[_FIRST_ROW:_LAST_ROW]
    return photograph(shown, "Rock shapes of this world's library", caption)


def _chosen(prototypes: tuple[RockPrototype, ...]) -> list[RockPrototype]:
    seen: dict[str, int] = {}
    turn = []
    for number, prototype in enumerate(prototypes):
        seen[prototype.family] = seen.get(prototype.family, 0) + 1
        turn.append((seen[prototype.family], number))
    return [prototypes[number] for _, number in sorted(turn)[:_SHOWN]]


def _figures(verification: dict[str, Any]) -> Html:
    overlaps, shapes = verification["overlaps"], verification["shapes"]
    listed = overlaps["of_listed_rocks"]
    besides = f" (and {thousands(listed)} of listed rocks)" if listed else ""
    parts = [shape["collision_parts"] for shape in shapes["shapes"]]
    rows: list[tuple[str, Cell]] = [
        ("Overlapping pairs", f"{thousands(overlaps['pairs'])}{besides}"),
        ("Closed, facing outward", f"{shapes['watertight']} of {shapes['count']} shapes"),
        ("Collision parts", f"{sum(parts)} in all, at most {max(parts)}"),
        ("Their volume in excess", _off(shapes, "hull_excess")),
        ("Their surface off", _off(shapes, "hull_distance")),
        ("Coarse outlines off", f"{100.0 * shapes['largest_outline_error']:.2f} %"),
    ]
    note = "The worst of all shapes: of its volume, and distances as parts of its mean axis."
    return join([facts(rows), paragraph(note, "note")])


def _off(shapes: dict[str, Any], name: str) -> str:
    limit = 100.0 * shapes[f"{name}_limit"]
    return f"{100.0 * shapes[f'largest_{name}']:.2f} %, limit {limit:g} %"
