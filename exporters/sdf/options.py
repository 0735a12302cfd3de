"""What can be chosen for an SDF export."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Interval

from terrain_forge.specs import NotNegative, Spec


@dataclass(frozen=True, kw_only=True)
class Options(Spec):
    """Options of the SDF export."""

    kind: Literal["sdf"] = "sdf"
    """The exporter, where the export's folder has another name."""
    flavour: Literal["gz", "classic"] = "gz"
    """`gz` writes SDF for Gazebo Fortress and later, `classic` SDF 1.6 for Gazebo 9 to 11."""
    release: Literal["fortress", "garden"] = "fortress"
    """The oldest gz-sim that shall read a `gz` world: `fortress` writes SDF 1.9, `garden` SDF 1.10,
    which knows other bodies than the Earth and so holds the site's longitude and latitude."""
    individual_min_m: NotNegative = 0.5
    """Rocks of at least this exposed diameter are visuals and collisions of their own, which share
    their shapes' meshes; smaller ones are merged into one mesh per tile and population, since each
    collision more slows every step of the physics. Loose rocks are never merged."""
    outline_error: Annotated[float, Interval(ge=0, le=0.5)] = 0.02
    """Largest error of a merged rock's outline, as a fraction of its size: how coarse it may be."""
    tile_cells: Annotated[int, Interval(ge=16, le=1024)] = 256
    """Cells of the ground's grid per mesh, each way."""
    ground: Literal["mesh", "heightmap"] = "mesh"
    """What the ground collides as: `mesh` is exact; `heightmap` is an image on a square grid, which
    is quicker to load and less exact. It is seen as a mesh either way."""
    heightmap_bits: Literal[8, 16] = 16
    """Bits of a heightmap's pixels. Fortress reads 8 right and misreads 16."""
    texture_pixels: Annotated[int, Interval(ge=1, le=8192)] = 1024
    """Pixels of the ground's textures along its longer side, all tiles together: as many for each
    node as that has room for, one at least."""
    normal_maps: bool = True
    """Whether the ground's textures get normal maps of soil and small stones; `gz` only, Classic
    has none."""
    friction: NotNegative = 0.7
    """Coulomb friction of ground and rocks."""
    sensors: bool = True
    """Whether the actors of scene.sdf carry the rover's cameras, lidar and IMU."""
    ros_package: bool = False
    """Whether the folder is a ROS 2 package too: package.xml, CMakeLists.txt, launch file, the
    configuration of the bridge to Gazebo's topics, and a note on how to start it."""
