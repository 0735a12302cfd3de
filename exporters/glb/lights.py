"""Sun and sky of a GLB, bright as they are in nature or as viewers like them."""

from __future__ import annotations

from typing import Any

import numpy as np

from terrain_forge.base import Array, portable
from terrain_forge.geometry import facing_sun, light_levels, sky_colours
from terrain_forge.model import Lighting, Mesh, World
from terrain_forge.writers import Gltf

from .ground import matt
from .options import Options

EXTENSION = "KHR_lights_punctual"
_EFFICACY = 98.0
"""Luminous efficacy of sunlight above an atmosphere [lm/W]: 133.1 klx (IES RP-21) of 1361 W/m²."""
_BLENDER_EFFICACY = 683.0
"""What Blender divides lumens by [lm/W]."""
_AIRY, _AIRLESS = 0.9, 1.2
"""What level white ground shows as where nothing but the Sun lights it, with a sky and without."""
_BLENDER = 1.7
"""How much brighter still Blender wants it, which compresses what is bright."""
_FAR = 2.5
"""Distance of the sky, over that of the horizon; the lamp for Blender hangs just within."""
_SIDES = 20.0
"""Sides of the site that the sky is scaled by, at least: from a near lamp shadows would fan out."""
_NOWHERE = 1e-3
"""Range of the lamp for Blender [m]."""


def add_lights(world: World, gltf: Gltf, options: Options) -> tuple[list[Any], list[Any]]:
    """Add what the sky is made of; returns the lights and the nodes, the first of them the Sun's.

    Blender divides lux by 683, so that what is well lit in viewers of three.js is black there, but
    it knows nothing of the range of a lamp. So for display a lamp far out in the Sun's direction
    stands in for the Sun: nothing lies within its range of a millimetre, where it would shine.
    """
    lighting = world.lighting
    levels = light_levels(world, options.lights)
    shown = options.lights == "display"
    alone = facing_sun(lighting, _AIRY if max(lighting.sky_rgb) > 0.0 else _AIRLESS)
    lux = options.sun_lux or (alone if shown else levels.sun * _EFFICACY)
    lights = [_light("directional", "sun", lux)]
    nodes = [_sun_node(lighting)]
    if not shown or options.sun_lux:
        return lights, nodes
    west, south, east, north = world.ground.bounds
    reach = _SIDES * max(east - west, north - south)
    beyond = options.horizon and world.horizon is not None
    if beyond and world.horizon:
        reach = max(reach, world.horizon.reach)
    middle = np.array([west + east, south + north, 2.0 * float(world.ground.elevation.mean())]) / 2
    away = 0.95 * _FAR * reach
    lamp = _light("point", "sun_for_blender", lux * _BLENDER * _BLENDER_EFFICACY * away * away)
    lights.append({**lamp, "range": _NOWHERE})
    nodes.append(
        {
            "name": "sun_for_blender",
            "translation": (middle + away * lighting.towards_sun).tolist(),
            "extensions": {EXTENSION: {"light": 1}},
        }
    )
    if beyond:  # black, too, hides the grey that viewers have by default
        colour = np.clip(sky_colours(world).horizon, 0.0, 1.0)
        nodes.append(_sky_node(gltf, middle, _FAR * reach, colour))
    return lights, nodes


def _light(kind: str, name: str, intensity: float) -> dict[str, Any]:
    return {"type": kind, "name": name, "color": [1, 1, 1], "intensity": float(intensity)}


def _sun_node(lighting: Lighting) -> dict[str, Any]:
    """The node that holds the first light of the file and aims it: it shines along its -z."""
    east, north, up = lighting.towards_sun
    # The shortest turn from +z to the Sun, of which (north × up) is the axis.
    turn = np.array([-north, east, 0.0, 1.0 + up])
    rotation = turn / portable.norm(turn)
    return {"name": "sun", "rotation": rotation.tolist(), "extensions": {EXTENSION: {"light": 0}}}


def _sky_node(gltf: Gltf, middle: Array, radius: float, colour: Array) -> dict[str, Any]:
    """Add a sphere that shines inwards, or is black; returns its node."""
    sphere = _sphere()
    material = {**matt("sky", rgb=(0.0, 0.0, 0.0)), "emissiveFactor": colour.tolist()}
    primitive = gltf.add_primitive(
        radius * sphere.vertices, -sphere.vertices, gltf.add_indices(sphere.faces)
    )
    mesh = {
        "name": "sky",
        "primitives": [{**primitive, "material": gltf.add("materials", material)}],
    }
    return {"name": "sky", "mesh": gltf.add("meshes", mesh), "translation": middle.tolist()}


def _sphere(rows: int = 12, columns: int = 24) -> Mesh:
    """A unit sphere whose faces look inwards."""
    up = np.linspace(-0.5 * np.pi, 0.5 * np.pi, rows + 1)[:, None]
    turn = 2.0 * np.pi * np.arange(columns)[None, :] / columns
    out = np.stack(
        [np.cos(up) * np.cos(turn), np.cos(up) * np.sin(turn), np.sin(up) + 0.0 * turn], axis=-1
    )
    node = np.arange((rows + 1) * columns).reshape(rows + 1, columns)
    low, high = node[:-1], node[1:]
    east = np.roll(node, -1, axis=1)
    faces = [
        np.stack([low, east[1:], east[:-1]], axis=-1),
        np.stack([low, high, east[1:]], axis=-1),
    ]
    whole = np.concatenate([face.reshape(-1, 3) for face in faces])
    return Mesh(vertices=np.round(out, 9).reshape(-1, 3), faces=whole.astype(np.int32))
