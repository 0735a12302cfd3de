"""Reading a URDF into an assembly.

The format: https://docs.ros.org/en/rolling/Tutorials/Intermediate/URDF/URDF-Main.html
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from terrain_forge.base import (
    Array,
    DataError,
    matrix_from_quaternion,
    portable,
    quaternion_from_rpy,
)
from terrain_forge.rovers.assembly import TURNING, Assembly, Body, Gear, Joint, Solid, placed
from terrain_forge.rovers.limits import (
    FARTHEST,
    HEAVIEST,
    MOST_EFFORT,
    MOST_LINKS,
    MOST_SHAPES,
    SMALLEST,
    check_name,
    require_below,
)
from terrain_forge.rovers.mesh_files import MeshFiles
from terrain_forge.rovers.packages import Packages
from terrain_forge.rovers.rover_xml import KEY

_GREY = (0.6, 0.6, 0.6)
_STEEPEST = 1e6
"""Largest part of an axis, and one over the smallest length of one."""
_ENDLESS = 1e17
"""Largest angle of a limit; many files write 1e16 for none."""
_TAGS = ("visual", "collision")
_KINDS = ("fixed", "revolute", "continuous", "prismatic", "floating", "planar")


def read_urdf(robot: Element, *, file: Path, packages: Packages, meshes: MeshFiles) -> Assembly:
    """The assembly of a `<robot>`.

    Args:
        robot: The root element.
        file: Where it is from; its mesh paths are relative to it.
        packages: Where the packages are that its paths name.
        meshes: Reads its meshes.

    Raises:
        DataError: for what a URDF cannot be: two roots, a loop, a number that is none.
    """
    joints = robot.findall("joint")
    links = _by_name(robot, "link", file)
    _by_name(robot, "joint", file)
    shapes = sum(len(link.findall(tag)) for link in links.values() for tag in _TAGS)
    require_below(len(links), MOST_LINKS, "links", file.name)
    require_below(shapes, MOST_SHAPES, "shapes", file.name)
    driven = _driven_joints(robot)
    by_child = {_reference(joint, "child"): joint for joint in joints}
    if len(by_child) < len(joints):
        raise DataError(f"{file.name}: a link is the child of two joints", key=KEY)
    materials = {_name(m): _rgb(m) for m in robot.findall("material")}  # the last of a name
    reader = _LinkReader(file, packages, meshes, materials)
    bodies = [
        reader.body(name, links[name], by_child.get(name), driven)
        for name in _parents_first(links, by_child, file)
    ]
    gears = [gear for joint in joints for gear in _gears(joint)]
    return Assembly(
        name=check_name(robot.get("name") or file.stem, "robot"),
        bodies=tuple(bodies),
        gears=tuple(gears),
        notes=(),
    )


class _LinkReader:
    """Makes bodies of links; knows where meshes are and what colours have names."""

    def __init__(
        self,
        file: Path,
        packages: Packages,
        meshes: MeshFiles,
        materials: dict[str, tuple[float, float, float] | None],
    ) -> None:
        self._file = file
        self._packages = packages
        self._meshes = meshes
        self._materials = materials

    def body(self, name: str, link: Element, joint: Element | None, driven: set[str]) -> Body:
        """The body of a link and of the joint above it."""
        mass, centre, inertia = _mass(link)
        seen, touched = (
            [
                solid
                for element in link.findall(tag)
                for solid in self._solids(element, collides=tag == "collision")
            ]
            for tag in _TAGS
        )
        solids = [*(replace(s, collides=any(map(s.fills, touched))) for s in seen)]
        solids += [s for s in touched if not any(map(s.fills, seen))]
        return Body(
            name=name,
            parent="" if joint is None else _reference(joint, "parent"),
            placement=np.eye(4) if joint is None else _origin(joint),
            joint=_joint(joint, driven),
            mass=mass,
            centre_of_mass=centre,
            inertia=inertia,
            solids=tuple(solids),
        )

    def _solids(self, element: Element, *, collides: bool) -> list[Solid]:
        geometry = element.find("geometry")
        rgb = None if collides else self._colour(element.find("material"))
        placement = _origin(element)
        for shape in geometry if geometry is not None else []:
            if shape.tag == "mesh":
                path = self._packages.path(shape.get("filename", ""), self._file.parent)
                scale = np.array(_floats(shape, "scale", "1 1 1", 3, most=FARTHEST))
                return self._meshes.solids(
                    path, scale=scale, placement=placement, collides=collides, rgb=rgb
                )
            return [
                Solid(
                    kind=shape.tag,
                    size=_size(shape),
                    placement=placement,
                    collides=collides,
                    visible=not collides,
                    rgb=rgb or _GREY,
                )
            ]
        raise DataError(f"{self._file.name}: a {element.tag} has no geometry", key=KEY)

    def _colour(self, material: Element | None) -> tuple[float, float, float] | None:
        if material is None:
            return None
        return _rgb(material) or self._materials.get(material.get("name", ""))


def _parents_first(
    links: dict[str, Element], by_child: dict[str, Element], file: Path
) -> list[str]:
    """Names of all links, parents before children."""
    parent = {child: _reference(joint, "parent") for child, joint in by_child.items()}
    for name in {*parent, *parent.values()} - set(links):
        raise DataError(f"{file.name}: a joint names the link {name!r}, there is none", key=KEY)
    roots = [name for name in links if name not in parent]
    if len(roots) != 1:
        found = ", ".join(roots) or "none"
        raise DataError(f"{file.name}: a rover has one root link, found {found}", key=KEY)
    order, level = [], roots
    while level:
        order += level
        last = set(level)
        level = [child for child, above in parent.items() if above in last]
    if len(order) < len(links):
        raise DataError(f"{file.name}: joints form a loop", key=KEY)
    return order


def _driven_joints(robot: Element) -> set[str]:
    """Joints with a motor, by a transmission or a ros2_control command."""
    names = {j.get("name", "") for t in robot.findall("transmission") for j in t.findall("joint")}
    for joint in robot.findall("ros2_control/joint"):
        if joint.find("command_interface") is not None:
            names.add(joint.get("name", ""))
    return names


def _joint(element: Element | None, driven: set[str]) -> Joint:
    if element is None:
        return Joint()
    name, kind = _name(element), element.get("type", "")
    if kind not in _KINDS:
        raise DataError(
            f"joint {name!r} has the type {kind[:40]!r}, must be one of {', '.join(_KINDS)}",
            key=KEY,
        )
    if kind not in TURNING:  # neither its axis nor its limits mean anything to the rover
        return Joint(name=name, kind=kind, driven=name in driven)
    axis = np.array(_floats(element.find("axis"), "xyz", "1 0 0", 3, most=_STEEPEST))
    length = float(portable.norm(axis))
    if not length >= 1 / _STEEPEST:
        raise DataError(f"joint {name!r} is {kind}, and its axis has no direction", key=KEY)
    limit, dynamics = element.find("limit"), element.find("dynamics")
    effort = _float(limit, "effort", 0.0)
    limits = tuple(_float(limit, end, 0.0, most=_ENDLESS) for end in ("lower", "upper"))
    return Joint(
        name=name,
        kind=kind,
        axis=axis / length,
        limits=(limits[0], limits[1]) if kind == "revolute" else None,
        damping=_loss(dynamics, "damping"),
        friction=_loss(dynamics, "friction"),
        effort=effort if 0 < effort <= MOST_EFFORT else None,
        driven=name in driven,
    )


def _loss(dynamics: Element | None, name: str) -> float:
    """Damping or dry friction; a negative one would drive the joint."""
    value = _float(dynamics, name, 0.0, most=MOST_EFFORT)
    if value < 0:
        raise DataError(f"dynamics {name}={value:g}: must be 0 or more", key=KEY)
    return value


def _gears(joint: Element) -> list[Gear]:
    """What a turning joint follows."""
    if joint.get("type") not in TURNING:
        return []
    gears = [
        Gear(
            joint=_name(joint),
            leader=mimic.get("joint", ""),
            ratio=_float(mimic, "multiplier", 1.0, most=MOST_EFFORT),
            offset=_float(mimic, "offset", 0.0, most=MOST_EFFORT),
        )
        for mimic in joint.findall("mimic")
    ]
    if any(gear.joint == gear.leader for gear in gears):
        raise DataError(f"joint {_name(joint)!r} follows itself", key=KEY)
    return gears


def _mass(link: Element) -> tuple[float, Array, Array]:
    """Mass [kg], centre of mass [m] and inertia about it in the link's axes [kg m²]."""
    inertial = link.find("inertial")
    if inertial is None:
        return 0.0, np.zeros(3), np.zeros((3, 3))
    mass = _float(inertial.find("mass"), "value", 0.0, most=HEAVIEST)
    if mass < 0:
        raise DataError(
            f"link {_name(link)!r} has a mass of {mass:g} kg, must be 0 or more", key=KEY
        )
    tensor = inertial.find("inertia")
    xx, xy, xz, yy, yz, zz = (
        _float(tensor, name, 0.0, most=HEAVIEST)
        for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    )
    placement = _origin(inertial)
    rotation = placement[:3, :3]
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return mass, placement[:3, 3], portable.product(portable.product(rotation, matrix), rotation.T)


def _origin(element: Element) -> Array:
    """The element's `<origin>` as a matrix, shape [4, 4]."""
    origin = element.find("origin")
    rpy = np.array(_floats(origin, "rpy", "0 0 0", 3, most=FARTHEST))
    position = np.array(_floats(origin, "xyz", "0 0 0", 3, most=FARTHEST))
    return placed(position, matrix_from_quaternion(quaternion_from_rpy(rpy)))


def _size(shape: Element) -> tuple[float, ...]:
    if shape.tag == "box":
        return _positive(shape, _floats(shape, "size", "", 3))
    radius = _float(shape, "radius", math.nan)
    if shape.tag == "sphere":
        return _positive(shape, (radius,))
    if shape.tag == "cylinder":
        return _positive(shape, (radius, _float(shape, "length", math.nan)))
    raise DataError(f"geometry {shape.tag!r}: box, cylinder, sphere or mesh", key=KEY)


def _positive(shape: Element, size: tuple[float, ...]) -> tuple[float, ...]:
    if not all(SMALLEST <= length <= FARTHEST for length in size):
        told = " ".join(f"{length:g}" for length in size)
        raise DataError(
            f"a {shape.tag} has lengths of {told} m, must be {SMALLEST:g} to {FARTHEST:g} m",
            key=KEY,
        )
    return size


def _rgb(material: Element) -> tuple[float, float, float] | None:
    colour = material.find("color")
    if colour is None:
        return None
    red, green, blue, _ = (min(max(v, 0.0), 1.0) for v in _floats(colour, "rgba", "", 4))
    return red, green, blue


def _name(element: Element) -> str:
    name = element.get("name", "")
    if not name:
        raise DataError(f"a {element.tag} has no name", key=KEY)
    return check_name(name, element.tag)


def _by_name(robot: Element, tag: str, file: Path) -> dict[str, Element]:
    """Links or joints by their names, each of which has one."""
    found: dict[str, Element] = {}
    for element in robot.findall(tag):
        if found.setdefault(_name(element), element) is not element:
            raise DataError(f"{file.name} has two {tag}s {_name(element)!r}", key=KEY)
    return found


def _reference(joint: Element, tag: str) -> str:
    found = joint.find(tag)
    if found is None or not found.get("link"):
        raise DataError(f"joint {_name(joint)!r} names no {tag} link", key=KEY)
    return str(found.get("link"))


def _float(element: Element | None, name: str, default: float, *, most: float = math.inf) -> float:
    return _floats(element, name, repr(default), 1, most=most)[0]


def _floats(
    element: Element | None, name: str, default: str, count: int, *, most: float = math.inf
) -> tuple[float, ...]:
    text = default if element is None else element.get(name, default)
    try:
        values = tuple(map(float, text.split()))
    except ValueError:
        values = ()
    if len(values) != count or not (text == default or all(map(math.isfinite, values))):
        what = "a number" if count == 1 else f"{count} numbers"
        tag = "?" if element is None else element.tag
        raise DataError(f"{tag} {name}={text[:200]!r}: must be {what}", key=KEY)
    if any(abs(value) > most for value in values):
        tag = "?" if element is None else element.tag
        raise DataError(f"{tag} {name}={text[:200]!r}: must be at most {most:g}", key=KEY)
    return values
