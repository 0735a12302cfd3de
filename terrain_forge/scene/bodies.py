"""Bodies that move through a scene, such as a rover: rays meet the nearer of both.

The bodies' ray scene is in a frame of their own that moves as a whole (base_link), so that it need
not be made anew where only that frame moves. A ray goes through the world first and is then turned
into the bodies' frame at its own time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from terrain_forge.base import Array, DataError, inner, kernel, over_chunks
from terrain_forge.scene.embree import INCOHERENT
from terrain_forge.scene.engine import empty_scene
from terrain_forge.scene.packets import (
    ACTIVE,
    BODY,
    CHUNKS,
    COPY,
    DIRECTION_X,
    FAR,
    GEOMETRY,
    LANES,
    NEAR,
    NORMAL_X,
    NOTHING,
    ORIGIN_X,
    TRIANGLE,
    U,
    V,
    hit_normal,
    hit_rock,
    intersect8,
    occluded8,
    packet_memory,
    set_ray,
)
from terrain_forge.scene.scene import Hits, RayScene, check_engine, committed, rays_of
from terrain_forge.scene.subject import Instances

SKIN = 5e-3
"""A ray meets a body from here on [m]: a sensor may sit on one, or a millimetre deep in it."""


class Bodies(NamedTuple):
    """Bodies at a moment as kernels need them."""

    handle: int
    """Address of their scene; 0 where there are none."""
    rotation: NDArray[np.float64]
    """From each part's frame to the bodies', shape [parts, 3, 3]."""
    low: tuple[float, float, float]
    """Lower corner of the box around them, in their frame [m]."""
    high: tuple[float, float, float]
    """Upper corner [m]."""
    near: float
    """What sees them meets them from here on [m]; shadows are all there."""


class BodyShapes:
    """Meshes of bodies, made ready once, that can be placed anew again and again."""

    def __init__(self, parts: Instances) -> None:
        """Take over the parts; where they are placed is told to `placed`."""
        check_engine()
        self.parts = parts
        """Meshes and colours."""
        self._shapes = [committed(mesh.vertices, mesh.faces) for mesh in parts.meshes]
        corners = [(m.vertices.min(axis=0), m.vertices.max(axis=0)) for m in parts.meshes]
        self._corners = np.array(corners).reshape(-1, 2, 3)

    def placed(self, position: Array, rotation: Array) -> PlacedBodies:
        """The parts at some places.

        Args:
            position: Where their frames begin in the bodies' frame [m], shape [parts, 3].
            rotation: From their frames to the bodies', shape [parts, 3, 3].
        """
        return PlacedBodies(self, position, rotation)

    def close(self) -> None:
        """Give the memory back; what was placed cannot be used any more."""
        for shape in self._shapes:
            shape.release()


class PlacedBodies:
    """Bodies at a moment; it gives its memory back when nobody holds it any more."""

    def __init__(self, shapes: BodyShapes, position: Array, rotation: Array) -> None:
        parts, count = shapes.parts, len(position)
        turns = np.ascontiguousarray(rotation, np.float64)
        self._scene = empty_scene()
        self._shapes = shapes
        low, high = np.zeros(3), np.zeros(3)
        if count:
            transforms = np.empty((count, 3, 4), np.float32)
            transforms[:, :, :3], transforms[:, :, 3] = turns, position
            self._scene.add_instances(shapes._shapes, which=parts.mesh, transforms=transforms)
            boxes = shapes._corners[parts.mesh]
            middle, half = boxes.mean(axis=1), 0.5 * np.ptp(boxes, axis=1)
            centre = position + (turns * middle[:, None, :]).sum(axis=-1)
            reach = (np.abs(turns) * half[:, None, :]).sum(axis=-1) + SKIN
            low, high = (centre - reach).min(axis=0), (centre + reach).max(axis=0)
        self._scene.commit()
        turns.setflags(write=False)
        self.bodies = Bodies(
            handle=self._scene.handle if count else 0,
            rotation=turns,
            low=(float(low[0]), float(low[1]), float(low[2])),
            high=(float(high[0]), float(high[1]), float(high[2])),
            near=SKIN,
        )
        """What kernels need."""

    def beyond(self, near: float) -> Bodies:
        """What kernels need that see no body that is nearer than so [m]."""
        return self.bodies._replace(near=float(near))

    def __del__(self) -> None:
        """Give the memory back."""
        if scene := getattr(self, "_scene", None):
            scene.release()


@inner
def _into(pose, x, y, z):  # type: ignore[no-untyped-def]
    """A vector turned from the scene's frame into that of a pose."""
    return (
        pose[0, 0] * x + pose[1, 0] * y + pose[2, 0] * z,
        pose[0, 1] * x + pose[1, 1] * y + pose[2, 1] * z,
        pose[0, 2] * x + pose[1, 2] * y + pose[2, 2] * z,
    )


@inner
def _passes(bodies, origin, direction, far):  # type: ignore[no-untyped-def]
    """Whether a ray comes through the box around the bodies."""
    near = 0.0
    for axis in range(3):
        o, d = origin[axis], direction[axis]
        low, high = bodies.low[axis], bodies.high[axis]
        if abs(d) < 1e-30:
            if o < low or o > high:
                return False
            continue
        a, b = (low - o) / d, (high - o) / d
        near, far = max(near, min(a, b)), min(far, max(a, b))
    return near <= far


@inner
def _turned(ray, word, own, bodies, poses, least):  # type: ignore[no-untyped-def]
    """Put the active rays that may meet a body, from `least` on, into `own`; returns how many."""
    own_word, count = own.view(np.uint32), 0
    for lane in range(LANES):
        own_word[ACTIVE, lane] = 0
        far = np.float64(ray[FAR, lane])
        if word[ACTIVE, lane] == 0 or not far > least:  # what is occluded has a far of -inf
            continue
        pose = poses[lane]
        origin = _into(
            pose,
            ray[ORIGIN_X, lane] - pose[0, 3],
            ray[ORIGIN_X + 1, lane] - pose[1, 3],
            ray[ORIGIN_X + 2, lane] - pose[2, 3],
        )
        direction = _into(
            pose,
            np.float64(ray[DIRECTION_X, lane]),
            np.float64(ray[DIRECTION_X + 1, lane]),
            np.float64(ray[DIRECTION_X + 2, lane]),
        )
        if _passes(bodies, origin, direction, far):
            near = max(np.float64(ray[NEAR, lane]), least)
            set_ray(own, own_word, lane, origin, direction, near, far)
            count += 1
    return count


@inner
def meet8(scene, bodies, poses, query, ray, own):  # type: ignore[no-untyped-def]
    """What `intersect8` does, with moving bodies before the world.

    A lane that meets a body holds the geometry BODY (`hit_rock` returns -4), the body's part in
    COPY, and a normal that is turned to the scene's frame already.

    Args:
        scene: Handle of the world's scene.
        bodies: `Bodies` at this moment.
        poses: The bodies' frame in the scene's own, [turn | place], shape [LANES, 3, 4].
        query: Query arguments, COHERENT or INCOHERENT.
        ray: The packet, filled, unit directions; its address must be a cache line's.
        own: Room for another packet.
    """
    word, address = ray.view(np.uint32), ray.ctypes.data
    intersect8(address + 4 * ACTIVE * LANES, scene, address, query)
    if bodies.handle == 0 or _turned(ray, word, own, bodies, poses, bodies.near) == 0:
        return
    own_word, own_address = own.view(np.uint32), own.ctypes.data
    intersect8(own_address + 4 * ACTIVE * LANES, bodies.handle, own_address, query)
    for lane in range(LANES):
        if own_word[ACTIVE, lane] == 0 or own_word[GEOMETRY, lane] == NOTHING:
            continue
        part, pose = np.int64(own_word[COPY, lane]), poses[lane]
        x, y, z = hit_normal(own, lane, part, bodies.rotation)
        for axis in range(3):
            ray[NORMAL_X + axis, lane] = pose[axis, 0] * x + pose[axis, 1] * y + pose[axis, 2] * z
        ray[FAR, lane], ray[U, lane], ray[V, lane] = own[FAR, lane], own[U, lane], own[V, lane]
        word[TRIANGLE, lane], word[COPY, lane] = own_word[TRIANGLE, lane], own_word[COPY, lane]
        word[GEOMETRY, lane] = BODY


@inner
def shade8(scene, bodies, poses, query, ray, own):  # type: ignore[no-untyped-def]
    """What `occluded8` does, with moving bodies in the world; see `meet8`."""
    word, address = ray.view(np.uint32), ray.ctypes.data
    occluded8(address + 4 * ACTIVE * LANES, scene, address, query)
    if bodies.handle == 0 or _turned(ray, word, own, bodies, poses, SKIN) == 0:
        return
    own_word, own_address = own.view(np.uint32), own.ctypes.data
    occluded8(own_address + 4 * ACTIVE * LANES, bodies.handle, own_address, query)
    for lane in range(LANES):
        if own_word[ACTIVE, lane] != 0 and own[FAR, lane] < 0.0:
            ray[FAR, lane] = -np.inf


@kernel
def _cast(  # type: ignore[no-untyped-def]
    begin, end, scene, origins, directions, rotation, bodies, poses, room, distance, normal, rock
):
    """Fill `distance`, `normal` and `rock` with the first hit of each ray of some chunks."""
    rows = -(-len(origins) // (LANES * CHUNKS)) * LANES  # of a chunk of whole packets
    pose = np.empty((LANES, 3, 4))
    for chunk in range(begin, end):
        ray, own = room[2 * chunk], room[2 * chunk + 1]
        word, stop = ray.view(np.uint32), min((chunk + 1) * rows, len(origins))
        for first in range(chunk * rows, stop, LANES):
            filled = min(LANES, stop - first)
            for lane in range(LANES):
                word[ACTIVE, lane] = 0
            for lane in range(filled):
                o, d = origins[first + lane], directions[first + lane]
                set_ray(ray, word, lane, (o[0], o[1], o[2]), (d[0], d[1], d[2]), 0.0, np.inf)
                pose[lane] = poses[(first + lane) % len(poses)]
            meet8(scene[0], bodies, pose, scene[1], ray, own)
            for lane in range(filled):
                row, hit = first + lane, hit_rock(word, lane)
                x, y, z, distance[row] = 0.0, 0.0, 0.0, np.inf
                if hit != -2:
                    x, y, z = hit_normal(ray, lane, hit, rotation)
                    distance[row] = ray[FAR, lane]
                rock[row], normal[row, 0], normal[row, 1], normal[row, 2] = hit, x, y, z


def cast_with_bodies(
    scene: RayScene, bodies: Bodies, poses: Array, origins: ArrayLike, directions: ArrayLike
) -> Hits:
    """What rays meet first, in the world or on moving bodies; for kernels there is `meet8`.

    Args:
        scene: The world.
        bodies: The bodies.
        poses: Their frame in the scene's own, [turn | place], shape [rays or 1, 3, 4].
        origins: Start points in the world frame [m], shape [rays, 3] or [3].
        directions: Unit vectors, shape [rays, 3] or [3].

    Raises:
        DataError: for shapes that do not fit, or values that are no rays.
    """
    origins, directions = rays_of(origins, directions)
    if len(poses) not in (1, len(origins)):
        raise DataError(f"{len(poses)} times for {len(origins)} rays: one, or one for each")
    distance = np.empty(len(origins), np.float32)
    normal = np.empty((len(origins), 3), np.float32)
    rock = np.empty(len(origins), np.int32)
    over_chunks(
        _cast,
        CHUNKS,
        (scene.handle, INCOHERENT),
        np.ascontiguousarray(origins - scene.origin),
        np.ascontiguousarray(directions, np.float64),
        scene.subject.instances.rotation,
        bodies,
        np.ascontiguousarray(poses),
        packet_memory(2 * CHUNKS),
        distance,
        normal,
        rock,
    )
    return Hits(distance=distance, normal=normal, rock=rock)
