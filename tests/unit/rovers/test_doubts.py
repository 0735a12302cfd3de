"""What of a rover's sizes can hardly be meant."""

from __future__ import annotations

import pytest

from terrain_forge.rovers import built_in_rovers, doubt_stance, doubt_unit, find_rover
from tests.helpers import rovers

_WHEEL = (
    '<body name="wheel_{0}" pos="{1} {2} {3}"><joint name="j_{0}" axis="0 1 0"/>'
    '<geom type="cylinder" size="{4} .04" zaxis="0 1 0" mass="1"/></body>'
)
_CORNERS = {"fl": (0.3, 0.25), "fr": (0.3, -0.25), "rl": (-0.3, 0.25), "rr": (-0.3, -0.25)}
_ROCKER = '<body name="rocker"><joint name="rock" axis="0 1 0"/><geom size=".05"/>'


def read(folder, *, lower, radius=0.15, rocker=False):
    """A rover of four wheels or six, some of them lower [m]; the left ones on a rocker or not."""
    places = _CORNERS | ({"ml": (0, 0.25), "mr": (0, -0.25)} if "ml" in lower else {})
    told = {
        name: _WHEEL.format(name, *place, -0.1 - lower.get(name, 0.0), radius)
        for name, place in places.items()
    }
    left, right = ("".join(told[n] for n in told if n.endswith(side)) for side in "lr")
    if rocker:
        left = f"{_ROCKER}{left}</body>"
    file = folder / "cart.xml"
    file.write_text(
        '<mujoco><worldbody><body name="hull"><freejoint/><geom type="box" size=".3 .2 .08" '
        f'mass="9"/>{left}{right}</body></worldbody></mujoco>'
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
    assert doubt_unit(rover) == doubt_stance(rover) == ""
