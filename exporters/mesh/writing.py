"""The mesh export from first to last."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from terrain_forge.base import ExportError
from terrain_forge.geometry import level_of_detail, texture_loss, with_horizon_loss
from terrain_forge.model import ExportReport, World
from terrain_forge.writers import MattMaterial

from .forms import Part, write_materials, write_obj_part, write_ply_part, write_stl_part
from .options import Options

MOST_NODES = 2**30
"""Of a mesh's ground: indices are 32-bit numbers, and rocks want some too."""


def export(world: World, directory: Path, *, options: Options) -> ExportReport:
    """Write the world as plain meshes: world.ply (stl, obj), or tile_000.ply and so on.

    Raises:
        ExportError: if the ground has more nodes than one mesh can hold.
    """
    rows, columns = world.ground.shape
    check_capacity(options, nodes=rows * columns, rocks=len(world.field))
    detail = [level_of_detail(p, options.outline_error) for p in world.library.prototypes]
    merged = options.tiles == "merged"
    grounds: list[MattMaterial] = []
    for tile in world.tiles(cells=max(world.ground.shape) if merged else options.tile_cells):
        name = "world" if merged else tile.name("tile")
        part = Part(name=name, tile=tile, options=options, detail=detail)
        path = directory / f"{name}.{options.format}"
        if options.format == "obj":
            grounds.append(write_obj_part(part, path))
        elif options.format == "stl":
            write_stl_part(part, path)
        else:
            write_ply_part(part, path)
    if options.format == "obj":
        write_materials(world, directory, grounds=grounds, textured=options.rocks == "objects")
    files = sorted(path.relative_to(directory) for path in directory.iterdir())
    report = ExportReport(files=tuple(files), losses=tuple(_losses(world, detail, options)))
    return with_horizon_loss(report, world.horizon, shown=False)


def check_capacity(options: Options, *, nodes: float, rocks: float) -> None:
    """Refuse a ground of more nodes than one mesh holds.

    Raises:
        ExportError: if it has.
    """
    del rocks  # half of the indices are left to them
    if options.tiles == "merged" and nodes > MOST_NODES:
        raise ExportError(
            f"tiles: merged: the ground has {nodes:.4g} nodes, one mesh holds {MOST_NODES} "
            "at most; choose tiles: tiled"
        )


def _losses(world: World, detail: list[int], options: Options) -> Iterator[str]:
    """What a plain mesh, or this export of one, does not say."""
    field = world.field
    yield "A mesh knows no physics, light, place or paths."
    if options.format == "obj":
        yield "Coordinates are rounded to 1 µm."
        yield texture_loss(world.ground, options.texture_pixels, normals=False)
    else:
        largest = np.float32(max(map(abs, world.ground.bounds)))
        yield f"Coordinates are float32: rounded by up to {500 * np.spacing(largest):.2g} mm."
        yield {"stl": "STL has no colours.", "ply": "PLY has colours, no textures."}[options.format]
    if not len(field):
        return
    if options.rocks == "none":
        yield f"The {len(field)} rocks are left out."
        return
    if field.dynamic.any():
        yield f"{int(field.dynamic.sum())} dynamic rocks stand still, as the others do."
    unfelt = len(field) - int(field.collides.sum())
    if unfelt:
        yield f"{unfelt} rocks that are visual-only are in it like the others."
    if options.rocks == "merged":
        yield f"{len(field)} rocks are merged, without names and textures."
        small = field.diameter < options.finest_min_m
        used, shapes = np.unique(field.prototype[small]), world.library.prototypes
        error = max((shapes[n].outline_errors[detail[n]] for n in used), default=0.0)
        if error:
            yield (
                f"The outlines of {int(small.sum())} rocks below {options.finest_min_m:g} m are "
                f"off by up to {100 * error:.1f} % of their size."
            )
