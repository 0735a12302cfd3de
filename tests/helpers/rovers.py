"""Rovers for tests: foreign files with the habits of real ones, and a rover's sums at rest."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path

import numpy as np
import trimesh

from terrain_forge.rovers import FileRover, find_rover, resolve_rover

morpheus = partial(find_rover, "morpheus")
skid4 = partial(find_rover, "skid4")

_BOX = (
    '<inertial><origin xyz="{at}" rpy="0 0 {yaw}"/><mass value="{mass}"/><inertia ixx="0.3" '
    'ixy="0.02" ixz="0" iyy="0.5" iyz="-0.01" izz="0.6"/></inertial>'
)
_WHEEL = (
    '<link name="{name}_wheel"><inertial><mass value="1.5"/><inertia ixx="0.009" ixy="0" ixz="0" '
    'iyy="0.009" iyz="0" izz="0.015"/></inertial><visual><geometry><mesh '
    'filename="package://tub/meshes/wheel.stl" scale="0.001 0.001 0.001"/></geometry></visual>'
    '<collision><geometry><mesh filename="package://tub/meshes/wheel.stl" '
    'scale="0.001 0.001 0.001"/></geometry></collision></link>'
    '<joint name="{name}_wheel_joint" type="continuous"><parent link="{parent}"/>'
    '<child link="{name}_wheel"/><origin xyz="{at}" rpy="{roll} 0 0"/><axis xyz="0 0 1"/>'
    '<limit effort="12" velocity="8"/><dynamics damping="0.05" friction="0.01"/></joint>'
)
RADIUS, WIDTH = 0.15, 0.10


def rocker_urdf(folder: Path) -> Path:
    """A rocker rover in a ROS package `tub`: four wheels, two rockers with a differential, a mast.

    Wheels are meshes in millimetres that turn about their own z, those on the right backwards; the
    root is an empty footprint; front wheels steer.
    """
    package = folder / "tub"
    (package / "meshes").mkdir(parents=True)
    (package / "urdf").mkdir()
    wheel = trimesh.creation.cylinder(radius=1000 * RADIUS, height=1000 * WIDTH, sections=64)
    wheel.export(package / "meshes" / "wheel.stl")
    parts = [
        '<link name="base_footprint"/><link name="base_link">',
        _BOX.format(at="0.05 0 0.1", yaw=0.2, mass=20),
        '<visual><geometry><box size="0.9 0.4 0.2"/></geometry><material name="white">'
        '<color rgba="1 0.5 0 1"/></material></visual>'
        '<collision><origin xyz="0 0 0.1"/><geometry><box size="0.9 0.4 0.2"/></geometry>'
        "</collision></link>"
        '<joint name="foot" type="fixed"><parent link="base_footprint"/><child link="base_link"/>'
        '<origin xyz="0.3 0.2 0.45"/></joint>',
        '<link name="mast">' + _BOX.format(at="0 0 0.3", yaw=0, mass=2) + "</link>",
        '<joint name="pan" type="revolute"><parent link="base_link"/><child link="mast"/>'
        '<origin xyz="0.4 0 0.2"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" '
        'velocity="1"/></joint>',
    ]
    for side, y in (("left", 0.3), ("right", -0.3)):
        parts.append(_rocker(side, y))
        for end, x in (("front", 0.4), ("rear", -0.4)):
            parent, at = f"{side}_rocker", f"{x} {math.copysign(0.12, y)} -0.2"
            if end == "front":
                parts.append(_steering(side, at))
                parent, at = f"{side}_knuckle", "0 0 0"
            roll = -math.pi / 2 if y > 0 else math.pi / 2
            parts.append(_WHEEL.format(name=f"{side}_{end}", parent=parent, at=at, roll=roll))
    file = package / "urdf" / "tub.urdf"
    file.write_text(f'<?xml version="1.0"?>\n<robot name="tub">{"".join(parts)}</robot>')
    return file


def _rocker(side: str, y: float) -> str:
    mimic = '<mimic joint="left_rocker_joint" multiplier="-1"/>' if side == "right" else ""
    return (
        f'<link name="{side}_rocker">{_BOX.format(at="0.1 0 -0.1", yaw=0.1, mass=3)}</link>'
        f'<joint name="{side}_rocker_joint" type="revolute"><parent link="base_link"/>'
        f'<child link="{side}_rocker"/><origin xyz="0 {y} 0" rpy="0 0.1 0"/><axis xyz="0 1 0"/>'
        f'<limit lower="-0.5" upper="0.4" effort="0" velocity="5"/>'
        f'<dynamics damping="4" friction="0.2"/>{mimic}</joint>'
    )


def _steering(side: str, at: str) -> str:
    inertia = '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/>'
    return (
        f'<link name="{side}_knuckle"><inertial><mass value="0.5"/>{inertia}</inertial></link>'
        f'<joint name="{side}_steer_wheel_joint" type="revolute"><parent link="{side}_rocker"/>'
        f'<child link="{side}_knuckle"/><origin xyz="{at}"/><axis xyz="0 0 1"/>'
        '<limit lower="-0.6" upper="0.6" effort="5" velocity="1"/></joint>'
    )


_PART = (
    '<link name="{name}"><inertial><mass value="{mass}"/><inertia ixx="0.1" ixy="0" ixz="0" '
    'iyy="0.1" iyz="0" izz="0.1"/></inertial><collision><origin rpy="{roll} 0 0"/><geometry>'
    "{shape}</geometry></collision></link>"
)
_JOINT = (
    '<joint name="{name}_joint" type="{kind}"><parent link="chassis"/><child link="{name}"/>'
    '<origin xyz="{at}"/><axis xyz="0 1 0"/></joint>'
)


def caster_urdf(folder: Path, *, caster_m: float, chassis_m: float) -> Path:
    """Two wheels of 0.2 m under a chassis, and a ball behind; undersides of both as high [m]."""
    wheel, ball = '<cylinder radius="0.2" length="0.1"/>', '<sphere radius="0.1"/>'
    parts = [_PART.format(name="chassis", mass=30, roll=0, shape='<box size="0.8 0.4 0.2"/>')]
    axle, low = 0.1 - chassis_m, -0.1 - chassis_m
    for name, y in (("wheel_l", 0.3), ("wheel_r", -0.3)):
        parts.append(_PART.format(name=name, mass=2, roll=math.pi / 2, shape=wheel))
        parts.append(_JOINT.format(name=name, kind="continuous", at=f"0.3 {y} {axle}"))
    parts.append(_PART.format(name="caster", mass=0.3, roll=0, shape=ball))
    parts.append(_JOINT.format(name="caster", kind="fixed", at=f"-0.35 0 {low + caster_m + 0.1}"))
    file = folder / "caster.urdf"
    file.write_text(f'<robot name="caster">{"".join(parts)}</robot>')
    return file


BUGGY = """<mujoco model="buggy">
  <compiler angle="degree"/>
  <worldbody>
    <geom type="plane" size="5 5 1"/>
    <body name="chassis" pos="1 2 0.5" euler="0 0 90">
      <freejoint/>
      <geom type="box" size="0.3 0.2 0.1" mass="12"/>
      <geom type="ellipsoid" size="0.1 0.1 0.05" pos="0 0 0.15" mass="1" contype="0"
            conaffinity="0" rgba="1 0 0 1"/>
      <body name="arm" pos="0.05 0.2 0">
        <joint name="swing" axis="0 1 0" pos="0.05 0 0" range="-20 30" damping="2"/>
        <geom type="capsule" size="0.03" fromto="-0.25 0 0 0.25 0 0" mass="2"/>
        WHEELS
      </body>
      <body name="right_front" pos="0.3 -0.3 -0.05">
        <joint name="rf" axis="0 -1 0"/>
        <geom type="cylinder" size="0.12 0.04" euler="90 0 0" mass="1.2"/>
      </body>
      <body name="right_rear" pos="-0.2 -0.3 -0.05">
        <joint name="rr" axis="0 -1 0"/>
        <geom type="cylinder" size="0.12 0.04" euler="90 0 0" mass="1.2"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <velocity joint="lf" kv="5" forcerange="-9 9"/>
    <velocity joint="lr" kv="5" forcerange="-9 9"/>
    <velocity joint="rf" kv="5" forcerange="-9 9"/>
    <velocity joint="rr" kv="5" forcerange="-9 9"/>
  </actuator>
</mujoco>
"""


def buggy_mjcf(folder: Path) -> Path:
    """An MJCF of four nameless wheels, two of them on an arm whose hinge is off its frame."""
    wheels = "".join(
        f'<body name="left_{end}" pos="{x} 0.1 -0.05"><joint name="l{end[0]}" axis="0 1 0"/>'
        '<geom type="cylinder" size="0.12 0.04" euler="90 0 0" mass="1.2"/></body>'
        for end, x in (("front", 0.25), ("rear", -0.25))
    )
    file = folder / "buggy.xml"
    file.write_text(BUGGY.replace("WHEELS", wheels))
    return file


def read(file, **choices):
    """The rover of a file."""
    return resolve_rover(FileRover(file=file.name, **choices), file.parent).rover


def origins(rover):
    """Each link's origin in base_link's frame at rest."""
    places = {"": np.zeros(3)}
    for link in rover.links:
        places[link.name] = places[link.parent] + link.origin
    return places


def total(parts):
    """Mass, centre of mass, inertia about it, of (mass, centre, inertia) in one frame."""
    mass = sum(m for m, _, _ in parts)
    centre = sum(m * np.asarray(c) for m, c, _ in parts) / mass
    inertia = np.zeros((3, 3))
    for m, c, own in parts:
        arm = np.asarray(c) - centre
        inertia += own + m * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return mass, centre, inertia


def at_rest(rover):
    """`total` of a rover that stands as described, in base_link's frame."""
    places = origins(rover)
    return total([(n.mass, places[n.name] + n.centre_of_mass, n.inertia) for n in rover.links])


def in_mujoco(model):
    """`total` of all bodies of a MuJoCo model as it is at first."""
    import mujoco

    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    parts = []
    for body in range(1, model.nbody):
        turn = data.ximat[body].reshape(3, 3)
        inertia = turn @ np.diag(model.body_inertia[body]) @ turn.T
        parts.append((model.body_mass[body], data.xipos[body], inertia))
    return total(parts)


def on_the_flat(rover, folder):
    """A MuJoCo model of a rover on a level plane."""
    import mujoco
    from terrain_forge.exporters.mjcf.rover import write_rover

    from terrain_forge.geometry import write_rover_meshes

    folder.mkdir(parents=True, exist_ok=True)
    write_rover_meshes(rover, folder / "meshes")
    write_rover(folder / "rover.xml", rover, gravity=3.71, friction=0.7)
    plane = '<geom type="plane" size="50 50 1" contype="0" conaffinity="1"/>'
    text = (folder / "rover.xml").read_text().replace("<worldbody>", f"<worldbody>{plane}", 1)
    (folder / "flat.xml").write_text(text)
    return mujoco.MjModel.from_xml_path(str(folder / "flat.xml"))


def drive(model, rover, *, speed, turn_rate, seconds):
    """Stand for 2 s, then drive; returns how far it came [m, 3], its turn [rad], passive angles."""
    import mujoco

    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, round(2 / model.opt.timestep))
    start, yaw = data.qpos[:3].copy(), _yaw(data)
    stood = {n.name: float(data.joint(n.name).qpos[0]) for n in rover.links if n.joint == "passive"}
    for step in range(1, round(seconds * 50) + 1):  # faster and faster for half a second
        for wheel in rover.wheels:
            rim = min(step / 25, 1.0) * (speed - turn_rate * wheel.centre[1])
            data.actuator(wheel.link).ctrl = rim / wheel.radius
        mujoco.mj_step(model, data, round(0.02 / model.opt.timestep))
    assert not any(warning.number for warning in data.warning)
    return data.qpos[:3] - start, _yaw(data) - yaw, start, stood


def _yaw(data):
    w, x, y, z = data.qpos[3:7]
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
