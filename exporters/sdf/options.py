"""What can be chosen for an SDF export."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import Interval

from terrain_forge.base import Idle, NearPath, NotNegative, RecipeError, Spec

_VERSIONS = {"classic": "1.6", "fortress": "1.9", "garden": "1.10"}


@dataclass(frozen=True, kw_only=True)
class Options(Spec):
    """Options of the SDF export."""

    whole_only: ClassVar[tuple[str, ...]] = (
        *("flavour", "tile_cells", "ground"),
        *("sensors", "ros_package"),
    )
    """Which a site in tiles has not."""
    kind: Literal["sdf"] = "sdf"
    """The exporter, where the export's folder has another name."""
    flavour: Literal["gz", "classic"] = "gz"
    """`gz` writes SDF for Gazebo Fortress and later, `classic` SDF 1.6 for Gazebo 9 to 11."""
    release: Literal["fortress", "garden"] | None = None
    """The oldest gz-sim that shall read a `gz` world: `fortress` writes SDF 1.9, `garden` SDF 1.10,
    which knows other bodies than the Earth and so holds the site's longitude and latitude. By
    default `fortress`."""
    mesh_format: Literal["glb", "obj"] | None = None
    """Of the ground, as it is seen and felt: `glb` is binary, a fifth as large, and makes merged
    rocks half as large too, but Fortress and Classic cannot read it; by default `glb` for `garden`,
    else `obj`, with the merged rocks as STL."""
    individual_min_m: NotNegative = 0.5
    """Rocks of at least this exposed diameter are visuals and collisions of their own, which share
    their shapes' meshes; smaller ones are merged into one mesh per tile and population, since each
    collision more slows every step of the physics. Dynamic rocks are never merged."""
    outline_error: Annotated[float, Interval(ge=0, le=0.5)] = 0.02
    """Largest error of a merged rock's outline, as a fraction of its size: how coarse it may be."""
    close_within_m: NearPath = 0.0
    """How far from a path single rocks of at least 0.25 m are drawn by the finer meshes of their
    shapes that a camera at 1 m asks for, at most [m]; 0 for none."""
    tile_cells: Annotated[int, Interval(ge=16, le=1024)] = 256
    """Cells of the ground's grid per mesh, each way."""
    ground: Literal["mesh", "heightmap"] = "mesh"
    """What the ground collides as: `mesh` is exact; `heightmap` is an image on a square grid, which
    is quicker to load and less exact. It is seen as a mesh either way."""
    heightmap_bits: Literal[8, 16] | None = None
    """Bits of a heightmap's pixels, by default as many as its readers take: 16 for `garden`, else
    8, which are steps of the ground's range / 255. Fortress and Classic misread 16."""
    texture_pixels: Annotated[int, Interval(ge=1, le=8192)] = 1024
    """Pixels of the ground's textures along its longer side, all tiles together: as many for each
    node as that has room for, one at least."""
    horizon: bool = True
    """Whether what lies beyond the border is in it, out to the horizon; visual-only."""
    normal_maps: bool = True
    """Whether ground and rocks get normal maps of what is finer than they are; `gz` only, Classic
    has none."""
    surface: Literal["regolith", "bedrock"] = "regolith"
    """What the ground is: its friction is that of the world's body (docs/driving.md)."""
    friction: NotNegative | None = None
    """Coulomb friction of ground and static rocks; without it each has its own, by body and
    surface. Dynamic rocks keep what they were settled with."""
    sensors: bool = True
    """Whether the actors of scene.sdf carry the rover's cameras, lidar and IMU."""
    ros_package: bool = False
    """Whether the folder is a ROS 2 package too: package.xml, CMakeLists.txt, launch file, the
    configuration of the bridge to Gazebo's topics, and a note on how to start it."""

    @property
    def version(self) -> str:
        """Version of SDF."""
        return _VERSIONS["classic" if self.flavour == "classic" else self.release or "fortress"]

    @property
    def binary(self) -> bool:
        """Whether the meshes of ground and merged rocks are GLB."""
        return (self.mesh_format or ("glb" if self.release == "garden" else "obj")) == "glb"

    @property
    def bytes_each(self) -> tuple[float, float]:
        """About how many bytes it writes for each node of the ground and each rock."""
        return (25, 6000) if self.binary else (161, 8800)

    @property
    def grey_bits(self) -> int:
        """Bits of a heightmap's pixels."""
        return self.heightmap_bits or (16 if self.release == "garden" else 8)

    def idle(self) -> Iterator[Idle]:
        """What has no effect beside other options."""
        if self.flavour == "classic":
            yield Idle("release", "it is of gz-sim, here the flavour is classic", refused=True)
            yield Idle("normal_maps", "Gazebo Classic has none")
        if self.ground == "mesh":
            why = "the ground is a mesh; choose ground: heightmap"
            yield Idle("heightmap_bits", why, refused=True)
        if self.friction is not None:
            yield Idle("surface", "friction is given")

    def __post_init__(self) -> None:
        self.refuse_idle()
        if self.binary and self.release != "garden":
            raise RecipeError(
                "Gazebo Fortress and Classic read no GLB; choose mesh_format: obj, or for newer "
                "ones release: garden",
                key=("mesh_format",),
            )
        if self.grey_bits == 16 and self.release != "garden":
            raise RecipeError(
                "16 bits are misread by Gazebo Fortress (as heights of 0 to 1 m) and by Classic; "
                "choose heightmap_bits: 8, or for newer ones release: garden",
                key=("heightmap_bits",),
            )
