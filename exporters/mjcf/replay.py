"""The paths: beads to look at, a mocap body that replays them, and the track that moves it."""

from __future__ import annotations

from io import StringIO

import numpy as np

from terrain_forge.base import Array
from terrain_forge.model import Trajectory

from .xml import element

_SITES = 400
_RGBA = (1.0, 0.85, 0.1, 0.6)
_COLUMNS = "time_s,x_m,y_m,z_m,qw,qx,qy,qz"


def path_sites(trajectory: Trajectory) -> list[str]:
    """Beads along a path, `<path>_<n>`, in a group of their own that a viewer can switch off."""
    count = min(_SITES, len(trajectory.time))
    beads = trajectory.position[np.linspace(0, len(trajectory.time) - 1, count).round().astype(int)]
    return [
        element("site", name=f"{trajectory.name}_{n}", pos=bead, size=0.02, group=2, rgba=_RGBA)
        for n, bead in enumerate(beads)
    ]


def replay_body(position: Array, quaternion: Array) -> str:
    """A mocap body that replays poses of base_link, whatever moves it."""
    marker = element("site", name="path_frame", type="box", size=(0.1, 0.02, 0.01), rgba=_RGBA)
    return element("body", [marker], name="path", mocap="true", pos=position, quat=quaternion)


def path_table(trajectory: Trajectory) -> bytes:
    """The track of the mocap body: a line per sample, time [s], `mocap_pos` and `mocap_quat`.

    Keyframes would hold it too, but each of them holds all of the model's joints as well.
    """
    samples = np.column_stack([trajectory.time, trajectory.position, trajectory.quaternion])
    text = StringIO()
    np.savetxt(text, samples, fmt="%.9f", delimiter=",", header=_COLUMNS, comments="")
    return text.getvalue().encode()
