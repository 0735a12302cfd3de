"""What `check` says of the rover."""

from __future__ import annotations

import re
from functools import partial

import pytest

from terrain_forge.base import RecipeError
from terrain_forge.pipeline import check
from terrain_forge.recipe import DriveSpec, ValidateSpec
from terrain_forge.rovers import FileRover
from tests.helpers import rovers
from tests.helpers.recipes import flat
from tests.unit.building.test_cost import planned


@pytest.fixture(scope="module")
def tub(tmp_path_factory):
    return rovers.rocker_urdf(tmp_path_factory.mktemp("urdf"))


recipe = partial(flat, (16.0, 12.0), 0.1)


def said(recipe, folder=None):
    """What is told of the rover, and the warnings."""
    lines = list(check(recipe, folder=folder) if folder else check(recipe))
    (told,) = (line.split(maxsplit=1)[1] for line in lines if line.startswith("  rover "))
    return told, [line.split(maxsplit=1)[1] for line in lines if line.startswith("  warning")]


def test_a_built_in_rover():
    told, warned = said(recipe())
    assert re.fullmatch(
        r"morpheus: [\d.]+ kg, 6 wheels of 0\.14 m driven, step limit 0\.22 m", told
    )
    assert warned == []


def test_a_rover_of_a_file_with_steering_that_is_held(tub):
    mine = FileRover(file=tub.name, packages={"tub": str(tub.parents[1])})
    told, warned = said(recipe(rover=mine), tub.parent)
    joints = "left_steer_wheel_joint, right_steer_wheel_joint"
    assert told.startswith("tub: ")
    assert f"4 wheels of 0.15 m driven, held: pan, {joints}, step limit" in told
    assert warned == []
    path = planned(0.1).paths[0]
    driven = recipe(rover=mine, paths=(path,), validate=ValidateSpec(drive=DriveSpec(path="0")))
    _, (warned,) = said(driven, tub.parent)
    assert warned == (
        f"joints that steer are held at rest ({joints}): the rover turns by skidding, or not at all"
    )


def test_held_steering_joints_without_limits_are_told_too(tub, tmp_path):
    endless = re.sub(
        r'("left_steer_wheel_joint" type=)"revolute"', r'\1"continuous"', tub.read_text()
    )
    assert endless != tub.read_text()
    motor = '<transmission><joint name="left_steer_wheel_joint"/><actuator/></transmission>'
    wheels = "".join(
        f'<transmission><joint name="{side}_{end}_wheel_joint"/><actuator/></transmission>'
        for side in ("left", "right")
        for end in ("front", "rear")
    )
    file = tmp_path / "rover.urdf"
    file.write_text(endless.replace("</robot>", f"{motor}{wheels}</robot>"))
    rover = rovers.read(file, packages={"tub": str(tub.parents[1])})
    assert rover.steering == ("left_steer_wheel_joint", "right_steer_wheel_joint")


def test_sensors_of_its_file_are_said_not_to_be_read(tub, tmp_path):
    sensors = "".join(
        f"<gazebo reference='base'><sensor name='{n}' type='{kind}'/></gazebo>"
        for n, kind in enumerate(("camera", "imu", "camera", "\x9b31m"))
    )
    sensors += "<sensor name='scan'><parent link='base'/><ray/></sensor>"
    sensors += "<ros2_control><sensor name='again'/></ros2_control>"
    file = tmp_path / "rover.urdf"
    file.write_text(tub.read_text().replace("</robot>", f"{sensors}</robot>"), encoding="utf-8")
    mine = FileRover(file=file.name, packages={"tub": str(tub.parents[1])})
    lines = check(recipe(rover=mine), folder=tmp_path)
    notes = [line.split(maxsplit=1)[1] for line in lines if line.startswith("  note")]
    assert notes[0].startswith("Axes turned about")
    assert notes[1].startswith("base_link is the file's link 'base_link'")
    assert notes[2].endswith("the recipe's `sensors` add some: 2 camera, 1 imu, 1 other, 1 ray.")


def test_sensors_of_an_mjcf_are_said_not_to_be_read(tmp_path):
    wheels = "".join(
        f"<body pos='{x} {y} -.1'><joint name='wheel{x}{y}' axis='0 1 0'/>"
        "<geom type='cylinder' size='.12 .04' zaxis='0 1 0'/></body>"
        for x in (-0.2, 0.2)
        for y in (-0.25, 0.25)
    )
    (tmp_path / "rover.xml").write_text(
        "<mujoco><worldbody><camera name='stage'/><body><freejoint/><geom type='box' "
        "size='.3 .2 .08'/><site name='s'/><camera name='eye'/><camera mode='trackcom'/>"
        "<body name='pan'/>"
        f"{wheels}</body></worldbody><equality><connect body1='pan' body2='world' anchor='0 0 1'/>"
        "</equality><sensor><gyro site='s'/><touch site='s'/>"
        "<jointpos joint='wheel0.20.25'/></sensor></mujoco>"
    )
    lines = list(check(recipe(rover=FileRover(file="rover.xml")), folder=tmp_path))
    assert any(line.startswith("  warning      Of its file is left out, ") for line in lines)
    _, note = (line for line in lines if line.startswith("  note"))
    assert note.endswith("the recipe's `sensors` add some: 1 camera, 1 gyro, 1 touch.")


def test_sizes_of_another_unit_and_beyond_the_site_are_warned_of(tub, tmp_path):
    file = rovers.caster_urdf(tmp_path, caster_m=0.02, chassis_m=0.05)
    told, warned = said(recipe(rover=FileRover(file=file.name, wheel_radius_m=40.0)), tmp_path)
    assert "2 wheels of 40.00 m driven, step limit" in told
    assert "another unit than metres" in warned[0]
    driven = recipe(rover=FileRover(file=file.name, wheel_radius_m=40.0), paths=planned(0.1).paths)
    with pytest.raises(RecipeError, match=r"wheels of 40\.00 m: .* unit than metres\? As metres, "):
        said(driven, tmp_path)
    assert "m wide, the site 16 × 12 m" in warned[1]
