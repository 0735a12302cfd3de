"""Which worlds are too much for MuJoCo, known before they are made."""

from __future__ import annotations

from terrain_forge.base import ExportError

from .options import Options

MOST_GEOMS = 250_000
"""Geoms that an export may have: MuJoCo steps 100,000 some 300 times a second."""
MOST_MESHES = 50_000
"""Meshes that an export may have."""
MANY_MESHES = 5000
"""Beyond so many, loading them takes seconds."""
_SECONDS_PER_MESH, _BYTES_PER_MESH = 0.6e-3, 0.17e6
"""What MuJoCo takes to load a mesh of its own (measured with 5000 and 15000 of them, one core)."""
FEWER = (
    "choose a smaller size_m, a larger smallest diameter_m, or the format usd, which merges small "
    "rocks"
)


def check_capacity(options: Options, *, nodes: float, rocks: float) -> None:
    """Refuse, before the world is made, more rocks than MuJoCo steps at any useful rate.

    Raises:
        ExportError: if there are.
    """
    del nodes  # a ground of any size becomes several height fields
    if rocks > MOST_GEOMS:
        raise ExportError(
            f"some {rocks:,.0f} rocks make at least as many geoms, MuJoCo steps {MOST_GEOMS:,} at "
            f"most: {FEWER}"
        )
    require_meshes(options, rocks)


def require_meshes(options: Options, count: float) -> None:
    """Refuse more meshes than MuJoCo loads in a bearable time.

    Raises:
        ExportError: if there are more.
    """
    if options.exact_scale and count > MOST_MESHES:
        raise ExportError(
            f"exact_scale: true makes some {count:,.0f} meshes, which MuJoCo would load in about "
            f"{loading_cost(count)}, at most {MOST_MESHES:,}: leave it out, which rounds sizes by "
            "1 % at most"
        )


def loading_cost(meshes: float) -> str:
    """Time and memory that MuJoCo takes to load meshes, in words."""
    return f"{meshes * _SECONDS_PER_MESH:.0f} s and {meshes * _BYTES_PER_MESH / 1e9:.1f} GB"
