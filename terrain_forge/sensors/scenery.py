"""What the rays of cameras and lidars meet: the world, what lies beyond it, the rover itself."""

from __future__ import annotations

from collections import OrderedDict
from functools import cached_property
from threading import Lock
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from terrain_forge.base import Array, DataError, given_numbers
from terrain_forge.geometry import rover_instances, rover_looks
from terrain_forge.model import World
from terrain_forge.scene import (
    SKIN,
    BodyShapes,
    Hits,
    Instances,
    PlacedBodies,
    RayScene,
    cast_with_bodies,
    subject_of,
)
from terrain_forge.sensors.links import RoverLinks
from terrain_forge.sensors.motion import Motion
from terrain_forge.terrain import heights_beyond

_KEPT = 8


class Scenery:
    """The ray scenes of a recording. Use it in a `with` block, or close it.

    Kernels that trace for themselves take four things: `scene.handle`, `rover_at(time).bodies`,
    `poses_at(times)` and room for a second packet; then `scene.meet8` does what `intersect8` does
    and `scene.shade8` what `occluded8` does, with the rover in the world:

        rover = scenery.rover_at(middle)      # hold it as long as the kernel runs
        poses = scenery.poses_at(times)       # one a column, or one for all
        ...
        meet8(scene.handle, rover.bodies, pose_of_lane, INCOHERENT, ray, own)

    where `pose_of_lane` has the shape [8, 3, 4], rays start in the scene's own frame (world less
    `scene.origin`) and have unit directions. `hit_rock` then tells a row of the rocks, or GROUND
    (-1), MISSED (-2), OUTSIDE (-3), BODY (-4): the rover, whose part is in the word COPY: a row of
    `rover_parts`.
    """

    def __init__(self, world: World, motion: Motion) -> None:
        self.world, self.motion = world, motion
        self.scene = RayScene(subject_of(world, close=True), often=True)
        """The ground, its rocks, and what lies beyond."""
        self._looks = rover_looks(world.rover)
        self._links = RoverLinks(world.rover, motion)
        self._placed = OrderedDict[float, PlacedBodies]()
        self._lock = Lock()

    @cached_property
    def rover_parts(self) -> Instances:
        """The rover's visible shapes, one for each link and colour; at rest, in base_link's frame.

        `rgb` is their linear albedo.
        """
        return rover_instances(self._looks, self.world.rover.origins)

    @cached_property
    def _shapes(self) -> BodyShapes:
        return BodyShapes(self.rover_parts)

    def rover_at(self, time: float) -> PlacedBodies:
        """The rover's shapes in base_link's frame as they stand at a time [s].

        For a sweep or a rolling shutter its middle serves: links move little against base_link
        meanwhile, and base_link's own motion is in `poses_at`.
        """
        with self._lock:
            if time not in self._placed:
                places = self._links.at(time)
                parts = [places[look.link] for look in self._looks]
                self._placed[time] = self._shapes.placed(
                    np.array([place for place, _ in parts]).reshape(-1, 3),
                    np.array([turn for _, turn in parts]).reshape(-1, 3, 3),
                )
                while len(self._placed) > _KEPT:
                    self._placed.popitem(last=False)
            return self._placed[time]

    def poses_at(self, times: ArrayLike) -> Array:
        """base_link in the frame of `scene` at times [s]: [turn | place], shape [times, 3, 4]."""
        state = self.motion.base.at(times)
        place = state.position - self.scene.origin
        return np.concatenate([state.rotation, place[:, :, None]], axis=2)

    def height_at(self, east: ArrayLike, north: ArrayLike) -> Array:
        """Height of the ground or of what lies beyond it [m], as rays meet it.

        Raises:
            ValueError: for a point beyond the horizon.
        """
        x, y = np.broadcast_arrays(*(np.asarray(c, np.float64) for c in (east, north)))
        within, heights = self.world.ground.covers(x, y), np.empty(x.shape)
        heights[within] = self.world.ground.height_at(x[within], y[within])
        if not within.all():
            if self.world.horizon is None:
                raise ValueError("point beyond the edge of a world without a horizon")
            beyond = x[~within], y[~within]
            heights[~within] = heights_beyond(self.world.ground, self.world.horizon, *beyond)
        return heights

    def cast(
        self, origins: ArrayLike, directions: ArrayLike, times: ArrayLike, *, near: float = SKIN
    ) -> Hits:
        """What rays in the world meet first, the rover among it.

        Args:
            origins: Start points [m], shape [rays, 3], or [3] for all rays.
            directions: Unit vectors, shape [rays, 3], or [3] for all rays.
            times: When each ray is cast, or when all are [s].
            near: What of the rover is nearer is not met [m].

        Raises:
            DataError: for shapes that do not fit, values that are no rays, or times beyond the
                motion.
        """
        moments = np.atleast_1d(given_numbers(times, "times of rays"))
        if moments.ndim > 1 or not moments.size:
            raise DataError(f"times of shape {moments.shape}: one for all rays, or one for each")
        poses = self.poses_at(moments)
        rover = self.rover_at(float(moments[len(moments) // 2]))
        return cast_with_bodies(self.scene, rover.beyond(near), poses, origins, directions)

    def close(self) -> None:
        """Give the memory back."""
        self._placed.clear()
        if "_shapes" in self.__dict__:
            self._shapes.close()
        self.scene.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()
