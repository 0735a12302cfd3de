"""What exporters do for a site in tiles; of one of another package it is judged at once."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from terrain_forge.base import PluginError, returning
from terrain_forge.building import exporter_words, require_plain
from terrain_forge.model import Export, Exporter, Tile, TiledSite, TileGrid, World


def begin_export(export: Export, world: World, folder: Path) -> None:
    """Write what an export's tiles share, before any of them.

    Raises:
        PluginError: if the exporter leaves a link in its folder, or writes beside it.
    """
    exporter, options = export.opened()
    folder.mkdir(exist_ok=True)
    if hasattr(exporter, "begin_tiles"):
        with _within(export, exporter, folder):
            exporter.begin_tiles(world, folder, options=options)


def export_tile(export: Export, tile: Tile, grid: TileGrid, folder: Path) -> dict[str, Any]:
    """Write an export's files of a tile into a new folder; returns its figures.

    Raises:
        PluginError: if the exporter returns what it may not, leaves a link in its folder, or
            writes beside it.
    """
    exporter, options = export.opened()
    folder.mkdir()
    what = f"exporter {export.kind!r}: export_tile"
    with (
        _within(export, exporter, folder),
        returning(exporter, what, "a dict that JSON can hold"),
    ):
        figures = exporter.export_tile(tile, folder, grid=grid, options=options)  # type: ignore[attr-defined]
        if not isinstance(figures, dict):
            raise TypeError(f"found {type(figures).__name__}")
        json.dumps(figures, allow_nan=False)
    return figures


def join_export(export: Export, tiled: TiledSite, folder: Path) -> tuple[str, ...]:
    """Write an export's files of the whole; returns what is lost.

    Raises:
        PluginError: if the exporter returns what it may not, leaves a link in its folder, or
            writes beside it.
    """
    exporter, options = export.opened()
    what = f"exporter {export.kind!r}: join_tiles"
    with _within(export, exporter, folder), returning(exporter, what, "a tuple of texts"):
        losses = exporter.join_tiles(tiled, folder, options=options)  # type: ignore[attr-defined]
        if isinstance(losses, str):
            raise TypeError(f"found the text {losses[:40]!r}")
        losses = tuple(map(str, losses))
    return losses


@contextmanager
def _within(export: Export, exporter: Exporter, folder: Path) -> Iterator[None]:
    """Refuse links that are left in an export's folder, and what is written beside it meanwhile."""
    before = {*folder.parent.iterdir()}
    yield
    require_plain(exporter, export.kind, folder)
    if odd := sorted({*folder.parent.iterdir()} - before):
        named = exporter_words(exporter, export.kind)
        raise PluginError(f"{named} wrote {odd[0].name} beside its folder")
