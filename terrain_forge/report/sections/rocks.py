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
    heading,
    paragraph,
    photograph,
    plot,
    signed,
    table,
    thousands,
)
from terrain_forge.report.section import Built, Section

_CURVES = (
    "How many rocks are larger than a diameter D, and how much of the ground they cover: this "
    "world's beside the law's, with the band in which 95 of 100 correct samples lie."
)
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
        """Curves, a table, shapes."""
        if not len(built.world.field):
            return [paragraph("This world has no rocks.")]
        parts = []
        curves = built.directory / "truth" / "size_frequency.png"
        if curves.is_file():
            proven = "Cumulative number and cover of rocks over diameter"
            parts.append(plot(curves, description=proven, caption=_CURVES))
        shapes = [heading("Shapes"), _sheet(built.world)]
        verification = built.json("truth/size_frequency.json")
        if not verification:
            return [*parts, *shapes]
        rows = [*verification["populations"], *verification["lists"]]
        if len(verification["populations"]) > 1:
            rows.append({"name": "together", **verification["together"]})
        sources = filter(None, map(_source, verification["populations"]))
        counts = [part for part in verification["populations"] if part.get("fit_to_counts")]
        return [
            *parts,
            heading("Against the law"),
            _table(rows, built),
            *(paragraph(_counted(part), "note") for part in counts),
            *(paragraph(words, "note") for words in sources),
            *_left_out(verification),
            *shapes,
        ]


def _table(parts: Sequence[dict[str, Any]], built: Built) -> Block:
    """A row for each figure that any population has, and a column for each population."""
    columns = [_column(part, built) for part in parts]
    names = [name for name in next(iter(columns), {}) if any(column[name] for column in columns)]
    rows = [[Cell(name), *(column[name] or "–" for column in columns)] for name in names]
    headings = ["Population", *(part["name"] for part in parts)]
    return table(headings, rows, figures="l" + "r" * len(parts), style="columns")


def _column(part: dict[str, Any], built: Built) -> dict[str, Shown]:
    """The figures of a population, empty where it has none."""
    count, cover, ks = part["count"], part["cover"], part.get("kolmogorov_smirnov")
    evenness, dynamic, burial = (part.get(n) for n in ("clark_evans", "dynamic", "burial"))
    ends, listed = part["diameter_m"], "as listed" if "file" in part else ""
    rests = (dynamic["dynamic"], dynamic["expected"]) if dynamic else ()
    known = [_percent(cover[n]) for n in ("expected", "standard_deviation") if n in cover]
    return {
        "Law": _law(part),
        "Arrangement": _LIES.get(part.get("arrangement", ""), listed),
        "Diameters": f"{ends[0]:.3g}–{ends[1]:.3g} m" if ends else "",
        "Expected number": thousands(round(count["expected"])) if "expected" in count else "",
        "Observed number": thousands(count["observed"]),
        "z of the number": signed(count["z"]) if "z" in count else "",
        "K–S distance": f"{ks['distance']:.4f}" if ks else "",
        "p of the sizes": f"{ks['p_value']:.3f}" if ks else "",
        "Drawn": _verdict(part, built),
        "Your counts": _fit(part.get("fit_to_counts")),
        "Unplaced": thousands(part["unplaced"]) if "unplaced" in part else "",
        "Unsupported": thousands(part["unsupported"]) if part.get("unsupported") else "",
        "Expected cover": " ± ".join(known),
        "Observed cover": _percent(cover["observed"]),
        "z of the cover": signed(cover["z"]) if "z" in cover else "",
        "Visible cover": _percent(cover["outline"]),
        "Clark–Evans ratio": f"{evenness['ratio']:.3f}" if evenness else "",
        "Burial": f"{burial['observed']:.3f}, asked {burial['expected']:.3f}" if burial else "",
        "Dynamic": " of ".join(map(thousands, rests)) if dynamic else "",
        "Visual-only": thousands(part["visual_only"]) if "visual_only" in part else "",
    }


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
        return ""
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


def _percent(share: float) -> str:
    return f"{100.0 * share:.3f} %"


def _left_out(verification: dict[str, Any]) -> list[Block]:
    """Where rocks were not counted."""
    area, left_out = verification["area_m2"], verification["corridor_area_m2"]
    if not left_out:
        return []
    words = (
        f"Counted on {thousands(round(area))} m²: corridors and exclusion zones "
        f"({thousands(round(left_out))} m²) are left out."
    )
    return [paragraph(words, "note")]


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
