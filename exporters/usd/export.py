"""The USD export from first to last."""

from __future__ import annotations

from pathlib import Path

from terrain_forge.ground_texture import detail_loss, texture_loss
from terrain_forge.mesh import Mesh
from terrain_forge.registry import ExportReport
from terrain_forge.rock_mesh import (
    coarse_shape,
    collision_losses,
    fixed_losses,
    largest_outline_error,
)
from terrain_forge.world import World

from .ground import write_detail, write_ground
from .library import write_library
from .options import Options
from .replay import write_scene
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
    coarse = [coarse_shape(p, options.outline_error) for p in world.library.prototypes]
    tiles = []
    for number, tile in enumerate(world.tiles(cells=options.tile_cells)):
        ground, rocks = f"ground_{number:03}", f"rocks_{number:03}"
        write_ground(tile, world, assets, name=ground, options=options)
        write_rocks(tile, world, assets, name=rocks, coarse=coarse, options=options)
        tiles.append((ground, rocks))
    write_world(directory / "world.usda", world, tiles=tiles)
    write_scene(directory / "scene.usda", world, base="./world.usda")
    files = sorted(p.relative_to(directory) for p in directory.rglob("*") if p.is_file())
    return ExportReport(files=tuple(files), losses=_losses(world, coarse, options))


def _losses(world: World, coarse: list[Mesh], options: Options) -> tuple[str, ...]:
    """What USD, or this export of it, does not say."""
    detail = world.appearance.detail
    losses = [
        texture_loss(world.ground, options.texture_pixels, normals=detail is not None),
        *([detail_loss(detail)] if detail else []),
        *fixed_losses(world.field),
        "Fixed rocks in pictures are turned by half-precision quaternions, off by below 0.001 rad.",
        "USD lights have no physical unit: intensities are W/m² and want an exposure.",
    ]
    if world.site.georeferenced:
        losses.append("Longitude and latitude of the site are left out: no USD schema holds them.")
    if world.trajectories and any(s.kind != "camera" for s in world.rover.sensors):
        losses.append("Lidar and IMU are bare frames: no USD schema holds their figures.")
    shapes, field = world.library.prototypes, world.field
    if field.loose.any():
        losses.append("Loose rocks have no torsional and no rolling friction: USD knows neither.")
    small = int((field.solid & ~field.loose & (field.diameter < options.collider_min_m)).sum())
    if small:
        error = largest_outline_error(coarse, shapes)
        losses.append(
            f"{small} rocks below {options.collider_min_m:g} m share one collider per tile, "
            f"its outline off by up to {100 * error:.1f} % of a rock's size."
        )
    return (*losses, *collision_losses(shapes))
