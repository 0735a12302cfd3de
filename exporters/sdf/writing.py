"""The SDF export from first to last."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from terrain_forge.exporters.sdf import rocks

from terrain_forge.base import ExportError, image_rows
from terrain_forge.geometry import (
    GroundTexture,
    bake_tile,
    coarse_shape,
    horizon_surface,
    with_horizon_loss,
    write_ground_glb,
    write_ground_obj,
    write_horizon_mesh,
    write_rover_meshes,
)
from terrain_forge.model import (
    ExportReport,
    Horizon,
    Tile,
    World,
    ground_patches,
    material_frictions,
    world_friction,
)
from terrain_forge.rocks import seen_close
from terrain_forge.writers import Lines, element, file_name, rock_name, write_png

from .actor import replay_actor
from .heightmap import make_heightmap, write_heightmap
from .losses import list_losses, require_loadable
from .model import TEXTURES, Model, mesh, surface
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
    name, classic = file_name(world.site.name), options.flavour == "classic"
    ground_model, rock_model, _ = models = [
        Model(
            folder=directory / f"models/{name}_{part}",
            classic=classic,
            version=options.version,
            relief=options.normal_maps and not classic,
        )
        for part in ("ground", "rocks", "rover")
    ]
    coarse = [coarse_shape(shape, options.outline_error) for shape in world.library.prototypes]
    friction = world_friction(world.site.body, options)
    parts: list[Lines] = []
    if heightmap:
        parts = [write_heightmap(heightmap, world.ground, ground_model, friction=friction.ground)]
    tiles = list(world.tiles(cells=options.tile_cells))
    links = []
    close = frozenset(seen_close(world, within=options.close_within_m).tolist())
    for tile in tiles:
        parts += _write_ground(tile, ground_model, options)
        links.append(
            rocks.write_tile(tile, rock_model, friction.rock, coarse, options, close=close)
        )
    ground_model.write_scripts([f"{tile.name('ground')}.png" for tile in tiles], address="clamp")
    link = element("link", *parts, name="ground")
    ground_model.write(title=f"{world.site.name}: ground", links=[link])
    rocks.write_model(world, rock_model, links=links, close=close, options=options)
    included = models[:2]
    if options.horizon and world.horizon:
        beyond = Model(
            folder=directory / f"models/{name}_horizon", classic=classic, version=options.version
        )
        write_horizon(world.horizon, beyond, title=f"{world.site.name}: horizon", options=options)
        included.append(beyond)
    actors = _actors(world, options, models=models)
    dynamic = rocks.dynamic_rocks(world, rock_model, close=close)
    for file, movers in (("world", dynamic), ("scene", dynamic + actors)):
        path = directory / f"{file}.sdf"
        write_world(path, world, name=name, models=included, movers=movers)
    if options.ros_package:
        write_package(world, directory, options=options)
    files = sorted(p.relative_to(directory) for p in directory.rglob("*") if p.is_file())
    losses = list_losses(world, coarse=coarse, heightmap=heightmap, options=options)
    report = ExportReport(files=tuple(files), losses=losses)
    return with_horizon_loss(report, world.horizon, shown=options.horizon)


def write_horizon(horizon: Horizon, model: Model, *, title: str, options: Options) -> None:
    """Write the model of what lies beyond the border: a visual without a collision."""
    shown, picture = horizon_surface(horizon)
    file = f"meshes/horizon.{'glb' if options.binary else 'obj'}"
    write_horizon_mesh(model.path(file), shown)
    write_png(model.path(f"{TEXTURES}/horizon.png"), picture)
    model.write_scripts(["horizon.png"], address="clamp")
    look = model.textured("horizon.png")
    visual = element("visual", mesh(model.uri(file)), look, name="horizon_visual")
    model.write(title=title, links=[element("link", visual, name="horizon")])


def _write_ground(tile: Tile, model: Model, options: Options) -> list[Lines]:
    """Write one tile's meshes and textures; returns its visual and, of a mesh, its collisions."""
    texture = bake_tile(tile, options.texture_pixels)
    return ground_surface(tile, texture, model, options, name=tile.name("ground"))


def ground_surface(
    tile: Tile,
    texture: GroundTexture,
    model: Model,
    options: Options,
    *,
    name: str,
) -> list[Lines]:
    """Write the meshes and the pictures of a piece of ground: its collisions, then its visual.

    A ground of one friction has one file for both, with the normals that Gazebo's physics asks of a
    collision mesh.
    """
    file = _write_mesh(tile, model, options, name, None)
    normals = None
    write_png(model.path(f"{TEXTURES}/{name}.png"), image_rows(texture.rgb))
    if not model.classic and options.normal_maps:
        normals = f"{name}_normals.png"
        write_png(model.path(f"{TEXTURES}/{normals}"), image_rows(texture.normals))
    shown = mesh(model.uri(file))
    look = model.textured(f"{name}.png", normals=normals)
    visual = element("visual", shown, look, name=f"{name}_visual")
    if options.ground == "heightmap":
        return [visual]
    collisions = []
    patches = ground_patches(tile.world, material_frictions(tile.whole, options))
    for number, (friction, cells) in enumerate(patches):
        # Where materials differ in friction, each is a collision of its own cells.
        part = name if cells is None else f"{name}_{number}"
        touched = shown
        if cells is not None:
            touched = mesh(model.uri(_write_mesh(tile, model, options, part, cells)))
        collisions.append(
            element("collision", touched, surface(friction), name=f"{part}_collision")
        )
    return [*collisions, visual]


def _write_mesh(
    tile: Tile, model: Model, options: Options, name: str, cells: NDArray[np.bool_] | None
) -> str:
    """Write the mesh of a tile's ground or of some of its cells; returns its file."""
    file = f"meshes/{name}.{'glb' if options.binary else 'obj'}"
    if options.binary:
        write_ground_glb(model.path(file), tile, cells=cells)
    else:
        with model.path(file).open("wb") as text:
            write_ground_obj(text, tile, cells=cells)
    return file


def _actors(world: World, options: Options, *, models: list[Model]) -> list[Lines]:
    """A replay of each trajectory, by the name of its path, which no model may have.

    The rover's meshes, which the actors show, go into the folder of the last model.
    """
    if world.trajectories:
        write_rover_meshes(world.rover, models[-1].folder / "meshes")
    taken = {rock_name(rock) for rock in world.field.id[world.field.dynamic].tolist()}
    taken |= {model.name for model in models[:2]} | {f"{file_name(world.site.name)}_horizon"}
    west, south, east, north = world.ground.bounds
    reach, classic = max(east - west, north - south), options.flavour == "classic"
    actors = []
    for trajectory in world.trajectories:
        name = file_name(trajectory.name)
        if name in taken:
            raise ExportError(
                f"path {trajectory.name!r}: a model of the scene is called so; choose another name"
            )
        sensors: list[Lines] = []
        if options.sensors:
            sensors = rig_sensors(world.rover, actor=name, classic=classic, reach=reach)
        actors.append(
            replay_actor(trajectory, world.rover, name=name, model=models[-1], sensors=sensors)
        )
    return actors
