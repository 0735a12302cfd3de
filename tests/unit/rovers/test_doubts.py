"""What of a rover's sizes can hardly be meant."""

from __future__ import annotations

import pytest

from terrain_forge.model import Coupling
from terrain_forge.rovers import built_in_rovers, doubts_of, find_rover
from terrain_forge.rovers.doubts import doubt_gears, doubt_rest, doubt_stance, doubt_unit
from tests.helpers import rovers

_WHEEL = (
    '<body name="wheel_{0}" pos="{1} {2} {3}"><joint name="j_{0}" axis="0 1 0"/>'
    '<geom type="cylinder" size="{4} .04" zaxis="0 1 0" mass="1"/></body>'
)
_CORNERS = {"fl": (0.3, 0.25), "fr": (0.3, -0.25), "rl": (-0.3, 0.25), "rr": (-0.3, -0.25)}
_ROCKER = '<body name="rocker{0}"><joint name="rock{0}" axis="0 1 0" {1}/><geom size=".05"/>'


def read(folder, *, lower, radius=0.15, rocker=False, limits="", gear=""):
    """A rover of four wheels or six, some of them lower [m]; the left ones on a rocker or not."""
    places = _CORNERS | ({"ml": (0, 0.25), "mr": (0, -0.25)} if "ml" in lower else {})
    told = {
        name: _WHEEL.format(name, *place, -0.1 - lower.get(name, 0.0), radius)
        for name, place in places.items()
    }
    left, right = ("".join(told[n] for n in told if n.endswith(side)) for side in "lr")
    if rocker:
        left = f"{_ROCKER.format('', limits)}{left}</body>"
    if gear:
        right = f"{_ROCKER.format('_r', '')}{right}</body>"
        gear = (
            f'<equality><joint joint1="rock" joint2="rock_r" polycoef="{gear} 0 0 0"/></equality>'
        )
    file = folder / "cart.xml"
    file.write_text(
        '<mujoco><worldbody><body name="hull"><freejoint/><geom type="box" size=".3 .2 .08" '
        f'mass="9"/>{left}{right}</body></worldbody>{gear}</mujoco>'
    )
    return rovers.read(file)


@pytest.mark.parametrize(
    ("lower", "rocker", "hangs"),
    [
        ({"fl": 0.4}, False, "0.4 m"),
        ({"fl": 0.4}, True, ""),  # a rocker turns until its wheels touch
        ({"fl": 0.02}, False, ""),  # less than a fifth of the radius
        ({"fl": 0.2, "rr": 0.2}, False, "0.4 m"),
        ({"fl": 0.4, "fr": 0.4}, False, ""),  # it stands with its nose up
        ({"ml": 0.1, "mr": 0.1}, False, "0.2 m"),
        ({"ml": -0.1, "mr": -0.1}, False, "0.1 m"),
    ],
)
def test_wheels_that_cannot_touch_level_ground_together(tmp_path, lower, rocker, hangs):
    told = doubt_stance(read(tmp_path, lower=lower, rocker=rocker))
    assert (f"hangs {hangs} above it" in told) if hangs else not told
    if "ml" in lower and lower["ml"] < 0:
        assert "wheel_ml hangs 0.1 m, wheel_mr hangs 0.1 m above" in told


def test_a_wheel_of_meters_is_none_of_metres(tmp_path):
    assert not doubt_unit(read(tmp_path, lower={}, radius=2.0))
    assert "wheels of 15.00 m: are the lengths" in doubt_unit(read(tmp_path, lower={}, radius=15.0))


@pytest.mark.parametrize("name", built_in_rovers())
def test_our_own_are_beyond_doubt(name):
    rover = find_rover(name)
    assert doubts_of(rover) == ()


@pytest.mark.parametrize(
    ("gears", "told"),
    [
        ([("a", "b", -2.0), ("b", "a", -0.5)], ""),
        ([("a", "b", -2.0), ("b", "a", -2.0)], "of a, b"),
        ([("a", "b", 2.0), ("c", "b", 3.0), ("c", "a", 1.5)], ""),
        ([("a", "b", 2.0), ("c", "b", 3.0), ("c", "a", 1.0)], "of a, c"),
        ([("a", "b", 0.0), ("a", "c", 1.0)], ""),
    ],
)
def test_gears_that_contradict_each_other(gears, told):
    couplings = tuple(Coupling(link=one, leader=other, ratio=ratio) for one, other, ratio in gears)
    found = doubt_gears(find_rover("skid4").replace(couplings=couplings))
    assert (told in found) if told else not found


@pytest.mark.parametrize(
    ("limits", "gear", "told"),
    [
        ("", "", ""),
        ('range="-30 30"', "0 -1", ""),
        ('range="0 30"', "", ""),
        ('range="5.73 30"', "", "rocker turns from 0.1 to 0.524 rad"),
        ('range="-30 -5.73"', "", "rocker turns from -0.524 to -0.1 rad"),
        ("", "0.15 -1", "rocker is 0.15 rad ahead of rocker_r by its gear"),
    ],
)
def test_joints_that_cannot_have_the_pose_in_which_the_rover_is_put_down(
    tmp_path, limits, gear, told
):
    rover = read(tmp_path, lower={}, rocker=True, limits=limits, gear=gear)
    found = doubt_rest(rover)
    assert (told in found) if told else not found
