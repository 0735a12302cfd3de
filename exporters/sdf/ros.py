"""The folder as a ROS 2 package: manifest, build and launch files, bridge, and how to start it."""

from __future__ import annotations

from pathlib import Path
from xml.sax.saxutils import escape

from terrain_forge.model import Topic, World
from terrain_forge.writers import file_name, identifier

from .options import Options
from .sensors import rig_topics

_PACKAGE = """<?xml version="1.0"?>
<package format="3">
  <name>{package}</name>
  <version>1.0.0</version>
  <description>{title}: a world for Gazebo, made by terrain-forge</description>
  <maintainer email="nobody@example.org">the maintainers of this world</maintainer>
  <license>as its sources have it</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
{depends}
  <export>
    <build_type>ament_cmake</build_type>
    <gazebo_ros gazebo_model_path="${{prefix}}/models"/>
  </export>
</package>
"""

_CMAKE = """cmake_minimum_required(VERSION 3.8)
project({package} NONE)
find_package(ament_cmake REQUIRED)
install(DIRECTORY {folders} DESTINATION share/${{PROJECT_NAME}})
install(FILES world.sdf scene.sdf DESTINATION share/${{PROJECT_NAME}})
ament_package()
"""

_LAUNCH = {
    "gz": '''"""Starts Gazebo with the scene and, where it carries sensors, the bridge to ROS 2."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import AppendEnvironmentVariable, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch_ros.actions import Node


def generate_launch_description():
    """Gazebo and the bridge."""
    here = Path(get_package_share_directory("{package}"))
    gazebo = Path(get_package_share_directory("ros_gz_sim")) / "launch" / "gz_sim.launch.py"
    return LaunchDescription(
        [
            AppendEnvironmentVariable("GZ_SIM_RESOURCE_PATH", str(here / "models")),
            AppendEnvironmentVariable("IGN_GAZEBO_RESOURCE_PATH", str(here / "models")),
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(str(gazebo)),
                launch_arguments={{"gz_args": f"-r {{here / 'scene.sdf'}}"}}.items(),
            ),
            Node(
                package="ros_gz_bridge",
                executable="parameter_bridge",
                parameters=[{{"config_file": str(here / "config" / "bridge.yaml")}}],
            ),
        ]
    )
''',
    "classic": '''"""Starts Gazebo Classic with the scene."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import AppendEnvironmentVariable, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource


def generate_launch_description():
    """Gazebo Classic."""
    here = Path(get_package_share_directory("{package}"))
    gazebo = Path(get_package_share_directory("gazebo_ros")) / "launch" / "gazebo.launch.py"
    return LaunchDescription(
        [
            AppendEnvironmentVariable("GAZEBO_MODEL_PATH", str(here / "models")),
            IncludeLaunchDescription(
                PythonLaunchDescriptionSource(str(gazebo)),
                launch_arguments={{"world": str(here / "scene.sdf")}}.items(),
            ),
        ]
    )
''',
}

_NOTE = {
    "gz": """# {title}

A ROS 2 package. In a workspace's `src` folder:

```sh
colcon build --packages-select {package}
. install/setup.sh
ros2 launch {package} scene.launch.py
```

Without ROS, in this folder:

```sh
GZ_SIM_RESOURCE_PATH="$PWD/models" gz sim -r scene.sdf              # Garden and later
IGN_GAZEBO_RESOURCE_PATH="$PWD/models" ign gazebo -r scene.sdf      # Fortress
ros2 run ros_gz_bridge parameter_bridge --ros-args -p config_file:="$PWD/config/bridge.yaml"
```

`world.sdf` is the place alone; `scene.sdf` adds an actor per path{sensors}. The bridge's message
types are those of Garden and later; for Fortress write `ignition.msgs` for `gz.msgs`.
""",
    "classic": """# {title}

A ROS 2 package. In a workspace's `src` folder:

```sh
colcon build --packages-select {package}
. install/setup.sh
ros2 launch {package} scene.launch.py
```

Without ROS, in this folder:

```sh
GAZEBO_MODEL_PATH="$PWD/models" gazebo scene.sdf
```

`world.sdf` is the place alone; `scene.sdf` adds an actor per path{sensors}. Sensors are on Gazebo's
own topics (`gz topic -l`); plugins of gazebo_ros_pkgs, added to them, publish to ROS.
""",
}


def write_package(world: World, directory: Path, *, options: Options) -> None:
    """Write package.xml, CMakeLists.txt, launch file, README.md and, for gz-sim, the bridge.

    The package is named after the world and the folder, so that one workspace can hold several
    exports of a world.
    """
    flavour, title = options.flavour, world.site.name
    package = f"{identifier(title)}_{identifier(directory.absolute().name)}".lower()
    gz = flavour == "gz"
    depends = ("ros_gz_sim", "ros_gz_bridge") if gz else ("gazebo_ros",)
    names = {
        "package": package,
        "title": title if title.isprintable() else file_name(title),
        "folders": "models launch config" if gz else "models launch",
        "depends": "\n".join(f"  <exec_depend>{name}</exec_depend>" for name in depends),
        "sensors": " with the rover's sensors" if options.sensors and world.rover.sensors else "",
    }
    _write(directory / "package.xml", _PACKAGE.format(**names | {"title": escape(names["title"])}))
    _write(directory / "CMakeLists.txt", _CMAKE.format(**names))
    _write(directory / "launch/scene.launch.py", _LAUNCH[flavour].format(**names))
    _write(directory / "README.md", _NOTE[flavour].format(**names))
    if gz:
        _write(directory / "config/bridge.yaml", _bridge(world, options))


def _bridge(world: World, options: Options) -> str:
    """Configuration of ros_gz_bridge: the clock, and what the actors' sensors publish."""
    entries = [_entry(Topic("clock", "Clock", "Clock"), "rosgraph_msgs")]
    for trajectory in world.trajectories if options.sensors else ():
        actor = file_name(trajectory.name)
        entries += [_entry(topic, "sensor_msgs") for topic in rig_topics(world.rover, actor=actor)]
    return "".join(entries)


def _entry(topic: Topic, ros_package: str) -> str:
    return (
        f'- ros_topic_name: "/{topic.name}"\n'
        f'  gz_topic_name: "/{topic.name}"\n'
        f'  ros_type_name: "{ros_package}/msg/{topic.ros_type}"\n'
        f'  gz_type_name: "gz.msgs.{topic.gz_type}"\n'
        "  direction: GZ_TO_ROS\n"
    )


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8", newline="\n")
