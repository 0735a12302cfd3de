"""The world file: gravity, physics, Sun and sky, and the models that it includes."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from terrain_forge.base import srgb_from_linear
from terrain_forge.dtm import ellipsoid
from terrain_forge.geometry import SkyColours, light_levels, sky_colours
from terrain_forge.model import Site, World
from terrain_forge.writers import Lines, Value, element, file_name, leaves, write_xml

from .model import Model, usable_name

STEP = 0.002
"""Time step of the physics [s]."""
_SYSTEMS = {
    "physics": "Physics",
    "user-commands": "UserCommands",
    "scene-broadcaster": "SceneBroadcaster",
    "sensors": "Sensors",
    "imu": "Imu",
}
"""The first three are those that gz-sim takes where nothing names any: a rover's own would keep it
from them, so that it would hang in the air."""
_SHADE = 0.05
"""Light in shadows where no air scatters any: the ground throws some back."""


def write_world(
    path: Path,
    world: World,
    *,
    name: str,
    models: list[Model],
    movers: list[Lines],
    included: bool = True,
) -> None:
    """Write a world file that includes the models and holds what moves: dynamic rocks, actors.

    Models that are not `included` tell the version alone; movers include what there is.
    """
    classic, version = models[0].classic, models[0].version
    # Siblings share one name space, and actors have the names of their paths.
    actors = {file_name(trajectory.name) for trajectory in world.trajectories}
    sun, physics = (f"{n}.1" if n in actors else n for n in ("sun", "default_physics"))
    sky = sky_colours(world)
    body = element(
        "world",
        *leaves(gravity=(0, 0, -world.site.body.gravity), magnetic_field="0 0 0"),
        *([_place(world.site)] if knows_surface(world.site, version) else []),
        _physics(physics, classic=classic),
        *([] if classic else _systems(sky)),
        *_lights(world, sky, sun=sun, classic=classic),
        *(element("include", *leaves(uri=f"model://{one.name}")) for one in models if included),
        *movers,
        name=usable_name(name),
    )
    write_xml(path, element("sdf", body, version=version))


def knows_surface(site: Site, version: str) -> bool:
    """Whether this version of SDF can say where on its body a site lies."""
    return version == "1.10" and site.georeferenced


def _place(site: Site) -> Lines:
    """Where the origin lies, on the ellipsoid of the site's own reference system."""
    assert site.lonlat is not None
    longitude, latitude = map(math.degrees, site.lonlat)
    equatorial, polar = ellipsoid(site.crs)
    where = leaves(
        surface_model="CUSTOM_SURFACE",
        world_frame_orientation="ENU",
        latitude_deg=f"{latitude:.9f}",
        longitude_deg=f"{longitude:.9f}",
        elevation=site.datum_height,
        surface_axis_equatorial=equatorial,
        surface_axis_polar=polar,
        heading_deg=0,
    )
    return element("spherical_coordinates", *where)


def _systems(sky: SkyColours) -> list[Lines]:
    # Cameras of early Fortress do not see the scene's own background.
    seen = leaves(render_engine="ogre2", background_color=_background(sky, classic=False))
    return [
        gz_system(kind, name, *(seen if kind == "sensors" else []))
        for kind, name in _SYSTEMS.items()
    ]


def gz_system(kind: str, name: str, *parts: Lines) -> Lines:
    """One of gz-sim's plugins, by the names that Fortress 6.16 and all later versions know."""
    names = {"filename": f"gz-sim-{kind}-system", "name": f"gz::sim::systems::{name}"}
    return element("plugin", *parts, **names)


def _physics(name: str, *, classic: bool) -> Lines:
    timing = leaves(max_step_size=STEP, real_time_factor=1, real_time_update_rate=1 / STEP)
    if classic:
        return element("physics", *timing, name=name, default="true", type="ode")
    # With DART's bullet detector no mesh meets another one: dynamic rocks would fall into the
    # ground.
    solver = element("solver", *leaves(solver_type="dantzig"))
    dart = element("dart", solver, *leaves(collision_detector="ode"))
    return element("physics", *timing, dart, name=name, default="true", type="dart")


def _lights(world: World, sky: SkyColours, *, sun: str, classic: bool) -> list[Lines]:
    levels = light_levels(world, "display")
    if classic:
        ambient = _SHADE + 0.6 * (1.0 - levels.share) * sky.mean / max(sky.mean.max(), _SHADE)
        bright = leaves(diffuse=(*(min(2.0 * levels.share, 1.0),) * 3, 1))
    else:
        # gz-sim spreads ambient light over π, and takes no channel above 1.
        ambient = np.pi * np.maximum(sky.mean, _SHADE)
        ambient /= max(ambient.max(), 1.0)
        bright = leaves(diffuse="1 1 1 1", intensity=levels.sun / np.pi)
    colours = leaves(ambient=(*ambient.tolist(), 1), background=_background(sky, classic=classic))
    light = [
        *leaves(cast_shadows="true", pose="0 0 100 0 0 0"),
        *bright,
        *leaves(specular="0.1 0.1 0.1 1", direction=-world.lighting.towards_sun),
    ]
    return [
        element("scene", *colours, *leaves(shadows="true", grid="false")),
        element("light", *light, name=sun, type="directional"),
    ]


def _background(sky: SkyColours, *, classic: bool) -> Value:
    """The sky's colour as Classic shows it, or in linear light, which gz-sim encodes."""
    colour = np.clip(sky.horizon, 0.0, 1.0)
    return (*(srgb_from_linear(colour) if classic else colour).tolist(), 1)
