"""The figures of Giubilato et al. 2020, to stand beside those of our worlds of the same paths."""

from __future__ import annotations

from dataclasses import dataclass

from terrain_forge.base import Record

SETUP = (
    "paper: Giubilato et al. 2020, one run each, cameras 1280 x 720 at 30 Hz 0.12 m apart, lidar "
    "64 x 1800 of +-16 deg at 10 Hz, TDr as its tables' captions say the median"
)
"""What the paper's figures are of."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PaperFigure(Record):
    """What the paper tells of a system on one of its two paths."""

    system: str
    """The paper's system."""
    ate: float
    """Absolute trajectory error, root mean square [m]."""
    drift: float
    """Drift of the path's length over 10 m, a part of it."""


PAPER_SYSTEMS = {
    "orb-slam2": ("ORB-SLAM2", ""),
    "rtab-map": ("RTAB-Map", ""),
    "libviso2": ("LibVISO2", ""),
    "a-loam": ("A-LOAM", ""),
    "hdl-graph-slam": ("HDL", ""),
    "lego-loam": ("LeGO-LOAM", ""),
    "orb-slam3": ("ORB-SLAM2", "its stereo mode is the older one's"),
    "loam": ("A-LOAM", "another implementation of the same method"),
}
"""The paper's system that one of ours is, or stands for, and then why it may."""
PAPER_TABLES = {
    "gale-long": {
        "ORB-SLAM2": (0.48, 6.31), "RTAB-Map": (0.14, 0.43), "LibVISO2": (1.56, 0.34),
        "A-LOAM": (0.76, 0.81), "HDL": (34.29, 60.3), "LeGO-LOAM": (0.21, 0.47),
    },
    "gale-short": {
        "ORB-SLAM2": (0.07, 1.91), "RTAB-Map": (0.04, 0.62), "LibVISO2": (0.39, 0.55),
        "A-LOAM": (7.65, 7.58), "HDL": (2.49, 13.1), "LeGO-LOAM": (0.63, 2.89),
    },
}  # fmt: skip
"""Tables II and III: ATE [m] and TDr [%]."""
PAPER_LENGTHS = {"gale-long": 300.0, "gale-short": 60.0}
"""About how long the paper's paths are [m]."""


def table_of(world: str) -> str:
    """The key in `PAPER_TABLES` of a world of that name, whether there is one or not."""
    return world.replace("_", "-")


def paper_figure(system: str, world: str) -> PaperFigure | None:
    """The paper's figure of a system, or of that which it stands for, if the world has its path."""
    name = PAPER_SYSTEMS.get(system, ("", ""))[0]
    told = PAPER_TABLES.get(table_of(world), {}).get(name)
    return told and PaperFigure(system=name, ate=told[0], drift=told[1] / 100.0)
