"""The mesh export from first to last."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from terrain_forge.errors import ExportError
from terrain_forge.ground_texture import texture_loss
from terrain_forge.registry import ExportReport
from terrain_forge.rock_surface import level_of_detail
from terrain_forge.world import World
from terrain_forge.writers.mtl import MattMaterial

from .obj import write_materials, write_obj_part
from .options import Options
from .part import Part
from .ply import write_ply_part
from .stl import write_stl_part

_MOST_NODES = 2**30
"""Of a mesh's ground: indices are 32-bit numbers, and rocks want some too."""


def export(world: World, directory: Path, *, options: Options) -> ExportReport:
    """Write the world as plain meshes: world.obj (stl, ply), or tile_000.obj and so on.

    Raises:
        ExportError: if the format has no objects but is asked for them, or if the ground has more
            nodes than one mesh can hold.
    """
    _require_possible(world, options)
    detail = [level_of_detail(p, options.outline_error) for p in world.library.prototypes]
    rocks = options.rocks != "none"
    grounds: list[MattMaterial] = []
    for part in _parts(world, detail, options):
        path = directory / f"{part.name}.{options.format}"
        if options.format == "obj":
            grounds.append(write_obj_part(part, directory, options=options))
        elif options.format == "stl":
            write_stl_part(part, path, rocks=rocks)
        else:
            write_ply_part(part, path, rocks=rocks)
    if options.format == "obj":
        write_materials(world, directory, grounds=grounds, textured=options.rocks == "objects")
    files = sorted(path.relative_to(directory) for path in directory.iterdir())
    return ExportReport(files=tuple(files), losses=_losses(world, detail, options))


def _parts(world: World, detail: list[int], options: Options) -> Iterator[Part]:
    def part(name: str, of: World) -> Part:
        return Part(
            name=name,
            world=of,
            whole=world,
            tile_cells=options.tile_cells,
            finest_min=options.finest_min_m,
            detail=tuple(detail),
        )

    if options.tiles == "merged":
        yield part("world", world)
        return
    for number, tile in enumerate(world.tiles(cells=options.tile_cells)):
        yield part(f"tile_{number:03}", tile)


def _require_possible(world: World, options: Options) -> None:
    if options.rocks == "objects" and options.format != "obj":
        raise ExportError(
            f"rocks: objects: {options.format} has no objects; choose format: obj, or rocks: merged"
        )
    rows, columns = world.ground.shape
    if options.tiles == "merged" and rows * columns > _MOST_NODES:
        raise ExportError(
            f"tiles: merged: the ground has {columns} × {rows} nodes, one mesh holds {_MOST_NODES} "
            "at most; choose tiles: tiled"
        )


def _losses(world: World, detail: list[int], options: Options) -> tuple[str, ...]:
    """What a plain mesh, or this export of one, does not say."""
    losses = ["A mesh knows no physics, light, place or paths: all rocks stand still."]
    unfelt = len(world.field) - int(world.field.solid.sum())
    if unfelt:
        losses.append(f"{unfelt} rocks that are there for the eye alone are in it like the others.")
    if options.format == "obj":
        losses.append("Coordinates are rounded to 1 µm.")
        losses.append(texture_loss(world.ground, options.texture_pixels, normals=False))
    else:
        largest = np.float32(max(map(abs, world.ground.bounds)))
        losses.append(
            f"Coordinates are float32: rounded by up to {500 * np.spacing(largest):.2g} mm."
        )
    losses += {"stl": ["STL has no colours."], "ply": ["PLY has colours, no textures."]}.get(
        options.format, []
    )
    if options.rocks == "none":
        losses.append(f"The {len(world.field)} rocks are left out.")
    elif options.rocks == "merged":
        losses.append(f"{len(world.field)} rocks are merged, without names and textures.")
        shapes = zip(world.library.prototypes, detail, strict=True)
        error = max((shape.outline_errors[level] for shape, level in shapes), default=0.0)
        if error and np.any(world.field.diameter < options.finest_min_m):
            losses.append(
                f"The outlines of rocks below {options.finest_min_m:g} m are off by up to "
                f"{100 * error:.1f} % of their size."
            )
    return tuple(losses)
