"""The page of a site in tiles."""

from __future__ import annotations

from typing import Any

from terrain_forge.tiling.order import TileOrder


def write_page(order: TileOrder, verification: dict[str, Any], manifest: dict[str, Any]) -> None:
    """Write report.html."""
    del order, verification, manifest
