"""Limits of the rates of passive joints: from a user's file into those formats that have them."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pytest
from terrain_forge.exporters.mjcf.rover import rig_losses
from terrain_forge.exporters.rover import Options, export

from terrain_forge.base import from_plain, to_plain
from terrain_forge.model import Rover
from tests.helpers import rovers, worlds

ROCKERS = "left_rocker", "right_rocker"


@pytest.fixture(scope="module")
def tub(tmp_path_factory):
    """A rover whose rockers turn at 5 rad/s at most, as its file says."""
    return rovers.read(rovers.rocker_urdf(tmp_path_factory.mktemp("urdf")))


@pytest.fixture(scope="module")
def exported(tub, tmp_path_factory):
    folder = tmp_path_factory.mktemp("rover")
    return folder, export(worlds.world(rocks=2, rover=tub), folder, options=Options()).losses


def rates(rover):
    return {link.name: link.rate_limit for link in rover.links if link.rate_limit is not None}


def test_rates_are_those_of_the_file(tub):
    assert rates(tub) == dict.fromkeys(ROCKERS, 5.0)
    assert rates(rovers.morpheus()) == {}


@pytest.mark.parametrize("text", ['velocity="0"', 'velocity="1e9"', ""])
def test_rates_that_mean_none(text, tmp_path):
    file = rovers.rocker_urdf(tmp_path)
    file.write_text(file.read_text().replace('velocity="5"', text))
    assert rates(rovers.read(file)) == {}


def test_urdf_and_sdf_keep_rates(tub, exported):
    folder, _ = exported
    urdf = ET.parse(folder / "tub.urdf").getroot()
    sdf = ET.parse(folder / "tub.sdf").getroot().find("model")
    wheel = tub.speed_limit / rovers.RADIUS
    for name in ROCKERS:
        joint = urdf.find(f"joint[@name='{name}_joint']")
        assert joint.find("limit").get("velocity") == "5"
        joint = sdf.find(f"joint[@name='{name}_joint']")
        assert float(joint.findtext("axis/limit/velocity")) == 5.0
    joint = sdf.find("joint[@name='left_rear_wheel_joint']")
    assert float(joint.findtext("axis/limit/velocity")) == pytest.approx(wheel)


def test_formats_without_rates_say_so(tub, exported):
    _, losses = exported
    told = "Limits of the rates of joints are left out{}: those of left_rocker, right_rocker."
    assert {told.format(" in MJCF"), told.format(" in USD")} <= set(losses)
    assert told.format("") in rig_losses(tub)
    assert not any("rates of joints" in loss for loss in rig_losses(rovers.morpheus()))


def test_rovers_of_before_load(tub):
    arrays: dict[str, np.ndarray] = {}
    plain = to_plain(tub, arrays)
    for link in plain["links"]:
        del link["rate_limit"]
    assert rates(from_plain(plain, arrays, Rover)) == {}
