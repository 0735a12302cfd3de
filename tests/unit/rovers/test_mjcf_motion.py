"""How joints of an MJCF turn and are tied: as in MuJoCo, or told."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from tests.helpers import rovers

_WHEEL = (
    '<body name="wheel_{0}{1}" pos="{2} {3} -.1"><joint name="{0}{1}" axis="0 1 0" {4}/>'
    '<geom type="cylinder" size=".12 .04" zaxis="0 1 0" mass="1"/></body>'
)
_ARM = (
    '<body name="arm_{0}" pos="0 {2} 0"><joint name="swing_{0}" axis="0 1 0" {1}/>'
    '<geom type="capsule" size=".02 .2" zaxis="1 0 0" mass="1"/>{3}</body>'
)


def two_arms(folder, extra="", *, joint="", body="", wheel=""):
    """The file of a rover of two arms, each with two wheels."""
    arms = "".join(
        _ARM.format(side, joint, y, "".join(
            _WHEEL.format(end, side, x, y / 4, wheel) for end, x in (("f", 0.25), ("r", -0.25))
        ))
        for side, y in (("l", 0.25), ("r", -0.25))
    )  # fmt: skip
    file = folder / "arms.xml"
    file.write_text(
        '<mujoco><compiler angle="degree"/><worldbody><body name="crate" pos="1 2 3"><freejoint/>'
        '<body name="stray" pos="9 9 9"/>'
        f'<geom type="box" size=".3 .2 .08" mass="9"/>{body}{arms}</body>'
        '<body name="rock" pos="5 0 0"><joint name="hop" stiffness="3"/><geom size=".1"/></body>'
        f"</worldbody>{extra}</mujoco>"
    )
    return file


def turned(model, angles):
    """The pose of a wheel of the left arm as the right one sees it, at some angles of joints."""
    data = mujoco.MjData(model)
    for joint, angle in angles.items():
        data.joint(joint).qpos = angle
    mujoco.mj_forward(model, data)
    arm, wheel = data.body("arm_r"), data.body("wheel_rl")
    turn = arm.xmat.reshape(3, 3)
    return turn.T @ np.column_stack([wheel.xpos - arm.xpos, wheel.xmat.reshape(3, 3)])


def test_limits_are_from_the_pose_as_written(tmp_path):
    """A joint whose `ref` is 10° there turns by 10° less up and more down."""
    file = two_arms(tmp_path, joint='range="-30 25" ref="10"')
    rover = rovers.read(file)
    arm = next(link for link in rover.links if link.name == "arm_r")
    np.testing.assert_allclose(np.degrees(arm.limits), (-40, 15))
    source = mujoco.MjModel.from_xml_path(str(file))
    ours = rovers.on_the_flat(rover, tmp_path / "o")
    for end in (0, 1):
        theirs = {name: source.joint(name).range[end] for name in ("swing_l", "swing_r")}
        mine = {name: ours.joint(name).range[end] for name in ("arm_l", "arm_r")}
        theirs["swing_l"] = source.joint("swing_l").qpos0
        mine["arm_l"] = 0.0
        np.testing.assert_allclose(turned(ours, mine), turned(source, theirs), atol=1e-6)


FIXED = '<tendon><fixed name="t"><joint joint="swing_l" coef="2"/>{}</fixed>{}</tendon>'
SECOND = '<joint joint="swing_r" coef="-0.5"/>'
OTHER = '<fixed name="u"><joint joint="swing_r" coef="3"/></fixed>'
LINEAR = {
    "joints": '<equality><joint joint1="swing_r" joint2="swing_l" polycoef=".1 -2 0 0 0"/>'
    "</equality>",
    "a tendon": FIXED.format(SECOND, "")
    + '<equality><tendon tendon1="t" polycoef=".1 0 0 0 0"/></equality>',
    "two tendons": FIXED.format("", OTHER)
    + '<equality><tendon tendon1="t" tendon2="u" polycoef=".1 -.4 0 0 0"/></equality>',
}


@pytest.mark.parametrize("tie", LINEAR)
def test_what_is_linear_between_two_joints_is_a_gear(tmp_path, tie):
    """The angles that it allows satisfy MuJoCo's own equality, from another pose as written."""
    file = two_arms(tmp_path, LINEAR[tie], joint='ref="7"')
    rover = rovers.read(file)
    (gear,) = rover.couplings
    assert rover.unread == ()
    for model, names, at_rest in (
        (mujoco.MjModel.from_xml_path(str(file)), {"arm_l": "swing_l", "arm_r": "swing_r"}, 7),
        (rovers.on_the_flat(rover, tmp_path / "o"), {"arm_l": "arm_l", "arm_r": "arm_r"}, 0),
    ):
        data = mujoco.MjData(model)
        data.joint(names[gear.leader]).qpos = np.radians(at_rest) + 0.3
        follower = data.joint(names[gear.link])
        for error in (0.0, 0.05):
            follower.qpos = np.radians(at_rest) + gear.ratio * 0.3 + gear.offset + error
            mujoco.mj_forward(model, data)
            of_equality = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
            assert of_equality.sum() == 1
            assert (abs(data.efc_pos[of_equality][0]) < 1e-9) == (error == 0.0)


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ({"joint": 'stiffness="20"'}, "spring: swing_l, swing_r"),
        ({"joint": 'armature="0.1"'}, "armature: swing_l, swing_r"),
        ({"body": '<body name="fin" gravcomp="1"><geom size=".01"/></body>'},
         "gravity compensation: fin"),
        ({"extra": '<equality><connect body1="arm_l" body2="arm_r" anchor="0 0 1"/></equality>'},
         "equality connect: arm_l with arm_r"),
        ({"extra": '<equality><weld name="glue" body1="arm_l" body2="crate"/></equality>'},
         "equality weld: glue"),
        ({"extra": '<equality><joint joint1="swing_l" joint2="swing_r" '
                   'polycoef="0 1 .3 0 0"/></equality>'}, "equality joint: swing_l with swing_r"),
        ({"extra": '<equality><joint joint1="swing_l"/></equality>'}, "equality joint: swing_l"),
        ({"extra": FIXED.format("", "") + '<equality><tendon tendon1="t"/></equality>'},
         "equality tendon: t"),
        ({"extra": FIXED.format(SECOND, "").replace('"t"', '"t" stiffness="3"')}, "tendon: t"),
        ({"extra": FIXED.format(SECOND, "") + '<actuator><motor name="m" tendon="t"/></actuator>'},
         "actuator on a tendon: m"),
        ({"extra": '<equality><joint joint1="fl" joint2="rl"/></equality>'}, "gear: fl by rl"),
    ],
)  # fmt: skip
def test_what_changes_the_motion_and_is_not_read_is_told(tmp_path, more, told):
    (said,) = rovers.read(two_arms(tmp_path, **more)).unread
    assert said == f"Of its file is left out, though it changes how the rover moves: {told}."


@pytest.mark.parametrize(
    "more",
    [
        {"wheel": 'armature="0.1"'},
        {"extra": FIXED.format(SECOND, "")},
        {"extra": '<equality><connect body1="rock" body2="world" anchor="0 0 1"/></equality>'},
        {"extra": '<equality><weld active="false" body1="arm_l" body2="crate"/></equality>'},
    ],
)
def test_what_does_nothing_to_the_rover_is_not_told(tmp_path, more):
    rover = rovers.read(two_arms(tmp_path, **more))
    assert (rover.unread, rover.couplings) == ((), ())
