"""The links of a rover: bodies that do not move against each other become one."""

from __future__ import annotations

import re

import numpy as np

from terrain_forge.base import Array, placed, portable, rpy_from_matrix
from terrain_forge.model import Link
from terrain_forge.rovers.assembly import Body
from terrain_forge.rovers.bounds import FileError
from terrain_forge.rovers.custom import Frame
from terrain_forge.rovers.tread import Tread

_ROUNDING = 1e-12
"""What rounding may leave of an inertia about the origin that is taken away again."""
_THINNEST = 1e-9
"""Smallest principal inertia over the largest; a thin rod of 10 m and 1 mm has 1e-8."""
_EDGE = 1e-6
"""Part of the largest principal inertia by which thin discs, whose other two add up to it, are kept
from the edge of what a body can have, where rounding decides whether engines take them."""
_TAKEN = re.compile(r"world|path|rock_\d+|base_link_free|__.*__|.*::.*")
"""Names that engines and the exported scenes have for themselves."""


def _steiner(arm: Array) -> Array:
    matrix: Array = portable.product(arm, arm) * np.eye(3) - np.outer(arm, arm)
    return matrix


def make_links(
    bodies: list[Body], wheels: set[str], passive: set[str], treads: dict[str, Tread]
) -> tuple[list[Link], dict[str, Frame], list[str]]:
    """Links, parents before children, the frames of the file's links, and what is said of them.

    A frame goes by the name of its link in the file: which link of the rover carries it, and its
    pose there.
    """
    moving = wheels | passive
    group: dict[str, str] = {}
    for body in bodies:
        group[body.name] = body.name if body.name in moving else group.get(body.parent, "")
    places = {"": np.zeros(3), **{b.name: b.placement[:3, 3] for b in bodies}}
    links, notes = list[Link](), list[str]()
    for name in ("", *(b.name for b in bodies if b.name in moving)):
        members = [body for body in bodies if group[body.name] == name]
        link, said = _make_link(name, members, places[name], wheels, treads)
        if name:
            parent = group[members[0].parent]
            link = link.replace(parent=called(parent), origin=places[name] - places[parent])
        links.append(link)
        notes += said
    _require_names([link.name for link in links])
    frames = {
        body.name: (called(group[body.name]), _frame(body, places[group[body.name]]))
        for body in bodies
    }
    return links, frames, notes


def _require_names(names: list[str]) -> None:
    """Refuse names of links by which exports would call two things.

    In SDF links and joints share their names, and the joint of a link X is called X_joint.
    """
    joints = {f"{name}_joint" for name in names} - {"base_link_joint"}  # its root has none
    for name in names:
        if names.count(name) > 1 or name in joints or _TAKEN.fullmatch(name):
            raise FileError(
                f"link {name!r} moves, and exports call something else so: give it another name"
            )


def _frame(body: Body, origin: Array) -> Array:
    """The frame that the file gives a body, beside the origin of the link that carries it."""
    shift = placed(-origin, np.eye(3))
    return portable.product(portable.product(shift, body.placement), body.told)


def called(name: str) -> str:
    """How the rover calls a link: its root is base_link, whatever the file says."""
    return {"": "base_link", "base_link": "base_link_moving"}.get(name, name)


def _make_link(
    name: str, members: list[Body], origin: Array, wheels: set[str], treads: dict[str, Tread]
) -> tuple[Link, list[str]]:
    """A link of bodies that do not move against each other."""
    mass, moment, about = 0.0, np.zeros(3), np.zeros((3, 3))  # in base_link's frame
    for body in members:
        rotation = body.placement[:3, :3]
        at = portable.product(rotation, body.centre_of_mass) + body.placement[:3, 3]
        mass += body.mass
        moment = moment + body.mass * at
        turned = portable.product(portable.product(rotation, body.inertia), rotation.T)
        about = about + turned + body.mass * _steiner(at)
    if not mass > 0:
        where = f"{_where(name)} moves but" if name else _where(name)
        raise FileError(f"{where} has no mass, must be above 0 kg")
    centre = moment / mass
    inertia, said = _possible(about - mass * _steiner(centre), about, name)
    joint, passive = members[0].joint, bool(name) and name not in wheels
    axis = np.array([1.0, 0.0, 0.0])
    if name:
        axis = portable.product(members[0].placement[:3, :3], joint.axis)
    # A wheel that rolls forward turns about +y, to whichever side its axis pointed.
    forward = -1.0 if name in wheels and axis[1] < 0 else 1.0
    shapes = []
    for body in members:
        for place, shape in body.solids:
            pose = portable.product(body.placement, place)
            rpy = rpy_from_matrix(pose[:3, :3])
            shapes.append(shape.replace(position=pose[:3, 3] - origin, rpy=rpy))
    if name in treads:
        shapes = treads[name].dress(shapes, origin)
    link = Link(
        name=called(name),
        parent="",
        joint="passive" if passive else "motor" if name else "free",
        origin=np.zeros(3),
        axis=forward * np.round(axis, 12) + 0.0,
        limits=joint.limits if passive else None,
        damping=joint.damping if name else 0.0,
        friction=joint.friction if name else 0.0,
        rate_limit=joint.rate if passive else None,
        mass=mass,
        centre_of_mass=centre - origin,
        inertia=inertia,
        shapes=tuple(shapes),
    )
    return link, said


def _where(name: str) -> str:
    """A link as the file calls it; its root may be several, joined by what fixes them."""
    return f"link {name!r}" if name else "the body of the rover"


def _possible(inertia: Array, about_origin: Array, name: str) -> tuple[Array, list[str]]:
    """The inertia, or its mean about all axes where no body could have it.

    It is what is left of that about the frame's origin, which leaves rounding errors of that size.
    """
    inertia = (inertia + inertia.T) / 2
    small, middle, large = portable.eigh(inertia)[0]
    rounding = _ROUNDING * float(np.trace(about_origin))
    beyond = large * (1 + _EDGE) - small - middle
    if small > max(rounding, _THINNEST * large) and beyond <= 2 * _EDGE * large:
        return inertia + max(beyond, 0.0) * np.eye(3), []
    mean = float(np.trace(inertia)) / 3
    if not mean > rounding:
        found = "a negative" if mean < -rounding else "no"
        raise FileError(f"{_where(name)} has {found} inertia, must be above 0")
    told = f"No body has the inertia of {called(name)}: its mean was taken."
    return mean * np.eye(3), [told]
