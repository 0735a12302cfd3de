"""The MJCF export: `world.xml` with the place, `scene.xml` with the rover and the paths in it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from terrain_forge.base import Array, matrix_from_quaternion, portable, quaternion_from_rpy
from terrain_forge.geometry import write_rover_meshes
from terrain_forge.model import (
    ExportReport,
    Friction,
    Tile,
    Trajectory,
    World,
    world_friction,
)
from terrain_forge.writers import file_name

from .blocks import split_ground, wide_rocks
from .capacity import require_counts
from .ground import GroundPart, ground_block, ground_part
from .losses import list_losses
from .materials import (
    SOLIMP,
    SOLREF,
    SURFACE_PRIORITY,
    rock_classes,
    rock_materials,
    sliding,
    texture_files,
)
from .options import Options
from .replay import path_sites, path_table, replay_body
from .rocks import dynamic_rocks, fixed_rocks, has_own_shape, mesh_assets, write_hulls, write_shapes
from .rover import (
    rover_actuators,
    rover_assets,
    rover_body,
    rover_classes,
    rover_equalities,
    rover_sensors,
)
from .xml import element

_LARGEST_FIELD = 4096
"""Cells of a height field each way; larger grounds become several."""
_SCENE_EXTENT = 8.0
"""What the viewer of `scene.xml` opens with, around the rover [m]."""
_MEMORY, _MEMORY_PER_ROCK, _MEMORY_PER_CONTACT = 64 * 2**20, 64 * 2**10, 8 * 2**10
"""MuJoCo's memory for contacts where rocks are dynamic [bytes]: five times what 2000 of them used,
twice what the contacts of slabs that cover many cells did. Its own guess grows with the number of
rocks squared."""


def export(world: World, directory: Path, *, options: Options) -> ExportReport:
    """Write `world.xml`, `scene.xml`, `assets/` and `paths/` into `directory`.

    Raises:
        ExportError: if the world has too many rocks, or too many wide dynamic ones.
    """
    require_counts(world, options)
    tiles = list(world.tiles(cells=_LARGEST_FIELD))
    grounds = _grounds(world, tiles, options)
    shapes = np.unique(world.field.prototype[has_own_shape(world.field, options)]).tolist()
    files = {
        "world.xml": _world_xml(world, tiles, grounds, options).encode(),
        "scene.xml": _scene_xml(world, tiles, options).encode(),
    }
    for trajectory in world.trajectories:
        files[f"paths/{file_name(trajectory.name)}.csv"] = path_table(trajectory)
    for part in grounds:
        files |= part.files
    if shapes:
        files |= texture_files(world)
    for folder in ("assets", *(["paths"] if world.trajectories else [])):
        (directory / folder).mkdir(exist_ok=True)
    for name, content in files.items():
        (directory / name).write_bytes(content)
    meshes = [
        *write_hulls(world.library, directory),
        *write_shapes(world.library, shapes, directory),
        *(f"assets/{name}" for name in write_rover_meshes(world.rover, directory / "assets")),
    ]
    written = tuple(map(Path, (*files, *meshes)))
    return ExportReport(files=written, losses=list_losses(world, options))


def _grounds(world: World, tiles: list[Tile], options: Options) -> list[GroundPart]:
    """The ground's tiles, and the blocks that are touched in their place where they must be."""
    wide = wide_rocks(world.field, world.ground.spacing)
    split = options.split_ground and len(wide) > 0
    kind = "ground_seen" if split else "ground"
    names = [f"ground_{n}" if n else "ground" for n in range(len(tiles))]
    parts = [
        ground_part(tile, name, kind=kind, largest=options.texture_pixels)
        for tile, name in zip(tiles, names, strict=True)
    ]
    if split:
        blocks = split_ground(world.ground, wide)
        parts += [ground_block(world.ground, b, f"block_{n}") for n, b in enumerate(blocks)]
    return parts


def _world_xml(world: World, tiles: list[Tile], grounds: list[GroundPart], options: Options) -> str:
    fields = [tile.field for tile in tiles]
    textured = bool(has_own_shape(world.field, options).any())
    assets = [asset for part in grounds for asset in part.assets]
    assets += [_sky(world), *rock_materials(world, textured=textured)]
    assets += mesh_assets(world.library, fields, options)
    bodies = [_sun(world), *(part.geom for part in grounds)]
    for field in fields:
        bodies += fixed_rocks(world.library, field, options)
        bodies += dynamic_rocks(world.library, field, options)
    west, south, east, north = world.ground.bounds
    centre = ((west + east) / 2, (south + north) / 2, float(world.ground.elevation.mean()))
    friction = world_friction(world.site.body, options)
    static = [*_static(friction), *rock_classes(world, textured=textured, friction=friction.rock)]
    parts = [
        *_settings(world, options, shown=_extent(world)),
        *_memory(world),
        element("statistic", center=centre, extent=_extent(world)),
        element("default", [element("default", static, class_="static")]),
        element("asset", assets),
        element("worldbody", bodies),
    ]
    return element("mujoco", parts, model=world.site.name) + "\n"


def _memory(world: World) -> list[str]:
    dynamic = world.field.select(world.field.dynamic)
    if not len(dynamic):
        return []
    contacts = 2.0 * np.ceil(dynamic.diameter / world.ground.spacing + 1.0) ** 2
    each = np.maximum(_MEMORY_PER_ROCK, _MEMORY_PER_CONTACT * contacts)
    return [element("size", memory=str(_MEMORY + int(each.sum())))]


def _settings(world: World, options: Options, *, shown: float) -> list[str]:
    """What MuJoCo would otherwise take from its own defaults, which have changed over versions.

    `shown` is the extent [m] of what the viewer opens with; clipping planes are multiples of it.
    """
    flags = [element("flag", sleep="enable")] if options.sleep else []
    option = element(
        "option", flags, timestep=options.timestep_s, gravity=(0.0, 0.0, -world.site.body.gravity),
        integrator="implicitfast", cone="elliptic", impratio=10, solver="Newton", jacobian="sparse",
    )  # fmt: skip
    visual = [
        element("headlight", ambient=(0.25,) * 3, diffuse=(0.1,) * 3, specular=(0.0,) * 3),
        element("quality", shadowsize=4096),
        element("map", znear=0.02 / shown, zfar=10 * _extent(world) / shown),
        element("global", offwidth=1920, offheight=1080),
    ]
    compiler = element("compiler", angle="radian", autolimits="true")
    return [compiler, option, element("visual", visual)]


def _static(friction: Friction) -> list[str]:
    """Defaults of ground and rocks: they meet what moves, never each other."""
    contact = element(
        "geom", contype=0, conaffinity=1, condim=3, priority=SURFACE_PRIORITY,
        friction=sliding(friction.ground), solref=SOLREF, solimp=SOLIMP,
    )  # fmt: skip
    # Blocks are touched and hidden, the ground above them is seen and not touched.
    fields = {
        "ground": {"group": 0},
        "ground_seen": {"group": 0, "contype": 0, "conaffinity": 0},
        "ground_block": {"group": 4},
    }
    classes = [
        element("default", [element("geom", type="hfield", **own)], class_=name)
        for name, own in fields.items()
    ]
    return [contact, *classes]


def _sun(world: World) -> str:
    towards = world.lighting.towards_sun
    return element(
        "light", name="sun", directional="true", dir=-towards, pos=towards * _extent(world),
        diffuse=(0.85,) * 3, ambient=(0.1,) * 3, specular=(0.1,) * 3, castshadow="true",
    )  # fmt: skip


def _sky(world: World) -> str:
    """The sky's colour at the horizon, darker above; linear light shown as sRGB by its 2.2 root."""
    horizon = portable.power(world.lighting.sky_rgb, 1 / 2.2)
    gradient = {"type": "skybox", "builtin": "gradient", "rgb1": 0.75 * horizon, "rgb2": horizon}
    return element("texture", name="sky", width=256, height=1536, **gradient)


def _extent(world: World) -> float:
    west, south, east, north = world.ground.bounds
    return max(east - west, north - south)


def _scene_xml(world: World, tiles: list[Tile], options: Options) -> str:
    position, quaternion = start_pose(world)
    parts = [element("include", file="world.xml"), *_settings(world, options, shown=_SCENE_EXTENT)]
    bodies = [replay_body(position, quaternion)]
    for trajectory in world.trajectories:
        bodies += path_sites(trajectory)
    parts.append(element("statistic", center=position, extent=_SCENE_EXTENT))
    if world.rover.links:
        bodies.append(rover_body(world.rover, position, quaternion))
        parts += [
            element("default", rover_classes(world_friction(world.site.body, options).ground)),
            element("asset", rover_assets(world.rover, "assets")),
            element("equality", rover_equalities(world.rover)),
            element("actuator", rover_actuators(world.rover)),
            element("sensor", rover_sensors(world.rover)),
        ]
        if world.trajectories:
            parts.append(element("keyframe", _keyframes(world, tiles)))
    parts.append(element("worldbody", bodies))
    return element("mujoco", parts, model=f"{world.site.name} scene") + "\n"


def _keyframes(world: World, tiles: list[Tile]) -> list[str]:
    """A state for each path, by its name: the rover and the mocap body at its start.

    Each holds all joints: the dynamic rocks' first, which world.xml has, then the rover's.
    """
    dynamic = [tile.field.select(tile.field.dynamic) for tile in tiles]
    rocks = [np.column_stack([field.position, field.quaternion]).ravel() for field in dynamic]
    hinges = np.zeros(sum(link.joint in ("passive", "motor") for link in world.rover.links))
    keys = []
    for start in world.trajectories:
        pose = start_pose(world, start)
        own = {"qpos": np.concatenate([*rocks, *pose, hinges])}
        keys.append(element("key", name=start.name, mpos=pose[0], mquat=pose[1], **own))
    return keys


def start_pose(world: World, start: Trajectory | None = None) -> tuple[Array, Array]:
    """Position [m] and quaternion of base_link: a path's start (the first's), or the middle.

    Raised so that no wheel reaches into the ground; the rover settles within a second.
    """
    if world.trajectories:
        start = start or world.trajectories[0]
        position, rpy = start.position[0].copy(), start.rpy[0]
    else:
        west, south, east, north = world.ground.bounds
        x, y = (west + east) / 2, (south + north) / 2
        position = np.array([x, y, float(world.ground.height_at(x, y))])
        rpy = np.zeros(3)
    quaternion = quaternion_from_rpy(rpy)
    position[2] += _lift(world, position, matrix_from_quaternion(quaternion))
    return position, quaternion


def _lift(world: World, position: Array, rotation: Array) -> float:
    """How far [m] the ground reaches above the lowest points of the wheels."""
    lowest = [wheel.centre - (0.0, 0.0, wheel.radius) for wheel in world.rover.wheels]
    if not lowest:
        return 0.0
    points = position + portable.product(np.array(lowest), rotation.T)
    points = points[world.ground.covers(points[:, 0], points[:, 1])]
    above = world.ground.height_at(points[:, 0], points[:, 1]) - points[:, 2]
    return float(above.max(initial=0.0))
