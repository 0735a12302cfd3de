"""The USD export from first to last."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from terrain_forge.geometry import (
    coarse_shape,
    collision_losses,
    detail_loss,
    largest_outline_error,
    level_of_detail,
    static_losses,
    texture_loss,
)
from terrain_forge.model import ExportReport, Mesh, World

from .craters import fresh_craters
from .ground import write_detail, write_ground
from .library import write_library
from .options import Options
from .replay import write_scene
from .rig import rig_losses
from .rocks import write_rocks, write_textures
from .scenery import write_world


def export(world: World, directory: Path, *, options: Options) -> ExportReport:
    """Write world.usda, scene.usda (with a replay of each trajectory) and their assets."""
    assets = directory / "assets"
    assets.mkdir()
    write_library(world.library, assets)
    write_textures(world, assets)
    if world.appearance.detail:
        write_detail(world.appearance.detail, assets)
    shapes = world.library.prototypes
    coarse = [coarse_shape(shape, options.outline_error) for shape in shapes]
    levels = np.array([level_of_detail(shape, options.outline_error) for shape in shapes], np.int64)
    craters, tiles = fresh_craters(world), []
    for number, tile in enumerate(world.tiles(cells=options.tile_cells)):
        ground, rocks = f"ground_{number:03}", f"rocks_{number:03}"
        write_ground(tile, world, assets, name=ground, craters=craters, options=options)
        write_rocks(tile, world, assets, name=rocks, coarse=coarse, levels=levels, options=options)
        tiles.append((ground, rocks))
    write_world(directory / "world.usda", world, tiles=tiles)
    write_scene(directory / "scene.usda", world, base="./world.usda")
    files = sorted(p.relative_to(directory) for p in directory.rglob("*") if p.is_file())
    return ExportReport(files=tuple(files), losses=_losses(world, coarse, levels, options))


def _losses(
    world: World, coarse: list[Mesh], levels: NDArray[np.int64], options: Options
) -> tuple[str, ...]:
    """What USD, or this export of it, does not say."""
    detail = world.appearance.detail
    losses = [
        texture_loss(world.ground, options.texture_pixels, normals=detail is not None),
        *([detail_loss(detail)] if detail else []),
        *static_losses(world.field),
        "USD lights have no physical unit: intensities are W/m² and want an exposure.",
        "USD does not say whose friction counts where two things touch: PhysX takes their mean.",
    ]
    if world.site.georeferenced:
        losses.append("Longitude and latitude of the site are left out: no USD schema holds them.")
    if world.trajectories:
        losses += rig_losses(world.rover)
    if world.field.dynamic.any():
        losses.append("Dynamic rocks have no torsional and no rolling friction: USD knows neither.")
    losses += _outline_losses(world, coarse, levels, options)
    return (*losses, *collision_losses(world.library.prototypes))


def _outline_losses(
    world: World, coarse: list[Mesh], levels: NDArray[np.int64], options: Options
) -> Iterator[str]:
    """How far small static rocks are off, as they are drawn and as they are touched."""
    field, shapes = world.field, world.library.prototypes
    if not field.dynamic.all():
        yield (
            "Static rocks in pictures are turned by half-precision quaternions, off by below "
            "0.001 rad."
        )
    small = ~field.dynamic & (field.diameter < options.collider_min_m)
    drawn = np.unique(field.prototype[small]).tolist()
    error = max((shapes[n].outline_errors[levels[n]] for n in drawn), default=0.0)
    if error:
        yield (
            f"{int(small.sum())} static rocks below {options.collider_min_m:g} m are drawn by "
            f"coarser meshes, their outlines off by up to {100 * error:.2g} % of their size."
        )
    small &= field.collides
    if small.any():
        used = np.unique(field.prototype[small]).tolist()
        error = largest_outline_error([coarse[n] for n in used], [shapes[n] for n in used])
        off = f", their outlines off by up to {100 * error:.2g} % of their size" if error else ""
        yield (
            f"{int(small.sum())} rocks below {options.collider_min_m:g} m share colliders per "
            f"tile{off}."
        )
