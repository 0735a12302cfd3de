"""The world file: gravity, physics, Sun and sky, and the models that it includes."""

from __future__ import annotations

from pathlib import Path

from terrain_forge.world import Lighting, World

from .markup import Lines, element, numbers, write_document
from .model import SPEC_VERSION, Model

_STEP = 0.002
"""Time step of the physics [s]."""


def write_world(
    path: Path, world: World, *, name: str, models: list[Model], movers: list[Lines]
) -> None:
    """Write a world file that includes the models and holds what moves: loose rocks, actors."""
    flavour = models[0].flavour
    body = element(
        "world",
        element("gravity", numbers([0, 0, -world.site.body.gravity])),
        element("magnetic_field", "0 0 0"),
        _physics(flavour),
        _scene(world.lighting),
        _sun(world.lighting),
        *(element("include", element("uri", f"model://{model.name}")) for model in models),
        *movers,
        name=name,
    )
    write_document(path, SPEC_VERSION[flavour], body)


def _physics(flavour: str) -> Lines:
    timing = [
        element("max_step_size", numbers([_STEP])),
        element("real_time_factor", "1"),
        element("real_time_update_rate", numbers([1 / _STEP])),
    ]
    if flavour == "classic":
        return element("physics", *timing, name="default_physics", default="true", type="ode")
    # With DART's bullet detector no mesh meets another one: loose rocks would fall into the ground.
    dart = element(
        "dart",
        element("solver", element("solver_type", "dantzig")),
        element("collision_detector", "ode"),
    )
    return element("physics", *timing, dart, name="default_physics", default="true", type="dart")


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


def _sun(lighting: Lighting) -> Lines:
    return element(
        "light",
        element("cast_shadows", "true"),
        element("pose", "0 0 100 0 0 0"),
        element("diffuse", "1 1 1 1"),
        element("specular", "0.1 0.1 0.1 1"),
        element("direction", numbers(-lighting.towards_sun)),
        name="sun",
        type="directional",
    )
