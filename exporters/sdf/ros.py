"""The folder as a ROS 2 package: manifest, build and launch files, bridge, and how to start it.

Their texts are the files of `ros_package`, with names in braces.
"""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from xml.sax.saxutils import escape

from terrain_forge.model import Topic, World
from terrain_forge.writers import file_name, identifier

from .options import Options
from .sensors import rig_topics


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
    for path, form in {
        "package.xml": "package.xml",
        "CMakeLists.txt": "CMakeLists.txt",
        "launch/scene.launch.py": f"{flavour}.launch.py",
        "README.md": f"{flavour}.README.md",
    }.items():
        text = (files(__package__) / "ros_package" / f"{form}.in").read_text(encoding="utf-8")
        own = {"title": escape(names["title"])} if form == "package.xml" else {}
        _write(directory / path, text.format(**names | own))
    if gz:
        _write(directory / "config/bridge.yaml", _bridge(world, options))


def _bridge(world: World, options: Options) -> str:
    """Configuration of ros_gz_bridge: the clock, and what the actors' sensors publish."""
    topics = [(Topic("clock", "Clock", "Clock"), "rosgraph_msgs")]
    for trajectory in world.trajectories if options.sensors else ():
        actor = file_name(trajectory.name)
        topics += [(topic, "sensor_msgs") for topic in rig_topics(world.rover, actor=actor)]
    return "".join(
        f'- ros_topic_name: "/{topic.name}"\n'
        f'  gz_topic_name: "/{topic.name}"\n'
        f'  ros_type_name: "{package}/msg/{topic.ros_type}"\n'
        f'  gz_type_name: "gz.msgs.{topic.gz_type}"\n'
        "  direction: GZ_TO_ROS\n"
        for topic, package in topics
    )


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8", newline="\n")
