"""From an assembly to a rover: what its wheels are, which joints turn, where its base is."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Collection, Iterable
from dataclasses import replace

import numpy as np

from terrain_forge.base import Array, DataError, placed, portable
from terrain_forge.model import RESTING, Coupling, Rover, Wheel
from terrain_forge.rovers.assembly import TURNING, Assembly, Body
from terrain_forge.rovers.custom import FileRover, Frame
from terrain_forge.rovers.links import called, make_links
from terrain_forge.rovers.tread import Tread, measure_tread, outline

_UPRIGHT = 0.7
"""Vertical part of an axis from which a joint is one that steers."""
_ACROSS = 0.95
"""Part of a wheel's axis that must point sideways."""
_TURNS = 4 * math.pi
"""Range of a limited joint that may be a wheel's all the same [rad]."""
_EARTH = 9.81
_ALIKE = 1e-4
"""Distance up to which frames are one [m]."""
_MOST_NAMES = 8
"""How many names of a kind are told."""
_HEADINGS = {"x": (1.0, 0.0), "-x": (-1.0, 0.0), "y": (0.0, -1.0), "-y": (0.0, 1.0)}
"""Cosine and sine of the turn that brings an axis forward."""
_DRAGGED = 0.25
"""Height of what such a part is dragged over, as a part of its own."""


def make_rover(assembly: Assembly, spec: FileRover) -> tuple[Rover, dict[str, Frame]]:
    """The rover that an assembly is, and where the frames of the file's links are, by name.

    Bodies that nothing moves become one link with what they are fixed to. The frame of base_link is
    x forward, y left, z up, its origin on the ground amid the driven wheels.

    Raises:
        DataError: if wheels are not found or do not roll forward, something that moves has no
            mass, or no part of the body is above the ground.
    """
    machine = _Machine(assembly, spec)
    wheels, free_wheels = machine.find_wheels()
    passive = machine.find_passive(wheels, free_wheels)
    bodies, treads = machine.stand(wheels)
    links, frames, notes = make_links(bodies, wheels, passive, treads)
    held = machine.held(wheels | passive)
    upright = machine.upright(wheels | free_wheels)
    if held:
        notes = [f"Held at rest: {', '.join(held)}.", *notes]
    backward = [name for name in treads if machine.axis(name)[1] < 0.0]
    if turned := [machine.bodies[name].joint.name or name for name in backward]:
        notes.append(
            "Axes turned about, so that a positive rate rolls forward, which the file's own "
            f"controllers must be told: {', '.join(turned)}."
        )
    if said := machine.base_said(bodies):
        notes.append(said)
    clearance = measure_belly(
        machine.rigid(bodies, wheels | passive),
        radius=min(tread.radius for tread in treads.values()),
        step_limit=spec.step_limit_m,
    )
    mass = sum(link.mass for link in links)
    rover = Rover(
        name=assembly.name,
        links=tuple(links),
        wheels=tuple(
            Wheel(link=called(name), centre=tread.centre, radius=tread.radius, width=tread.width)
            for name, tread in treads.items()
        ),
        sensors=(),
        torque_limit=spec.torque_limit_n_m or machine.torque(wheels, treads, mass),
        speed_limit=spec.speed_limit_m_s,
        tilt_limit=math.radians(spec.tilt_limit_deg),
        clearance=clearance,
        step_limit=spec.step_limit_m,
        couplings=machine.couplings(passive),
        held=tuple(held),
        steering=tuple(name for name in held if name in upright),
        notes=(*notes, *assembly.notes),
        unread=tuple(machine.unread(wheels, passive)),
    )
    return rover, frames


def _listed(names: list[str]) -> str:
    """Names, the first of many."""
    more = f" and {len(names) - _MOST_NAMES} more" if len(names) > _MOST_NAMES else ""
    return ", ".join(names[:_MOST_NAMES]) + more


class _Machine:
    """An assembly with the recipe's word about it; joints go by the names of their bodies."""

    def __init__(self, assembly: Assembly, spec: FileRover) -> None:
        self.assembly = assembly
        self.bodies = {body.name: body for body in assembly.bodies}
        self.spec = spec
        self.file = spec.file
        self.told_gears = [
            Coupling(
                link=c.joint, leader=c.follows, ratio=c.ratio, offset=math.radians(c.offset_deg)
            )
            for c in spec.couplings
        ]
        self.gears = [*assembly.gears, *self.told_gears]
        self.of_joint = {b.joint.name: b.name for b in assembly.bodies if b.joint.name}
        self.poses: dict[str, Array] = {}
        """Of each body in the root's frame at rest, shape [4, 4]."""
        for body in assembly.bodies:
            above = self.poses.get(body.parent, np.eye(4))
            self.poses[body.name] = portable.product(above, body.placement)
        name = spec.base or ("base_link" if "base_link" in self.bodies else "")
        if name and name not in self.bodies:
            raise DataError(
                f"{self.file} has no link {name!r}, it has: {', '.join(self.bodies)}",
                key=("rover", "base"),
            )
        self.base_name = name or assembly.bodies[0].name
        pose = self.poses[self.base_name]
        cosine, sine = _HEADINGS[spec.forward]
        turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        self.base = portable.product(turn, pose[:3, :3].T)
        """Rotation from the file's root axes to those of base_link, shape [3, 3]."""

    def base_said(self, bodies: list[Body]) -> str:
        """Where base_link is in the file's frame of its base; nothing where they are one."""
        pose = next(b.placement for b in bodies if b.name == self.base_name)
        told = self.bodies[self.base_name].told
        there = -portable.product(pose[:3, :3].T, pose[:3, 3]) - told[:3, 3]
        turned = "" if self.spec.forward == "x" else f" and its x axis along {self.spec.forward}"
        if not turned and portable.norm(there) < _ALIKE:
            return ""
        place = ", ".join(f"{round(float(value), 4) + 0.0:g}" for value in there)
        return (
            f"base_link is the file's link {self.base_name!r} with its origin moved to ({place}) m "
            f"there, on the ground amid the driven wheels{turned}; a sensor with `link: "
            f"{self.base_name}` stays in the file's frame."
        )

    def axis(self, name: str) -> Array:
        """Axis of a body's joint in base_link's axes."""
        turned = portable.product(self.base, self.poses[name][:3, :3])
        return portable.product(turned, self.bodies[name].joint.axis)

    def _turning(self) -> str:
        names = [b.joint.name for b in self.bodies.values() if b.joint.kind in TURNING]
        return ", ".join(names) or "none"

    def _told(self, key: str) -> set[str]:
        """Bodies of the joints or links that the recipe lists under a key."""
        bodies = set()
        for n, name in enumerate(getattr(self.spec, key)):
            found = name if name in self.bodies else self.of_joint.get(name, "")
            if not found or self.bodies[found].joint.kind not in TURNING:
                has = self._turning()
                raise DataError(
                    f"{self.file} has no joint or link {name!r} that turns, it has: {has}",
                    key=("rover", key, n),
                )
            bodies.add(found)
        return bodies

    def find_wheels(self) -> tuple[set[str], set[str]]:
        """Bodies of the driven wheels, and of wheels that roll without a motor."""
        if self.spec.wheels:
            told = self._told("wheels")
            if len(told) < 2:
                raise DataError(
                    f"{self.file}: {', '.join(self.spec.wheels)} is one wheel, 2 are needed",
                    key=("rover", "wheels"),
                )
            return told, set()
        found = {body.name for body in self.bodies.values() if self._is_wheel(body)}
        driven = {name for name in found if self.bodies[name].joint.driven} or found
        driven -= self._told("passive") | self._told("held")
        if len(driven) < 2:
            raise DataError(
                f"{self.file}: found {len(driven)} wheels (joints that turn without end, with "
                f"'wheel' in a name); name them, joints that turn: {self._turning()}",
                key=("rover", "wheels"),
            )
        return driven, found - driven

    def _is_wheel(self, body: Body) -> bool:
        joint, limits = body.joint, body.joint.limits
        endless = joint.kind == "continuous" or (limits and limits[1] - limits[0] > _TURNS)
        named = "wheel" in body.name.lower() or "wheel" in joint.name.lower()
        return bool(endless and named and abs(self.axis(body.name)[2]) < _UPRIGHT)

    def find_passive(self, wheels: set[str], free_wheels: set[str]) -> set[str]:
        """Bodies whose joints turn freely: suspensions, swivels, wheels without a motor."""
        told, held = self._told("passive"), self._told("held")
        for name in sorted(told):
            if (limits := self.bodies[name].joint.limits) and not limits[0] < limits[1]:
                raise DataError(
                    f"{name!r} cannot turn: its limits are {limits[0]:g} to {limits[1]:g} rad",
                    key=("rover", "passive"),
                )
        geared = {self.of_joint.get(name) for g in self.gears for name in (g.link, g.leader)}
        above = {name for wheel in wheels | free_wheels for name in self._ancestors(wheel)}
        near = above | geared
        free = {n for n, b in self.bodies.items() if n in near and self._is_suspension(b)}
        return (free | told | free_wheels) - held - wheels

    def held(self, moving: set[str]) -> list[str]:
        """Joints that are not fixed in the file and at rest in the rover."""
        named = [b for b in self.bodies.values() if b.joint.kind != "fixed" and b.joint.name]
        return [b.joint.name for b in named if b.name not in moving]

    def upright(self, wheels: set[str]) -> set[str]:
        """Joints above wheels that turn about an upright axis: these steer where they are held."""
        above = {name for wheel in wheels for name in self._ancestors(wheel)}
        return {self.bodies[n].joint.name for n in above if self._is_upright(self.bodies[n])}

    def _is_upright(self, body: Body) -> bool:
        return body.joint.kind in TURNING and abs(self.axis(body.name)[2]) >= _UPRIGHT

    def _is_suspension(self, body: Body) -> bool:
        joint = body.joint
        moves = joint.limits is None or joint.limits[0] < joint.limits[1]
        steers = joint.kind == "revolute" and self._is_upright(body)
        return joint.kind in TURNING and moves and not joint.driven and not steers

    def _ancestors(self, name: str) -> list[str]:
        names = []
        while parent := self.bodies[name].parent:
            names.append(parent)
            name = parent
        return names

    def rigid(self, bodies: list[Body], moving: set[str]) -> list[Body]:
        """Those of the bodies that do not move against the root."""
        return [b for b in bodies if not moving.intersection({b.name, *self._ancestors(b.name)})]

    def unread(self, wheels: set[str], passive: set[str]) -> list[str]:
        """A sentence on what of the file would change how the rover moves; motors are ours."""
        moving, found = wheels | passive, defaultdict[str, list[str]](list)
        for one in self.assembly.unread:
            free = passive if one.kind == "armature" else moving
            if not one.joint or self.of_joint.get(one.joint) in free:
                found[one.kind].append(one.name)
        for gear in self.assembly.gears:
            pair = {self.of_joint.get(name, "") for name in (gear.link, gear.leader)}
            if pair & moving and not pair <= passive:
                found["gear"].append(f"{gear.link} by {gear.leader}")
        if not found:
            return []
        told = "; ".join(f"{kind}: {_listed(names)}" for kind, names in found.items())
        return [f"Of its file is left out, though it changes how the rover moves: {told}."]

    def couplings(self, passive: Collection[str]) -> tuple[Coupling, ...]:
        """Gears between passive joints."""
        found = []
        for gear in self.gears:
            pair = (self.of_joint.get(gear.link, ""), self.of_joint.get(gear.leader, ""))
            if all(name in passive for name in pair):
                found.append(gear.replace(link=called(pair[0]), leader=called(pair[1])))
            elif gear in self.told_gears:
                wrong = gear.link if pair[0] not in passive else gear.leader
                raise DataError(
                    f"{wrong!r} is no passive joint, there are: "
                    f"{', '.join(sorted(passive)) or 'none'}",
                    key=("rover", "couplings"),
                )
        leaders = {gear.link: gear.leader for gear in found}
        for told in self.told_gears:
            self._require_end(told.link, leaders)
        return tuple(found)

    def _require_end(self, joint: str, leaders: dict[str, str]) -> None:
        """Refuse a joint that follows itself, in the end."""
        first = self.of_joint[joint]
        at, passed = leaders[first], {first}
        while at not in passed:
            passed.add(at)
            at = leaders.get(at, "")
        if at == first:
            raise DataError(f"{joint!r} follows itself", key=("rover", "couplings"))

    def stand(self, wheels: set[str]) -> tuple[list[Body], dict[str, Tread]]:
        """All bodies in base_link's frame, and the treads of the wheels."""
        for name in sorted(wheels):
            if abs(self.axis(name)[1]) < _ACROSS:
                raise DataError(
                    f"{self.file}: wheel {name!r} turns about "
                    f"({', '.join(f'{value:.2f}' for value in self.axis(name))}), not across the "
                    f"rover: forward is {self.spec.forward}, choose another of x, -x, y, -y, or "
                    "name the driven wheels by `wheels`",
                    key=("rover", "forward"),
                )
        turned = placed(np.zeros(3), self.base)
        raised = {n: portable.product(turned, pose) for n, pose in self.poses.items()}
        treads = self._treads(wheels, raised)
        lowest = min(tread.centre[2] - tread.radius for tread in treads.values())
        amid = np.mean([tread.centre for tread in treads.values()], axis=0)
        origin = np.array([amid[0], amid[1], lowest])
        shift = placed(-origin, np.eye(3))
        bodies = [
            replace(b, placement=portable.product(shift, raised[n])) for n, b in self.bodies.items()
        ]
        return bodies, {n: replace(t, centre=t.centre - origin) for n, t in treads.items()}

    def _treads(self, wheels: set[str], poses: dict[str, Array]) -> dict[str, Tread]:
        """Treads of the wheels, front left first."""
        parts: dict[str, list[Body]] = {name: [self.bodies[name]] for name in sorted(wheels)}
        for body in self.bodies.values():  # a tyre may be a link of its own
            for name in self._ancestors(body.name) if body.joint.kind == "fixed" else []:
                if name in wheels:
                    parts[name].append(body)
        treads = {
            name: measure_tread(
                name,
                [(portable.product(poses[b.name], at), s) for b in bodies for at, s in b.solids],
                centre=poses[name][:3, 3],
                axis=self.axis(name),
                radius=self.spec.wheel_radius_m,
            )
            for name, bodies in parts.items()
        }
        places = {n: (-round(float(t.centre[0]), 2), -t.centre[1], n) for n, t in treads.items()}
        return {name: treads[name] for name in sorted(treads, key=places.__getitem__)}

    def torque(self, wheels: set[str], treads: dict[str, Tread], mass: float) -> float:
        """The file's least effort of a wheel [N m]; else that for the steepest tilt, twice over.

        What the wheels' own friction and damping take at the largest speed comes on top.
        """
        joints = [self.bodies[name].joint for name in wheels]
        if efforts := [joint.effort for joint in joints if joint.effort]:
            return min(efforts)
        radius = max(tread.radius for tread in treads.values())
        slope = math.sin(math.radians(self.spec.tilt_limit_deg))
        rate = self.spec.speed_limit_m_s / min(tread.radius for tread in treads.values())
        lost = max(joint.friction + joint.damping * rate for joint in joints)
        return 2 * mass * _EARTH * slope * radius / len(wheels) + lost


def measure_belly(bodies: Iterable[Body], *, radius: float, step_limit: float | None) -> float:
    """Free height under the body [m], by what collides of it, else by what is seen.

    A part that rests on the ground is dragged over what is a quarter as high as itself, where a
    ball is met at 60° from below; what is higher holds it.

    Args:
        bodies: What the body consists of, in base_link's frame.
        radius: Of the smallest wheel [m].
        step_limit: The recipe's word on what the rover goes over [m].

    Raises:
        DataError: if no part is above the ground and the recipe does not tell the step limit.
    """
    solids = [(body, pose, shape) for body in bodies for pose, shape in body.solids]
    spans = []
    for body, pose, shape in [one for one in solids if one[2].collides] or solids:
        whole = portable.product(body.placement, pose)
        heights = outline(shape, whole[:3, :3], whole[:3, 3])[:, 2]
        spans.append((float(np.min(heights)), float(np.max(heights)), body.name))
    above = [low for low, _, _ in spans if low > RESTING * radius]
    dragged = [_DRAGGED * (high - low) for low, high, _ in spans if low <= RESTING * radius]
    if above:
        return min(above + dragged)
    if step_limit is None:
        why = f"the lowest collider is {min(spans)[2]}" if spans else "the body has no shape"
        raise DataError(
            f"no part of the body is above the ground, {why}: its clearance is unknown; give "
            "rover.step_limit_m",
            key=("rover",),
        )
    return 0.0
