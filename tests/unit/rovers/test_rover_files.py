"""Rovers of the user's own: what URDF, xacro and MJCF files become."""

from __future__ import annotations

import json
import math
from pathlib import Path

import mujoco
import numpy as np
import pytest

from terrain_forge.base import DataError, RecipeError
from terrain_forge.making import plan
from terrain_forge.model import World
from terrain_forge.pipeline import realise
from terrain_forge.recipe import recipe_from_json
from terrain_forge.rovers import FileRover, resolve_rover
from terrain_forge.rovers.custom import CouplingSpec
from terrain_forge.rovers.mesh_files import MeshFiles
from terrain_forge.rovers.packages import Packages
from tests.helpers import rovers
from tests.helpers.places import DATA

CURIOSITY = Path("curiosity_rover/curiosity_description/models/urdf/curiosity_mars_rover.xacro")


@pytest.fixture(scope="module")
def tub(tmp_path_factory):
    return rovers.rocker_urdf(tmp_path_factory.mktemp("urdf"))


@pytest.fixture(scope="module")
def buggy(tmp_path_factory):
    return rovers.buggy_mjcf(tmp_path_factory.mktemp("mjcf"))


def changed(file, tmp_path, *changes, **choices):
    """The rover of a file with some of its text replaced."""
    text = file.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    other = tmp_path / "other.urdf"
    other.write_text(text)
    return rovers.read(other, packages={"tub": str(file.parents[1])}, **choices)


def test_a_urdf_becomes_a_rover_on_the_ground(tub):
    rover = rovers.read(tub)
    assert [link.name for link in rover.links if link.joint == "passive"] == [
        "left_rocker",
        "right_rocker",
    ]
    assert [wheel.link for wheel in rover.wheels] == [
        *("left_front_wheel", "right_front_wheel", "left_rear_wheel", "right_rear_wheel")
    ]
    # The rockers stand pitched by 0.1 rad, so the rear wheels touch first.
    x = 0.4 * math.cos(0.1)
    drop = 0.8 * math.sin(0.1)
    amid = (0.4 * math.cos(0.1) - 0.4 * math.cos(0.1)) / 2 - 0.2 * math.sin(0.1)
    centres = rover.wheel_centres
    np.testing.assert_allclose(centres[:, 0] - amid, [x, x, -x, -x] - np.float64(amid), atol=1e-9)
    np.testing.assert_allclose(centres[:, 1], [0.42, -0.42, 0.42, -0.42], atol=1e-9)
    low = rovers.RADIUS
    heights = [low, low, low + drop, low + drop]
    np.testing.assert_allclose(centres[:, 2], heights, atol=1e-9)
    for wheel in rover.wheels:
        assert wheel.radius == pytest.approx(rovers.RADIUS, rel=1e-6)
        assert wheel.width == pytest.approx(rovers.WIDTH, rel=1e-6)
    assert rover.torque_limit == 12.0
    held, turned, moved = rover.notes
    assert held == "Held at rest: pan, left_steer_wheel_joint, right_steer_wheel_joint."
    assert turned.startswith("Axes turned about, so that a positive rate rolls forward")
    assert turned.endswith(": right_front_wheel_joint, right_rear_wheel_joint.")
    where = f"({round(amid, 4):g}, 0, {round(-0.2 * math.cos(0.1) - drop / 2 - low, 4):g}) m there"
    assert f"base_link is the file's link 'base_link' with its origin moved to {where}" in moved


def test_wheels_turn_forward_about_plus_y_and_roll_on_cylinders(tub):
    rover = rovers.read(tub)
    for link in rover.links:
        if link.joint != "motor":
            continue
        np.testing.assert_allclose(link.axis, (0, 1, 0), atol=1e-9)
        assert (link.damping, link.friction) == (0.05, 0.01)
        touching = [shape for shape in link.shapes if shape.collides]
        assert [shape.kind for shape in touching] == ["cylinder"]
        assert not touching[0].visible
        assert [shape.kind for shape in link.shapes if shape.visible] == ["mesh"]


def test_limits_damping_and_the_differential_are_kept(tub):
    rover = rovers.read(tub)
    rocker = next(link for link in rover.links if link.name == "left_rocker")
    assert rocker.limits == (-0.5, 0.4)
    assert (rocker.damping, rocker.friction) == (4.0, 0.2)
    (gear,) = rover.couplings
    assert (gear.link, gear.leader, gear.ratio) == ("right_rocker", "left_rocker", -1.0)


def test_a_moving_link_called_base_link_keeps_gear_and_motor(tub, tmp_path):
    free = ('"base_link"', '"hull"')
    rover = changed(tub, tmp_path, free, ('"left_rocker"', '"base_link"'), base="hull")
    (gear,) = rover.couplings
    assert gear.leader == "base_link_moving"
    rover = changed(tub, tmp_path, free, ('"left_front_wheel"', '"base_link"'), base="hull")
    assert {wheel.link for wheel in rover.wheels} <= {link.name for link in rover.links}
    assert rover.wheels[0].link == "base_link_moving"


@pytest.mark.parametrize("kind", ["tub", "buggy"])
def test_masses_and_inertia_are_those_that_mujoco_reads_in_the_file(kind, request, tmp_path):
    file = request.getfixturevalue(kind)
    if kind == "tub":
        wheels = ()
        text = file.read_text().replace("package://tub/meshes/", f"{file.parents[1]}/meshes/")
        keep = '<mujoco><compiler fusestatic="false" strippath="false"/></mujoco><link name="base_f'
        source = tmp_path / "plain.urdf"
        source.write_text(text.replace('<link name="base_f', keep, 1))
        model = mujoco.MjModel.from_xml_path(str(source))
    else:
        wheels = ("lf", "lr", "rf", "rr")
        model = mujoco.MjModel.from_xml_path(str(file))
    rover = rovers.read(file, wheels=wheels)
    mass, _, inertia = rovers.in_mujoco(model)
    ours, at, tensor = rovers.at_rest(rover)
    assert ours == pytest.approx(mass, rel=1e-12)
    np.testing.assert_allclose(np.linalg.eigvalsh(tensor), np.linalg.eigvalsh(inertia), rtol=1e-9)
    assert np.linalg.norm(at[:2]) < 0.2
    if kind == "tub":  # its base is not turned against the file's axes
        np.testing.assert_allclose(tensor, inertia, atol=1e-9)


def test_an_mjcf_becomes_a_rover(buggy):
    rover = rovers.read(buggy, wheels=("lf", "lr", "rf", "rr"))
    assert {wheel.link for wheel in rover.wheels} == {
        *("left_front", "left_rear", "right_front", "right_rear")
    }
    places = rovers.origins(rover)
    amid = rover.wheel_centres[:, :2].mean(axis=0)
    np.testing.assert_allclose(amid, 0.0, atol=1e-9)
    # Its hinge is 5 cm ahead of its frame, which is 5 cm ahead of the chassis' and 25 cm off.
    right = places["right_rear"] - places["arm"]
    np.testing.assert_allclose(right, (-0.3, -0.5, -0.05), atol=1e-9)
    arm = next(link for link in rover.links if link.name == "arm")
    assert arm.joint == "passive"
    assert arm.limits == pytest.approx((math.radians(-20), math.radians(30)))
    assert all(wheel.radius == pytest.approx(0.12) for wheel in rover.wheels)
    assert rover.torque_limit == 9.0
    seen = [shape for shape in rover.links[0].shapes if shape.rgb == (1.0, 0.0, 0.0)]
    assert [(shape.kind, shape.collides) for shape in seen] == [("mesh", False)]


@pytest.mark.parametrize(
    ("actuator", "joint", "torque"),
    [
        ('motor ctrlrange="-8 6"', "", 8.0),
        ('motor ctrlrange="-1 1" gear="7"', "", 7.0),
        ('velocity kv="5" ctrlrange="-3 3" forcerange="-2 2" gear="4"', "", 8.0),
        ('general gainprm="3" ctrlrange="-2 2" dyntype="filter" dynprm="0.1"', "", 6.0),
        ('motor ctrlrange="-8 8"', 'actuatorfrcrange="-5 5"', 5.0),
    ],
)
def test_the_torque_of_an_mjcf_is_that_about_the_joint(buggy, tmp_path, actuator, joint, torque):
    servo = 'velocity joint="lf" kv="5" forcerange="-9 9"'
    text = buggy.read_text().replace(servo, f'{actuator} joint="lf"')
    text = text.replace('"lf" axis', f'"lf" {joint} axis')
    file = tmp_path / "geared.xml"
    file.write_text(text)
    assert rovers.read(file, wheels=("lf", "lr", "rf", "rr")).torque_limit == torque


@pytest.mark.parametrize("kind", ["tub", "buggy"])
def test_a_foreign_rover_stands_drives_straight_and_turns_left(kind, request, tmp_path):
    wheels = () if kind == "tub" else ("lf", "lr", "rf", "rr")
    rover = rovers.read(request.getfixturevalue(kind), wheels=wheels)
    model = rovers.on_the_flat(rover, tmp_path)
    moved, yaw, start, stood = rovers.drive(model, rover, speed=0.3, turn_rate=0.0, seconds=5.0)
    assert np.linalg.norm(start[:2]) < 0.1
    assert moved[0] == pytest.approx(1.5, rel=0.06)
    assert abs(moved[1]) < 0.05
    assert abs(yaw) < 0.05
    if kind == "tub":  # the differential
        assert stood["left_rocker"] == pytest.approx(-stood["right_rocker"], abs=0.01)
    moved, yaw, *_ = rovers.drive(model, rover, speed=0.0, turn_rate=0.6, seconds=3.0)
    assert 0.3 < yaw < 1.8
    assert np.linalg.norm(moved[:2]) < 0.25


def test_what_the_recipe_says_goes_before_what_the_file_seems_to_say(tub):
    rover = rovers.read(
        tub,
        held=("right_rocker_joint",),
        passive=("pan",),
        wheel_radius_m=0.2,
        torque_limit_n_m=7.0,
        tilt_limit_deg=20.0,
    )
    passive = {link.name for link in rover.links if link.joint == "passive"}
    assert passive == {"left_rocker", "mast"}
    assert rover.couplings == ()
    assert {wheel.radius for wheel in rover.wheels} == {0.2}
    assert rover.torque_limit == 7.0
    assert rover.tilt_limit == pytest.approx(math.radians(20))


def test_gears_that_the_file_lacks_come_from_the_recipe(tub, tmp_path):
    gear = CouplingSpec(joint="right_rocker_joint", follows="left_rocker_joint", ratio=-0.5)
    mimic = '<mimic joint="left_rocker_joint" multiplier="-1"/>'
    rover = changed(tub, tmp_path, (mimic, ""), couplings=(gear,))
    assert [(c.link, c.ratio) for c in rover.couplings] == [("right_rocker", -0.5)]
    assert changed(tub, tmp_path, (mimic, "")).couplings == ()


def test_a_wheel_that_follows_another_is_told(tub, tmp_path):
    start = '<child link="left_rear_wheel"/>'
    geared = changed(tub, tmp_path, (start, f'{start}<mimic joint="left_front_wheel_joint"/>'))
    assert [gear.link for gear in geared.couplings] == ["right_rocker"]
    (told,) = geared.unread
    assert told.endswith(": gear: left_rear_wheel_joint by left_front_wheel_joint.")
    held = rovers.read(tub, held=("left_rocker_joint", "right_rocker_joint"))
    assert held.unread == rovers.read(tub).unread == ()


def test_springs_and_ties_of_simulators_are_told(tub, tmp_path):
    extra = (
        '<gazebo reference="left_rocker_joint"><springStiffness>50</springStiffness></gazebo>'
        '<gazebo reference="right_rocker_joint"><spring_stiffness>0</spring_stiffness></gazebo>'
        '<gazebo reference="pan"><springStiffness>50</springStiffness></gazebo>'
        '<gazebo reference="mast"><turnGravityOff>true</turnGravityOff></gazebo>'
        '<gazebo reference="base_link"><turnGravityOff>false</turnGravityOff></gazebo>'
        '<gazebo><joint name="loop" type="revolute"/></gazebo>'
        '<drake:linear_bushing_rpy name="strut"/></robot>'
    )
    (told,) = changed(tub, tmp_path, ("</robot>", extra)).unread
    assert told == (
        "Of its file is left out, though it changes how the rover moves: spring: left_rocker_joint;"
        " gravity switched off: mast; joint of Gazebo's: loop; drake:linear_bushing_rpy: strut."
    )


def test_driven_joints_are_held_and_wheels_without_a_motor_roll_freely(tub, tmp_path):
    commands = "".join(
        f'<joint name="{joint}"><command_interface name="velocity"/></joint>'
        for joint in ("left_front_wheel_joint", "right_front_wheel_joint", "left_rocker_joint")
    )
    control = f'<ros2_control name="c" type="system">{commands}</ros2_control></robot>'
    rover = changed(tub, tmp_path, ("</robot>", control))
    assert [wheel.link for wheel in rover.wheels] == ["left_front_wheel", "right_front_wheel"]
    passive = {link.name for link in rover.links if link.joint == "passive"}
    assert passive == {"right_rocker", "left_rear_wheel", "right_rear_wheel"}
    assert "left_rocker_joint" in rover.notes[0]


def test_a_base_that_looks_another_way_is_turned(tub):
    rover = rovers.read(tub)
    with pytest.raises(DataError, match=r"wheel '\w+' turns about .*, or name the driven wheels"):
        rovers.read(tub, forward="y")
    back = rovers.read(tub, forward="-x")
    np.testing.assert_allclose(back.wheel_centres[:, :2].mean(axis=0), 0, atol=1e-9)
    assert back.wheels[0].link == "right_rear_wheel"
    _, centre, _ = rovers.at_rest(rover)
    _, turned, _ = rovers.at_rest(back)
    np.testing.assert_allclose(turned[:2], -centre[:2], atol=1e-9)
    assert turned[2] == pytest.approx(centre[2])


@pytest.mark.parametrize(
    ("changes", "choices", "message", "key"),
    [
        ([('"continuous"', '"revolute"')], {}, "found 0 wheels .*left_rocker_joint", "wheels"),
        ([], {"wheels": ("front",)}, "no joint or link 'front' that turns, it has: pan", "wheels"),
        ([], {"base": "hull"}, "has no link 'hull', it has: base_footprint", "base"),
        ([('value="1.5"', 'value="0"')], {}, "link '.*_wheel' moves but has no mass", "file"),
        ([('ixx="0.009"', 'ixx="0"'), ('iyy="0.009"', 'iyy="0"'), ('izz="0.015"', 'izz="0"')],
         {}, "link '.*_wheel' has no inertia", "file"),
        ([('ixx="0.009"', 'ixx="-0.9"')], {}, "link '.*_wheel' has a negative inertia", "file"),
        ([('value="2"', 'value="-2"')], {}, "link 'mast' has a mass of -2 kg", "file"),
        ([("wheel.stl", "tyre.stl")], {}, "mesh tyre.stl is missing", "file"),
        ([('xyz="0 0 1"', 'xyz="0 0 up"')], {}, "axis xyz='0 0 up': must be 3 numbers", "file"),
        ([('<link name="base_footprint"/>', "")], {}, "names the link 'base_footprint'", "file"),
        ([('<child link="mast"/>', '<child link="left_rocker"/>')], {}, "child of two", "file"),
        ([("</robot>", "")], {}, "not XML", "file"),
        ([('<axis xyz="0 0 1"/>', '<axis xyz="0 0 0"/>')], {},
         "joint '.*' is revolute, and its axis has no direction", "file"),
        ([('"revolute"', '"hinge"')], {}, "'left_rocker_joint' has the type 'hinge'|'pan'", "file"),
        ([('<mimic joint="left_rocker_joint"', '<mimic joint="right_rocker_joint"')], {},
         "'right_rocker_joint' follows itself", "file"),
        ([("</robot>", '<gazebo reference="a&#10;b"/></robot>')], {},
         r"gazebo reference .*a.*b", "file"),
        ([('<mimic joint="left_rocker_joint"', '<mimic joint="left_rocker"')], {},
         r"other.urdf: 'right_rocker_joint' follows the joint 'left_rocker', there is none "
         r"\(did you mean 'left_rocker_joint'\?\)", "file"),
        ([('name="mast"', 'name="base_link"')], {}, "has two links 'base_link'", "file"),
        ([("robot", "sdf")], {}, "is a <sdf>, allowed: a URDF or xacro", "file"),
        ([], {"couplings": (CouplingSpec(joint="pan", follows="left_rocker_joint"),)},
         "'pan' is no passive joint, there are: left_rocker, right_rocker", "couplings"),
        ([], {"couplings": (CouplingSpec(joint="left_rocker_joint",
                                         follows="right_rocker_joint"),)},
         "'left_rocker_joint' follows itself", "couplings"),
        ([], {"wheels": ("left_front_wheel", "left_front_wheel_joint")}, "is one wheel", "wheels"),
        ([("package://tub", "package://bath")], {}, "package 'bath' is not found", "packages"),
    ],
)  # fmt: skip
def test_what_is_no_rover_is_refused(tub, tmp_path, changes, choices, message, key):
    with pytest.raises(DataError, match=message) as caught:
        changed(tub, tmp_path, *changes, **choices)
    assert caught.value.key[:2] == ("rover", key)


def test_missing_files_are_refused(tmp_path):
    with pytest.raises(DataError, match=r"no such file: tub\.urdf"):
        rovers.read(tmp_path / "tub.urdf")
    (tmp_path / "bad.xml").write_text("<mujoco><nothing/></mujoco>")
    with pytest.raises(DataError, match="MuJoCo cannot load it"):
        rovers.read(tmp_path / "bad.xml")


@pytest.mark.parametrize(
    ("head", "file", "tag"),
    [
        (
            '<asset><hfield name="f" file="dunes.png" size="1 1 1 1"/></asset>',
            "dunes.png",
            "hfield",
        ),
        ('<asset><mesh name="m" file="hub.stl"/></asset>', "hub.stl", "mesh"),
        ('<include file="wheels.xml"/>', "wheels.xml", "include"),
    ],
)
def test_a_file_that_a_model_names_and_is_not_there(tmp_path, head, file, tag):
    text = f'<mujoco><compiler meshdir="parts"/>{head}<worldbody/></mujoco>'
    (tmp_path / "rover.xml").write_text(text)
    with pytest.raises(DataError) as caught:
        rovers.read(tmp_path / "rover.xml")
    said = str(caught.value)
    assert f"the file '{file}' of a <{tag}> is not there, in {tmp_path}" in said
    assert "\n" not in said


@pytest.mark.parametrize(
    "name",
    ["world", "path", "rock_12", "base_link_free", "__wheel__", "left::wheel", "WHEEL_joint"],
)
def test_names_that_exports_need_are_refused_where_something_moves(tub, tmp_path, name):
    changes = [('"left_rocker"', f'"{name}"'), ('"right_rocker"', '"WHEEL"')]
    with pytest.raises(DataError, match="moves, and exports call something else so"):
        changed(tub, tmp_path, *changes)


def test_a_suspension_that_cannot_move_is_held(tub, tmp_path):
    rover = changed(tub, tmp_path, ('lower="-0.5" upper="0.4"', 'lower="0" upper="0"'))
    assert {link.joint for link in rover.links} == {"free", "motor"}
    assert "left_rocker_joint, right_rocker_joint" in rover.notes[0]
    for limits in ('lower="0" upper="0"', 'lower="0.5" upper="-0.5"'):  # MuJoCo: none; a fault
        change = 'lower="-0.5" upper="0.4"', limits
        with pytest.raises(DataError, match="'left_rocker' cannot turn: its limits are"):
            changed(tub, tmp_path, change, passive=("left_rocker_joint",))


def test_an_inertia_that_no_body_has_is_evened_out_and_told(tub, tmp_path):
    rover = changed(tub, tmp_path, ('izz="0.015"', 'izz="0.15"'))
    assert "No body has the inertia of left_front_wheel: its mean was taken." in rover.notes
    wheel = next(link for link in rover.links if link.name == "left_front_wheel")
    np.testing.assert_allclose(wheel.inertia, np.eye(3) * (0.15 + 0.018) / 3)


def test_thin_discs_askew_have_an_inertia_that_mujoco_takes(tub, tmp_path):
    roll = math.pi / 2
    changes = [('izz="0.015"', 'izz="0.018"'), (f'rpy="{roll} 0', f'rpy="{roll + 0.2} 0')]
    rover = changed(tub, tmp_path, *changes)
    assert not any("its mean" in note for note in rover.notes)
    rovers.on_the_flat(rover, tmp_path)
    wheel = next(link for link in rover.links if link.name == "right_front_wheel")
    moments = np.linalg.eigvalsh(wheel.inertia)
    np.testing.assert_allclose(moments, (0.009, 0.009, 0.018), rtol=1e-5)


def test_motors_overcome_the_friction_of_their_own_joints(tub, tmp_path):
    no_effort = ('<limit effort="12" velocity="8"/>', "")
    rolling = 'damping="0.05" friction="0.01"'
    ideal = changed(tub, tmp_path, no_effort, (rolling, ""), speed_limit_m_s=0.3)
    stiff = changed(
        tub, tmp_path, no_effort, (rolling, 'damping="5" friction="10"'), speed_limit_m_s=0.3
    )
    lost = stiff.torque_limit - ideal.torque_limit
    assert lost == pytest.approx(10 + 5 * 0.3 / rovers.RADIUS, rel=1e-6)


XACRO = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'


def xacro_of(tub):
    """The rover's file with an include, a property and paths by `$(find …)`."""
    text = tub.read_text().replace("<robot ", f"<robot {XACRO} ")
    text = text.replace("package://tub", "file://$(find tub)")
    head, tail = text.split('<link name="mast">')
    extra = '<xacro:property name="heavy" value="${2 * 3}"/>'
    include = '<xacro:include filename="$(find tub)/urdf/more.xacro"/>'
    (tub.parent / "more.xacro").write_text(f"<robot {XACRO}>{extra}</robot>")
    body = f'{head}{include}<link name="mast">{tail}'
    return body.replace('<mass value="2"/>', '<mass value="${heavy}"/>')


@pytest.mark.parametrize("trust", [False, True])
def test_a_xacro_is_expanded(tub, trust):
    if trust:
        pytest.importorskip("xacro")
    file = tub.parent / "tub.urdf.xacro"
    file.write_text(xacro_of(tub))
    found = resolve_rover(FileRover(file=file.name, trust=trust), file.parent)
    assert found.rover.mass == pytest.approx(rovers.read(tub).mass + 4.0)
    assert [path.name for path in found.files] == ["tub.urdf.xacro", "more.xacro", "wheel.stl"]


def test_a_urdf_is_never_evaluated(tub, tmp_path):
    comment = ("</robot>", "<!-- $(env HOME) ${1/0} --></robot>")
    assert changed(tub, tmp_path, comment) == rovers.read(tub)
    with pytest.raises(DataError, match=r"origin rpy='\$\(optenv PAN 0 0 0\)': must be 3 numbers"):
        changed(tub, tmp_path, ('<origin xyz="0.4 0 0.2"/>', '<origin rpy="$(optenv PAN 0 0 0)"/>'))
    text = xacro_of(tub)
    (tub.parent / "named.urdf").write_text(text)
    told = "named.urdf holds <xacro:include>; a .urdf is not evaluated, name it .xacro"
    with pytest.raises(DataError, match=told):
        rovers.read(tub.parent / "named.urdf")


def test_trust_runs_the_files_python(tub):
    pytest.importorskip("xacro")
    file = tub.parent / "clever.xacro"
    text = xacro_of(tub).replace("${heavy}", "${sum([heavy for _ in range(1)], 0)}")
    file.write_text(text.replace("sum(", "python.sum("))
    with pytest.raises(DataError, match=r"is not allowed: .*`trust: true` runs its Python"):
        rovers.read(file)
    assert rovers.read(file, trust=True).mass == pytest.approx(rovers.read(tub).mass + 4.0)


@pytest.mark.parametrize(
    "change",
    [
        ('<child link="base_link"/>', '<child link="base_link"/><axis xyz="0 0 0"/>'),
        ('<child link="base_link"/>', '<child link="base_link"/><limit lower="x"/><mimic/>'),
        ('<child link="base_link"/>', '<child link="base_link"/><mimic joint="foot"/>'),
    ],
)
def test_a_fixed_joint_has_no_axis_limits_or_leader(tub, tmp_path, change):
    assert changed(tub, tmp_path, change) == rovers.read(tub)


def recipe(rover, spacing=0.1):
    return recipe_from_json(
        json.dumps(
            {
                "name": "yard",
                "body": "mars",
                "dtm": {"kind": "flat", "size_m": [6, 4]},
                "terrain": {"spacing_m": spacing},
                "rocks": {"library": {"shapes": 1}},
                "rover": rover,
                "exports": [],
            }
        )
    )


def test_a_world_keeps_the_rover_and_the_hashes_of_its_files(tub, tmp_path):
    file = str(tub)
    site = plan(recipe({"kind": "file", "file": file, "packages": {"tub": str(tub.parents[1])}}))
    world = realise(site)
    assert world.rover == rovers.read(tub)
    world.save(tmp_path)
    assert World.load(tmp_path) == world
    with np.load(tmp_path / "world" / "arrays.npz") as arrays:
        assert sum("rover" in name and name.endswith("vertices") for name in arrays) == 4
    assert [name for name, _ in site.inputs] == ["tub.urdf", "../meshes/wheel.stl"]
    assert str(tub.parents[1]) not in site.recipe_json


def test_wheels_below_the_grounds_spacing_are_refused(tub):
    spec = {"kind": "morpheus", "dimensions": {"wheel_radius_m": 0.08}}
    with pytest.raises(RecipeError, match=r"wheel radius 0.08 m is below .* spacing, 0.1 m") as e:
        plan(recipe(spec))
    assert e.value.key == ("rover",)
    with pytest.raises(RecipeError, match="below the ground's spacing"):
        plan(recipe({"kind": "file", "file": str(tub)}, spacing=0.2))


@pytest.fixture(scope="module")
def curiosity():
    for folder in (DATA / "rover" / "curiosity",):
        if (folder / CURIOSITY).is_file():
            return folder
    pytest.skip("the Curiosity model is not here")


@pytest.mark.slow
def test_curiosity_stands_and_drives(curiosity, tmp_path):
    arms = ("F_L", "B_L", "F_R", "B_R", "B2_L", "B2_R")
    name = "suspension_arm_{}_joint".format
    gears = tuple(
        CouplingSpec(joint=name(arm), follows=name("F_L"), ratio=ratio)
        for arm, ratio in (("B_L", 1.0), ("F_R", -1.0), ("B_R", -1.0))
    )
    stiff = FileRover(file=str(CURIOSITY))
    bogies = FileRover(file=str(CURIOSITY), passive=tuple(map(name, arms)), couplings=gears)
    for number, spec in enumerate((stiff, bogies)):
        rover = resolve_rover(spec, curiosity).rover
        assert len(rover.wheels) == 6
        assert 850 < rover.mass < 950
        model = rovers.on_the_flat(rover, tmp_path / str(number))
        moved, yaw, start, stood = rovers.drive(model, rover, speed=0.4, turn_rate=0.0, seconds=2.5)
        assert abs(yaw) < 0.05
        assert np.linalg.norm(start) < 0.03
        assert len(stood) == 6 * number
        assert moved[0] == pytest.approx(0.9, abs=0.06)
        assert abs(moved[1]) < 0.1
        if spec is stiff:
            continue
        moved, yaw, *_ = rovers.drive(model, rover, speed=0.0, turn_rate=0.4, seconds=2.0)
        assert yaw > 0.15
        assert np.linalg.norm(moved[:2]) < 0.6


@pytest.mark.parametrize("signs", [(-1, 1, 1), (1, -1, 1), (-1, -1, 1), (-1, -1, -1)])
def test_a_mirrored_mesh_is_not_inside_out(tub, tmp_path, signs):
    x, y, z = (0.001 * sign for sign in signs)
    mirrored = changed(tub, tmp_path, ('scale="0.001 0.001 0.001"', f'scale="{x} {y} {z}"'))
    shapes = [s for link in mirrored.links for s in link.shapes if s.mesh is not None]
    assert {shape.visible for shape in shapes} == {True}
    for shape in shapes:
        a, b, c = shape.mesh.vertices[shape.mesh.faces].swapaxes(0, 1)
        assert np.einsum("ij,ij->", a, np.cross(b, c)) > 0.0


def test_a_mesh_in_gltf_may_keep_its_numbers_beside_it(tub):
    import trimesh

    folder = tub.parents[1] / "meshes"
    wheel = trimesh.load_mesh(folder / "wheel.stl")
    wheel.merge_vertices()
    for name, data in trimesh.Scene(wheel).export(file_type="gltf").items():
        (folder / ("wheel.gltf" if name == "model.gltf" else name)).write_bytes(data)
    file = tub.parent / "tub_gltf.urdf"
    file.write_text(tub.read_text().replace("wheel.stl", "wheel.gltf"))
    assert rovers.read(file).mass == rovers.read(tub).mass


# pycollada 0.9 writes so with NumPy 2.5.
@pytest.mark.filterwarnings("ignore:Setting the shape on a NumPy array:DeprecationWarning")
def test_a_mesh_in_collada_keeps_its_triangles_where_a_material_is_lost(tmp_path):
    import trimesh

    box = trimesh.creation.box()
    paint = trimesh.visual.material.PBRMaterial(baseColorFactor=[200, 40, 30, 255])
    box.visual = trimesh.visual.TextureVisuals(uv=box.vertices[:, :2], material=paint)
    text = trimesh.exchange.dae.export_collada([box, trimesh.creation.icosphere()]).decode()
    lost = text.replace('instance_effect url="#', 'instance_effect url="#no_', 1)
    seen = []
    for content in (text, lost):
        file = tmp_path / f"{len(seen)}.dae"
        file.write_text(content)
        files = MeshFiles(Packages({}, file))
        seen.append(
            {
                len(shape.mesh.faces): shape.rgb
                for _, shape in files.solids(
                    file, scale=np.ones(3), placement=np.eye(4), collides=False, rgb=None
                )
            }
        )
    red, grey, black = (0.784, 0.157, 0.118), (0.6, 0.6, 0.6), (0.0, 0.0, 0.0)
    assert seen == [{12: red, 1280: black}, {12: grey, 1280: black}]


def test_a_build_removes_no_mesh_of_its_rover(tub, tmp_path):
    """A file that the rover's own file names, in an older world that lists it."""
    import shutil

    from tests.helpers.command_line import run

    kit = tmp_path / "kit"
    shutil.copytree(tub.parents[1], kit)
    recipe_ = {
        **{"schema": 1, "name": "k", "body": "moon", "dtm": {"kind": "flat", "size_m": [6, 4]}},
        **{"terrain": {"spacing_m": 0.5}, "rocks": {"library": {"shapes": 1}, "populations": []}},
        **{"exports": ["geotiff"]},
    }
    path, out = kit / "k.yaml", kit / "meshes"
    path.write_text(json.dumps(recipe_))
    shutil.move(out, kit / "aside")
    assert run("build", path, "-o", out).returncode == 0
    shutil.copy(kit / "aside" / "wheel.stl", out / "wheel.stl")
    rover = {"kind": "file", "file": "urdf/tub.urdf", "packages": {"tub": "."}}
    path.write_text(json.dumps(recipe_ | {"rover": rover}))
    for force in ((), ("--force",)):
        done = run("build", path, "-o", out, *force)
        assert (done.returncode, "wheel.stl lies in it" in done.stderr) == (2, True), done.stderr
    assert (out / "wheel.stl").exists()
