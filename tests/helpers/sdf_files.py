"""What SDF files of an export say."""

import xml.etree.ElementTree as ET
from functools import partial

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from terrain_forge.model import Trajectory
from tests.helpers import exports

exported = partial(exports.exported, "sdf")


def numbers(element):
    return np.array(element.text.split(), float)


def models(directory):
    return {
        path.parent.name: ET.parse(path).getroot().find("model")
        for path in sorted(directory.glob("models/*/model.sdf"))
    }


def file_of(directory, uri):
    return directory / "models" / uri.removeprefix("model://")


def meshes(directory, model, kind, file_of=file_of):
    """Name, vertices in the model's frame and faces of a model's visuals or collisions."""
    for part in model.iter(kind):
        mesh = part.find("geometry/mesh")
        read = trimesh.load(file_of(directory, mesh.findtext("uri")), force="mesh", process=False)
        vertices = read.vertices * (numbers(s) if (s := mesh.find("scale")) is not None else 1)
        if (pose := part.find("pose")) is not None:
            turn = Rotation.from_euler("xyz", numbers(pose)[3:])
            vertices = turn.apply(vertices) + numbers(pose)[:3]
        yield part.get("name"), vertices, read.faces


def waypoints(actor):
    stops = list(actor.iter("waypoint"))
    times = [stop.findtext("time") for stop in stops]
    return times, np.array([numbers(stop.find("pose")) for stop in stops])


def winding():
    """Three rounds of a circle at 0.4 m/s, sampled at 12 Hz."""
    time = np.arange(0, 190, 1 / 12)
    angle = 0.1 * time
    position = np.stack([4 * np.cos(angle), 4 * np.sin(angle), 0.1 * np.sin(3 * angle)], -1)
    rpy = np.stack([0.05 * np.sin(angle), 0.04 * np.cos(2 * angle), angle + np.pi / 2], -1)
    return Trajectory(name="rounds", time=time, position=position, rpy=rpy, closed=True)


def actor_sensors(directory):
    sensors = ET.parse(directory / "scene.sdf").getroot().iter("sensor")
    return {sensor.get("name"): sensor for sensor in sensors}
