"""Visuals and collisions of mesh files, as Drake's parser reads them."""

from __future__ import annotations

from ..sdf.markup import Lines, element, numbers

MATERIALS = "world.mtl"
"""The material file beside the meshes."""


def visual(name: str, uri: str, *, pose: Lines | None = None, scale: float = 1.0) -> Lines:
    """A visual of an OBJ with its own material, which Drake takes for pictures and for Meshcat."""
    return element("visual", *_placed(pose), _mesh(uri, scale), name=name)


def rigid(
    name: str, uri: str, friction: float, *, pose: Lines | None = None, scale: float = 1.0
) -> Lines:
    """A collision that is the mesh itself, dents and all, for bodies with hydroelastic contact.

    In point contact Drake takes any mesh for its convex hull.
    """
    contact = element("drake:rigid_hydroelastic")
    return element(
        "collision", *_placed(pose), _mesh(uri, scale), _properties(contact, friction), name=name
    )


def compliant(name: str, uri: str, friction: float, *, scale: float, modulus: float) -> Lines:
    """A collision of a convex mesh that gives way with a hydroelastic modulus [Pa]."""
    contact = [
        *element("drake:compliant_hydroelastic"),
        *element("drake:hydroelastic_modulus", numbers([modulus])),
    ]
    shape = _mesh(uri, scale, element("drake:declare_convex"))
    return element("collision", shape, _properties(contact, friction), name=name)


def _placed(pose: Lines | None) -> list[Lines]:
    return [pose] if pose else []


def _mesh(uri: str, scale: float, *hints: Lines) -> Lines:
    size = [element("scale", numbers([scale] * 3))] if scale != 1.0 else []
    return element("geometry", element("mesh", element("uri", uri), *size, *hints))


def _properties(contact: Lines, friction: float) -> Lines:
    mu = numbers([friction])
    return element(
        "drake:proximity_properties",
        contact,
        element("drake:mu_dynamic", mu),
        element("drake:mu_static", mu),
    )
