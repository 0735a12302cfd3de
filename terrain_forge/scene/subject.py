"""What the renderer shows: ground, instances of meshes, tracks and light, of a world or made up."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terrain_forge.base import Array, Record, Rows, shaped
from terrain_forge.model import (
    CLOSE_MIN_M,
    USUAL,
    Heightfield,
    Horizon,
    Lighting,
    Mesh,
    Photometry,
    RockField,
    World,
    merge,
    rotations,
)
from terrain_forge.scene.rock_tile import no_tile, rock_tile
from terrain_forge.scene.tints import rock_colours


@dataclass(frozen=True, kw_only=True, eq=False)
class Instances(Rows):
    """Copies of meshes, each with a pose, a size and a colour."""

    meshes: tuple[Mesh, ...]
    """The meshes, in frames of their own."""
    mesh: NDArray[np.int32] = field(metadata=shaped("copies", dtype=np.int32))
    """Index into `meshes` of each copy, shape [copies]."""
    position: Array = field(metadata=shaped("copies", 3))
    """Where their frames begin in the world [m], shape [copies, 3]."""
    rotation: Array = field(metadata=shaped("copies", 3, 3))
    """From their frames to the world's, shape [copies, 3, 3]."""
    scale: Array = field(metadata=shaped("copies"))
    """Their size over that of their meshes, shape [copies]."""
    grain: Array = field(metadata=shaped("copies"))
    """Diameter that the fine texture on them is made for [m], shape [copies]."""
    rgb: Array = field(metadata=shaped("copies", 3))
    """Linear albedo, shape [copies, 3]."""

    def add(self, other: Instances) -> Instances:
        """These copies and others after them."""
        moved = other.replace(mesh=other.mesh + np.int32(len(self.meshes)))
        return self.joined(moved).replace(meshes=(*self.meshes, *other.meshes))


@dataclass(frozen=True, kw_only=True, eq=False)
class Subject(Record):
    """Everything that a picture shows."""

    ground: Heightfield
    """The bare ground."""
    ground_rgb: NDArray[np.uint8]
    """Its sRGB colour at the nodes, shape [rows, columns, 3]."""
    instances: Instances
    """What stands on it, first of all the rocks."""
    lighting: Lighting
    """The Sun and the sky."""
    sun_diameter: float
    """Angle that the Sun's disc fills [rad]."""
    seed: int
    """Seed of the fine texture."""
    photometry: Photometry | None = None
    """How ground and instances send light back; None for Lambert's law."""
    airless: bool = False
    """Whether the body has no wind: less dust lies on its rocks."""
    tracks: tuple[Array, ...] = ()
    """Paths that wheels have left tracks along, east and north [m], shape [points, 2] each."""
    half_gauge: float = 0.5
    """Sideways distance of the wheels from the paths [m]."""
    wheel_width: float = 0.2
    """Width of the wheels [m]."""
    grain: NDArray[np.uint8] | None = None
    """Pebbles, roughness and slabs of the nodes, 100 for 1, shape [rows, columns, 3]; None where
    they are usual."""
    tile: NDArray[np.float32] = field(default_factory=no_tile)
    """Relief of rocks' faces, as `rock_tile` makes it."""
    horizon: Horizon | None = None
    """What lies beyond the ground's edge; None for nothing that rays could meet."""

    def __post_init__(self) -> None:
        if self.ground_rgb.flags.writeable or not self.ground_rgb.flags.c_contiguous:
            self.freeze("ground_rgb", np.uint8, (*self.ground.shape, 3))
        if self.grain is not None:
            self.freeze("grain", np.uint8, (*self.ground.shape, 3))

    @property
    def node_grain(self) -> NDArray[np.uint8]:
        """`grain`, also where it is usual."""
        if self.grain is not None:
            return self.grain
        usual = np.rint(100.0 * np.array(USUAL)).astype(np.uint8)
        return fixed_array(np.tile(usual, (*self.ground.shape, 1)))

    @property
    def usual_grain(self) -> tuple[float, float, float]:
        """What most of the ground's grain is, 1 for 1: that of the land beyond its edge."""
        if self.grain is None:
            return USUAL
        levels, counts = np.unique(self.grain[::8, ::8].reshape(-1, 3), axis=0, return_counts=True)
        pebbles, rough, slabs = (0.01 * levels[counts.argmax()]).tolist()
        return pebbles, rough, slabs


def subject_of(world: World, *, close: bool = False) -> Subject:
    """A world for the renderer: the instances are its rocks and those that reach into it, by id.

    A rock is its shape, as in truth, or where it is large and `close` is wanted its close mesh,
    which cameras and lidars at a metre see.
    """
    rocks, rover, looks = merge(world.field, world.neighbours), world.rover, world.appearance
    wheels: dict[str, Any] = {}
    if rover.wheels:
        wheels = {
            "half_gauge": float(np.abs(rover.wheel_centres[:, 1]).max()),
            "wheel_width": max(wheel.width for wheel in rover.wheels),
        }
    return Subject(
        ground=world.ground,
        ground_rgb=looks.ground_rgb,
        grain=None if looks.material is None and looks.drift is None else looks.grain,
        instances=Instances(
            **_shapes(world, rocks, close=close),
            position=rocks.position,
            rotation=rotations(rocks),
            scale=rocks.scale,
            grain=rocks.diameter,
            rgb=rock_colours(world, rocks),
        ),
        tile=rock_tile(world.library),
        lighting=world.lighting,
        sun_diameter=world.sun_diameter,
        seed=world.site.seed,
        photometry=world.site.body.photometry,
        airless=world.site.body.airless,
        horizon=world.horizon,
        tracks=tuple(trajectory.position[:, :2] for trajectory in world.trajectories),
        **wheels,
    )


def _shapes(world: World, rocks: RockField, *, close: bool) -> dict[str, Any]:
    """`meshes` and `mesh` of the rocks' instances."""
    shapes = world.library.prototypes
    mesh, meshes = rocks.prototype, [shape.meshes[0] for shape in shapes]
    if not close:
        return {"meshes": tuple(meshes), "mesh": mesh}
    large = rocks.diameter >= CLOSE_MIN_M
    for number in np.unique(rocks.prototype[large]).tolist():
        if (finer := shapes[number].close) is not None:
            mesh = np.where(large & (rocks.prototype == number), np.int32(len(meshes)), mesh)
            meshes.append(finer)
    return {"meshes": tuple(meshes), "mesh": mesh}


def fixed_array(array: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """An array that nobody writes into, as those of records are: one kernel serves both."""
    array.setflags(write=False)
    return array
