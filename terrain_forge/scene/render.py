"""Pictures of a ray scene: two to four samples a pixel, each sees the Sun and the sky by rays."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import get_num_threads, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from terrain_forge.base import Array, inlined, inner, kernel, srgb_from_linear, worker_threads
from terrain_forge.scene.camera import Camera
from terrain_forge.scene.embree import COHERENT, INCOHERENT
from terrain_forge.scene.light import Light, Triple, add_sky, add_surface, towards_sun
from terrain_forge.scene.packets import (
    ACTIVE,
    FAR,
    LANES,
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
from terrain_forge.scene.scene import RayScene
from terrain_forge.scene.surface import (
    COLUMNS,
    FLAT_X,
    FLAT_Y,
    FLAT_Z,
    LIFT,
    NOBODY,
    OWNER,
    RANGE,
    Land,
    Stones,
    Tracks,
    X,
    Y,
    Z,
    hemisphere,
    see_apron,
    see_ground,
    see_rock,
)

_SAMPLES, _MAP_SAMPLES = 4, 2
_TILE = 4
_OFFSETS = np.array([(0.375, 0.125), (0.625, 0.875), (0.875, 0.375), (0.125, 0.625)])
_ALL = (1 << LANES) - 1
_SKY_REACH = 8.0


def triple(vector: Array) -> Triple:
    """Three plain numbers: kernels pass them about without counting references."""
    return float(vector[0]), float(vector[1]), float(vector[2])


class _View(NamedTuple):
    position: Triple
    forward: Triple
    right: Triple
    down: Triple
    width: int
    height: int
    pinhole: bool
    step: float
    samples: int


@inner
def _aim(view, column, row):  # type: ignore[no-untyped-def]
    """Origin and unit direction of the ray through a place in the picture."""
    x, y = column - 0.5 * view.width, row - 0.5 * view.height
    a, b, c = (
        x * view.right[0] + y * view.down[0],
        x * view.right[1] + y * view.down[1],
        x * view.right[2] + y * view.down[2],
    )
    o, f = view.position, view.forward
    if not view.pinhole:
        return (o[0] + a, o[1] + b, o[2] + c), (f[0], f[1], f[2])
    a, b, c = a + f[0], b + f[1], c + f[2]
    length = np.sqrt(a * a + b * b + c * c)
    return (o[0], o[1], o[2]), (a / length, b / length, c / length)


@inner
def _place(ray, lane, rock, distance, start, towards, stones, point):  # type: ignore[no-untyped-def]
    """Move a surface point to a lane's hit; returns whether it is beside the pixel's last one.

    A point that is keeps its normal and albedo, which are filtered for the whole pixel anyway.
    """
    beside = point[OWNER] == rock and abs(distance - point[RANGE]) < 0.03 * distance
    point[X] = start[0] + distance * towards[0]
    point[Y] = start[1] + distance * towards[1]
    point[Z] = start[2] + distance * towards[2]
    point[RANGE], point[OWNER] = distance, rock
    point[FLAT_X], point[FLAT_Y], point[FLAT_Z] = hit_normal(ray, lane, rock, stones.rotation)
    return beside


@inner
def _shade(ray, word, lane, view, towards, land, tracks, stones, point):  # type: ignore[no-untyped-def]
    facing = -(point[FLAT_X] * towards[0] + point[FLAT_Y] * towards[1] + point[FLAT_Z] * towards[2])
    step = view.step * (point[RANGE] if view.pinhole else 1.0)
    footprint = step / np.sqrt(max(facing, 0.04))
    rock = np.int64(point[OWNER])
    u, v = np.float64(ray[U, lane]), np.float64(ray[V, lane])
    if rock == -1:
        see_ground(point, land, tracks, footprint)
    elif rock < 0:
        see_apron(point, land, np.int64(word[TRIANGLE, lane]), u, v, footprint)
    else:
        see_rock(point, land, stones, rock, np.int64(word[TRIANGLE, lane]), u, v, footprint)


@inner
def _leave(ray, word, lane, point, direction, reach):  # type: ignore[no-untyped-def]
    """Aim a lane from just above a surface point; returns whether it may lead out of the surface.

    Of a rock's triangle that is known. The ground is smoother than its triangles (LIFT): those that
    the Sun lies behind may still be lit, or the edge of night would run along them.
    """
    rise = (
        direction[0] * point[FLAT_X] + direction[1] * point[FLAT_Y] + direction[2] * point[FLAT_Z]
    )
    lift = 5e-4 + 2e-4 * point[RANGE]
    start = (
        point[X] + lift * point[FLAT_X],
        point[Y] + lift * point[FLAT_Y],
        point[Z] + lift * point[FLAT_Z] + point[LIFT],
    )
    set_ray(ray, word, lane, start, direction, 0.0, reach)
    out = rise > 0.0 or point[OWNER] < 0.0
    if not out:
        word[ACTIVE, lane] = 0
    return out


@inlined
def _see_packet(  # type: ignore[no-untyped-def]
    scene, query, view, land, tracks, stones, light, ray, point, left, top, sample
):
    """Shade what a packet of pixels sees and ask for the Sun.

    Returns bit masks of the lanes that see a surface, that are in sunlight, and whose surface was
    seen by their pixel's last sample already.
    """
    word, address = ray.view(np.uint32), ray.ctypes.data
    x, y = left + _OFFSETS[sample, 0], top + _OFFSETS[sample, 1]
    for lane in range(LANES):
        start, towards = _aim(view, x + lane % _TILE, y + lane // _TILE)
        set_ray(ray, word, lane, start, towards, 0.0, np.inf)
    intersect8(address + 4 * ACTIVE * LANES, scene, address, query)
    seen, lit, known = 0, 0, 0
    for lane in range(LANES):
        start, towards = _aim(view, x + lane % _TILE, y + lane // _TILE)
        word[ACTIVE, lane] = 0
        rock = hit_rock(word, lane)
        if rock == -2:
            continue
        seen |= 1 << lane
        distance = np.float64(ray[FAR, lane])
        beside = _place(ray, lane, rock, distance, start, towards, stones, point[lane])
        known |= beside << lane
        if not beside:
            _shade(ray, word, lane, view, towards, land, tracks, stones, point[lane])
        column, row = left + lane % _TILE, top + lane // _TILE
        sun = towards_sun(light, land.key, column, row, sample * (_SAMPLES // view.samples))
        lit |= _leave(ray, word, lane, point[lane], sun, np.inf) << lane
    if lit:
        occluded8(address + 4 * ACTIVE * LANES, scene, address, query)
        for lane in range(LANES):
            lit &= ~((ray[FAR, lane] < 0.0) << lane)
    return seen, lit, known


@inlined
def _see_sky(scene, query, land, ray, point, left, top, sample, seen):  # type: ignore[no-untyped-def]
    """Bit mask of the lanes from whose surface a random ray gets to the sky."""
    word, address = ray.view(np.uint32), ray.ctypes.data
    free = 0
    for lane in range(LANES):
        word[ACTIVE, lane] = 0
        if (seen >> lane) & 1:
            column, row = left + lane % _TILE, top + lane // _TILE
            up = hemisphere(point[lane], land.key, column, row, sample)
            if up[2] > 0.0:
                free |= _leave(ray, word, lane, point[lane], up, _SKY_REACH) << lane
    if free:
        occluded8(address + 4 * ACTIVE * LANES, scene, address, query)
        for lane in range(LANES):
            free &= ~((ray[FAR, lane] < 0.0) << lane)
    return free


@inlined
def _sample(  # type: ignore[no-untyped-def]
    scene, queries, view, land, tracks, stones, light, ray, point, left, top, sample, image
):
    """Add one sample to each pixel of a packet; returns whether all were as the last one was."""
    seen, lit, known = _see_packet(
        scene, queries[0], view, land, tracks, stones, light, ray, point, left, top, sample
    )
    x, y = left + _OFFSETS[sample, 0], top + _OFFSETS[sample, 1]
    free = 0
    if seen and light.airy:
        free = _see_sky(scene, queries[1], land, ray, point, left, top, sample, seen)
    for lane in range(LANES):
        pixel = image[top + lane // _TILE, left + lane % _TILE]
        start, towards = _aim(view, x + lane % _TILE, y + lane // _TILE)
        if (seen >> lane) & 1:
            sunny, open_sky = (lit >> lane) & 1, (free >> lane) & 1
            add_surface(pixel, point[lane], sunny, open_sky, towards, light, view.pinhole)
        else:
            add_sky(pixel, start, towards, view.step, land, light)
    even = lit == _ALL or (lit == 0 and not light.airy)
    return seen == 0 or (known == _ALL and even)


@inlined
def _expose_packet(scene, queries, view, land, tracks, stones, light, ray, point, left, top, image):  # type: ignore[no-untyped-def]
    """Expose 4 × 2 pixels: half the samples where nothing changes and the Sun shines."""
    for lane in range(LANES):
        point[lane, OWNER] = NOBODY
    taken = 0
    for sample in range(view.samples):
        calm = _sample(
            scene, queries, view, land, tracks, stones, light, ray, point, left, top, sample, image
        )
        taken = sample + 1
        if calm and taken == view.samples // 2:
            break
    for lane in range(LANES):
        for channel in range(3):
            image[top + lane // _TILE, left + lane % _TILE, channel] /= taken


def _borrow(_typing, members):  # type: ignore[no-untyped-def]
    """The tuple or named tuple with all its arrays lent."""

    def build(context, builder, _signature, arguments):  # type: ignore[no-untyped-def]
        loan = arguments[0]
        for index, member in enumerate(members):
            if isinstance(member, types.Array):
                value = builder.extract_value(loan, index)
                view = context.make_array(member)(context, builder, value)
                view.meminfo = view.meminfo.type(None)
                loan = builder.insert_value(loan, view._getvalue(), index)
        return loan

    return members(members), build


borrow: Any = intrinsic(_borrow)
"""A tuple's arrays handed to kernels without their owner.

Numba counts references to an array at every call that takes it, atomically; in a renderer of many
small functions that costs more than the shading. A lent array is not counted: the caller keeps it.
"""


@kernel
def _expose_band(scene, queries, view, land, tracks, stones, light, band, ray, point, image):  # type: ignore[no-untyped-def]
    land, tracks, stones = borrow(land), borrow(tracks), borrow(stones)
    light = borrow(light)
    ray, point, pixels = borrow((ray, point, image))
    for half in range(2 * (image.shape[1] // _TILE)):
        left, top = half // 2 * _TILE, band * _TILE + half % 2 * (_TILE // 2)
        _expose_packet(
            scene, queries, view, land, tracks, stones, light, ray, point, left, top, pixels
        )


def expose(
    scene: RayScene, camera: Camera, *, land: Land, tracks: Tracks, stones: Stones, light: Light
) -> NDArray[np.float32]:
    """The picture in linear RGB, shape [height, width, 3], not yet developed."""
    width, height = (-(-side // _TILE) * _TILE for side in (camera.width, camera.height))
    view = _View(
        position=triple(camera.position - scene.origin),
        forward=triple(camera.forward),
        right=triple(camera.right),
        down=triple(camera.down),
        width=camera.width,
        height=camera.height,
        pinhole=camera.pinhole,
        step=float(np.linalg.norm(camera.right)),
        samples=_SAMPLES if camera.pinhole else _MAP_SAMPLES,
    )
    image = np.zeros((height, width, 3), dtype=np.float32)
    queries = COHERENT, INCOHERENT

    def expose_band(band: int) -> None:
        ray, point = packet_memory(1)[0], np.zeros((LANES, COLUMNS))
        _expose_band(
            scene.handle, queries, view, land, tracks, stones, light, band, ray, point, image
        )

    # Bands write rows of their own, so that the threads' order does not matter.
    with worker_threads(get_num_threads()) as threads:
        list(threads.map(expose_band, range(height // _TILE)))
    return image[: camera.height, : camera.width]


def develop(image: NDArray[np.float32]) -> NDArray[np.uint8]:
    """The sRGB bytes of a linear picture; from half white on it is compressed, not clipped."""
    steps = 4096
    exposure = np.linspace(0.0, 4.0, steps)
    shoulder = np.where(exposure < 0.5, exposure, 1.0 - 0.5 * np.exp(1.0 - 2.0 * exposure))
    table = (255.0 * np.clip(srgb_from_linear(shoulder), 0.0, 1.0)).astype(np.float32)
    index = np.minimum(image * ((steps - 1) / 4.0), steps - 1).astype(np.int32)
    # Interleaved gradient noise (Jimenez 2014) hides the steps of a smooth sky.
    rows, columns = image.shape[:2]
    noise = 0.06711056 * np.arange(columns)[None, :] + 0.00583715 * np.arange(rows)[:, None]
    whole = np.empty_like(noise)
    for factor in (52.9829189, 0.999):
        noise -= np.floor(noise, out=whole)
        noise *= factor
    dithered = table[index] + noise.astype(np.float32)[:, :, None]
    return np.asarray(dithered, dtype=np.uint8)
