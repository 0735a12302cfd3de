"""Reading a URDF into an assembly.

The format: https://docs.ros.org/en/rolling/Tutorials/Intermediate/URDF/URDF-Main.html
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from terrain_forge.base import (
    Array,
    hint_at,
    matrix_from_quaternion,
    placed,
    plain_number,
    portable,
    quaternion_from_rpy,
)
from terrain_forge.model import Coupling
from terrain_forge.rovers import bounds
from terrain_forge.rovers.assembly import (
    TURNING,
    Assembly,
    Body,
    Joint,
    Solid,
    Unread,
    bare_shape,
)
from terrain_forge.rovers.bounds import FileError
from terrain_forge.rovers.mesh_files import MeshFiles
from terrain_forge.rovers.packages import Packages

_GREY = (0.6, 0.6, 0.6)
_STEEPEST = 1e6
"""Largest part of an axis, and one over the smallest length of one."""
_ENDLESS = 1e17
"""Largest angle of a limit; many files write 1e16 for none."""
_TAGS = ("visual", "collision")
_OF_GAZEBO = {
    "springstiffness": "spring",
    "turngravityoff": "gravity switched off",
    "dampingfactor": "damping of a link",
}
"""Elements of a `<gazebo>` that change the motion, in small letters without `_`."""
_OFF = ("", "0", "0.0", "false")
_DRAKE = ("drake:linear_", "drake:ball_", "drake:tendon_", "drake:joint", "drake:mimic")
"""How tags of Drake's begin that tie links to each other."""
_KINDS = ("fixed", "revolute", "continuous", "prismatic", "floating", "planar")


def read_urdf(robot: Element, file: Path, packages: Packages) -> tuple[Assembly, list[Path]]:
    """The assembly of a `<robot>`, and the meshes that it names.

    Args:
        robot: The root element.
        file: Where it is from; its mesh paths are relative to it.
        packages: Where the packages are that its paths name.

    Raises:
        DataError: for what a URDF cannot be: two roots, a loop, a number that is none.
    """
    links, joints = (_by_name(robot, tag, file) for tag in ("link", "joint"))
    shapes = sum(len(link.findall(tag)) for link in links.values() for tag in _TAGS)
    bounds.require_below(len(links), bounds.MOST_LINKS, "links", file.name)
    bounds.require_below(shapes, bounds.MOST_SHAPES, "shapes", file.name)
    transmitted = robot.findall("transmission/joint")
    controlled = robot.findall("ros2_control/joint/command_interface/..")
    driven = {joint.get("name", "") for joint in (*transmitted, *controlled)}
    by_child = {_reference(joint, "child"): joint for joint in joints.values()}
    if len(by_child) < len(joints):
        raise FileError(f"{file.name}: a link is the child of two joints")
    materials = {_name(m): _rgb(m) for m in robot.findall("material")}  # the last of a name
    meshes = MeshFiles(packages)
    reader = _LinkReader(file, packages, meshes, materials)
    bodies = [
        reader.body(name, links[name], by_child.get(name), driven)
        for name in _parents_first(links, by_child, file)
    ]
    name = bounds.check_name(robot.get("name") or file.stem, "robot")
    gears = tuple(gear for joint in joints.values() for gear in _gears(joint, joints, file))
    sensors = tuple(map(_kind, (*robot.findall("gazebo//sensor"), *robot.findall("sensor"))))
    assembly = Assembly(
        name=name,
        bodies=tuple(bodies),
        gears=gears,
        sensors=sensors,
        unread=tuple(_unread(robot)),
    )
    return assembly, list(meshes.read)


def _unread(robot: Element) -> list[Unread]:
    """What simulators read beside URDF's own elements, and what changes the motion."""
    found = []
    for tag in robot.findall("gazebo[@reference]"):
        name = bounds.check_name(tag.get("reference", ""), "gazebo reference")
        for element in tag.iter():
            kind = _OF_GAZEBO.get(element.tag.lower().replace("_", ""))
            if kind and (element.text or "").strip().lower() not in _OFF:
                found.append(Unread(kind, name, joint=name if kind == "spring" else ""))
    ties = [("joint of Gazebo's", joint) for joint in robot.findall("gazebo/joint")]
    ties += [(element.tag, element) for element in robot if element.tag.startswith(_DRAKE)]
    for kind, element in ties:
        name = bounds.check_name(element.get("name", "") or "one", kind)
        found.append(Unread(bounds.check_name(kind, "tag"), name))
    return list(dict.fromkeys(found))


def _kind(sensor: Element) -> str:
    """Kind of a sensor of Gazebo's, or of the older proposal to URDF, which is a child's tag."""
    told = [child.tag for child in sensor if child.tag in ("camera", "ray", "laser")]
    return sensor.get("type") or (told or ["other"])[0]


@dataclass(frozen=True)
class _LinkReader:
    """Makes bodies of links; knows where meshes are and what colours have names."""

    file: Path
    packages: Packages
    meshes: MeshFiles
    materials: dict[str, tuple[float, float, float] | None]

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
        solids = [
            (place, shape.replace(collides=any(_fills((place, shape), s) for s in touched)))
            for place, shape in seen
        ]  # one solid is both seen and touched where two fill the same space
        solids += [t for t in touched if not any(_fills(t, s) for s in seen)]
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
        material, rgb = element.find("material"), None
        if material is not None and not collides:
            rgb = _rgb(material) or self.materials.get(material.get("name", ""))
        placement = _origin(element)
        for shape in geometry if geometry is not None else []:
            if shape.tag == "mesh":
                path = self.packages.path(shape.get("filename", ""), self.file.parent)
                scale = np.array(_floats(shape, "scale", "1 1 1", 3, most=bounds.FARTHEST))
                return self.meshes.solids(
                    path, scale=scale, placement=placement, collides=collides, rgb=rgb
                )
            made = bare_shape(
                kind=shape.tag,
                size=_size(shape),
                collides=collides,
                visible=not collides,
                rgb=rgb or _GREY,
            )
            return [(placement, made)]
        raise FileError(f"{self.file.name}: a {element.tag} has no geometry")


def _fills(one: Solid, other: Solid) -> bool:
    (at, a), (there, b) = one, other
    alike = a.mesh is None is b.mesh and (a.kind, a.size) == (b.kind, b.size)
    return alike and np.array_equal(at, there)


def _parents_first(
    links: dict[str, Element], by_child: dict[str, Element], file: Path
) -> list[str]:
    """Names of all links, parents before children."""
    parent = {child: _reference(joint, "parent") for child, joint in by_child.items()}
    for name in {*parent, *parent.values()} - set(links):
        raise FileError(f"{file.name}: a joint names the link {name!r}, there is none")
    roots = [name for name in links if name not in parent]
    if not roots and links:
        raise FileError(f"{file.name}: joints form a loop of the links {_loop(parent)}")
    if len(roots) != 1:
        found = ", ".join(roots) or "none"
        raise FileError(f"{file.name}: a rover has one root link, found {found}")
    order, level = [], roots
    while level:
        order += level
        last = set(level)
        level = [child for child, above in parent.items() if above in last]
    if len(order) < len(links):
        rest = {child: above for child, above in parent.items() if child not in order}
        raise FileError(f"{file.name}: joints form a loop of the links {_loop(rest)}")
    return order


def _loop(parent: dict[str, str]) -> str:
    """The links of a loop, from a parent to its child, where each link has one of these parents."""
    seen: list[str] = []
    name = next(iter(parent))
    while name not in seen:
        seen.append(name)
        name = parent[name]
    return ", ".join(reversed(seen[seen.index(name) :]))


def _joint(element: Element | None, driven: set[str]) -> Joint:
    if element is None:
        return Joint()
    name, kind = _name(element), element.get("type", "")
    if kind not in _KINDS:
        raise FileError(
            f"joint {name!r} has the type {kind[:40]!r}, must be one of {', '.join(_KINDS)}"
        )
    if kind not in TURNING:  # neither its axis nor its limits mean anything to the rover
        return Joint(name=name, kind=kind, driven=name in driven)
    axis = np.array(_floats(element.find("axis"), "xyz", "1 0 0", 3, most=_STEEPEST))
    length = float(portable.norm(axis))
    if not length >= 1 / _STEEPEST:
        raise FileError(f"joint {name!r} is {kind}, and its axis has no direction")
    limit, dynamics = element.find("limit"), element.find("dynamics")
    effort, rate = (_float(limit, key, 0.0) for key in ("effort", "velocity"))
    limits = tuple(_float(limit, end, 0.0, most=_ENDLESS) for end in ("lower", "upper"))
    return Joint(
        name=name,
        kind=kind,
        axis=axis / length,
        limits=(limits[0], limits[1]) if kind == "revolute" else None,
        damping=_float(dynamics, "damping", 0.0, least=0.0, most=bounds.MOST_EFFORT),
        friction=_float(dynamics, "friction", 0.0, least=0.0, most=bounds.MOST_EFFORT),
        effort=effort if 0 < effort <= bounds.MOST_EFFORT else None,
        rate=rate if 0 < rate <= bounds.FASTEST else None,
        driven=name in driven,
    )


def _gears(joint: Element, joints: Collection[str], file: Path) -> list[Coupling]:
    """What a turning joint follows."""
    if joint.get("type") not in TURNING:
        return []
    gears = [
        Coupling(
            link=_name(joint),
            leader=mimic.get("joint", ""),
            ratio=_float(mimic, "multiplier", 1.0, most=bounds.MOST_EFFORT),
            offset=_float(mimic, "offset", 0.0, most=bounds.MOST_EFFORT),
        )
        for mimic in joint.findall("mimic")
    ]
    for leader in (gear.leader for gear in gears):
        if leader == _name(joint):
            raise FileError(f"joint {leader!r} follows itself")
        if leader not in joints:
            hint = hint_at(leader, [name for name in joints if name != _name(joint)])
            raise FileError(
                f"{file.name}: {_name(joint)!r} follows the joint {leader!r}, there is none{hint}"
            )
    return gears


def _mass(link: Element) -> tuple[float, Array, Array]:
    """Mass [kg], centre of mass [m] and inertia about it in the link's axes [kg m²]."""
    inertial = link.find("inertial")
    if inertial is None:
        return 0.0, np.zeros(3), np.zeros((3, 3))
    mass = _float(inertial.find("mass"), "value", 0.0, most=bounds.HEAVIEST)
    if mass < 0:
        raise FileError(f"link {_name(link)!r} has a mass of {mass:g} kg, must be 0 or more")
    tensor = inertial.find("inertia")
    xx, xy, xz, yy, yz, zz = (
        _float(tensor, name, 0.0, most=bounds.HEAVIEST)
        for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    )
    placement = _origin(inertial)
    rotation = placement[:3, :3]
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return mass, placement[:3, 3], portable.product(portable.product(rotation, matrix), rotation.T)


def _origin(element: Element) -> Array:
    """The element's `<origin>` as a matrix, shape [4, 4]."""
    origin = element.find("origin")
    rpy = np.array(_floats(origin, "rpy", "0 0 0", 3, most=bounds.FARTHEST))
    position = np.array(_floats(origin, "xyz", "0 0 0", 3, most=bounds.FARTHEST))
    return placed(position, matrix_from_quaternion(quaternion_from_rpy(rpy)))


def _size(shape: Element) -> tuple[float, ...]:
    sizes = {"box": ("size",), "sphere": ("radius",), "cylinder": ("radius", "length")}
    if shape.tag not in sizes:
        raise FileError(f"geometry {shape.tag!r}: box, cylinder, sphere or mesh")
    count = 3 if shape.tag == "box" else 1
    size = tuple(v for key in sizes[shape.tag] for v in _floats(shape, key, "", count))
    least, most = bounds.SMALLEST, bounds.FARTHEST
    if not all(least <= length <= most for length in size):
        told = " ".join(f"{length:g}" for length in size)
        raise FileError(f"a {shape.tag} has lengths of {told} m, must be {least:g} to {most:g} m")
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
        raise FileError(f"a {element.tag} has no name")
    return bounds.check_name(name, element.tag)


def _by_name(robot: Element, tag: str, file: Path) -> dict[str, Element]:
    """Links or joints by their names, each of which has one."""
    found: dict[str, Element] = {}
    for element in robot.findall(tag):
        if found.setdefault(_name(element), element) is not element:
            raise FileError(f"{file.name} has two {tag}s {_name(element)!r}")
    return found


def _reference(joint: Element, tag: str) -> str:
    found = joint.find(tag)
    if found is None or not found.get("link"):
        raise FileError(f"joint {_name(joint)!r} names no {tag} link")
    return str(found.get("link"))


def _float(element: Element | None, name: str, default: float, **bounds: float) -> float:
    return _floats(element, name, repr(default), 1, **bounds)[0]


def _floats(
    element: Element | None,
    name: str,
    default: str,
    count: int,
    *,
    least: float = -math.inf,
    most: float = math.inf,
) -> tuple[float, ...]:
    """The numbers of an attribute, none of them above `most` to either side."""
    text = default if element is None else element.get(name, default)
    try:
        values = tuple(map(plain_number, text.split()))
    except ValueError:
        values = ()
    why = ""
    if len(values) != count or not (text == default or all(map(math.isfinite, values))):
        why = "a number" if count == 1 else f"{count} numbers"
    elif any(abs(value) > most for value in values):
        why = f"at most {most:g}"
    elif any(value < least for value in values):
        why = f"{least:g} or more"
    if why:
        tag = "?" if element is None else element.tag
        hint = "; a file called .xacro is read as xacro" if "$(" in text or "${" in text else ""
        raise FileError(f"{tag} {name}={text[:200]!r}: must be {why}{hint}")
    return values
