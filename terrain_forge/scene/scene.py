"""The ground and the instances of a subject as one thing that rays can be cast at."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from threading import Lock
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrain_forge.base import Array, DataError, TerrainForgeError, given_numbers, over_chunks
from terrain_forge.model import Heightfield, World
from terrain_forge.scene import packets
from terrain_forge.scene.embree import COHERENT, INCOHERENT
from terrain_forge.scene.engine import EngineScene, empty_scene, engine_name
from terrain_forge.scene.subject import Subject, subject_of

GROUND = -1
"""What `Hits.rock` holds where a ray met the ground."""
MISSED = -2
"""What `Hits.rock` holds where a ray met nothing."""
OUTSIDE = -3
"""What `Hits.rock` holds where a ray met what lies beyond the ground's edge."""
BODY = -4
"""What `Hits.rock` holds where a ray met a moving body, such as the rover."""

_FIRST = Lock()  # two threads that make the first scene must not get a device each


@dataclass(frozen=True, kw_only=True, eq=False)
class Hits:
    """The first thing that each ray met."""

    distance: NDArray[np.float32]
    """From the ray's origin [m]; infinite where missed, shape [rays]."""
    normal: NDArray[np.float32]
    """Outward unit normal of the surface in the world frame; zero where missed, shape [rays, 3]."""
    rock: NDArray[np.int32]
    """Row of the subject's instances, or GROUND, MISSED, OUTSIDE or BODY, shape [rays]."""


class RayScene:
    """The triangulated ground and its instances. Use it in a `with` block, or close it.

    Coordinates are kept in 32 bits; rays are moved to a frame at the ground's middle first, so that
    the error does not grow with the place of a tile in its site.

    Args:
        subject: What the rays are cast at.
        often: Whether so many are cast that it is worth to be longer in making it ready.
    """

    def __init__(self, subject: Subject, *, often: bool = False) -> None:
        check_engine()
        self.subject = subject
        """What the rays are cast at."""
        ground, copies = subject.ground, subject.instances
        west, south, east, north = ground.bounds
        heights = float(ground.elevation.min()) + float(ground.elevation.max())
        self.origin: Array = 0.5 * np.array([west + east, south + north, heights])
        """Where the scene's own frame lies in the world [m], shape [3]."""
        self._shapes: list[EngineScene] = []
        self._whole = empty_scene()
        self._whole.add_grid(_vertices(ground, self.origin), often=often)
        if len(copies):
            self._shapes = [committed(mesh.vertices, mesh.faces) for mesh in copies.meshes]
            transforms = np.empty((len(copies), 3, 4), dtype=np.float32)
            transforms[:, :, :3] = copies.rotation * copies.scale[:, None, None]
            transforms[:, :, 3] = copies.position - self.origin
            self._whole.add_instances(self._shapes, which=copies.mesh, transforms=transforms)
        if subject.horizon is not None:
            beyond = subject.horizon.mesh
            self._whole.add_triangles(beyond.vertices - self.origin, beyond.faces)
        self._whole.commit()

    @property
    def handle(self) -> int:
        """Address of the scene, for kernels that trace for themselves; it begins at `origin`.

        Raises:
            TerrainForgeError: if it is closed.
        """
        return self._whole.handle

    def cast(self, origins: ArrayLike, directions: ArrayLike, *, coherent: bool = False) -> Hits:
        """What rays meet first.

        Args:
            origins: start points in the world frame [m], shape [rays, 3] or [3].
            directions: of any length but zero, shape [rays, 3] or [3].
            coherent: neighbouring rays run side by side (faster; the result is the same).

        Raises:
            DataError: for shapes that do not fit, or values that are no rays.
        """
        start, towards = rays_of(origins, directions)
        start = start - self.origin
        unit = towards / np.linalg.norm(towards, axis=1, keepdims=True)
        distance = np.empty(len(start), dtype=np.float32)
        normal = np.empty((len(start), 3), dtype=np.float32)
        rock = np.empty(len(start), dtype=np.int32)
        query = COHERENT if coherent else INCOHERENT
        over_chunks(
            packets.cast_packets,
            packets.CHUNKS,
            self.handle,
            query,
            np.ascontiguousarray(start, np.float32),
            np.ascontiguousarray(unit, np.float32),
            self.subject.instances.rotation,
            packets.packet_memory(),
            distance,
            normal,
            rock,
        )
        return Hits(distance=distance, normal=normal, rock=rock)

    def close(self) -> None:
        """Give the memory back; the scene cannot be used any more."""
        for scene in (self._whole, *self._shapes):
            scene.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


def rays_of(origins: ArrayLike, directions: ArrayLike) -> tuple[Array, Array]:
    """Start points [m] and directions, of each as many as rays, shape [rays, 3].

    One point, or one direction, stands for all rays.

    Raises:
        DataError: for shapes that do not fit, or values that are no rays.
    """
    start = given_numbers(origins, "origins of rays")
    towards = given_numbers(directions, "directions of rays")
    pair = np.atleast_2d(start), np.atleast_2d(towards)
    counts = {len(one) for one in pair} - {1}
    if len(counts) > 1 or any(one.ndim != 2 or one.shape[1] != 3 for one in pair):
        raise DataError(
            f"origins of shape {start.shape} and directions of shape {towards.shape}: both must "
            "be (rays, 3), or one of them (3,) for all rays"
        )
    if not pair[1].any(axis=1).all():
        raise DataError("directions of rays must have a length above 0")
    start, towards = np.broadcast_arrays(*pair)
    return start, towards


def open_scene(world: World, *, close: bool = False) -> RayScene:
    """The ray scene of a world; with `close` as cameras at a metre see its large rocks.

    Raises:
        TerrainForgeError: where Embree is missing or of another version.
    """
    return RayScene(subject_of(world, close=close))


def _vertices(ground: Heightfield, origin: Array) -> NDArray[np.float32]:
    """The ground's nodes, rows running south: so Embree cuts cells south-west to north-east."""
    vertices = np.empty((*ground.shape, 3), dtype=np.float32)
    vertices[..., 0] = ground.east - origin[0]
    vertices[..., 1] = (ground.north - origin[1])[::-1, None]
    vertices[..., 2] = ground.elevation[::-1] - origin[2]
    return vertices


def committed(vertices: Array, faces: NDArray[np.int32]) -> EngineScene:
    """A mesh as an engine's scene, to be copied into others."""
    scene = empty_scene()
    scene.add_triangles(vertices, faces)
    scene.commit()
    return scene


def check_engine() -> None:
    """See once that the engine works.

    Raises:
        TerrainForgeError: where Embree is missing or of another version.
    """
    with _FIRST:
        _check_engine()


@cache
def _check_engine() -> None:
    """Cast one ray at a copy of a triangle, so that a foreign memory layout cannot go unnoticed."""
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    triangle = committed(corners, np.array([[0, 1, 2]], dtype=np.int32))
    whole = empty_scene()
    lifts = np.array(
        [[[1, 0, 0, 9], [0, 1, 0, 0], [0, 0, 1, 0]], [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 2]]]
    )
    whole.add_instances(
        [triangle], which=np.zeros(2, np.int32), transforms=lifts.astype(np.float32)
    )
    whole.commit()
    start, towards = np.array([[0.2, 0.2, 5.0]], np.float32), np.array([[0, 0, -1]], np.float32)
    turns = np.broadcast_to(np.eye(3), (2, 3, 3)).copy()
    turns.setflags(write=False)  # as those of scenes are: one kernel serves both
    distance, normal = np.empty(1, np.float32), np.empty((1, 3), np.float32)
    rock = np.empty(1, np.int32)
    given = whole.handle, INCOHERENT, start, towards, turns, packets.packet_memory()
    packets.cast_packets(0, 1, *given, distance, normal, rock)
    found = [float(distance[0]), int(rock[0]), *normal[0].tolist()]
    whole.release()
    triangle.release()
    if not np.allclose(found, [3.0, 1.0, 0.0, 0.0, 1.0], atol=1e-6):
        raise TerrainForgeError(f"ray tracing: {engine_name()} answers a test ray with {found}")
