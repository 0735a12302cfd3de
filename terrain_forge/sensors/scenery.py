"""What the rays of cameras and lidars meet: the world, what lies beyond it, the rover itself."""

from __future__ import annotations

from typing import Self

from terrain_forge.model import World
from terrain_forge.scene import RayScene, open_scene
from terrain_forge.sensors.motion import Motion


class Scenery:
    """The ray scenes of a recording. Use it in a `with` block, or close it."""

    def __init__(self, world: World, motion: Motion) -> None:
        self.world, self.motion = world, motion
        self.scene: RayScene = open_scene(world)
        """The ground, its rocks, and what lies beyond the site."""

    def close(self) -> None:
        """Give the memory back."""
        self.scene.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()
