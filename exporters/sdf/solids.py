"""Solids of links and their mass properties, in SDF's words."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from terrain_forge.base import Array
from terrain_forge.model import Shape, moments

from .markup import Lines, element, numbers


def inertial(
    mass: float,
    tensor: Array,
    *,
    centre: Array | None = None,
    text: Callable[[Iterable[float]], str] = numbers,
) -> Lines:
    """Mass [kg], inertia about the centre of mass [kg m²], and where that is [m], if not at 0.

    Args:
        mass: Mass.
        tensor: Inertia, shape [3, 3].
        centre: Centre of mass in the link's frame, shape [3].
        text: How numbers are written.
    """
    place = [] if centre is None else [element("pose", text([*centre, 0, 0, 0]))]
    inertia = [element(name, text([value])) for name, value in moments(tensor).items()]
    weight = element("mass", text([mass]))
    return element("inertial", *place, weight, element("inertia", *inertia))


def solid(shape: Shape, uri: str, *, text: Callable[[Iterable[float]], str] = numbers) -> Lines:
    """The geometry of a shape, whose mesh, if it is one, is at a URI."""
    content: list[Lines] = []
    if shape.kind == "mesh":
        content = [element("uri", uri)]
    elif shape.kind == "box":
        content = [element("size", text(shape.size))]
    else:
        names = ("radius", "length")
        content = [element(n, text([v])) for n, v in zip(names, shape.size, strict=False)]
    return element("geometry", element(shape.kind, *content))
