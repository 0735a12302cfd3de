"""The SDF scene, read without Gazebo: the actor, its sensors, the package for ROS."""

import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
import trimesh
from ruamel.yaml import YAML

from terrain_forge.base import srgb_from_linear
from terrain_forge.geometry import light_levels
from terrain_forge.model import simple_sensors
from tests.helpers import rovers
from tests.helpers.rovers import morpheus
from tests.helpers.sdf_files import actor_sensors, exported, numbers, waypoints, winding


def test_the_actor_is_the_trajectory_at_whole_milliseconds(small_world, sdf):
    actor = ET.parse(sdf / "scene.sdf").getroot().find("world/actor")
    assert actor.get("name") == "arc"
    times, poses = waypoints(actor)
    trajectory = small_world.trajectories[0]
    milliseconds = np.array(times, float) * 1000
    assert np.abs(milliseconds - np.rint(milliseconds)).max() < 1e-9
    assert (milliseconds.astype(int) == np.rint(milliseconds)).all()  # as gz-sim cuts them
    away = np.abs(np.array(times, float)[:, None] - trajectory.time).min(axis=0)
    assert away.max() < 0.001
    wanted = trajectory.at(np.array(times, float))
    assert np.abs(poses[:, :3] - wanted.position).max() < 1e-7
    assert np.abs(poses[:, 3:] - wanted.rpy).max() < 1e-7


def test_yaw_is_continuous_over_many_rounds(small_world, tmp_path):
    world = small_world.replace(trajectories=(winding(),))
    directory = exported(world, tmp_path / "sdf")
    actor = ET.parse(directory / "scene.sdf").getroot().find("world/actor")
    _, poses = waypoints(actor)
    assert np.abs(np.diff(poses[:, 5])).max() < 0.1
    assert poses[-1, 5] - poses[0, 5] > 18
    assert actor.findtext("script/loop") == "true"
    assert 0 <= float(actor.find("script/trajectory").get("tension")) <= 1


def test_actors_show_the_meshes_of_a_custom_rover(small_world, tmp_path):
    rover = rovers.read(rovers.rocker_urdf(tmp_path))
    directory = exported(small_world.replace(rover=rover), tmp_path / "sdf")
    link = ET.parse(directory / "scene.sdf").getroot().find("world/actor/link")
    shown = {visual.get("name"): visual for visual in link.iter("visual")}
    places, found = rovers.origins(rover), 0
    for part in rover.links:
        for number, shape in enumerate(part.shapes):
            if shape.mesh is None or not shape.visible:
                continue
            visual = shown[f"{part.name}_{number}"]
            pose = np.array(visual.findtext("pose").split(), float)
            np.testing.assert_allclose(pose[:3], places[part.name] + shape.position, atol=1e-6)
            np.testing.assert_allclose(pose[3:], shape.rpy, atol=1e-6)
            file = visual.findtext("geometry/mesh/uri").removeprefix("model://")
            mesh = trimesh.load(directory / "models" / file, process=False)
            assert len(mesh.faces) == len(shape.mesh.faces)
            np.testing.assert_allclose(mesh.bounds[1] - mesh.bounds[0], shape.size, atol=1e-5)
            found += 1
    assert found == 4


@pytest.fixture(scope="module")
def roving(small_world):
    return small_world.replace(rover=morpheus())


def test_the_actor_carries_the_rovers_sensors(roving, tmp_path):
    found = actor_sensors(exported(roving, tmp_path / "sdf"))
    kinds = {"camera": "camera", "lidar": "gpu_lidar", "imu": "imu"}
    sensors = simple_sensors(roving.rover.sensors)
    assert list(found) == [sensor.name for sensor in sensors]
    for sensor in sensors:
        written = found[sensor.name]
        assert written.get("type") == kinds[sensor.kind]
        assert float(written.findtext("update_rate")) == sensor.rate_hz
        wanted = np.hstack([sensor.position, sensor.rpy])
        assert np.allclose(numbers(written.find("pose")), wanted, atol=1e-8)
    left, right = (numbers(found[f"camera_{side}"].find("pose")) for side in ("left", "right"))
    assert left[1] - right[1] == pytest.approx(0.12)
    topics = [sensor.findtext("topic") for sensor in found.values()]
    # gz-sim puts camera_info beside the image: two images in one place would share it
    assert len({topic.rsplit("/", 1)[0] for topic in topics[:2]}) == 2


def test_noise_is_per_sample_not_a_density(roving, tmp_path):
    """At 200 Hz an ADIS16448 has 0.00239964 rad/s and 0.0282843 m/s² per sample."""
    found = actor_sensors(exported(roving, tmp_path / "sdf"))
    for tag, wanted in (("angular_velocity", 0.00239964), ("linear_acceleration", 0.0282843)):
        for axis in "xyz":
            noise = found["imu"].find(f"imu/{tag}/{axis}/noise")
            assert noise.get("type") == "gaussian"
            assert float(noise.findtext("stddev")) == pytest.approx(wanted, rel=1e-5)
            assert float(noise.findtext("dynamic_bias_stddev")) > 0
    assert float(found["lidar"].findtext("lidar/noise/stddev")) == 0.015
    # Electrons are counted with noise √n: at half of a well of 10,000, read with 6 more, 0.0071.
    noise = float(found["camera_left"].findtext("camera/noise/stddev"))
    assert noise == pytest.approx(np.sqrt(5000 + 36) / 10_000, rel=1e-6)


def test_the_lidar_turns_once_and_looks_up_and_down(roving, tmp_path):
    scan = actor_sensors(exported(roving, tmp_path / "sdf"))["lidar"].find("lidar/scan")
    low, high, count = (
        float(scan.findtext(f"horizontal/{tag}")) for tag in ("min_angle", "max_angle", "samples")
    )
    assert (high - low) * count / (count - 1) == pytest.approx(2 * np.pi)
    low, high = (float(scan.findtext(f"vertical/{tag}")) for tag in ("min_angle", "max_angle"))
    assert np.degrees([low, high]) == pytest.approx([-15, 15])


def test_classic_has_a_multicamera_and_rays(roving, tmp_path):
    found = actor_sensors(exported(roving, tmp_path / "sdf", flavour="classic"))
    types = {name: sensor.get("type") for name, sensor in found.items()}
    assert types == {"cameras": "multicamera", "lidar": "ray", "imu": "imu"}
    places = [numbers(camera.find("pose")) for camera in found["cameras"].iter("camera")]
    cameras = simple_sensors(roving.rover.sensors)[:2]
    assert np.allclose(places, [np.hstack([c.position, c.rpy]) for c in cameras], atol=1e-8)


@pytest.mark.parametrize("sensors", [True, False])
def test_worlds_name_their_systems(roving, tmp_path, sensors):
    """gz-sim adds none where a rover that somebody includes brings any: nothing would fall."""
    directory = exported(roving, tmp_path / "sdf", sensors=sensors)
    for file in ("world.sdf", "scene.sdf"):
        plugins = ET.parse(directory / file).getroot().findall("world/plugin")
        names = [plugin.get("name").removeprefix("gz::sim::systems::") for plugin in plugins]
        assert names == ["Physics", "UserCommands", "SceneBroadcaster", "Sensors", "Imu"]
    assert bool(actor_sensors(directory)) == sensors


def test_classic_has_systems_of_its_own(roving, tmp_path):
    directory = exported(roving, tmp_path / "sdf", flavour="classic")
    assert ET.parse(directory / "scene.sdf").getroot().find("world/plugin") is None


@pytest.mark.parametrize("flavour", ["gz", "classic"])
def test_the_ros_package_installs_what_it_starts(roving, tmp_path, flavour):
    world = roving.replace(site=roving.site.replace(name="Gale <2> & Söhne"))
    directory = exported(world, tmp_path / "sdf", flavour=flavour, ros_package=True)
    manifest = ET.parse(directory / "package.xml").getroot()
    package = manifest.findtext("name")
    assert re.fullmatch("[a-z][a-z0-9_]*", package)
    exports = manifest.find("export/gazebo_ros").get("gazebo_model_path")
    assert (directory / exports.replace("${prefix}/", "")).is_dir()
    cmake = (directory / "CMakeLists.txt").read_text()
    assert f"project({package} NONE)" in cmake
    for name in re.search(r"DIRECTORY ([\w ]+) DEST", cmake)[1].split():
        assert (directory / name).is_dir()
    for name in re.search(r"FILES ([\w. ]+) DEST", cmake)[1].split():
        assert (directory / name).is_file()
    launch = (directory / "launch/scene.launch.py").read_text()
    compile(launch, "scene.launch.py", "exec")
    assert f'"{package}"' in launch
    assert "Söhne" in (directory / "README.md").read_text(encoding="utf-8")


def test_the_bridge_knows_every_topic_of_the_scene(roving, tmp_path):
    directory = exported(roving, tmp_path / "sdf", ros_package=True)
    entries = YAML(typ="safe").load(directory / "config/bridge.yaml")
    bridged = {entry["gz_topic_name"] for entry in entries}
    for name, sensor in actor_sensors(directory).items():
        topic = "/" + sensor.findtext("topic")
        assert (topic if name != "lidar" else f"{topic}/points") in bridged
        if sensor.get("type") == "camera":
            assert f"{topic.rsplit('/', 1)[0]}/camera_info" in bridged
    assert {entry["direction"] for entry in entries} == {"GZ_TO_ROS"}
    plain = exported(roving, tmp_path / "plain")
    assert {path.name for path in plain.iterdir()} == {"world.sdf", "scene.sdf", "models"}


def shown(channels):
    """The sRGB that gz-sim shows for a colour of a file, which it takes for linear light."""
    return srgb_from_linear(np.array([float(n) for n in channels.split()][:3]))


def test_gz_shows_colours_as_they_are(small_world, tmp_path):
    """It encodes what it shows, textures are decoded before: without that rocks were white."""
    world = small_world.replace(rover=morpheus())
    gz, classic = (exported(world, tmp_path / k, flavour=k) for k in ("gz", "classic"))
    scenes = [ET.parse(folder / "scene.sdf").getroot() for folder in (gz, classic)]
    rocks = [
        ET.parse(folder / "models/by-hand_rocks/model.sdf").getroot() for folder in (gz, classic)
    ]
    for new, old in (scenes, rocks):
        plain = {v.get("name"): v for v in new.iter("visual") if v.find("material/pbr") is None}
        assert plain
        for visual in old.iter("visual"):
            if visual.get("name") in plain:
                told = plain[visual.get("name")].findtext("material/diffuse")
                wanted = numbers(visual.find("material/diffuse"))[:3]
                assert shown(told) == pytest.approx(wanted, abs=1e-6)
    seen = scenes[0].findtext("world/plugin/background_color")
    assert seen == scenes[0].findtext("world/scene/background")
    wanted = numbers(scenes[1].find("world/scene/background"))[:3]
    assert shown(seen) == pytest.approx(wanted, abs=1e-6)


@pytest.mark.parametrize("sky", [(0.0, 0.0, 0.0), (0.78, 0.5, 0.4)])
def test_level_ground_is_lit_for_display_in_gz(small_world, tmp_path, sky):
    """The Sun as in other formats; ambient light, which gz-sim divides by π, within its limit."""
    world = small_world.replace(lighting=small_world.lighting.replace(dust=None, sky_rgb=sky))
    scene = ET.parse(exported(world, tmp_path / "sdf") / "scene.sdf").getroot()
    light, levels = scene.find("world/light"), light_levels(world, "display")
    assert float(light.findtext("intensity")) == pytest.approx(levels.sun / np.pi)
    ambient = numbers(scene.find("world/scene/ambient"))[:3]
    wanted = np.pi * np.maximum(levels.sky * np.array(sky), 0.05)
    assert ambient == pytest.approx(wanted / max(wanted.max(), 1.0))
