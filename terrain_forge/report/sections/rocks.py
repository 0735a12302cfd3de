"""The rocks on the report page: size-frequency verification, shapes, stand-ins."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

from terrain_forge.model import World
from terrain_forge.report.blocks import (
    Block,
    Cell,
    Shown,
    facts,
    heading,
    paragraph,
    photograph,
    plot,
    signed,
    table,
    thousands,
)
from terrain_forge.report.section import Built, Section

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


class Rocks(Section):
    """Size-frequency verification, which truth/size_frequency.json has, and shapes."""

    kind, title, place = "rocks", "The rocks", 60

    def blocks(self, built: Built) -> Sequence[Block]:
        """Curves, tables, shapes, and how good the stand-ins are."""
        if not len(built.world.field):
            return [paragraph("This world has no rocks.")]
        parts = []
        curves = built.directory / "truth" / "size_frequency.png"
        if curves.is_file():
            proven = "Cumulative number and cover of rocks over diameter"
            parts.append(plot(curves, description=proven))
        verification = built.json("truth/size_frequency.json")
        if not verification:
            return [*parts, heading("Shapes"), _sheet(built.world)]
        rows = [*verification["populations"], *verification["lists"]]
        if len(verification["populations"]) > 1:
            rows.append({"name": "together", **verification["together"]})
        sources = filter(None, map(_source, verification["populations"]))
        counts = [part for part in verification["populations"] if part.get("fit_to_counts")]
        return [
            *parts,
            heading("Numbers and sizes"),
            table(_SIZES, [_size_row(part, built) for part in rows], figures="llrrrrrrrll"),
            *(paragraph(_counted(part), "note") for part in counts),
            heading("Cover and places"),
            table(_PLACES, [_place_row(part) for part in rows], figures="llrrrrrrrrr"),
            paragraph(_note(verification), "note"),
            *(paragraph(words, "note") for words in sources),
            heading("Shapes"),
            _sheet(built.world),
            *_figures(verification),
        ]


_SIZES = ("Population", "Law", "D [m]", "Expected", "Observed", "z", "K–S", "p", "Unplaced",
          "Drawn", "Your counts")  # fmt: skip
_PLACES = ("Population", "Arrangement", "Cover expected", "±", "Observed", "z", "Visible cover",
           "Clark–Evans", "Burial", "Dynamic", "Visual only")  # fmt: skip


def _size_row(part: dict[str, Any], built: Built) -> list[Shown]:
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
        _verdict(part, built),
        _fit(part.get("fit_to_counts")),
    ]


def _verdict(part: dict[str, Any], built: Built) -> Shown:
    """Whether the rocks are drawn as the law says, by the check of their sizes."""
    if "file" in part:
        return Cell("as listed", "open")
    for check in built.validation.get("checks", ()):
        if check["name"] == f"rocks: sizes of {part['name']}":
            return Cell("as the law", "good") if check["passed"] else Cell("differs", "bad")
    return ""


def _fit(fit: dict[str, Any] | None) -> Shown:
    """Whether the law fits the rocks that the user counted."""
    if not fit:
        return "–"
    if fit["fits"] is None:
        return Cell("not tested", "open")
    words = f"{'fit' if fit['fits'] else 'do not fit'}, p = {fit['p_value']:.2g}"
    if fit["fits"] and fit["warnings"]:
        return Cell(f"{words}, end far from these", "open")
    return Cell(words, "good" if fit["fits"] else "bad")


def _counted(part: dict[str, Any]) -> str:
    fit = part["fit_to_counts"]
    words = "; ".join([fit["summary"], *(f"warning: {text}" for text in fit["warnings"])])
    return f"{part['name']}: {words}."


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


def _place_row(part: dict[str, Any]) -> list[Shown]:
    cover, evenness, dynamic = part["cover"], part.get("clark_evans"), part.get("dynamic")
    wanted, burial = "expected" in cover, part.get("burial")
    return [
        part["name"],
        _LIES.get(part.get("arrangement", ""), "as listed" if "file" in part else ""),
        _percent(cover["expected"]) if wanted else "–",
        _percent(cover["standard_deviation"]) if wanted else "–",
        _percent(cover["observed"]),
        signed(cover.get("z")),
        _percent(cover["outline"]),
        f"{evenness['ratio']:.3f}" if evenness else "–",
        f"{burial['observed']:.3f} for {burial['expected']:.3f}" if burial else "–",
        f"{thousands(dynamic['dynamic'])} of {thousands(dynamic['expected'])}" if dynamic else "–",
        thousands(part["visual_only"]) if "visual_only" in part else "–",
    ]


def _percent(share: float) -> str:
    return f"{100.0 * share:.3f} %"


def _note(verification: dict[str, Any]) -> str:
    note = (
        "z: deviation in standard deviations of a correct sampler. K–S: Kolmogorov–Smirnov "
        "distance "
        "of the diameters from the law, and its p. Drawn: whether the rocks are drawn as the law "
        "says; your counts: whether the law fits the rocks that it was fitted to. "
        "Cover: Σ πD²/4; ±: its standard deviation; seen from above: where a rock is the highest "
        "thing, less since a rock's outline is no disc. Clark–Evans: distance to the nearest rock "
        "over that of random points; rocks that cannot overlap lie a little more evenly (above 1), "
        "clustered ones closer (below 1). Burial: mean buried part of the height, for what was "
        "asked; rocks lie deeper where the ground falls away under them. Dynamic: those that "
        "found rest, the others are fixed."
    )
    if verification["corridor_area_m2"] > 0:
        note += (
            f" Over {thousands(round(verification['area_m2']))} m²: corridors and exclusion zones "
            f"({thousands(round(verification['corridor_area_m2']))} m²) are left out."
        )
    return note


def _sheet(world: World) -> Block:
    """Some of the library's shapes, each family once before any comes twice."""
    from terrain_forge.rocks import SIZES, render_contact_sheet

    seen, turns = Counter[str](), list[tuple[int, int]]()
    for number, prototype in enumerate(world.library.prototypes):
        seen[prototype.family] += 1
        turns.append((seen[prototype.family], number))
    shapes = [world.library.prototypes[number] for _, number in sorted(turns)[:_SHOWN]]
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


def _figures(verification: dict[str, Any]) -> list[Block]:
    overlaps, shapes = verification["overlaps"], verification["shapes"]
    listed = overlaps["of_listed_rocks"]
    besides = f" (and {thousands(listed)} of listed rocks)" if listed else ""
    parts = [shape["collision_parts"] for shape in shapes["shapes"]]
    rows: list[tuple[str, Shown]] = [
        ("Overlapping pairs", f"{thousands(overlaps['pairs'])}{besides}"),
        ("Closed, facing outward", f"{shapes['watertight']} of {shapes['count']} shapes"),
        ("Collision parts", f"{sum(parts)} in all, at most {max(parts)}"),
        ("Their volume in excess", _off(shapes, "hull_excess")),
        ("Surface deviation", _off(shapes, "hull_distance")),
        ("Coarse outlines off", f"{100.0 * shapes['largest_outline_error']:.2f} %"),
    ]
    note = "The worst of all shapes: of its volume, and distances as parts of its mean axis."
    return [facts(rows), paragraph(note, "note")]


def _off(shapes: dict[str, Any], name: str) -> str:
    limit = 100.0 * shapes[f"{name}_limit"]
    return f"{100.0 * shapes[f'largest_{name}']:.2f} %, limit {limit:g} %"
