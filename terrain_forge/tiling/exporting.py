"""What exporters do for a site in tiles; of one of another package it is judged at once."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from terrain_forge.base import PluginError, first_link, returning
from terrain_forge.model import Export, Exporter, Tile, TiledSite, TileGrid, World


def begin_export(export: Export, world: World, folder: Path) -> None:
    """Write what an export's tiles share, before any of them.

    Raises:
        PluginError: if the exporter leaves a link in its folder.
    """
    exporter, options = export.opened()
    folder.mkdir(exist_ok=True)
    if hasattr(exporter, "begin_tiles"):
        exporter.begin_tiles(world, folder, options=options)
        _require_no_link(export, exporter, folder)


def export_tile(export: Export, tile: Tile, grid: TileGrid, folder: Path) -> dict[str, Any]:
    """Write an export's files of a tile into a new folder; returns its figures.

    Raises:
        PluginError: if the exporter returns what it may not, leaves a link in its folder, or
            writes beside it.
    """
    exporter, options = export.opened()
    beside = {path.name for path in folder.parent.iterdir()} | {folder.name}
    folder.mkdir()
    with returning(exporter, f"exporter {export.kind!r}: export_tile", "a dict that JSON can hold"):
        figures = exporter.export_tile(tile, folder, grid=grid, options=options)  # type: ignore[attr-defined]
        if not isinstance(figures, dict):
            raise TypeError(f"found {type(figures).__name__}")
        json.dumps(figures, allow_nan=False)
    _require_no_link(export, exporter, folder)
    if odd := sorted({path.name for path in folder.parent.iterdir()} - beside):
        raise PluginError(f"{_named(export, exporter)} wrote {odd[0]} beside its folder")
    return figures


def join_export(export: Export, tiled: TiledSite, folder: Path) -> tuple[str, ...]:
    """Write an export's files of the whole; returns what is lost.

    Raises:
        PluginError: if the exporter returns what it may not, or leaves a link in its folder.
    """
    exporter, options = export.opened()
    with returning(exporter, f"exporter {export.kind!r}: join_tiles", "a tuple of texts"):
        losses = exporter.join_tiles(tiled, folder, options=options)  # type: ignore[attr-defined]
        if isinstance(losses, str):
            raise TypeError(f"found the text {losses[:40]!r}")
        losses = tuple(map(str, losses))
    _require_no_link(export, exporter, folder)
    return losses


def _require_no_link(export: Export, exporter: Exporter, folder: Path) -> None:
    if link := first_link(folder):
        raise PluginError(f"{_named(export, exporter)} left the link {link} in its folder")


def _named(export: Export, exporter: Exporter) -> str:
    module = getattr(exporter, "__name__", export.kind)
    return f"exporter {export.kind!r} ({module})"
