"""The clearance of users' rovers: what of a body is its measure, and what rests on the ground."""

from __future__ import annotations

import pytest

from terrain_forge.base import DataError
from terrain_forge.paths import highest_step
from tests.helpers import rovers


def two_wheels(tmp_path, *, caster_m, chassis_m=0.05, **choices):
    file = rovers.caster_urdf(tmp_path, caster_m=caster_m, chassis_m=chassis_m)
    return rovers.read(file, **choices)


@pytest.mark.parametrize("caster_m", [0.0, -0.004, 0.009])
@pytest.mark.parametrize(("chassis_m", "clearance"), [(0.04, 0.04), (0.15, 0.05)])
def test_parts_that_rest_on_the_ground_are_dragged(tmp_path, caster_m, chassis_m, clearance):
    """The ball of 0.2 m over 0.05 m, unless the chassis is lower."""
    rover = two_wheels(tmp_path, caster_m=caster_m, chassis_m=chassis_m)
    assert rover.clearance == pytest.approx(clearance)
    assert highest_step(rover) == pytest.approx(clearance)


def test_low_parts_that_do_not_touch_are_the_clearance(tmp_path):
    assert two_wheels(tmp_path, caster_m=0.02).clearance == pytest.approx(0.02)


def test_a_rover_of_which_nothing_is_above_the_ground_needs_a_step_limit(tmp_path):
    wanted = r"lowest collider is caster: .* give rover\.step_limit_m"
    with pytest.raises(DataError, match=wanted) as error:
        two_wheels(tmp_path, caster_m=0.0, chassis_m=0.0001)
    assert error.value.key == ("rover",)
    rover = two_wheels(tmp_path, caster_m=0.0, chassis_m=0.0001, step_limit_m=0.03)
    assert (rover.clearance, highest_step(rover)) == (0.0, 0.03)


def test_a_rover_is_as_long_as_what_is_on_the_ground_reaches(tmp_path):
    """Evenly about base_link, which lies amid the driven wheels: the ball ends 0.75 m behind it."""
    on_the_ground = rovers.caster_urdf(tmp_path, caster_m=0.0, chassis_m=0.15)
    assert rovers.read(on_the_ground).length == pytest.approx(1.5)
    above = rovers.caster_urdf(tmp_path, caster_m=0.05, chassis_m=0.15)
    assert rovers.read(above).length == pytest.approx(0.4)
    assert rovers.read(above).width == pytest.approx(0.7)
