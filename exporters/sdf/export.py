"""The SDF export from first to last."""

from __future__ import annotations

from pathlib import Path

from terrain_forge.exporters.sdf import ground, rocks

from terrain_forge.base import ExportError
from terrain_forge.geometry import coarse_shape, write_rover_meshes
from terrain_forge.model import ExportReport, Mesh, World, world_friction
from terrain_forge.writers import file_name, rock_name

from .actor import replay_actor
from .heightmap import Heightmap, make_heightmap, write_heightmap
from .load import require_loadable
from .losses import list_losses
from .markup import Lines
from .model import Model
from .options import Options
from .ros import write_package
from .scenery import write_world
from .sensors import rig_sensors


def export(world: World, directory: Path, *, options: Options) -> ExportReport:
    """Write world.sdf, scene.sdf (with a replay of each trajectory) and their models.

    The models' names begin with the world's, so that several worlds can share one resource path.

    Raises:
        ExportError: if the ground is too large for a heightmap, the rocks are too many elements, or
            a path is named like a model.
    """
    require_loadable(world, options)
    heightmap = None
    if options.ground == "heightmap":
        heightmap = make_heightmap(world.ground, bits=options.grey_bits)
    name = file_name(world.site.name)
    *models, rover_model = (
        _model(directory, f"{name}_{part}", options) for part in ("ground", "rocks", "rover")
    )
    coarse = [coarse_shape(shape, options.outline_error) for shape in world.library.prototypes]
    _write_models(world, *models, coarse=coarse, heightmap=heightmap, options=options)
    taken = {rock_name(rock) for rock in world.field.id[world.field.dynamic].tolist()}
    taken |= {model.name for model in models}
    actors = _actors(world, options, rover_model=rover_model, taken=taken)
    dynamic = rocks.dynamic_rocks(world, models[1])
    sensing = bool(options.sensors and actors and world.rover.sensors)
    for file, movers, sees in (("world", dynamic, False), ("scene", dynamic + actors, sensing)):
        path = directory / f"{file}.sdf"
        write_world(path, world, name=name, models=models, movers=movers, sensing=sees)
    if options.ros_package:
        write_package(world, directory, options=options)
    files = sorted(p.relative_to(directory) for p in directory.rglob("*") if p.is_file())
    losses = list_losses(world, coarse=coarse, heightmap=heightmap, version=models[0].version,
                         options=options)  # fmt: skip
    return ExportReport(files=tuple(files), losses=losses)


def _model(directory: Path, name: str, options: Options) -> Model:
    return Model(
        folder=directory / "models" / name,
        name=name,
        flavour=options.flavour,
        version=options.version,
    )


def _actors(world: World, options: Options, *, rover_model: Model, taken: set[str]) -> list[Lines]:
    """A replay of each trajectory, by the name of its path, which no model may have.

    The rover's meshes, which the actors show, go into the folder of `rover_model`.
    """
    if world.trajectories:
        write_rover_meshes(world.rover, rover_model.folder / "meshes")
    west, south, east, north = world.ground.bounds
    actors = []
    for trajectory in world.trajectories:
        name = file_name(trajectory.name)
        if name in taken:
            raise ExportError(
                f"path {trajectory.name!r}: a model of the scene is called so; choose another name"
            )
        sensors: list[Lines] = []
        if options.sensors:
            reach = max(east - west, north - south)
            sensors = rig_sensors(world.rover, actor=name, flavour=options.flavour, reach=reach)
        actors.append(
            replay_actor(trajectory, world.rover, name=name, model=rover_model, sensors=sensors)
        )
    return actors


def _write_models(
    world: World,
    ground_model: Model,
    rock_model: Model,
    *,
    coarse: list[Mesh],
    heightmap: Heightmap | None,
    options: Options,
) -> None:
    names: list[str] = []
    parts: list[Lines] = []
    links: list[Lines] = []
    if heightmap:
        friction = world_friction(world.site.body, options).ground
        parts.append(write_heightmap(heightmap, world.ground, ground_model, friction=friction))
    for tile in world.tiles(cells=options.tile_cells):
        names.append(tile.name("ground"))
        parts += ground.write_tile(tile, ground_model, options=options)
        links.append(rocks.write_tile(tile, rock_model, coarse=coarse, options=options))
    title = f"{world.site.name}: ground"
    ground.write_model(ground_model, title=title, tiles=names, parts=parts)
    rocks.write_model(world, rock_model, links=links, options=options)
