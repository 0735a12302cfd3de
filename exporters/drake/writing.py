"""The Drake export from first to last."""

from __future__ import annotations

from pathlib import Path

from terrain_forge.base import image_rows
from terrain_forge.geometry import (
    PLACE_LOSS,
    bake_tile,
    largest_outline_error,
    level_of_detail,
    rock_look_losses,
    static_losses,
    texture_loss,
    with_horizon_loss,
    write_ground_obj,
)
from terrain_forge.model import (
    ExportReport,
    Mesh,
    Tile,
    World,
    ground_patches,
    material_frictions,
)
from terrain_forge.writers import (
    Lines,
    MattMaterial,
    element,
    file_name,
    leaves,
    write_mtl,
    write_png,
    write_xml,
)

from ..sdf.model import usable_name
from ..sdf.rocks import is_single
from .options import ADVICE, WORTH_SAYING, Load, Options, require_parsable
from .rocks import (
    MATERIALS,
    collision,
    dynamic_rocks,
    fixed_rocks,
    visual,
    write_materials,
    write_shapes,
)

_SDF_VERSION = "1.9"
_NAMESPACE = {"xmlns:drake": "http://drake.mit.edu"}


def export(world: World, directory: Path, *, options: Options) -> ExportReport:
    """Write world.sdf, its meshes and textures, and a package.xml for package:// URIs.

    Raises:
        ExportError: if the rocks are too many for Drake's parser.
    """
    load = require_parsable(world, options)
    folder = directory / "assets"
    folder.mkdir()
    shapes = world.library.prototypes
    error = options.merged_error(world)
    coarse = [p.meshes[level_of_detail(p, error)] for p in shapes]
    links: list[Lines] = []
    rocks: list[Lines] = []
    looks: list[MattMaterial] = []
    for tile in world.tiles(cells=options.tile_cells):
        links.append(_ground_link(tile, folder, options))
        name = tile.name("ground")
        looks.append(MattMaterial(name=name, texture=f"{name}.png"))
        rocks += fixed_rocks(tile, folder, coarse=coarse, options=options)
    rocks += dynamic_rocks(world, folder, options)
    single = world.field.select(is_single(world.field, options.individual_min_m))
    write_shapes(world, single, folder)
    write_mtl(folder / MATERIALS, [*looks, *write_materials(world, single, folder)])
    ground = element("model", element("static", "true"), *links, name="ground")
    name = file_name(world.site.name)
    body = element("world", ground, *rocks, name=usable_name(name), **_NAMESPACE)
    write_xml(directory / "world.sdf", element("sdf", body, version=_SDF_VERSION))
    package = leaves(name=name, version="0.0.0", description="A world of terrain-forge")
    write_xml(directory / "package.xml", element("package", *package, format="2"))
    files = sorted(p.relative_to(directory) for p in directory.rglob("*") if p.is_file())
    report = ExportReport(files=tuple(files), losses=_losses(world, coarse, load, options))
    return with_horizon_loss(report, world.horizon, shown=False)


def _ground_link(tile: Tile, folder: Path, options: Options) -> Lines:
    """Write a tile's mesh and texture; returns its link."""
    name = tile.name("ground")
    with (folder / f"{name}.obj").open("wb") as file:
        file.write(f"mtllib {MATERIALS}\nusemtl {name}\n".encode())
        write_ground_obj(file, tile)
    texture = bake_tile(tile, options.texture_pixels)
    write_png(folder / f"{name}.png", image_rows(texture.rgb))
    uri = f"{folder.name}/{name}.obj"
    touched = []
    patches = ground_patches(tile.world, material_frictions(tile.whole, options))
    for number, (friction, cells) in enumerate(patches):
        # Where materials differ in friction, each is a collision of its own cells.
        part = name if cells is None else f"{name}_{number}"
        if cells is not None:
            with (folder / f"{part}.obj").open("wb") as file:
                write_ground_obj(file, tile, cells=cells)
        shape = f"{folder.name}/{part}.obj"
        touched.append(collision(f"{part}_collision", shape, friction))
    return element("link", visual(f"{name}_visual", uri), *touched, name=name)


def _losses(world: World, coarse: list[Mesh], load: Load, options: Options) -> tuple[str, ...]:
    """What Drake's SDF, or this export of it, does not say."""
    losses = [
        "Drake's parser takes no gravity, light or sky: set gravity with "
        "plant.mutable_gravity_field().set_gravity_vector"
        f"([0, 0, {-world.site.body.gravity:g}]).",
        "The ground collides as it is with bodies of hydroelastic contact alone: in point contact "
        "Drake takes a mesh for its convex hull.",
        "Drake mixes the friction of two things that touch, 2ab / (a + b): the surface's is what "
        "counts only for a wheel that has the same.",
        texture_loss(world.ground, options.texture_pixels, normals=False),
    ]
    if world.trajectories:
        losses.append("Drake has no actors: the paths are left out.")
    if world.site.georeferenced:
        losses.append(PLACE_LOSS)
    if world.field.dynamic.any():
        losses.append("Dynamic rocks have no rolling friction, which Drake does not know.")
    losses += static_losses(world.field)
    losses += rock_look_losses(world)
    small = int((~is_single(world.field, options.individual_min_m)).sum())
    if small:
        error = largest_outline_error(coarse, world.library.prototypes)
        losses.append(
            f"{small} rocks below {options.individual_min_m:g} m are merged per tile and show no "
            f"texture, their outline off by up to {100 * error:.1f} % of their size."
        )
    if load.seconds > WORTH_SAYING:
        losses.append(f"Drake's parser loads {load}; {ADVICE}.")
    return tuple(losses)
