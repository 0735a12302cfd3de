"""Dynamic rocks: a model each, which gravity holds and a rover can push."""

from __future__ import annotations

import math

import numpy as np
from terrain_forge.exporters.sdf import material

from terrain_forge.base import rpy_from_quaternion
from terrain_forge.geometry import inertias
from terrain_forge.model import World
from terrain_forge.rocks import dynamic_contact

from .markup import Lines, element, numbers
from .model import Model, surface
from .rocks import hull_file, scaled_mesh, shape_file, texture_file
from .solids import inertial


def dynamic_rocks(world: World, model: Model) -> list[Lines]:
    """A model `rock_<id>` for each dynamic rock, sharing meshes and textures with the static ones.

    Args:
        world: The world.
        model: The model of the static rocks.
    """
    field = world.field.select(world.field.dynamic)
    poses = np.hstack([field.position, rpy_from_quaternion(field.quaternion)])
    looks = [
        "".join(material.textured(model, texture_file(n))) for n in range(len(field.populations))
    ]
    tensors = inertias(field, world.library)
    models = []
    for row, rock in enumerate(field.id.tolist()):
        prototype, scale = int(field.prototype[row]), float(field.scale[row])
        shape = scaled_mesh(model.uri(shape_file(prototype)), scale)
        touch = "".join(_contact(float(field.diameter[row])))
        parts = [f'<visual name="visual">{shape}{looks[field.population[row]]}</visual>']
        for part in range(len(world.library.prototypes[prototype].hulls)):
            body = f"{scaled_mesh(model.uri(hull_file(prototype, part)), scale)}{touch}"
            parts.append(f'<collision name="collision_{part}">{body}</collision>')
        weight = "".join(inertial(float(field.mass[row]), tensors[row]))
        link = element("link", [weight], parts, name="rock")
        pose = element("pose", numbers(poses[row]))
        models.append(element("model", pose, link, name=f"rock_{rock}"))
    return models


def _contact(diameter: float) -> Lines:
    """Friction of a dynamic rock, as it was settled.

    SDF's torsional friction is 3π/16 patch radius · coefficient · normal force.
    """
    contact = dynamic_contact(diameter)
    radius = 16.0 * contact.torsional / (3.0 * math.pi * contact.sliding)
    return surface(contact.sliding, patch_radius=radius)
