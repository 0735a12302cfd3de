"""The MJCF export: `world.xml` with the place, `scene.xml` with the rover and the paths in it."""

from __future__ import annotations

import math
from io import StringIO
from pathlib import Path

import numpy as np

from terrain_forge.base import Array, matrix_from_quaternion, portable, quaternion_from_rpy
from terrain_forge.geometry import light_levels, sky_colours, with_horizon_loss, write_rover_meshes
from terrain_forge.model import ExportReport, Rover, Shape, Tile, Trajectory, World, world_friction
from terrain_forge.writers import Lines, element, file_name

from .ground import ground_elements, horizon_elements
from .losses import list_losses, require_counts
from .materials import rock_materials, static_classes, texture_files
from .options import Options
from .rocks import dynamic_rocks, fixed_rocks, has_own_shape, mesh_assets, write_meshes
from .rover import rover_body, rover_sections, simulation

_LARGEST_FIELD = 4096
"""Cells of a height field each way; larger grounds become several."""
_SCENE_EXTENT = 8.0
"""What the viewer of `scene.xml` opens with, around the rover [m]."""
_MEMORY, _MEMORY_PER_ROCK, _MEMORY_PER_CONTACT = 64 * 2**20, 64 * 2**10, 8 * 2**10
"""MuJoCo's memory for contacts where rocks are dynamic [bytes]: five times what 2000 of them used,
twice what the contacts of slabs that cover many cells did. Its own guess grows with the number of
rocks squared."""
_SITES = 400
_CLEAR = 2e-3
"""Between a rover's wheels and the ground where it starts [m]."""
_UPRIGHT = 0.9
"""Cosine of a cylinder's axis to the vertical from which on it stands rather than lies."""
_RGBA = (1.0, 0.85, 0.1, 0.6)
_COLUMNS = "time_s,x_m,y_m,z_m,qw,qx,qy,qz"


def export(world: World, directory: Path, *, options: Options) -> ExportReport:
    """Write `world.xml`, `scene.xml`, `assets/` and `paths/` into `directory`.

    Raises:
        ExportError: if the world has too many rocks, or too many wide dynamic ones.
    """
    require_counts(world, options)
    tiles = list(world.tiles(cells=_LARGEST_FIELD))
    assets, geoms, ground_files = ground_elements(world, tiles, options)
    if options.horizon and world.horizon:
        looks, seen = horizon_elements(world.horizon, directory)
        assets, geoms = [*assets, *looks], [*geoms, *seen]
        beyond = ["assets/horizon.obj", "assets/horizon.png"]
    else:
        beyond = []
    drawn = world.field.select(has_own_shape(world.field, options))
    files = {
        "world.xml": _text(_world(world, tiles, assets, geoms, options)),
        "scene.xml": _text(_scene(world, tiles, options)),
    }
    for trajectory in world.trajectories:
        files[f"paths/{file_name(trajectory.name)}.csv"] = _path_table(trajectory)
    files |= ground_files
    if len(drawn):
        files |= texture_files(world)
    for folder in ("assets", *(["paths"] if world.trajectories else [])):
        (directory / folder).mkdir(exist_ok=True)
    for name, content in files.items():
        (directory / name).write_bytes(content)
    meshes = [
        *write_meshes(world.library, drawn, directory),
        *(f"assets/{name}" for name in write_rover_meshes(world.rover, directory / "assets")),
    ]
    written = tuple(map(Path, (*files, *meshes, *beyond)))
    report = ExportReport(files=written, losses=list_losses(world, options))
    return with_horizon_loss(report, world.horizon, shown=options.horizon)


def _text(lines: Lines) -> bytes:
    return ("\n".join(lines) + "\n").encode()


def _world(
    world: World, tiles: list[Tile], assets: list[Lines], bodies: list[Lines], options: Options
) -> Lines:
    """The model of the place, with the ground's assets and geoms."""
    fields = [tile.field for tile in tiles]
    textured = bool(has_own_shape(world.field, options).any())
    looks = [_sky(world), *rock_materials(world, textured=textured)]
    meshes = mesh_assets(world.library, fields, options)
    rocks: list[Lines] = []
    for field in fields:
        rocks.append(list(fixed_rocks(world, field, options)))
        rocks += dynamic_rocks(world, field, options)
    west, south, east, north = world.ground.bounds
    centre = ((west + east) / 2, (south + north) / 2, float(world.ground.elevation.mean()))
    static = static_classes(world, world_friction(world.site.body, options), textured=textured)
    return element(
        "mujoco",
        *_settings(world, options, shown=_extent(world)),
        *_memory(world),
        element("statistic", center=centre, extent=_extent(world)),
        element("default", static),
        element("asset", *assets, *looks, meshes),
        element("worldbody", _sun(world), *bodies, *rocks),
        model=world.site.name,
    )


def _memory(world: World) -> list[Lines]:
    dynamic = world.field.select(world.field.dynamic)
    if not len(dynamic):
        return []
    contacts = 2.0 * np.ceil(dynamic.diameter / world.ground.spacing + 1.0) ** 2
    each = np.maximum(_MEMORY_PER_ROCK, _MEMORY_PER_CONTACT * contacts)
    return [element("size", memory=str(_MEMORY + int(each.sum())))]


def _settings(world: World, options: Options, *, shown: float) -> list[Lines]:
    """How the model is stepped and seen.

    `shown` is the extent [m] of what the viewer opens with; clipping planes are multiples of it.
    """
    visual = element(
        "visual",
        element("headlight", ambient=(0.25,) * 3, diffuse=(0.1,) * 3, specular=(0.0,) * 3),
        element("quality", shadowsize=4096),
        element("map", znear=0.02 / shown, zfar=_farthest(world, options) / shown),
        element("global", offwidth=1920, offheight=1080),
    )
    gravity = world.site.body.gravity
    return [*simulation(gravity, timestep=options.timestep_s, sleep=options.sleep), visual]


def _farthest(world: World, options: Options) -> float:
    """How far can be seen [m]."""
    beyond = world.horizon.reach if options.horizon and world.horizon else 0.0
    return max(10.0 * _extent(world), 1.5 * (beyond + _extent(world)))


def _sun(world: World) -> Lines:
    towards = world.lighting.towards_sun
    direct = 0.85 * min(2.0 * light_levels(world, "display").share, 1.0)
    return element(
        "light", name="sun", directional="true", dir=-towards, pos=towards * _extent(world),
        diffuse=(direct,) * 3, ambient=(0.1 + 0.5 * (0.85 - direct),) * 3, specular=(0.1,) * 3,
        castshadow="true",
    )  # fmt: skip


def _sky(world: World) -> Lines:
    """The sky's colour at the horizon, darker above; linear light shown as sRGB by its 2.2 root."""
    horizon = portable.power(np.clip(sky_colours(world).horizon, 0.0, 1.0), 1 / 2.2)
    gradient = {"type": "skybox", "builtin": "gradient", "rgb1": 0.75 * horizon, "rgb2": horizon}
    return element("texture", name="sky", width=256, height=1536, **gradient)


def _extent(world: World) -> float:
    west, south, east, north = world.ground.bounds
    return max(east - west, north - south)


def _scene(world: World, tiles: list[Tile], options: Options) -> Lines:
    position, quaternion = start_pose(world)
    friction = world_friction(world.site.body, options).ground
    marker = element("site", name="path_frame", type="box", size=(0.1, 0.02, 0.01), rgba=_RGBA)
    # A mocap body that replays poses of base_link, whatever moves it.
    place = {"pos": position, "quat": quaternion}
    bodies = [element("body", marker, name="path", mocap="true", **place)]
    for trajectory in world.trajectories:
        bodies += _path_sites(trajectory)
    rover: list[Lines] = []
    if world.rover.links:
        bodies.append(rover_body(world.rover, position, quaternion))
        rover = rover_sections(world.rover, friction=friction, folder="assets")
        if world.trajectories:
            rover.append(element("keyframe", *_keyframes(world, tiles)))
    return element(
        "mujoco",
        element("include", file="world.xml"),
        *_settings(world, options, shown=_SCENE_EXTENT),
        element("statistic", center=position, extent=_SCENE_EXTENT),
        *rover,
        element("worldbody", *bodies),
        model=f"{world.site.name} scene",
    )


def _keyframes(world: World, tiles: list[Tile]) -> list[Lines]:
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

    Raised so that no part reaches into the ground; the rover settles within a second.
    """
    ground, rpy = world.ground, np.zeros(3)
    if world.trajectories:
        start = start or world.trajectories[0]
        position, rpy = start.position[0].copy(), start.rpy[0]
    else:
        west, south, east, north = ground.bounds
        x, y = (west + east) / 2, (south + north) / 2
        position = np.array([x, y, float(ground.height_at(x, y))])
    quaternion = quaternion_from_rpy(rpy)
    if world.rover.wheels:
        treads = np.concatenate(_treads(world.rover))
        points = position + portable.product(treads, matrix_from_quaternion(quaternion).T)
        points = points[ground.covers(points[:, 0], points[:, 1])]
        above = ground.height_at(points[:, 0], points[:, 1]) - points[:, 2] + _CLEAR
        position[2] += float(above.max(initial=0.0))
    return position, quaternion


def _treads(rover: Rover) -> list[Array]:
    """Points on the lower half of each driven wheel, and around all else that a rover collides by.

    Points of base_link's frame [m], shape [points, 3] each.
    """
    wheels = {wheel.link: wheel for wheel in rover.wheels}
    treads = []
    for link in rover.links:
        if wheel := wheels.get(link.name):
            treads.append(_lower_half(wheel.centre, link.axis, wheel.radius, wheel.width))
        else:
            at = rover.origins[link.name]
            treads += [at + _around(shape) for shape in link.shapes if shape.collides]
    return treads


def _around(shape: Shape) -> Array:
    """Points on what collides, those of a rolling shape on its lower half, in the link's frame."""
    turn = matrix_from_quaternion(quaternion_from_rpy(shape.rpy))
    if shape.kind == "sphere":
        left, at = np.array([0.0, 1.0, 0.0]), shape.position
        rings = shape.size[0] * _half_circle(9)
        return np.concatenate(
            [_lower_half(at + y * left, left, radius, 0.0) for y, radius in rings]
        )
    if shape.kind == "cylinder" and abs(turn[2, 2]) < _UPRIGHT:
        return _lower_half(shape.position, turn[:, 2], *shape.size)
    if shape.mesh is not None:
        points = shape.mesh.vertices
    else:
        size = (
            (2.0 * shape.size[0],) * 2 + shape.size[1:] if shape.kind == "cylinder" else shape.size
        )
        points = np.array(np.meshgrid(*[(-0.5, 0.5)] * 3)).reshape(3, -1).T * size
    return np.asarray(shape.position + portable.product(points, turn.T))


def _lower_half(centre: Array, axle: Array, radius: float, width: float) -> Array:
    """Points on the lower half of a cylinder that lies about an axle, shape [points, 3]."""
    ahead = np.cross(axle, (0.0, 0.0, 1.0))
    ahead /= portable.norm(ahead)
    circle, across = radius * _half_circle(33), width * np.linspace(-0.5, 0.5, 5)
    points = np.array([(x, y, -z) for y in across for x, z in circle])
    return np.asarray(
        centre + portable.product(points, np.array([ahead, axle, np.cross(ahead, axle)]))
    )


def _half_circle(count: int) -> Array:
    """Sines and cosines from -90° to 90°, shape [count, 2]; NumPy's hang on the processor."""
    angles = np.linspace(-0.5 * math.pi, 0.5 * math.pi, count).tolist()
    return np.array([(math.sin(angle), math.cos(angle)) for angle in angles])


def _path_sites(trajectory: Trajectory) -> list[Lines]:
    """Beads along a path, `<path>_<n>`, in a group of their own that a viewer can switch off."""
    count = min(_SITES, len(trajectory.time))
    beads = trajectory.position[np.linspace(0, len(trajectory.time) - 1, count).round().astype(int)]
    return [
        element("site", name=f"{trajectory.name}_{n}", pos=bead, size=0.02, group=2, rgba=_RGBA)
        for n, bead in enumerate(beads)
    ]


def _path_table(trajectory: Trajectory) -> bytes:
    """The track of the mocap body: a line per sample, time [s], `mocap_pos` and `mocap_quat`.

    Keyframes would hold it too, but each of them holds all of the model's joints as well.
    """
    samples = np.column_stack([trajectory.time, trajectory.position, trajectory.quaternion])
    text = StringIO()
    np.savetxt(text, samples, fmt="%.9f", delimiter=",", header=_COLUMNS, comments="")
    return text.getvalue().encode()
