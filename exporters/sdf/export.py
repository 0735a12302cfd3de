"""The SDF export from first to last."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from terrain_forge.mesh import Mesh
from terrain_forge.registry import ExportReport
from terrain_forge.rock_mesh import (
    coarse_shape,
    collision_losses,
    fixed_losses,
    largest_outline_error,
)
from terrain_forge.world import World
from terrain_forge.writers.naming import file_name

from . import ground, rocks
from .actor import replay_actor
from .loose import loose_rocks
from .markup import Lines
from .model import Model
from .options import Options
from .scenery import write_world


def export(world: World, directory: Path, *, options: Options) -> ExportReport:
    """Write world.sdf, scene.sdf (with a replay of each trajectory) and their models.

    The models' names begin with the world's, so that several worlds can share one resource path.
    """
    name = file_name(world.site.name)
    models = [
        Model(folder=directory / "models" / full, name=full, flavour=options.flavour)
        for full in (f"{name}_ground", f"{name}_rocks")
    ]
    coarse = [coarse_shape(shape, options.outline_error) for shape in world.library.prototypes]
    _write_models(world, *models, coarse=coarse, options=options)
    actors = [
        replay_actor(trajectory, world.rover, name=file_name(trajectory.name))
        for trajectory in world.trajectories
    ]
    loose = loose_rocks(world, models[1])
    for file, movers in (("world.sdf", loose), ("scene.sdf", loose + actors)):
        write_world(directory / file, world, name=name, models=models, movers=movers)
    files = sorted(p.relative_to(directory) for p in directory.rglob("*") if p.is_file())
    return ExportReport(files=tuple(files), losses=_losses(world, coarse, options))


def _write_models(
    world: World, ground_model: Model, rock_model: Model, *, coarse: list[Mesh], options: Options
) -> None:
    friction = options.friction
    block_of_shape = cache(ground.shape_block)
    names: list[str] = []
    parts: list[Lines] = []
    links: list[Lines] = []
    for number, tile in enumerate(world.tiles(cells=options.tile_cells)):
        names.append(f"ground_{number:03}")
        parts += ground.write_tile(
            tile,
            world,
            ground_model,
            name=names[-1],
            friction=friction,
            block_of_shape=block_of_shape,
        )
        links.append(
            rocks.write_tile(tile, world, rock_model, number=number, coarse=coarse, options=options)
        )
    title = f"{world.site.name}: ground"
    ground.write_model(ground_model, title=title, tiles=names, parts=parts)
    rocks.write_model(world, rock_model, links=links, options=options)


def _losses(world: World, coarse: list[Mesh], options: Options) -> tuple[str, ...]:
    """What SDF, or this export of it, does not say."""
    field, shapes = world.field, world.library.prototypes
    losses = [
        *fixed_losses(field),
        "SDF lights have no radiometric unit: the Sun shines with 1, its "
        f"{world.lighting.irradiance:.0f} W/m² and its angular size are lost.",
        "Actors replay the path without colliding and carry no sensors.",
    ]
    if field.loose.any():
        losses.append("Loose rocks have no rolling friction, which SDF does not know.")
    if world.site.georeferenced:
        version = "1.9" if options.flavour == "gz" else "1.6"
        losses.append(
            f"SDF {version} knows no surface but the Earth's: longitude and latitude are left out."
        )
    small = int((~rocks.is_single(field, options)).sum())
    if small:
        error = largest_outline_error(coarse, shapes)
        losses.append(
            f"{small} rocks below {options.individual_min_m:g} m are merged per tile: no longer "
            f"separate, without texture, their outline off by up to {100 * error:.1f} % of their "
            "size."
        )
    return (*losses, *collision_losses(shapes))
