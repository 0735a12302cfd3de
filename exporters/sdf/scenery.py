"""The world file: gravity, physics, Sun and sky, and the models that it includes."""

from __future__ import annotations

import math
from pathlib import Path

from terrain_forge.dtm import ellipsoid
from terrain_forge.model import Lighting, Site, World
from terrain_forge.writers import file_name

from .load import STEP
from .markup import Lines, element, numbers, world_name, write_document
from .model import Model

_SYSTEMS = {
    "physics": "Physics",
    "user-commands": "UserCommands",
    "scene-broadcaster": "SceneBroadcaster",
    "sensors": "Sensors",
    "imu": "Imu",
}
"""The first three are those that gz-sim takes for a world that names none."""


def write_world(
    path: Path, world: World, *, name: str, models: list[Model], movers: list[Lines], sensing: bool
) -> None:
    """Write a world file that includes the models and holds what moves: dynamic rocks, actors.

    Args:
        path: The file.
        world: The world.
        name: Its name in the file.
        models: The models of ground and rocks.
        movers: Elements of what moves.
        sensing: Whether something carries sensors, for which gz-sim wants plugins.
    """
    flavour, version = models[0].flavour, models[0].version
    located = knows_surface(world.site, version)
    body = element(
        "world",
        element("gravity", numbers([0, 0, -world.site.body.gravity])),
        element("magnetic_field", "0 0 0"),
        *([_spherical_coordinates(world.site)] if located else []),
        _physics(flavour, name=_free("default_physics", world)),
        *(_systems() if sensing and flavour == "gz" else []),
        _scene(world.lighting),
        _sun(world.lighting, name=_free("sun", world)),
        *(element("include", element("uri", f"model://{model.name}")) for model in models),
        *movers,
        name=world_name(name),
    )
    write_document(path, version, body)


def _free(name: str, world: World) -> str:
    """A name that no actor has, which have those of their paths: siblings share one name space."""
    taken = {file_name(trajectory.name) for trajectory in world.trajectories}
    return f"{name}.1" if name in taken else name


def knows_surface(site: Site, version: str) -> bool:
    """Whether this version of SDF can say where on its body a site lies."""
    return version == "1.10" and site.georeferenced


def _spherical_coordinates(site: Site) -> Lines:
    """Where the origin lies, on the ellipsoid of the site's own reference system."""
    assert site.lonlat is not None
    longitude, latitude = map(math.degrees, site.lonlat)
    equatorial, polar = ellipsoid(site.crs)
    return element(
        "spherical_coordinates",
        element("surface_model", "CUSTOM_SURFACE"),
        element("world_frame_orientation", "ENU"),
        element("latitude_deg", f"{latitude:.9f}"),
        element("longitude_deg", f"{longitude:.9f}"),
        element("elevation", numbers([site.datum_height])),
        element("surface_axis_equatorial", numbers([equatorial])),
        element("surface_axis_polar", numbers([polar])),
        element("heading_deg", "0"),
    )


def _systems() -> list[Lines]:
    """gz-sim's plugins, by the names that Fortress 6.16 and all later versions know."""
    files = {kind: f"gz-sim-{kind}-system" for kind in _SYSTEMS}
    return [
        element(
            "plugin",
            *([element("render_engine", "ogre2")] if kind == "sensors" else []),
            filename=files[kind],
            name=f"gz::sim::systems::{system}",
        )
        for kind, system in _SYSTEMS.items()
    ]


def _physics(flavour: str, *, name: str) -> Lines:
    timing = [
        element("max_step_size", numbers([STEP])),
        element("real_time_factor", "1"),
        element("real_time_update_rate", numbers([1 / STEP])),
    ]
    if flavour == "classic":
        return element("physics", *timing, name=name, default="true", type="ode")
    # With DART's bullet detector no mesh meets another one: dynamic rocks would fall into the
    # ground.
    dart = element(
        "dart",
        element("solver", element("solver_type", "dantzig")),
        element("collision_detector", "ode"),
    )
    return element("physics", *timing, dart, name=name, default="true", type="dart")


def _scene(lighting: Lighting) -> Lines:
    # Where no air scatters light, the ground still throws some back into the shadows.
    ambient = [0.05 + 0.4 * channel for channel in lighting.sky_rgb]
    return element(
        "scene",
        element("ambient", numbers([*ambient, 1])),
        element("background", numbers([*lighting.sky_rgb, 1])),
        element("shadows", "true"),
        element("grid", "false"),
    )


def _sun(lighting: Lighting, *, name: str) -> Lines:
    return element(
        "light",
        element("cast_shadows", "true"),
        element("pose", "0 0 100 0 0 0"),
        element("diffuse", "1 1 1 1"),
        element("specular", "0.1 0.1 0.1 1"),
        element("direction", numbers(-lighting.towards_sun)),
        name=name,
        type="directional",
    )
