"""Rovers and kinds of sensors from another package: files and a module that entry points name."""

from __future__ import annotations

import io
import json
import logging
import xml.etree.ElementTree as ET

import pytest

from terrain_forge.rovers import built_in_rovers
from tests.helpers.command_line import run
from tests.helpers.plugins import fresh, install

RECIPE = """
schema: 1
name: plugged
body: moon
horizon: {reach_m: 0}
dtm: {kind: flat, size_m: [6, 4]}
terrain: {spacing_m: 0.1}
rocks: {library: {shapes: 1}}
paths: [{name: ahead, speed_m_s: 0.3, route: {kind: polyline, points_m: [[-1, 0], [1, 0]]}}]
rover: ROVER
exports: [rover, sdf, mjcf, usd]
"""
SENSORS = """
  - {name: depth, kind: radar, position_m: [0, 0, "${clearance_m}"], reach: 7}
  - {name: nose, kind: sniffer, position_m: [0.4, 0, 0.3]}
"""
KINDS = '''
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

from terrain_forge.model import Sensor, Topic


@dataclass(frozen=True, kw_only=True, eq=False)
class RadarSensor(Sensor):
    """A radar altimeter, which SDF and MuJoCo know."""

    kind: Literal["radar"] = "radar"
    """A radar."""
    title: ClassVar[str] = "radar"
    topics: ClassVar[tuple[Topic, ...]] = (Topic("", "Altimeter", "Altimeter"),)
    mjcf: ClassVar[tuple[str, ...]] = ("rangefinder",)
    rate_hz: float = 5.0
    """Hz."""
    reach: float = 9.0
    """m."""

    def sdf(self, *, classic, far):
        return "altimeter", {"altimeter": {"@version": "1", "reach": self.reach}}


@dataclass(frozen=True, kw_only=True, eq=False)
class SnifferSensor(Sensor):
    """What no format knows."""

    kind: Literal["sniffer"] = "sniffer"
    """A nose."""
    title: ClassVar[str] = "odour sensor"
    rate_hz: float = 1.0
    """Hz."""
'''
CART = """<robot name="whatever">
  <link name="chassis">
    <inertial><mass value="8"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><box size="0.6 0.3 0.1"/></geometry></collision>
  </link>
  {}
</robot>"""
WHEEL = """<link name="wheel_{n}">
    <inertial>
      <mass value="1"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <collision>
      <origin rpy="1.5708 0 0"/><geometry><cylinder radius="0.2" length="0.1"/></geometry>
    </collision>
  </link>
  <joint name="axle_{n}" type="continuous">
    <parent link="chassis"/><child link="wheel_{n}"/><origin xyz="{x} {y} 0"/><axis xyz="0 1 0"/>
  </joint>"""
POINTS = """[terrain_forge.rovers]
fleet = fleet
[terrain_forge.sensor_kinds]
fleet = fleet_sensors
broken = no_such_module
"""


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A folder with a package of rovers and a module of sensors, as pip would install them."""
    skid4 = built_in_rovers()["skid4"].FILE
    description = skid4.with_suffix(".yaml").read_text().rstrip() + SENSORS
    places = [("fl", 0.2, 0.3), ("fr", 0.2, -0.3), ("rl", -0.2, 0.3), ("rr", -0.2, -0.3)]
    cart = CART.format("".join(WHEEL.format(n=n, x=x, y=y) for n, x, y in places))
    told = "sensors: [{name: a, kind: %s, link: %s, position_m: [0, 0, 1]}]\n"
    files = {
        "__init__.py": "",
        "tank.xacro": skid4.read_text(),
        "tank.yaml": description.replace("default: 0.165", "default: 0.18"),
        "skid4.xacro": "<robot/>",
        "cart.urdf": cart,
        "smelly.urdf": cart,
        "smelly.yaml": told % ("snifer", "base_link"),
        "handy.urdf": cart,
        "handy.yaml": told % ("sniffer", "arm"),
        "wide.urdf": cart,
        "wide.yaml": told % ("camera", "base_link, width: 64"),
        "steep.urdf": cart,
        "steep.yaml": "reading: {tilt_limit: 30}\n",
        "crooked.urdf": "<robot/>",
        "crooked.yaml": "wings: 2\n",
    }
    modules = {"fleet_sensors.py": KINDS} | {f"fleet/{name}": text for name, text in files.items()}
    return install(tmp_path_factory.mktemp("site"), "fleet", POINTS, modules)


def build(folder, rover):
    (folder / "plugged.yaml").write_text(RECIPE.replace("ROVER", rover))
    return run("build", folder / "plugged.yaml", "-o", folder / "o")


@pytest.fixture(scope="module")
def built(site, tmp_path_factory):
    folder = tmp_path_factory.mktemp("tank")
    told = logging.StreamHandler(io.StringIO())  # what is skipped may be told on the first import
    logging.getLogger().addHandler(told)
    with fresh(site, anew=True):
        done = build(folder, "{kind: tank, dimensions: {track_m: 0.7}}")
    logging.getLogger().removeHandler(told)
    assert done.returncode == 0, done.stderr
    return folder / "o", told.stream.getvalue()


def test_a_copied_file_is_a_rover_with_options(built):
    out, warnings = built
    robot = ET.parse(out / "rover" / "tank.urdf").getroot()
    assert robot.get("name") == "tank"
    joint = robot.find("joint[@name='wheel_front_left_joint']/origin")
    assert [float(number) for number in joint.get("xyz").split()] == [0.26, 0.35, 0.18]
    assert (out / "rover" / "tank.xml").is_file()
    assert "skid4.xacro is skipped: there is one of that name" in warnings
    assert "crooked.urdf is skipped: crooked.yaml" in warnings
    assert "sensor kind 'broken' (no_such_module) is skipped" in warnings


def test_a_new_kind_of_sensor_is_in_every_format_or_told_as_a_loss(built):
    out, _ = built
    scene = ET.parse(out / "sdf" / "scene.sdf").getroot()
    radar = next(sensor for sensor in scene.iter("sensor") if sensor.get("name") == "depth")
    assert (radar.get("type"), radar.findtext("update_rate")) == ("altimeter", "5")
    assert radar.find("altimeter").get("version") == "1"
    assert radar.findtext("altimeter/reach") == "7"
    model = ET.parse(out / "rover" / "tank.xml").getroot()
    assert model.find("sensor/rangefinder[@name='depth_rangefinder']").get("site") == "depth"
    assert model.find(".//site[@name='nose']") is not None
    stage = (out / "rover" / "tank.usda").read_text()
    assert 'string kind = "radar"' in stage
    losses = {
        folder: export["losses"]
        for folder, export in json.loads((out / "manifest.json").read_text())["exports"].items()
    }
    left_out = "SDF has no sensor for the rover's odour sensor: it is left out."
    frames = "Lidar, IMU, radar and odour sensor are bare frames: no USD schema holds their"
    assert left_out in losses["sdf"]
    assert left_out in losses["rover"]
    assert any(loss.startswith(frames) for loss in losses["usd"])
    assert (
        "An odour sensor is a bare site; its figures are not part of the model." in losses["mjcf"]
    )


def test_a_saved_world_brings_its_sensors_back(site, built):
    with fresh(site):
        import terrain_forge as tf

        *_, radar, sniffer = tf.World.load(built[0]).rover.sensors
        assert (radar.kind, radar.figures) == ("radar", {"rate_hz": 5.0, "reach": 7.0})
        assert (sniffer.kind, sniffer.figures) == ("sniffer", {"rate_hz": 1.0})


def test_a_bare_urdf_is_a_rover_too(site):
    with fresh(site):
        from terrain_forge.rovers import find_rover

        wheels = {wheel.link for wheel in find_rover("cart").wheels}
    assert wheels == {f"wheel_{name}" for name in ("fl", "fr", "rl", "rr")}


WRONG = {
    "tnak": "unknown rover 'tnak' (did you mean 'tank'?), known: cart, handy, morpheus,",
    "{kind: tnak}": "whose kind is cart, handy, morpheus, skid4, smelly, steep, tank, wide or file",
    "{kind: tank, dimensions: {wheelbase_m: 0.3}}": "must be more than two wheel radii",
    "{kind: tank, dimensions: {wheelbase: 0.3}}": "did you mean 'wheelbase_m'?",
    "smelly": "smelly.yaml: unknown kind of sensor 'snifer', there are: camera, imu,",
    "wide": "wide.yaml: sensors[0].width: unknown key 'width'",
    "steep": "steep.yaml: reading.tilt_limit: unknown key 'tilt_limit'",
    "handy": "handy.yaml: a sensor sits on 'arm', which is no link of the rover",
    "{kind: cart, dimensions: {wheelbase_m: 0.3}}": "unknown key 'dimensions'",
}


def test_what_it_cannot_be_is_refused(site, tmp_path):
    with fresh(site):
        for rover, told in WRONG.items():
            done = build(tmp_path, rover)
            assert done.returncode == 2, rover
            assert told in done.stderr
