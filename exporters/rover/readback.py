"""The rover's URDF by the rules of urdfdom, which ROS and Drake read it with."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from terrain_forge.validation import ASPECTS, Consumer, Reading, Sample

_SIZES = {"box": ("size", 3), "sphere": ("radius", 1), "cylinder": ("radius", 1)}
_KINDS = {"revolute", "continuous", "prismatic", "fixed", "floating", "planar"}
_MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def read_rover(sample: Sample, folder: Path, options: Any, scratch: Path) -> Reading:
    """What urdfdom would refuse in the rover's URDF."""
    del sample, scratch
    reasons = dict.fromkeys(ASPECTS, "a rover's own files hold no place")
    if "urdf" not in options.formats:
        return Reading(consumer=URDFDOM.name, reasons=reasons)
    found = [said for file in folder.glob("*.urdf") for said in urdf_findings(file)]
    del reasons["findings"]
    return Reading(consumer=URDFDOM.name, findings=tuple(found), reasons=reasons)


def urdf_findings(file: Path) -> Iterator[str]:
    """What urdfdom refuses in a URDF, and masses that no body has, a sentence each."""
    robot = ElementTree.parse(file).getroot()
    links, joints = robot.findall("link"), robot.findall("joint")
    for tag in ("material", "link", "joint"):
        counts = Counter(element.get("name", "") for element in robot.findall(tag))
        yield from (f"{tag} {name!r} is not unique" for name, n in counts.items() if n > 1)
        if "" in counts:
            yield f"a {tag} has no name"
    materials = {material.get("name", "") for material in robot.findall("material")}
    for colour in robot.iter("color"):
        if not all(0 <= value <= 1 for value in _numbers(colour, "rgba", 4) or [-1.0]):
            yield f"a colour is {colour.get('rgba')!r}"
    for link in links:
        yield from _of_link(link, materials)
    yield from _of_tree(links, joints)
    for joint in joints:
        yield from _of_joint(joint, {other.get("name", "") for other in joints})


def _of_link(link: Element, materials: set[str]) -> Iterator[str]:
    name = link.get("name")
    for inertial in link.findall("inertial"):
        mass = _numbers(inertial.find("mass"), "value", 1)
        moments = [_numbers(inertial.find("inertia"), moment, 1) for moment in _MOMENTS]
        if not mass or not all(moments):
            yield f"link {name!r} lacks its mass or a moment of inertia"
        elif mass[0] < 0 or (mass[0] == 0 and any(moment != [0.0] for moment in moments)):
            yield f"link {name!r} has a mass of {mass[0]:g} kg"
    for part in (*link.findall("visual"), *link.findall("collision")):
        solid = part.find("geometry[1]/*")
        material = part.find("material")
        if solid is None or (solid.tag == "mesh" and not solid.get("filename")):
            yield f"link {name!r} has a {part.tag} without a geometry"
        elif solid.tag in _SIZES and not _numbers(solid, *_SIZES[solid.tag]):
            yield f"link {name!r} has a {solid.tag} without a size"
        if material is not None and not len(material) and material.get("name") not in materials:
            yield f"material {material.get('name')!r} is nowhere defined"


def _of_joint(joint: Element, names: set[str]) -> Iterator[str]:
    name, kind = joint.get("name"), joint.get("type")
    if kind not in _KINDS:
        yield f"joint {name!r} has the type {kind!r}"
    if kind in ("revolute", "prismatic"):
        limit = joint.find("limit")
        if not (_numbers(limit, "effort", 1) and _numbers(limit, "velocity", 1)):
            yield f"joint {name!r} is {kind} and has no limits"
    axis = _numbers(joint.find("axis"), "xyz", 3) if joint.find("axis") is not None else [1.0]
    if kind != "fixed" and not any(axis):
        yield f"joint {name!r} has no axis"
    for mimic in joint.findall("mimic"):
        if mimic.get("joint") not in names - {name}:
            yield f"joint {name!r} follows {mimic.get('joint')!r}"


def _of_tree(links: list[Element], joints: list[Element]) -> Iterator[str]:
    """One root, one joint above each other link, no loop."""
    names = {link.get("name", "") for link in links}
    above: dict[str, str] = {}
    for joint in joints:
        ends = [(e.get("link", "") if (e := joint.find(t)) is not None else "") for t in _ENDS]
        if not set(ends) <= names:
            yield f"joint {joint.get('name')!r} joins {' and '.join(map(repr, ends))}"
        if above.setdefault(ends[1], ends[0]) != ends[0]:
            yield f"link {ends[1]!r} hangs on two links"
    roots = sorted(names - above.keys())
    if len(roots) != 1:
        yield f"there are {len(roots)} roots: {', '.join(roots)}"
    reached, last = set(roots), set(roots)
    while last:
        last = {child for child, parent in above.items() if parent in last} - reached
        reached |= last
    if names - reached:
        yield f"links hang in a loop: {', '.join(sorted(names - reached))}"


_ENDS = ("parent", "child")


def _numbers(element: Element | None, name: str, count: int) -> list[float]:
    """So many numbers of an attribute; none where they are not there."""
    try:
        numbers = [
            float(word) for word in (element.get(name, "") if element is not None else "").split()
        ]
    except ValueError:
        return []
    return numbers if len(numbers) == count else []


URDFDOM = Consumer(name="urdfdom's rules", read=read_rover)
"""The rules of urdfdom."""
CONSUMERS = (URDFDOM,)
"""What reads these exports back."""
