"""The tree of a tileset: boxes in boxes, down to the tiles and their levels of detail."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from terrain_forge.base import Array
from terrain_forge.model import BuiltTile, TileGrid

_BLOCK = 16
"""Tiles each way of which a tileset has a file of its own, where there are more."""
Box = tuple[Array, Array]
"""Lowest and highest corner [m]."""


def write_tileset(tiles: dict[tuple[int, int], BuiltTile], grid: TileGrid, directory: Path) -> None:
    """Write tileset.json over the tiles by their places, and files of parts where they are many."""
    many = max(grid.across, grid.up) > _BLOCK
    root = _node(tiles, grid, (0, grid.up), (0, grid.across), directory, many)
    _write(directory / "tileset.json", root)


def _write(path: Path, root: dict[str, Any]) -> None:
    tileset = {
        "asset": {"version": "1.1", "generator": "terrain-forge"},
        "geometricError": root["geometricError"],
        "root": root,
    }
    path.write_text(json.dumps(tileset, separators=(",", ":")) + "\n", encoding="utf-8")


def _node(
    tiles: dict[tuple[int, int], BuiltTile],
    grid: TileGrid,
    rows: tuple[int, int],
    columns: tuple[int, int],
    directory: Path,
    many: bool,
) -> dict[str, Any]:
    """The box of a rectangle of tiles with what it holds; nothing of its own is shown."""
    up, across = rows[1] - rows[0], columns[1] - columns[0]
    if up == across == 1:
        return _chain(tiles[rows[0], columns[0]])
    own_file = many and max(up, across) <= _BLOCK
    parts = [
        _node(tiles, grid, some, others, directory, many and not own_file)
        for some in _halves(*rows)
        for others in _halves(*columns)
    ]
    low = np.min([_corners(part)[0] for part in parts], axis=0)
    high = np.max([_corners(part)[1] for part in parts], axis=0)
    node = {
        "boundingVolume": _volume(low, high),
        "geometricError": float(np.hypot(*(high - low)[:2])),
        "refine": "REPLACE",
        "children": parts,
    }
    if not own_file:
        return node
    name = f"tileset_{rows[0]:03}_{columns[0]:03}.json"
    _write(directory / name, node)
    return {
        "boundingVolume": node["boundingVolume"],
        "geometricError": node["geometricError"],
        "refine": "REPLACE",
        "content": {"uri": name},
    }


def _halves(first: int, end: int) -> list[tuple[int, int]]:
    """A range in two, at a multiple of the largest power of two within it."""
    length = end - first
    if length == 1:
        return [(first, end)]
    half = 1
    while 2 * half < length:
        half *= 2
    return [(first, first + half), (first + half, end)]


def _chain(tile: BuiltTile) -> dict[str, Any]:
    """A tile's levels of detail, the coarsest outermost; it lies at its anchor."""
    anchor = np.array(tile.figures["anchor"])
    low, high = (np.array(corner) for corner in tile.figures["box"])
    node, contents = dict[str, Any](), tile.figures.get("contents", {})
    for name, error in tile.figures["errors"].items():  # the finest first
        finer = [node] if node else []
        node = {
            "boundingVolume": _volume(low, high),
            "geometricError": max([error, *(part["geometricError"] for part in finer)]),
            "refine": "REPLACE",
            "content": {"uri": contents.get(name, f"{tile.folder}/{name}.glb")},
            **({"children": finer} if finer else {}),
        }
    turned = np.eye(4)
    turned[3, :3] = anchor  # column by column
    return {**node, "transform": turned.ravel().tolist()}


def _volume(low: Array, high: Array) -> dict[str, Any]:
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    axes = np.diag(np.maximum(half, 1e-6)).ravel().tolist()
    return {"box": [*middle.tolist(), *axes]}


def _corners(node: dict[str, Any]) -> Box:
    """The corners of a node's box in its parent's frame."""
    box = np.array(node["boundingVolume"]["box"])
    half = np.diag(box[3:].reshape(3, 3))
    shift = np.array(node["transform"])[12:15] if "transform" in node else np.zeros(3)
    return box[:3] - half + shift, box[:3] + half + shift
