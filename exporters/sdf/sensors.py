"""The rover's sensors on an actor or a model, as each kind describes itself."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from terrain_forge.model import Rover, Sensor, Topic, figures_lost, simple_sensors, titles
from terrain_forge.writers import Lines, element, identifier, leaves

_FAR = 300.0
"""What a camera sees at least [m]."""


def rig_sensors(
    rover: Rover, *, actor: str, classic: bool = False, reach: float = 0.0
) -> list[Lines]:
    """The `<sensor>` elements of a rover's rig, in the frame of base_link; cameras first.

    In Gazebo Classic the cameras are one multicamera, which takes their images at the same moment.
    The topics hold the actor's name; cameras see as far as the world is large, `reach` [m].
    """
    origins = rover.origins
    cameras: list[Lines] = []
    others: list[Lines] = []
    lenses: list[Lines] = []
    for sensor in simple_sensors(rover.sensors):
        told = sensor.sdf(classic=classic, far=max(_FAR, reach))
        if told is None:
            continue
        kind, content = told
        pose = element("pose", (*(origins[sensor.link] + sensor.position), *sensor.rpy))
        if classic and kind == "camera":
            lens = _children(content["camera"])
            lenses.append(element("camera", pose, *lens, name=sensor.name))
            cameras = [_sensor("cameras", "multicamera", sensor.rate_hz, lenses)]
            continue
        address = element("topic", f"{_topic(actor, sensor)}{sensor.sdf_topic}")
        parts = [pose, *([] if classic else [address]), *_children(content)]
        group = cameras if kind == "camera" else others
        group.append(_sensor(sensor.name, kind, sensor.rate_hz, parts))
    return cameras + others


def rig_topics(rover: Rover, *, actor: str) -> list[Topic]:
    """What the sensors of an actor publish in gz-sim."""
    return [
        topic._replace(name="/".join(filter(None, (_topic(actor, sensor), topic.name))))
        for sensor in simple_sensors(rover.sensors)
        for topic in sensor.topics
    ]


def rig_losses(rover: Rover) -> list[str]:
    """What SDF does not say of a rig."""
    known: dict[bool, list[Sensor]] = {False: [], True: []}
    for sensor in simple_sensors(rover.sensors):
        known[sensor.sdf(classic=False, far=_FAR) is not None].append(sensor)
    left_out = (
        f"SDF has no sensor for the rover's {name}: it is left out."
        for name in titles(known[False])
    )
    return [*left_out, *figures_lost(known[True], "sdf")]


def _topic(actor: str, sensor: Sensor) -> str:
    return f"{identifier(actor)}/{identifier(sensor.name)}"


def _sensor(name: str, kind: str, rate: float, content: list[Lines]) -> Lines:
    return element("sensor", *leaves(update_rate=rate), *content, name=name, type=kind)


def _children(content: Mapping[str, Any]) -> list[Lines]:
    """The elements of a mapping, as `Sensor.sdf` describes them."""
    elements = []
    for tag, value in content.items():
        if isinstance(value, Mapping):
            own = {key[1:]: text for key, text in value.items() if key[0] == "@"}
            elements.append(element(tag, *_children(value), **own))
        elif tag[0] != "@":
            elements.append(element(tag, value))
    return elements
