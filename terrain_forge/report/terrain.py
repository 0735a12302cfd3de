"""The DTM on the report page: what was read of it, what it needed, how the detail keeps to it."""

from __future__ import annotations

from typing import Any

from terrain_forge.report.style import Cell, Html, facts


def dtm_part(terrain: dict[str, Any]) -> list[Html]:
    """What a page says of a world's DTM; nothing of a flat site, or of one not validated.

    Args:
        terrain: The part `terrain` of validation/report.json.
    """
    state = terrain.get("dtm_state")
    if not state:
        return []
    return [Html("<h3>The terrain model</h3>"), facts([*_state(state), *_detail(terrain)])]


def _state(state: dict[str, Any]) -> list[tuple[str, Cell]]:
    rows, columns = state["samples"]
    error = state["scale_error_at_the_edge"]
    lengths = "as given" if error is None else f"{1e6 * error:.2g} in a million off at the edge"
    return [
        ("Samples read", f"{columns} × {rows}"),
        ("Repairs", "; ".join(state["repairs"]) or "none"),
        ("In exact planes", f"{100.0 * state['planar_fraction']:.1f} % of the samples"),
        ("Lengths", lengths),
    ]


def _detail(terrain: dict[str, Any]) -> list[tuple[str, Cell]]:
    worst = terrain["worst_pixel_mean_m"]
    return [
        ("Exponent at the joint", _with_error(terrain["exponent_at_the_joint"])),
        ("Exponent of the spectrum", _with_error(terrain["exponent_of_the_spectrum"])),
        ("Exponent of the detail", f"{terrain['hurst']:.2f}"),
        ("Means over pixels", "–" if worst is None else f"{1000.0 * worst:.2g} mm off at most"),
    ]


def _with_error(found: dict[str, float] | None) -> str:
    return f"{found['value']:.2f} ± {found['standard_error']:.2f}" if found else "not fitted"
