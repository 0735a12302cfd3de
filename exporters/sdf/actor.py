"""A rover that replays a trajectory: an SDF actor with a script of waypoints."""

from __future__ import annotations

import numpy as np

from terrain_forge.base import Array
from terrain_forge.geometry import rover_mesh
from terrain_forge.model import Rover, Trajectory
from terrain_forge.paths import sample_times, spline_places
from terrain_forge.writers import Lines, element, leaves

from .model import Model, plain, solid


def replay_actor(
    trajectory: Trajectory, rover: Rover, *, name: str, model: Model, sensors: list[Lines]
) -> Lines:
    """An actor that moves `base_link` along the trajectory, looking like the rover at rest.

    Angles are continuous: Gazebo interpolates them as plain numbers, and a wrapped yaw would make
    the rover spin. Tension 0 makes its spline smooth; more would brake at each waypoint. The
    rover's meshes are those of the model (`write_rover_meshes`).
    """
    stops = []
    times, poses = waypoints(trajectory)
    for time, pose in zip(times.tolist(), poses.tolist(), strict=True):
        short = f"{time:.3f}"
        told = short if float(short) == time else repr(time)
        place = " ".join(f"{value + 0.0:.7f}" for value in pose)
        stops.append(f"<waypoint><time>{told}</time><pose>{place}</pose></waypoint>")
    path = element("trajectory", stops, id="0", type="drive", tension="0")
    loop = "true" if trajectory.closed else "false"
    script = element("script", *leaves(loop=loop, delay_start=0, auto_start="true"), path)
    link = element("link", *_visuals(rover, model), *sensors, name="base_link")
    return element("actor", script, link, name=name)


def waypoints(trajectory: Trajectory) -> tuple[Array, Array]:
    """The trajectory at its sample times, moved to whole milliseconds.

    gz-sim cuts times to milliseconds, so the poses are those of the moved times, and a time whose
    product with 1000 is a hair below its whole number is the next larger one. Where Gazebo's spline
    would leave the path there are more of them than samples.

    Returns:
        Times [s], shape [n], and x, y, z [m], roll, pitch, yaw [rad, continuous], shape [n, 6].
    """
    last = np.floor(trajectory.time[-1] * 1000 + 1e-6)
    wanted = sample_times(trajectory, spline_places)
    milliseconds = np.unique(np.minimum(np.rint(wanted * 1000), last))
    times = milliseconds / 1000
    times = np.where(np.floor(times * 1000) < milliseconds, np.nextafter(times, np.inf), times)
    poses = trajectory.at(times)
    return times, np.hstack([poses.position, poses.rpy])


def _visuals(rover: Rover, model: Model) -> list[Lines]:
    if not any(link.shapes for link in rover.links):
        box = element("geometry", element("box", *leaves(size="1 1 1")))
        pose = element("pose", "0 0 0.5 0 0 0")
        grey = plain((0.8, 0.8, 0.8), classic=model.classic)
        return [element("visual", pose, box, grey, name="box")]
    origins, visuals = rover.origins, []
    for index, link in enumerate(rover.links):
        for number, shape in enumerate(link.shapes):
            if not shape.visible:
                continue
            name = f"{link.name}_{number}"
            pose = element("pose", (*(origins[link.name] + shape.position), *shape.rpy))
            geometry = solid(shape, model.uri(f"meshes/{rover_mesh(index, number)}"))
            look = plain(shape.rgb, classic=model.classic)
            visuals.append(element("visual", pose, geometry, look, name=name))
    return visuals
