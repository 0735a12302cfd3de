"""What rocks look like and how things touch: textures, materials, default classes, contacts.

MuJoCo takes all parameters of a contact from the geom of the higher priority. The surface has it,
so that each surface has its own friction, whatever rolls on it; a dynamic rock goes before both,
since it stays in place only with the parameters that it was settled with. The softness comes from
the convergence test (docs/driving.md).
"""

from __future__ import annotations

from itertools import product

import numpy as np

from terrain_forge.base import srgb_from_linear
from terrain_forge.geometry import rock_maps, rock_texture
from terrain_forge.model import Friction, World
from terrain_forge.rocks import dynamic_contact
from terrain_forge.scene import TINTS, tint_colours
from terrain_forge.writers import Lines, Value, element, encode_texture

_SURFACE_PRIORITY, _DYNAMIC_PRIORITY = 2, 3
"""Priorities of contacts: above those that a rover's wheels may have."""
_SOLREF = (0.04, 1.0)
"""Time constant [s] and damping ratio of a contact with what is fixed."""
_SOLIMP = (0.9, 0.95, 0.001)
"""Impedance at first touch and at depth, and that depth [m]."""
_MATT = {"specular": 0.0, "shininess": 0.0}
_MAPS = {"normal": "rock_normals.png", "roughness": "rock_roughness.png"}
"""Files of the maps that all rocks share, by the role of a material's layer."""
_UNTOUCHABLE = {"contype": 0, "conaffinity": 0}
_ROCK_GROUP, _PICTURE_GROUP, _HIDDEN_GROUP = 1, 2, 3
"""Groups of geoms: seen and touched, seen alone, touched alone (viewers hide groups above 2)."""


def sliding(coefficient: float) -> tuple[float, float, float]:
    """Sliding, torsional and rolling friction as MuJoCo lists them; contacts use the first."""
    return coefficient, 0.005, 0.0001


def rock_materials(world: World, *, textured: bool) -> list[Lines]:
    """A material for each colour of each population, and one that shows its texture in that.

    MuJoCo's own renderer shows the colours alone; others see the maps of normals and roughness too.
    """
    looks, layers = [], list[Lines]()
    if textured and world.library.normals is not None:
        for role, file in _MAPS.items():
            name = f"rock_{role}"
            looks.append(element("texture", name=name, type="2d", file=f"assets/{file}"))
            layers.append(element("layer", texture=name, role=role))
    for n, tints in enumerate(srgb_from_linear(tint_colours(world))):
        if textured:
            image = {"type": "2d", "file": f"assets/rock_{n}.png"}
            looks.append(element("texture", name=f"shape_{n}", **image))
        # MuJoCo multiplies what is shown, not light: so the lightest colour is in the texture.
        factors = tints / np.maximum(tints.max(axis=0), 1e-9)
        for tint, (colour, factor) in enumerate(zip(tints.tolist(), factors.tolist(), strict=True)):
            rgba, name = (*colour, 1.0), f"rock_{n}_{tint}"
            looks.append(element("material", name=name, rgba=rgba, **_MATT))
            if textured:
                rgba, name = (*factor, 1.0), f"shape_{n}_{tint}"
                shown = element("layer", texture=f"shape_{n}", role="rgb")
                looks.append(element("material", shown, *layers, name=name, rgba=rgba, **_MATT))
    return looks


def texture_files(world: World) -> dict[str, bytes]:
    """The populations' textures, and the rocks' maps, by the names of their files."""
    images = {
        f"rock_{n}.png": rock_texture(world, n, tinted=True)
        for n in range(len(world.field.populations))
    }
    images |= dict(zip(_MAPS.values(), rock_maps(world) or (), strict=False))
    return {f"assets/{file}": encode_texture(image) for file, image in images.items()}


def static_classes(world: World, friction: Friction, *, textured: bool) -> Lines:
    """Default classes of ground and rocks, so that a rock's line holds only what is its own.

    They meet what moves, never each other. Per colour of a population `rock_<n>_<tint>` is seen
    and touched, `seen_<n>_<tint>` seen alone, `shape_<n>_<tint>` too, with its texture; `hull` is
    touched alone, and so is `dynamic`, which also meets what is fixed.
    """
    surface = element(
        "geom", contype=0, conaffinity=1, condim=3, priority=_SURFACE_PRIORITY,
        friction=sliding(friction.ground), solref=_SOLREF, solimp=_SOLIMP,
    )  # fmt: skip
    # Blocks are touched and hidden, the ground above them is seen and not touched.
    grounds = [
        _class("ground", type="hfield", group=0),
        _class("ground_seen", type="hfield", group=0, **_UNTOUCHABLE),
        _class("ground_block", type="hfield", group=4),
        _class("horizon", type="mesh", group=0, **_UNTOUCHABLE),
    ]
    contact = dynamic_contact(1.0)  # torsional and rolling friction grow with the rock
    classes = [
        element("geom", type="mesh", group=_ROCK_GROUP, friction=sliding(friction.rock)),
        _class("hull", group=_HIDDEN_GROUP),
        _class("dynamic", group=_HIDDEN_GROUP, contype=1, conaffinity=1,
               priority=_DYNAMIC_PRIORITY, condim=contact.condim, solref=contact.solref),
    ]  # fmt: skip
    picture = {"group": _PICTURE_GROUP, **_UNTOUCHABLE}
    for n, tint in product(range(len(world.field.populations)), range(TINTS)):
        look = f"{n}_{tint}"
        classes.append(_class(f"rock_{look}", material=f"rock_{look}"))
        classes.append(_class(f"seen_{look}", material=f"rock_{look}", **picture))
        if textured:
            classes.append(_class(f"shape_{look}", material=f"shape_{look}", **picture))
    rocks = element("default", *classes, class_="rock")
    return element("default", surface, *grounds, rocks, class_="static")


def _class(name: str, **attributes: Value) -> Lines:
    return element("default", element("geom", **attributes), class_=name)
